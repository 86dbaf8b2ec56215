//! Products of tall matrices, with the widest instructions that the processor has.
//!
//! Each is a sum over rows of a few columns at a time, which stay in registers; nothing is
//! copied or transposed before. A general matrix product packs its operands first, which for a
//! few hundred rows and a few dozen columns costs as much as the product.

use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Simd, WithSimd};

/// JᵀJ.
pub(crate) fn gram(j: &DMatrix<f64>) -> DMatrix<f64> {
    gram_of(j, 0, j.ncols())
}

/// The same of `len` columns from `start` on.
pub(crate) fn gram_of(j: &DMatrix<f64>, start: usize, len: usize) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(len, len);
    let columns = Columns::of(j, start, len);
    if len == 1 {
        gram[(0, 0)] = Arch::new().dispatch(SquaredLength(columns.data));
        return gram;
    }
    Arch::new().dispatch(Dots::<3> {
        left: columns,
        right: columns,
        lower: true,
        out: &mut gram,
    });
    gram.fill_upper_triangle_with_lower_triangle();
    gram
}

/// Jᵀr.
pub(crate) fn gradient(j: &DMatrix<f64>, r: &DVector<f64>) -> DVector<f64> {
    let mut gradient = DMatrix::zeros(j.ncols(), 1);
    Arch::new().dispatch(Dots::<1> {
        left: Columns::of(j, 0, j.ncols()),
        right: Columns {
            data: r.as_slice(),
            rows: r.len(),
            count: 1,
        },
        lower: false,
        out: &mut gradient,
    });
    gradient.column(0).into_owned()
}

/// AᵀB.
pub(crate) fn across(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(a.ncols(), b.ncols());
    Arch::new().dispatch(Dots::<3> {
        left: Columns::of(a, 0, a.ncols()),
        right: Columns::of(b, 0, b.ncols()),
        lower: false,
        out: &mut out,
    });
    out
}

/// J U, where U is upper triangular.
pub(super) fn times_upper(j: &DMatrix<f64>, upper: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(j.nrows(), j.ncols());
    Arch::new().dispatch(TimesUpper {
        j,
        upper,
        out: &mut out,
    });
    out
}

/// Columns of the left matrix that are taken at once, and of a matrix like it: as many sums as
/// sixteen registers hold beside what is added to them.
const LEFT: usize = 3;

/// Columns of a matrix that follow each other.
#[derive(Clone, Copy)]
struct Columns<'a> {
    data: &'a [f64],
    rows: usize,
    count: usize,
}

impl<'a> Columns<'a> {
    fn of(matrix: &'a DMatrix<f64>, start: usize, count: usize) -> Self {
        let rows = matrix.nrows();
        Self {
            data: &matrix.as_slice()[start * rows..(start + count) * rows],
            rows,
            count,
        }
    }

    #[inline(always)]
    fn column(&self, k: usize) -> &'a [f64] {
        &self.data[k * self.rows..(k + 1) * self.rows]
    }
}

/// Products of each column of `left` with each of `right`, which is `RIGHT` at once.
struct Dots<'a, const RIGHT: usize> {
    left: Columns<'a>,
    right: Columns<'a>,
    /// Only those that are not above the diagonal.
    lower: bool,
    out: &'a mut DMatrix<f64>,
}

impl<const RIGHT: usize> WithSimd for Dots<'_, RIGHT> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (n, others) = (self.left.count, self.right.count);
        for i in (0..n).step_by(LEFT) {
            // past the last column it is the last again
            let left = std::array::from_fn(|k| self.left.column((i + k).min(n - 1)));
            let end = match self.lower {
                true => others.min(i + LEFT),
                false => others,
            };
            for j in (0..end).step_by(RIGHT) {
                let right = std::array::from_fn(|k| self.right.column((j + k).min(others - 1)));
                let sums: [[f64; LEFT]; RIGHT] = dots(simd, left, right);
                for (sums, j) in sums.iter().zip(j..others) {
                    for (sum, i) in sums.iter().zip(i..n) {
                        self.out[(i, j)] = *sum;
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn column(of: &DMatrix<f64>, k: usize) -> &[f64] {
    let m = of.nrows();
    &of.as_slice()[k * m..(k + 1) * m]
}

#[inline(always)]
fn dots<S: Simd, const L: usize, const R: usize>(
    simd: S,
    left: [&[f64]; L],
    right: [&[f64]; R],
) -> [[f64; L]; R] {
    let (left, left_rest) = split::<S, L>(left);
    let (right, right_rest) = split::<S, R>(right);
    let steps = left.iter().chain(&right).map(|c| c.len()).min();
    let steps = steps.unwrap_or(0);
    let (left, right) = (left.map(|c| &c[..steps]), right.map(|c| &c[..steps]));
    let mut sums = [[simd.splat_f64s(0.0); L]; R];
    let mut take = |left: [S::f64s; L], right: [S::f64s; R]| {
        for (sums, y) in sums.iter_mut().zip(right) {
            for (sum, x) in sums.iter_mut().zip(left) {
                *sum = simd.mul_add_e_f64s(x, y, *sum);
            }
        }
    };
    for k in 0..steps {
        take(left.map(|c| c[k]), right.map(|c| c[k]));
    }
    let rest = |c: &[f64]| simd.partial_load_f64s(c);
    take(left_rest.map(rest), right_rest.map(rest));
    sums.map(|sums| sums.map(|sum| simd.reduce_sum_f64s(sum)))
}

/// Whole registers of each column, and what is left of it.
#[inline(always)]
fn split<S: Simd, const N: usize>(columns: [&[f64]; N]) -> ([&[S::f64s]; N], [&[f64]; N]) {
    let both = columns.map(S::as_simd_f64s);
    (both.map(|(whole, _)| whole), both.map(|(_, rest)| rest))
}

/// Sums that are added to in turn: one would wait for its last addition.
const SUMS: usize = 4;

struct SquaredLength<'a>(&'a [f64]);

impl WithSimd for SquaredLength<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (whole, rest) = S::as_simd_f64s(self.0);
        let mut sums = [simd.splat_f64s(0.0); SUMS];
        sums[0] = {
            let rest = simd.partial_load_f64s(rest);
            simd.mul_f64s(rest, rest)
        };
        for several in whole.chunks(SUMS) {
            for (sum, x) in sums.iter_mut().zip(several) {
                *sum = simd.mul_add_e_f64s(*x, *x, *sum);
            }
        }
        let [a, b, c, d] = sums;
        simd.reduce_sum_f64s(simd.add_f64s(simd.add_f64s(a, b), simd.add_f64s(c, d)))
    }
}

struct TimesUpper<'a> {
    j: &'a DMatrix<f64>,
    upper: &'a DMatrix<f64>,
    out: &'a mut DMatrix<f64>,
}

