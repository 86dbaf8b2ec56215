//! Orthogonal factorisation of a tall Jacobian: the last step of a fit, its covariance, and
//! what the data cannot tell apart.

use nalgebra::{DMatrix, DVector};

use super::product::{gram, times_upper};

/// Triangular factor of a Jacobian with what a step and its covariance need.
#[derive(Clone, Debug)]
pub struct Triangle {
    /// Upper triangle of J, unknowns x unknowns.
    pub r: DMatrix<f64>,
    /// First unknowns of Qᵀ r.
    pub z: DVector<f64>,
}

impl Triangle {
    /// Of no rows at all, for `unknowns` columns.
    pub fn new(unknowns: usize) -> Self {
        Self {
            r: DMatrix::zeros(unknowns, unknowns),
            z: DVector::zeros(unknowns),
        }
    }

    /// Takes a block of rows in: Householder QR of `[R z; J r]`, so memory does not grow with
    /// the number of rows (Golub and Van Loan, 5.2).
    pub fn push(&mut self, jacobian: &DMatrix<f64>, residual: &DVector<f64>) {
        let n = self.z.len();
        let new = jacobian.nrows();
        let mut stacked = DMatrix::zeros(n + new, n + 1);
        stacked.view_mut((0, 0), (n, n)).copy_from(&self.r);
        stacked.view_mut((0, n), (n, 1)).copy_from(&self.z);
        stacked.view_mut((n, 0), (new, n)).copy_from(jacobian);
        stacked.view_mut((n, n), (new, 1)).copy_from(residual);
        let square = stacked.qr().unpack_r();
        self.r = square.view((0, 0), (n, n)).upper_triangle();
        self.z = square.view((0, n), (n, 1)).column(0).into_owned();
    }

    /// Least-squares step; `None` where a diagonal entry is zero.
    pub fn step(&self) -> Option<DVector<f64>> {
        self.r.solve_upper_triangular(&self.z)
    }

    /// Least-squares step for another residual r of the same Jacobian, by its gradient Jᵀr
    /// (the seminormal equations): as good as the residual is, not better than the gradient.
    pub fn step_along(&self, gradient: &DVector<f64>) -> Option<DVector<f64>> {
        let half = self.r.tr_solve_upper_triangular(gradient)?;
        self.r.solve_upper_triangular(&half)
    }

    /// (JᵀJ)⁻¹, by the triangle's inverse.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let transposed = lower_inverse(self.r.transpose())?;
        Some(gram(&transposed))
    }
}

/// First half of a CholeskyQR2 (Yamamoto, Nakatsukasa, Yanagisawa and Fukaya 2015): the
/// Cholesky factor of the normal equations makes the columns nearly orthonormal, a second
/// round, on those, makes them so to rounding. As good as Householder's QR while the
/// condition number of the columns, each scaled to length one, is below about 1e7, and a
/// matrix product instead of a sweep a column.
#[derive(Clone, Debug)]
pub struct Preconditioner {
    /// Factor of the normal equations, upper.
    first: DMatrix<f64>,
    /// J times this is nearly orthonormal.
    whitening: DMatrix<f64>,
}

impl Preconditioner {
    /// From JᵀJ; `None` where that is not numerically positive definite.
    pub fn new(normal: &DMatrix<f64>) -> Option<Self> {
        let n = normal.ncols();
        let lengths: Vec<f64> = normal.diagonal().iter().map(|x| x.sqrt()).collect();
        if !lengths.iter().all(|&x| x > 0.0 && x.is_finite()) {
            return None;
        }
        let unit = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] / (lengths[i] * lengths[j]));
        let lower = unit.cholesky()?.unpack();
        let mut whitening = lower_inverse(lower.clone())?.transpose();
        for (mut row, length) in whitening.row_iter_mut().zip(&lengths) {
            row /= *length;
        }
        let mut first = lower.transpose();
        for (mut column, length) in first.column_iter_mut().zip(&lengths) {
            column *= *length;
        }
        Some(Self { first, whitening })
    }

    /// A block of the Jacobian with nearly orthonormal columns.
    pub fn whitened(&self, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        times_upper(jacobian, &self.whitening)
    }

    /// The triangle from the sums over all blocks of `WᵀW` and `Wᵀr`, W whitened; `None`
    /// where W is too far from orthonormal.
    pub fn triangle(&self, gram: &DMatrix<f64>, projected: &DVector<f64>) -> Option<Triangle> {
        let n = gram.ncols();
        let off = gram - DMatrix::identity(n, n);
        if off.amax().is_nan() || off.amax() >= 1e-3 {
            return None;
        }
        let lower = gram.clone().cholesky()?.unpack();
        Some(Triangle {
            z: lower.solve_lower_triangular(projected)?,
            r: lower.transpose() * &self.first,
        })
    }
}

