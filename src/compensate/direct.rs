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

use super::damped::cross;
use crate::{Scalar, Twist};

/// Volume that the last three axes span, all of length one, at least.
const APART: f64 = 0.02;

/// The reciprocal vectors of three and their volume.
#[inline(always)]
fn reciprocal<T: Scalar>(
    a: &Vector3<T>,
    b: &Vector3<T>,
    c: &Vector3<T>,
) -> Option<[Vector3<T>; 3]> {
    let bc = cross(b, c);
    let volume = dot(a, &bc);
    // NaN is not apart.
    let apart = volume.abs() > T::of(APART);
    if !apart {
        return None;
    }
    let inverse = T::one() / volume;
    Some([bc * inverse, cross(c, a) * inverse, cross(a, b) * inverse])
}

#[inline(always)]
fn dot<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// The steps p with `J p = e` for the J whose columns [`super::rigid::approach`] gave. False,
/// and no steps, unless there are six joints whose last three axes are well apart. Not finite
/// where J is singular; the caller's checks find it.
#[inline(never)]
pub(super) fn step<T: Scalar>(columns: &[Twist<T>], e: &Twist<T>, steps: &mut [T]) -> bool {
    let ([c1, c2, c3, c4, c5, c6], [s1, s2, s3, s4, s5, s6]) = (columns, steps) else {
        return false;
    };
    let Some([r4, r5, r6]) = reciprocal(&c4.angular, &c5.angular, &c6.angular) else {
        return false;
    };
    let turns = |w: &Vector3<T>| Vector3::new(dot(&r4, w), dot(&r5, w), dot(&r6, w));
    let without =
        |v: &Vector3<T>, t: &Vector3<T>| v - c4.linear * t.x - c5.linear * t.y - c6.linear * t.z;
    // The first joint turns about z.
    let t1 = Vector3::new(r4.z, r5.z, r6.z);
    let (t2, t3, t) = (turns(&c2.angular), turns(&c3.angular), turns(&e.angular));
    let a1 = without(&c1.linear, &t1);
    let a2 = without(&c2.linear, &t2);
    let a3 = without(&c3.linear, &t3);
    let b = without(&e.linear, &t);
    let (n, m) = (cross(&a2, &a3), cross(&a1, &b));
    let inverse = T::one() / dot(&a1, &n);
    let p1 = dot(&b, &n) * inverse;
    let p2 = dot(&a3, &m) * inverse;
    let p3 = -(dot(&a2, &m) * inverse);
    let rest = t - t1 * p1 - t2 * p2 - t3 * p3;
    (*s1, *s2, *s3) = (p1, p2, p3);
    (*s4, *s5, *s6) = (rest.x, rest.y, rest.z);
    true
}

#[cfg(test)]
mod tests {
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
        assert!(step(&columns, &e, &mut steps));
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
        assert!(!step(&columns, &Twist::zero(), &mut steps));
        columns[5].angular.x = f64::NAN;
        assert!(!step(&columns, &Twist::zero(), &mut steps));
        assert!(!step(&columns[..5], &Twist::zero(), &mut steps));
    }
}