/// Columns that a product gives at once.
const COLUMNS: usize = 4;

/// Registers of rows that are taken at once.
const ROWS: usize = 3;

impl WithSimd for TimesUpper<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (m, n) = self.j.shape();
        let several = ROWS * S::F64_LANES;
        for first in (0..n).step_by(COLUMNS) {
            let last = (first + COLUMNS).min(n) - 1;
            let terms: Vec<Term<'_>> = (0..=last)
                .map(|i| {
                    let factor = |k: usize| self.upper[(i, (first + k).min(last))];
                    (column(self.j, i), std::array::from_fn(factor))
                })
                .collect();
            let mut from = 0;
            while from < m {
                let rows = match m - from {
                    left if left >= several => several,
                    left => left.min(S::F64_LANES),
                };
                let here = from..from + rows;
                let mut columns = self.out.as_mut_slice()[first * m..].chunks_mut(m);
                let places: [Option<&mut [f64]>; COLUMNS] =
                    std::array::from_fn(|_| Some(&mut columns.next()?[here.clone()]));
                if rows == several {
                    let load = |c: &[f64]| -> [S::f64s; ROWS] {
                        let whole = S::as_simd_f64s(&c[here.clone()]).0;
                        std::array::from_fn(|r| whole[r])
                    };
                    combined(simd, &terms, load, places);
                } else {
                    let load = |c: &[f64]| [simd.partial_load_f64s(&c[here.clone()])];
                    combined(simd, &terms, load, places);
                }
                from += rows;
            }
        }
    }
}

/// A column, and what it is multiplied by in each of the columns that come of it.
type Term<'a> = (&'a [f64], [f64; COLUMNS]);

/// Sums of terms, into some rows of the columns that come of them.
#[inline(always)]
fn combined<S: Simd, const R: usize>(
    simd: S,
    terms: &[Term<'_>],
    load: impl Fn(&[f64]) -> [S::f64s; R],
    places: [Option<&mut [f64]>; COLUMNS],
) {
    let mut sums = [[simd.splat_f64s(0.0); R]; COLUMNS];
    for (column, factors) in terms {
        let rows = load(column);
        for (sums, factor) in sums.iter_mut().zip(factors) {
            let factor = simd.splat_f64s(*factor);
            for (sum, x) in sums.iter_mut().zip(rows) {
                *sum = simd.mul_add_e_f64s(x, factor, *sum);
            }
        }
    }
    for (place, sums) in places.into_iter().flatten().zip(sums) {
        for (place, sum) in place.chunks_mut(S::F64_LANES).zip(sums) {
            simd.partial_store_f64s(place, sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn random(m: usize, n: usize) -> DMatrix<f64> {
        let mut random = Random::new(m as u64, n as u64);
        DMatrix::from_fn(m, n, |_, _| random.normal())
    }

    #[test]
    fn products_are_those_of_any_shape() {
        let sizes = [0, 1, 2, 3, 4, 5, 7, 8, 9, 12, 13, 25, 40];
        for (m, n) in sizes.iter().flat_map(|&m| sizes.map(|n| (m, n))) {
            let j = random(m, n);
            let r = random(m, 1).column(0).into_owned();
            let upper = random(n, n).upper_triangle();
            // sums of up to forty products of order one, rounded in another order
            let near = |a: &[f64], b: &[f64]| {
                assert_eq!(a.len(), b.len());
                let off = a.iter().zip(b).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-13, "{m} by {n}");
            };
            near(gram(&j).as_slice(), (j.transpose() * &j).as_slice());
            near(
                across(&upper, &upper).as_slice(),
                (upper.transpose() * &upper).as_slice(),
            );
            let other = random(m, 5);
            near(
                across(&j, &other).as_slice(),
                (j.transpose() * &other).as_slice(),
            );
            near(gradient(&j, &r).as_slice(), (j.transpose() * &r).as_slice());
            near(times_upper(&j, &upper).as_slice(), (&j * &upper).as_slice());
        }
    }
}
