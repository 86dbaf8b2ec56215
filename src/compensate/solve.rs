//! Small symmetric positive definite equations: the normal equations of fewer than six joints.
//! Those of six rows are in [`super::damped`].

use crate::Scalar;

/// `L D Lᵀ` of a symmetric positive definite K x K matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor<T, const K: usize> {
    /// Unit lower triangle.
    l: [[T; K]; K],
    /// Reciprocals of the pivots.
    inverse_d: [T; K],
}

#[expect(
    clippy::needless_range_loop,
    reason = "the indices are those of the equations, their bounds constants"
)]
impl<T: Scalar, const K: usize> Factor<T, K> {
    /// Factor of the matrix with the lower triangle `a`. No pivot is taken below `floor`,
    /// which is what damping leaves of it without rounding: so there is always a factor.
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

    /// Solution of `L D Lᵀ x = b`.
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

    /// Trace of the first `rows` rows of `(L D Lᵀ)⁻¹`: the sum of the reciprocal eigenvalues.
    pub(super) fn inverse_trace(&self, rows: usize) -> T {
        let mut trace = T::zero();
        for column in (0..K).take(rows) {
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
            trace += sum;
        }
        trace
    }
}

/// Six products and their sum.
#[inline]
pub(super) fn dot<T: Scalar>(a: &[T; 6], b: &[T; 6]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}

/// Adds `factor` times `b` to `a`.
#[inline(always)]
pub(super) fn add<T: Scalar>(a: &mut [T; 6], b: &[T; 6], factor: T) {
    a[0] += b[0] * factor;
    a[1] += b[1] * factor;
    a[2] += b[2] * factor;
    a[3] += b[3] * factor;
    a[4] += b[4] * factor;
    a[5] += b[5] * factor;
}