/// Inverse of a lower triangle: column by column, each from its diagonal on, so a sixth of the
/// work of solving for the unit matrix. `None` where a diagonal entry is zero.
fn lower_inverse(lower: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = lower.ncols();
    let mut inverse = DMatrix::zeros(n, n);
    let columns = inverse.as_mut_slice().chunks_exact_mut(n.max(1));
    for (j, column) in columns.enumerate() {
        column[j] = 1.0;
        for k in j..n {
            let below = &lower.as_slice()[k * n + k..(k + 1) * n];
            let (pivot, below) = below.split_first()?;
            if pivot.abs() < f64::MIN_POSITIVE {
                return None;
            }
            let x = column[k] / pivot;
            column[k] = x;
            for (y, l) in column[k + 1..].iter_mut().zip(below) {
                *y -= l * x;
            }
        }
    }
    Some(inverse)
}

/// Why a column is not fitted.
#[derive(Clone, Debug, PartialEq)]
pub enum Dropped {
    /// Not even a large change shows in the data.
    Invisible,
    /// A combination of the kept columns (index, weight), largest weight first.
    Dependent(Vec<(usize, f64)>),
}

/// Columns in order of priority, sorted into those that the data can tell apart and those
/// that they cannot.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Indices of fitted columns, ascending.
    pub kept: Vec<usize>,
    /// Index and reason of the others.
    pub dropped: Vec<(usize, Dropped)>,
}

/// Goes through the columns in order; a column whose part orthogonal to those kept so far is
/// shorter than `visible`, or than `relative` times itself, is dropped. Householder's
/// reflections, so orthogonal to rounding.
pub fn select(jacobian: &DMatrix<f64>, visible: f64, relative: f64) -> Selection {
    select_in_turns(jacobian, visible, &[relative])
}

/// The same in several turns: what one share of `relative` leaves out is asked again with the
/// next, unless it falls short of the last already. `kept` is in the order of being kept.
pub fn select_in_turns(jacobian: &DMatrix<f64>, visible: f64, relative: &[f64]) -> Selection {
    let mut basis = Basis::default();
    let mut selection = Selection::default();
    let last = relative.last().copied().unwrap_or(0.0);
    let (m, n) = jacobian.shape();
    let column = |k: usize| Reflected::new(&jacobian.as_slice()[k * m..(k + 1) * m]);
    let mut asked: Vec<(usize, Reflected)> = (0..n).map(|k| (k, column(k))).collect();
    for &relative in relative {
        for (k, mut column) in std::mem::take(&mut asked) {
            if column.length <= visible {
                selection.dropped.push((k, Dropped::Invisible));
                continue;
            }
            basis.reflect(&mut column);
            let left = norm(column.rest());
            if left > visible && left > relative * column.length {
                basis.push(column, left);
                selection.kept.push(k);
            } else if left > visible && left > last * column.length {
                asked.push((k, column));
            } else {
                let along = column.values[..column.reflections].to_vec();
                let weights = basis.triangle.backward(along);
                let combination = combination(weights, &selection.kept);
                selection.dropped.push((k, Dropped::Dependent(combination)));
            }
        }
    }
    selection
}

