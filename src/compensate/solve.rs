//! Small symmetric positive definite equations.
//!
//! Six rows are written out: the compiler does not unroll triangular loops, which doubles
//! their cost on a Cortex-M4F.

use crate::Scalar;

/// `L D Lᵀ` of a symmetric positive definite K x K matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor<T, const K: usize> {
    /// Unit lower triangle.
    l: [[T; K]; K],
    /// Reciprocals of the pivots.
    inverse_d: [T; K],
}

impl<T: Scalar> Factor<T, 6> {
    /// Factor of the matrix with the lower triangle `a`. No pivot is taken below `floor`,
    /// which is what damping leaves of it without rounding: so there is always a factor.
    #[inline]
    pub(super) fn of_six(a: &[[T; 6]; 6], floor: T) -> Self {
        let mut l = [[T::zero(); 6]; 6];
        let mut inverse_d = [T::zero(); 6];
        // Column j of L D, less what the columns before it take away; then of L.
        let mut c = [[T::zero(); 6]; 6];
        macro_rules! column {
            ($j:literal; $($k:literal)*; $($i:literal: $($m:literal)*);*) => {
                let pivot = a[$j][$j] $(- l[$j][$k] * c[$j][$k])*;
                inverse_d[$j] = T::one() / if pivot > floor { pivot } else { floor };
                $(
                    c[$i][$j] = a[$i][$j] $(- l[$i][$m] * c[$j][$m])*;
                    l[$i][$j] = c[$i][$j] * inverse_d[$j];
                )*
            };
        }
        column!(0; ; 1: ; 2: ; 3: ; 4: ; 5:);
        column!(1; 0; 2: 0; 3: 0; 4: 0; 5: 0);
        column!(2; 0 1; 3: 0 1; 4: 0 1; 5: 0 1);
        column!(3; 0 1 2; 4: 0 1 2; 5: 0 1 2);
        column!(4; 0 1 2 3; 5: 0 1 2 3);
        column!(5; 0 1 2 3 4;);
        Self { l, inverse_d }
    }

    /// Solution of `L D Lᵀ x = b`.
    #[inline(never)]
    pub(super) fn solve_six(&self, b: &[T; 6]) -> [T; 6] {
        let (l, d) = (&self.l, &self.inverse_d);
        let mut x = *b;
        macro_rules! forward {
            ($($i:literal: $($k:literal)*);*) => {
                $($(x[$i] -= l[$i][$k] * x[$k];)*)*
            };
        }
        macro_rules! backward {
            ($($i:literal: $($k:literal)*);*) => {
                $(x[$i] *= d[$i]; $(x[$i] -= l[$k][$i] * x[$k];)*)*
            };
        }
        forward!(1: 0; 2: 0 1; 3: 0 1 2; 4: 0 1 2 3; 5: 0 1 2 3 4);
        backward!(5: ; 4: 5; 3: 4 5; 2: 3 4 5; 1: 2 3 4 5; 0: 1 2 3 4 5);
        x
    }

    /// As [`Factor::inverse_trace`].
    #[inline]
    pub(super) fn inverse_trace_six(&self, weights: &[T; 6]) -> T {
        let (l, d) = (&self.l, &self.inverse_d);
        let mut trace = weights[5] * d[5];
        // Column c of the inverse of L: one, then these.
        macro_rules! column {
            ($c:literal; $($i:literal: $($k:literal)*);*) => {
                let mut x = [T::zero(); 6];
                let mut sum = d[$c];
                $(
                    x[$i] = -l[$i][$c] $(- l[$i][$k] * x[$k])*;
                    sum += x[$i] * x[$i] * d[$i];
                )*
                trace += sum * weights[$c];
            };
        }
        column!(0; 1: ; 2: 1; 3: 1 2; 4: 1 2 3; 5: 1 2 3 4);
        column!(1; 2: ; 3: 2; 4: 2 3; 5: 2 3 4);
        column!(2; 3: ; 4: 3; 5: 3 4);
        column!(3; 4: ; 5: 4);
        column!(4; 5: );
        trace
    }
}

#[expect(
    clippy::needless_range_loop,
    reason = "the indices are those of the equations, their bounds constants"
)]
impl<T: Scalar, const K: usize> Factor<T, K> {
    /// As [`Factor::of_six`], for any number of rows.
    pub(super) fn of(a: &[[T; K]; K], floor: T) -> Self {
        let o = T::zero();
        let mut l = [[o; K]; K];
        let mut c = [[o; K]; K];
        let mut inverse_d = [o; K];
        for j in 0..K {
            let mut pivot = a[j][j];
            for k in 0..j {
                pivot -= l[j][k] * c[j][k];
            }
            inverse_d[j] = T::one() / if pivot > floor { pivot } else { floor };
            for i in j + 1..K {
                let mut sum = a[i][j];
                for k in 0..j {
                    sum -= l[i][k] * c[j][k];
                }
                c[i][j] = sum;
                l[i][j] = sum * inverse_d[j];
            }
        }
        Self { l, inverse_d }
    }

    /// As [`Factor::solve_six`].
    pub(super) fn solve(&self, b: &[T; K]) -> [T; K] {
        let mut x = *b;
        for i in 0..K {
            for k in 0..i {
                x[i] -= self.l[i][k] * x[k];
            }
        }
        for i in (0..K).rev() {
            x[i] *= self.inverse_d[i];
            for k in i + 1..K {
                x[i] -= self.l[k][i] * x[k];
            }
        }
        x
    }

    /// Trace of `W (L D Lᵀ)⁻¹` for a diagonal W: the sum of the reciprocal eigenvalues where
    /// W is the identity.
    pub(super) fn inverse_trace(&self, weights: &[T; K]) -> T {
        let mut trace = T::zero();
        for column in 0..K {
            // Column of the inverse of L.
            let mut x = [T::zero(); K];
            x[column] = T::one();
            let mut sum = self.inverse_d[column];
            for i in column + 1..K {
                let mut entry = T::zero();
                for k in column..i {
                    entry -= self.l[i][k] * x[k];
                }
                x[i] = entry;
                sum += entry * entry * self.inverse_d[i];
            }
            trace += sum * weights[column];
        }
        trace
    }
}

/// Adds `scale` times the outer product of `c` to the lower triangle of `a`.
#[inline]
pub(super) fn accumulate<T: Scalar>(a: &mut [[T; 6]; 6], c: &[T; 6], scale: T) {
    let s = c.map(|x| x * scale);
    macro_rules! row {
        ($($i:literal: $($j:literal)*);*) => { $($(a[$i][$j] += s[$i] * c[$j];)*)* };
    }
    row!(0: 0; 1: 0 1; 2: 0 1 2; 3: 0 1 2 3; 4: 0 1 2 3 4; 5: 0 1 2 3 4 5);
}

/// Six products and their sum.
#[inline]
pub(super) fn dot<T: Scalar>(a: &[T; 6], b: &[T; 6]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}
