//! The undamped step of six joints clear of singularities, by blocks of three.
//!
//! ```text
//! [ V1 V2 ] [ p1 ]   [ v ]        p2 = Z2⁻¹ (w - Z1 p1)
//! [ Z1 Z2 ] [ p2 ] = [ w ]        (V1 - V2 Z2⁻¹ Z1) p1 = v - V2 Z2⁻¹ w
//! ```
//! The last three joints take over what the first three leave of the rotation, which is what
//! MRD 5.45 to 5.52 do for a nominal wrist; here the axes need not meet. Half the operations
//! of [`super::damped`], since nothing is squared. Needs the last three axes well apart in
//! direction.

use nalgebra::Vector3;

use crate::vector::{cross, dot};
use crate::{Scalar, Twist};

/// Volume that the last three axes span, all of length one, at least.
const APART: f64 = 0.02;

/// Twice the error from which its bound in [`step`] is exact, m.
const FAR: f64 = 0.01;

/// Vectors across each two of three axes, and the reciprocal of the volume that the three span.
/// `None` unless they are well apart.
#[inline(always)]
pub(super) fn across<T: Scalar>([c4, c5, c6]: [&Twist<T>; 3]) -> Option<([Vector3<T>; 3], T)> {
    let (a, b, c) = (&c4.angular, &c5.angular, &c6.angular);
    let bc = cross(b, c);
    let volume = dot(a, &bc);
    // NaN is not apart.
    let apart = volume.abs() > T::of(APART);
    if !apart {
        return None;
    }
    Some(([bc, cross(c, a), cross(a, b)], T::one() / volume))
}

/// What bounds `V2 Z2⁻¹`, in which the last three axes' ways to the point come together.
///
/// With the way d from axis 5 to the point, the columns of V2 are `z_k x d` and `z_k x (o5 - o_k)`,
/// so that `|V2 Z2⁻¹| <= |d| + |Z2⁻¹| apart`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wrist<T> {
    /// Longest way from axis 5 to the tool point, and a quarter of [`FAR`], m.
    reach: T,
    /// How far axes 4 and 6 are from axis 5, root of the sum of squares, m.
    apart: T,
}

impl<T: Scalar> Wrist<T> {
    /// `reach`: longest way from axis 5 to the tool point, m; `before` and `beyond`: ways from
    /// axis 4 to 5 and from 5 to 6, m.
    pub(super) fn of(reach: T, before: T, beyond: T) -> Self {
        Self {
            reach: reach + T::of(FAR / 4.0),
            apart: (before * before + beyond * beyond).root(),
        }
    }

    /// A bound of `|J⁻¹|²`: see [`step`]. `m`: `|M|²`; `inverse`: of the volume that the last
    /// three axes span; `off`: square of the way from the tool point to the columns' point.
    #[inline(always)]
    pub(super) fn bound(&self, m: T, inverse: T, off: T) -> T {
        let r = inverse.abs() * T::of(1.732_050_9);
        // The point is off the tool point by the root of `off`, which the parabola
        // `FAR / 4 + off / FAR` is never below.
        let k = self.reach + off * T::of(1.0 / FAR) + self.apart * r;
        let k1 = T::one() + k;
        (T::one() + k * k1) * m + k1 * (r * r)
    }
}