/// The same from `normal` = JᵀJ of `equations` rows, `None` where its rounding could decide
/// otherwise. A Cholesky factorisation that passes over dependent columns is exact for a matrix
/// within (rows + columns) epsilon of JᵀJ, each entry by the lengths of its two columns (Higham
/// 2002, 10.3): what of a column is left over is off by at most that much of the combination
/// that is taken from it, squared.
pub fn select_by_normal(
    normal: &DMatrix<f64>,
    equations: usize,
    visible: f64,
    relative: f64,
) -> Option<Selection> {
    let n = normal.ncols();
    let rounding = 2.0 * (equations + n) as f64 * f64::EPSILON;
    let mut triangle = Rows::default();
    let mut selection = Selection::default();
    let mut lengths: Vec<f64> = Vec::new();
    for k in 0..n {
        let square = normal[(k, k)];
        let length = square.sqrt();
        if length <= visible {
            selection.dropped.push((k, Dropped::Invisible));
            continue;
        }
        let products = selection.kept.iter().map(|&i| normal[(i, k)]);
        let along = triangle.forward(products.collect());
        let left = square - dot(&along, &along);
        let weights = triangle.backward(along.clone());
        let taken: f64 = weights.iter().zip(&lengths).map(|(w, l)| w.abs() * l).sum();
        let error = rounding * (length + taken).powi(2);
        let limit = (visible * visible).max(relative * relative * square);
        if left - error > limit {
            triangle.push(along, left.sqrt());
            selection.kept.push(k);
            lengths.push(length);
        } else if left + error < limit {
            let combination = combination(weights, &selection.kept);
            selection.dropped.push((k, Dropped::Dependent(combination)));
        } else {
            return None;
        }
    }
    Some(selection)
}

/// Rows of a lower triangle L.
#[derive(Default)]
struct Rows(Vec<Vec<f64>>);

impl Rows {
    fn push(&mut self, mut row: Vec<f64>, diagonal: f64) {
        row.push(diagonal);
        self.0.push(row);
    }

    /// L⁻¹ x.
    fn forward(&self, mut x: Vec<f64>) -> Vec<f64> {
        for (i, row) in self.0.iter().enumerate() {
            x[i] = (x[i] - dot(&row[..i], &x[..i])) / row[i];
        }
        x
    }

    /// L⁻ᵀ x.
    fn backward(&self, mut x: Vec<f64>) -> Vec<f64> {
        for (i, row) in self.0.iter().enumerate().rev() {
            let value = x[i] / row[i];
            x[i] = value;
            for (y, l) in x[..i].iter_mut().zip(row) {
                *y -= value * l;
            }
        }
        x
    }
}

/// The weights of a combination of the `kept` columns, largest first.
fn combination(weights: Vec<f64>, kept: &[usize]) -> Vec<(usize, f64)> {
    let mut combination: Vec<(usize, f64)> = kept
        .iter()
        .copied()
        .zip(weights)
        .filter(|(_, w)| w.abs() > 1e-6)
        .collect();
    combination.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    combination
}

/// Product of two slices of one length, in four sums that the processor forms at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// A column after some of the reflections.
struct Reflected {
    /// The first ones are final, one a reflection.
    values: Vec<f64>,
    reflections: usize,
    /// Of the column, whatever is done to it.
    length: f64,
}

impl Reflected {
    fn new(column: &[f64]) -> Self {
        Self {
            values: column.to_vec(),
            reflections: 0,
            length: norm(column),
        }
    }

    /// What is orthogonal to the columns that made the reflections.
    fn rest(&self) -> &[f64] {
        self.values.get(self.reflections..).unwrap_or(&[])
    }
}

/// Householder's reflections, one a kept column, which they bring to a triangle (Golub and Van
/// Loan, 5.2.2).
#[derive(Default)]
struct Basis {
    /// Reflection k is `1 - v vᵀ`, its v zero before entry k.
    normals: Vec<Vec<f64>>,
    /// The kept columns, one a row.
    triangle: Rows,
}

impl Basis {
    /// Does to a column what it lacks of all reflections.
    fn reflect(&self, column: &mut Reflected) {
        for normal in &self.normals[column.reflections..] {
            let rest = &mut column.values[column.reflections..];
            let along = dot(normal, rest);
            for (x, v) in rest.iter_mut().zip(normal) {
                *x -= along * v;
            }
            column.reflections += 1;
        }
    }

    /// Takes a column in; `left`: the length of its rest, not zero.
    fn push(&mut self, mut column: Reflected, left: f64) {
        let mut normal = column.values.split_off(column.reflections);
        // away from zero, so that nothing is lost where the rest is nearly along its first axis
        let diagonal = match normal.first() {
            Some(&first) if first > 0.0 => -left,
            _ => left,
        };
        if let Some(first) = normal.first_mut() {
            *first -= diagonal;
            // |v|² is to be 2
            let scale = (left * first.abs()).sqrt().recip();
            normal.iter_mut().for_each(|x| *x *= scale);
        }
        self.triangle.push(column.values, diagonal);
        self.normals.push(normal);
    }
}
