//! The damped step: six equations, solved without a loop.
//!
//! ```text
//! delta_q = S Jᵀ y,   (J S Jᵀ + mu I) y = e
//! ```
//! `e`: desired minus predicted, J: joint Jacobian, both about the same point in the same
//! axes, weighted alike, S: a diagonal. MRD 5.43, damped. What the step leaves of the linear
//! equations is `mu y`, exactly.
//!
//! The matrix is gathered joint by joint in 21 numbers and factored in blocks of three, all
//! written out: a small floating-point unit keeps them in its registers.

use nalgebra::Vector3;

use crate::vector::{along, less, square, times};
use crate::{Scalar, Twist};

/// Symmetric 3 x 3, lower triangle.
#[derive(Clone, Copy, Debug)]
struct Symmetric<T> {
    xx: T,
    yx: T,
    yy: T,
    zx: T,
    zy: T,
    zz: T,
}

impl<T: Scalar> Symmetric<T> {
    /// Adds `a bᵀ`, which is symmetric.
    #[inline(always)]
    fn add_product(&mut self, a: &Vector3<T>, b: &Vector3<T>) {
        self.xx += a.x * b.x;
        self.yx += a.y * b.x;
        self.yy += a.y * b.y;
        self.zx += a.z * b.x;
        self.zy += a.z * b.y;
        self.zz += a.z * b.z;
    }

    /// No pivot is taken below `floor`.
    #[inline(always)]
    fn factor(&self, floor: T) -> Factor<T> {
        let inverse = |pivot: T| T::one() / if pivot > floor { pivot } else { floor };
        let ix = inverse(self.xx);
        let (yx, zx) = (self.yx * ix, self.zx * ix);
        let iy = inverse(self.yy - yx * self.yx);
        let below = self.zy - yx * self.zx;
        let zy = below * iy;
        let iz = inverse(self.zz - zx * self.zx - zy * below);
        Factor {
            yx,
            zx,
            zy,
            inverse: Vector3::new(ix, iy, iz),
        }
    }
}

/// `L diag(1 / inverse) Lᵀ`, L with ones on its diagonal.
#[derive(Clone, Copy, Debug)]
struct Factor<T: Scalar> {
    yx: T,
    zx: T,
    zy: T,
    inverse: Vector3<T>,
}

impl<T: Scalar> Factor<T> {
    /// `L⁻¹ b`.
    #[inline(always)]
    fn forward(&self, b: &Vector3<T>) -> Vector3<T> {
        let y = b.y - self.yx * b.x;
        Vector3::new(b.x, y, b.z - self.zx * b.x - self.zy * y)
    }

    /// `L⁻ᵀ b`.
    #[inline(always)]
    fn backward(&self, b: &Vector3<T>) -> Vector3<T> {
        let y = b.y - self.zy * b.z;
        Vector3::new(b.x - self.yx * y - self.zx * b.z, y, b.z)
    }

    /// Lower left entry of `L⁻¹`.
    #[inline(always)]
    fn corner(&self) -> T {
        self.yx * self.zy - self.zx
    }

    /// `row L⁻¹`.
    #[inline(always)]
    fn behind(&self, row: &Vector3<T>) -> Vector3<T> {
        Vector3::new(
            row.x - row.y * self.yx + row.z * self.corner(),
            row.y - row.z * self.zy,
            row.z,
        )
    }

    /// `L⁻¹` times a matrix of three rows.
    #[inline(always)]
    fn before(&self, [x, y, z]: [Vector3<T>; 3]) -> [Vector3<T>; 3] {
        [
            x,
            less(&y, &times(&x, self.yx)),
            along(&less(&z, &times(&y, self.zy)), &x, self.corner()),
        ]
    }

    /// Trace of the inverse of the factored matrix: its eigenvalues' reciprocals added up.
    #[inline(always)]
    fn inverse_trace(&self) -> T {
        let (one, corner) = (T::one(), self.corner());
        let i = &self.inverse;
        i.x + i.y * (one + self.yx * self.yx) + i.z * (one + self.zy * self.zy + corner * corner)
    }

    #[inline(always)]
    fn scaled(&self, b: &Vector3<T>) -> Vector3<T> {
        let i = &self.inverse;
        Vector3::new(b.x * i.x, b.y * i.y, b.z * i.z)
    }
}

/// `J Jᵀ + D`, gathered column by column.
#[derive(Clone, Copy, Debug)]
struct NormalMatrix<T: Scalar> {
    angular: Symmetric<T>,
    linear: Symmetric<T>,
    /// Row k: k-th linear with the three angular equations.
    mixed: [Vector3<T>; 3],
}