/// The steps p with `J p = e` for the J whose columns [`super::rigid::approach`] gave. `None`,
/// and no steps, unless the last three axes are well apart. Not finite where J is singular; the
/// caller's checks find it.
///
/// With a `wrist`, and the square `off` of the way from the tool point to the point that the
/// columns are about, a bound of `|J⁻¹|²`, the sum of squares of its entries, is returned, zero
/// otherwise: with `M` the three columns that belong to v, `R = Z2⁻¹` and `K = V2 R`
///
/// ```text
/// J⁻¹ = [ M, [0 R]ᵀ - M K ]     |J⁻¹|² <= |M|² + (|R| + k |M|)² <= (1 + k + k²) |M|² + (1 + k) |R|²
/// ```
/// for any `k >= |K|`, and `|R|² <= 3 / volume²`, since the axes have length one.
#[inline(never)]
pub(super) fn step<T: Scalar>(
    columns: &[Twist<T>; 6],
    e: &Twist<T>,
    steps: &mut [T; 6],
    wrist: Option<&Wrist<T>>,
    off: T,
) -> Option<T> {
    let [c1, c2, c3, c4, c5, c6] = columns;
    let (normals, inverse_volume) = across([c4, c5, c6])?;
    let [r4, r5, r6] = normals.map(|normal| normal * inverse_volume);
    let turns = |w: &Vector3<T>| Vector3::new(dot(&r4, w), dot(&r5, w), dot(&r6, w));
    let without =
        |v: &Vector3<T>, t: &Vector3<T>| v - c4.linear * t.x - c5.linear * t.y - c6.linear * t.z;
    // What is read behind a barrier is not read before, when the registers are full.
    core::hint::black_box(());
    // The first joint turns about z.
    let t1 = Vector3::new(r4.z, r5.z, r6.z);
    let (t2, t3, t) = (turns(&c2.angular), turns(&c3.angular), turns(&e.angular));
    core::hint::black_box(());
    let (x, y, z) = (&c4.linear, &c5.linear, &c6.linear);
    let a1 = Vector3::new(
        c1.linear.x - x.x * t1.x - y.x * t1.y - z.x * t1.z,
        c1.linear.y - x.y * t1.x - y.y * t1.y - z.y * t1.z,
        -(x.z * t1.x) - y.z * t1.y - z.z * t1.z,
    );
    let a2 = without(&c2.linear, &t2);
    let a3 = without(&c3.linear, &t3);
    let b = without(&e.linear, &t);
    let (n1, n2, n3) = (cross(&a2, &a3), cross(&a3, &a1), cross(&a1, &a2));
    let inverse = T::one() / dot(&a1, &n1);
    let p1 = dot(&b, &n1) * inverse;
    let p2 = dot(&b, &n2) * inverse;
    let p3 = dot(&b, &n3) * inverse;
    let rest = t - t1 * p1 - t2 * p2 - t3 * p3;
    *steps = [p1, p2, p3, rest.x, rest.y, rest.z];
    let Some(wrist) = wrist else {
        return Some(T::zero());
    };
    let mut m = T::zero();
    let rows = [
        n1,
        n2,
        n3,
        n1 * t1.x + n2 * t2.x + n3 * t3.x,
        n1 * t1.y + n2 * t2.y + n3 * t3.y,
        n1 * t1.z + n2 * t2.z + n3 * t3.z,
    ];
    for row in &rows {
        m = m + row.x * row.x + row.y * row.y + row.z * row.z;
    }
    Some(wrist.bound(m * inverse * inverse, inverse_volume, off))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};

    use super::super::damped::shared_multipliers;
    use super::super::solve::dot;
    use super::*;

    fn columns() -> [Twist<f64>; 6] {
        let axis = |x: f64, y: f64, z: f64| Vector3::new(x, y, z).normalize();
        let axes = [
            Vector3::z(),
            axis(0.1, 1.0, 0.2),
            axis(0.0, -1.0, 0.3),
            axis(0.5, 0.3, 0.8),
            axis(-0.7, 0.6, 0.1),
            axis(0.6, 0.2, -0.9),
        ];
        let ways = [
            Vector3::new(0.4, 0.2, 0.7),
            Vector3::new(0.3, 0.1, -0.5),
            Vector3::new(-0.2, 0.5, 0.4),
            Vector3::new(0.1, 0.05, 0.1),
            Vector3::new(0.1, -0.05, 0.02),
            Vector3::new(0.02, 0.01, 0.08),
        ];
        core::array::from_fn(|k| Twist::new(axes[k].cross(&ways[k]), axes[k]))
    }

    #[test]
    fn takes_the_error_away() {
        let columns = columns();
        let e = Twist::new([1e-3, -2e-3, 5e-4].into(), [3e-3, 1e-3, -2e-3].into());
        let mut steps = [0.0; 6];
        assert!(step(&columns, &e, &mut steps, None, 0.0).is_some());
        let sum = columns
            .iter()
            .zip(steps)
            .fold(Twist::zero(), |sum, (c, p)| sum.plus(&c.scaled(p)));
        assert!((sum.linear - e.linear).norm() < 1e-17);
        assert!((sum.angular - e.angular).norm() < 1e-17);
    }

    #[test]
    fn says_where_the_last_axes_lie_in_a_plane() {
        let mut columns = columns();
        columns[5].angular = columns[3].angular;
        let mut steps = [0.0; 6];
        assert!(step(&columns, &Twist::zero(), &mut steps, None, 0.0).is_none());
        columns[5].angular.x = f64::NAN;
        assert!(step(&columns, &Twist::zero(), &mut steps, None, 0.0).is_none());
    }

    /// The example's columns with their numbers as one matrix.
    fn matrix(columns: &[Twist<f64>; 6]) -> Matrix6<f64> {
        Matrix6::from_columns(&columns.map(|c| Vector6::from(c.rows())))
    }

    /// An arm whose last three axes come within `apart` of each other, at random.
    fn drawn(next: &mut impl FnMut() -> f64, apart: f64) -> ([Twist<f64>; 6], Wrist<f64>) {
        let mut vector = |size: f64| Vector3::new(next(), next(), next()) * size;
        let axes = [(); 6].map(|()| vector(1.0).normalize());
        let ways = [(); 3].map(|()| vector(0.5));
        let (centre, off) = (vector(0.2), [vector(apart), vector(apart)]);
        let columns = core::array::from_fn(|k| {
            let axis = if k == 0 { Vector3::z() } else { axes[k] };
            let way = match k {
                0..3 => ways[k],
                3 => centre + off[0],
                4 => centre,
                _ => centre + off[1],
            };
            Twist::new(axis.cross(&way), axis)
        });
        let wrist = Wrist::of(centre.norm(), off[0].norm(), off[1].norm());
        (columns, wrist)
    }

    fn draws() -> impl FnMut() -> f64 {
        let mut state = 7_u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    #[test]
    fn bounds_the_inverse() {
        let mut next = draws();
        for apart in [0.0, 1e-3, 0.1] {
            let (mut all, mut close) = (0, 0);
            while all < 2000 {
                let (columns, wrist) = drawn(&mut next, apart);
                let (mut steps, e) = ([0.0; 6], Twist::zero());
                if let Some(bound) = step(&columns, &e, &mut steps, Some(&wrist), 0.0) {
                    let inverse = matrix(&columns).try_inverse().unwrap();
                    let ratio = bound / inverse.norm_squared();
                    assert!(ratio >= 1.0, "{apart}: {ratio}");
                    all += 1;
                    close += usize::from(ratio < 2.0);
                }
            }
            // Near enough to be of use.
            assert!(apart > 0.01 || close > 1600, "{apart}: {close}");
        }
    }

    /// Where it is taken in place of the damped step, it differs from that by next to nothing.
    #[test]
    fn hands_over_without_a_jump() {
        let mut next = draws();
        let (clear, damping) = (0.03_f64.powi(2), 1e-7);
        let mut near = 0;
        while near < 500 {
            let (columns, wrist) = drawn(&mut next, 1e-3);
            let mut half = || Vector3::new(next(), next(), next()) * 0.01;
            let e = Twist::new(half(), half());
            let mut steps = [0.0; 6];
            let bound = step(&columns, &e, &mut steps, Some(&wrist), 0.0);
            let Some(bound) = bound.filter(|&bound| bound * clear <= 1.0) else {
                continue;
            };
            let rows = columns.map(|column| column.rows());
            let (y, [linear, angular]) =
                shared_multipliers(&rows, &[1.0; 6], damping, &e.rows(), true);
            // Whatever is clear by the bound is so by the trace.
            assert!(linear + angular <= bound);
            let size = Vector6::from(steps).norm();
            for (row, step) in rows.iter().zip(steps) {
                assert!((dot(row, &y) - step).abs() <= damping * bound * size);
            }
            near += usize::from(bound * clear > 0.3);
        }
    }
}