impl<T: Scalar> NormalMatrix<T> {
    /// `mu` times the identity.
    #[inline(always)]
    fn diagonal(mu: T) -> Self {
        let o = T::zero();
        let diagonal = Symmetric {
            xx: mu,
            yx: o,
            yy: mu,
            zx: o,
            zy: o,
            zz: mu,
        };
        Self {
            angular: diagonal,
            linear: diagonal,
            mixed: [Vector3::zeros(); 3],
        }
    }

    /// Adds `a bᵀ`, which is symmetric.
    #[inline(always)]
    fn add_product(&mut self, a: &Twist<T>, b: &Twist<T>) {
        self.linear.add_product(&a.linear, &b.linear);
        self.angular.add_product(&a.angular, &b.angular);
        let (v, w) = (&a.linear, &b.angular);
        let [x, y, z] = &mut self.mixed;
        *x = along(x, w, v.x);
        *y = along(y, w, v.y);
        *z = along(z, w, v.z);
    }

    /// Solves for `y`; where `clearance` is asked for, with the two halves of the trace of the
    /// inverse of the matrix, linear and angular, otherwise with zeros. No pivot is taken below
    /// `floor`. Not finite if a number in it or in `e` is not; the caller's checks find it.
    #[inline(always)]
    fn solve(&self, e: &Twist<T>, floor: T, clearance: bool) -> (Twist<T>, [T; 2]) {
        let upper = self.angular.factor(floor);
        let [x, y, z] = &self.mixed;
        let (x, y, z) = (upper.forward(x), upper.forward(y), upper.forward(z));
        let (lx, ly, lz) = (upper.scaled(&x), upper.scaled(&y), upper.scaled(&z));
        let a = &self.linear;
        let lower = Symmetric {
            xx: rest(a.xx, &lx, &x),
            yx: rest(a.yx, &ly, &x),
            yy: rest(a.yy, &ly, &y),
            zx: rest(a.zx, &lz, &x),
            zy: rest(a.zy, &lz, &y),
            zz: rest(a.zz, &lz, &z),
        }
        .factor(floor);
        let f = upper.forward(&e.angular);
        let b = &e.linear;
        let g = lower.forward(&Vector3::new(
            rest(b.x, &lx, &f),
            rest(b.y, &ly, &f),
            rest(b.z, &lz, &f),
        ));
        let linear = lower.backward(&lower.scaled(&g));
        let mut angular = upper.scaled(&f);
        for (l, k) in [(&lx, linear.x), (&ly, linear.y), (&lz, linear.z)] {
            angular = less(&angular, &times(l, k));
        }
        let solution = Twist::new(linear, upper.backward(&angular));
        let traces = if clearance {
            let rows = [&lx, &ly, &lz].map(|row| upper.behind(row));
            let [x, y, z] = lower.before(rows);
            let i = &lower.inverse;
            let angular =
                upper.inverse_trace() + i.x * square(&x) + i.y * square(&y) + i.z * square(&z);
            [lower.inverse_trace(), angular]
        } else {
            [T::zero(); 2]
        };
        (solution, traces)
    }
}

/// `a - u · v`.
#[inline(always)]
fn rest<T: Scalar>(a: T, u: &Vector3<T>, v: &Vector3<T>) -> T {
    a - u.x * v.x - u.y * v.y - u.z * v.z
}

/// Solves `(J S Jᵀ + mu I) y = e` for any J. `columns`: of J; `shares`: diagonal of S. Where
/// `clearance` is asked for, with the two halves of the trace of `(J S Jᵀ + mu I)⁻¹`, linear
/// and angular. No pivot is taken below `mu`, which is what it leaves of one without rounding:
/// so there is always an answer.
pub(crate) fn shared_multipliers<T: Scalar>(
    columns: &[[T; 6]],
    shares: &[T],
    mu: T,
    e: &[T; 6],
    clearance: bool,
) -> ([T; 6], [T; 2]) {
    let twist =
        |&[a, b, c, d, e, f]: &[T; 6]| Twist::new(Vector3::new(a, b, c), Vector3::new(d, e, f));
    let mut normal = NormalMatrix::diagonal(mu);
    // A count that the compiler does not know keeps it from unrolling the loop and from
    // interleaving the columns, for which it runs out of registers.
    let count = core::hint::black_box(columns.len());
    for (column, &share) in columns.iter().zip(shares).take(count) {
        let column = twist(column);
        let shared = Twist::new(times(&column.linear, share), times(&column.angular, share));
        normal.add_product(&shared, &column);
    }
    let (y, traces) = normal.solve(&twist(e), mu, clearance);
    (y.rows(), traces)
}
