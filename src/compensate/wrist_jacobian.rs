//! The undamped step of arms with a spherical wrist, in closed form. MRD 5.45 to 5.52.
//!
//! About the wrist centre only the first three joints move a point, and with the second and
//! third axes parallel they come one after the other:
//!
//! ```text
//! J = [ V 0 ; Z1 Z2 ]                                        MRD 5.45
//! p1 = z2 · m / z2 · v1                                      in kind of 5.46
//! p2 = a · m' / D,  p3 = b · m' / D,   D = a · v2            5.47, 5.48
//! a = v3 x z2,  b = z2 x v2,  m' = m - v1 p1
//! ```
//! with m what the wrist centre has to move, v_k what it moves per unit of joint k, and z_k the
//! axes; what these three leave of the rotation is shared out among the last three axes by
//! their reciprocal vectors (5.49 to 5.51). In vectors it needs no frame of its own, and holds
//! for every arm of the kind, whatever its offsets and twists.
//!
//! Which arms are: nominal ones, and calibrated ones whose deviations leave the second and third
//! axes parallel and the last three in one point, to rounding: base, tool, joint offsets, lengths
//! along. Any other takes [`super::direct`], which does the same by blocks of three and finds
//! the same step.

use nalgebra::Vector3;

use super::direct::{Wrist, across};
use crate::vector::{add_cross, cross, dot, square};
use crate::{Scalar, Twist};

/// The steps p with `J p = e` for the J whose columns [`super::rigid::approach`] gave, of an arm
/// of the kind; `way`: from the wrist centre to the point that they are about, m. `None`, and
/// no steps, unless the last three axes are well apart in direction. Not finite where the arm is
/// stretched or the centre above the first axis; the caller's checks find it.
///
/// With a `wrist`, and the square `off` of the way from the tool point to the point that the
/// columns are about, a bound of `|J⁻¹|²` is returned, zero otherwise: that of
/// [`super::direct::step`], here with `V2 Z2⁻¹ = -[way]x`, and with the rows of
///
/// ```text
/// M = [ V⁻¹ ; -Z2⁻¹ Z1 V⁻¹ ],   V⁻¹ = [ z2 / d ; (a - z2 a · v1 / d) / D ; (b - z2 b · v1 / d) / D ]
/// ```
/// where `d = z2 · v1`, and `a`, `b` are across z2 and as long as v3 and v2.
#[inline(never)]
pub(super) fn step<T: Scalar>(
    columns: &[Twist<T>; 6],
    way: &Vector3<T>,
    e: &Twist<T>,
    steps: &mut [T; 6],
    wrist: Option<&Wrist<T>>,
    off: T,
) -> Option<T> {
    let [c1, c2, c3, c4, c5, c6] = columns;
    let (z2, z3) = (&c2.angular, &c3.angular);
    // Of the centre: the columns' point less the way. The first joint turns about z.
    let (x1, y1) = (c1.linear.x + way.y, c1.linear.y - way.x);
    let v2 = add_cross(&c2.linear, way, z2);
    let v3 = add_cross(&c3.linear, way, z3);
    let (a, b) = (cross(&v3, z2), cross(z2, &v2));
    let (i1, i) = (T::one() / (z2.x * x1 + z2.y * y1), T::one() / dot(&a, &v2));
    let m = add_cross(&e.linear, way, &e.angular);
    let p1 = dot(z2, &m) * i1;
    let rest = Vector3::new(m.x - x1 * p1, m.y - y1 * p1, m.z);
    let (p2, p3) = (dot(&a, &rest) * i, dot(&b, &rest) * i);
    let turn = e.angular - z2 * p2 - z3 * p3;
    let turn = Vector3::new(turn.x, turn.y, turn.z - p1);
    let ([n4, n5, n6], inverse) = across([c4, c5, c6])?;
    let about = |n: &Vector3<T>| dot(n, &turn) * inverse;
    *steps = [p1, p2, p3, about(&n4), about(&n5), about(&n6)];
    let Some(wrist) = wrist else {
        return Some(T::zero());
    };
    let along = |r: &Vector3<T>| (r.x * x1 + r.y * y1) * i1;
    let side = dot(z2, z3);
    let sum = a + b * side;
    let (a1, b1) = (along(&a), along(&b));
    let s1 = a1 + b1 * side;
    let u1 = Vector3::new(n4.z, n5.z, n6.z);
    let u2 = Vector3::new(dot(&n4, z2), dot(&n5, z2), dot(&n6, z2));
    let rows = square(&a) + square(&b) + a1 * a1 + b1 * b1;
    let turns = dot(&u1, &u1) * (i1 * i1) - (T::of(2.0) * dot(&u1, &u2)) * (s1 * i1 * i)
        + dot(&u2, &u2) * (square(&sum) + s1 * s1) * (i * i);
    let m = i1 * i1 + rows * (i * i) + turns * (inverse * inverse);
    Some(wrist.bound(m, inverse, off))
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use nalgebra::{Matrix6, Vector6};

    use super::super::direct;
    use super::super::rigid::{Rest, approach, turns_at};
    use super::*;
    use crate::{BakedJoint, Joint, JointKind, LinkMass, Pose, bake};

    fn draws(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    /// An arm of the kind, at random.
    fn arm(next: &mut impl FnMut() -> f64) -> [BakedJoint<f64>; 6] {
        core::array::from_fn(|k| {
            let alpha = match k {
                1 if next() < 0.0 => core::f64::consts::PI,
                1 | 5 => 0.0,
                _ => FRAC_PI_2 + 0.8 * next(),
            };
            let link = if k < 3 { 0.5 } else { 0.0 };
            BakedJoint {
                theta: next(),
                tx: link * next(),
                ty: link * next(),
                sin_alpha: if alpha > 3.0 { 0.0 } else { alpha.sin() },
                cos_alpha: alpha.cos(),
                ..BakedJoint::identity()
            }
        })
    }

    /// The pass along the arm at the joints `q`, to a target `near` its tool point, and the
    /// columns.
    fn pass<T: Scalar>(
        joints: &[BakedJoint<f64>; 6],
        tip: &Vector3<f64>,
        q: &[f64; 6],
        near: &Pose<f64>,
    ) -> (Rest<T>, [Twist<T>; 6]) {
        let joints = joints.map(|joint| joint.cast::<T>());
        let mut turns = [[T::zero(); 2]; 6];
        turns_at(&joints, &q.map(T::of), &mut turns);
        let mut columns = [Twist::zero(); 6];
        let (tip, target) = (tip.map(T::of), near.cast());
        let rest = approach(&joints, &turns, &tip, &target, &mut columns, true);
        (rest, columns)
    }

    /// An arm of the kind somewhere: where its last joint and its tool point are, that point in
    /// the last joint's frame, and the joints.
    fn somewhere(
        next: &mut impl FnMut() -> f64,
    ) -> ([BakedJoint<f64>; 6], Vector3<f64>, [f64; 6], Pose<f64>) {
        let joints = arm(next);
        let q: [f64; 6] = core::array::from_fn(|_| 3.0 * next());
        let tip = Vector3::new(next(), next(), next()) * 0.2;
        let mut frames = [crate::Frame::identity(); 6];
        let last = crate::forward(&Pose::identity(), &joints, &q, &mut frames);
        let off = Vector3::new(next(), next(), next()) * 0.01;
        let at = last.rotation * tip + last.translation + off;
        (joints, tip, q, Pose::new(last.rotation, at))
    }

    /// The same steps and nearly the same bounds, to rounding.
    fn is_the_general_step<T: Scalar>() {
        let mut next = draws(11);
        let (mut clear, mut all) = (0, 0);
        while all < 3000 {
            let (joints, tip, q, near) = somewhere(&mut next);
            let (rest, columns) = pass::<T>(&joints, &tip, &q, &near);
            let mut part = || Vector3::new(next(), next(), next()).map(|x| T::of(x * 0.01));
            let e = Twist::new(part(), part());
            let wrist = Wrist::of(T::of(tip.norm()), T::zero(), T::zero());
            let off = rest.squares[0];
            let (mut fast, mut slow) = ([T::zero(); 6], [T::zero(); 6]);
            let closed = step(&columns, &rest.way, &e, &mut fast, Some(&wrist), off);
            let general = direct::step(&columns, &e, &mut slow, Some(&wrist), off);
            assert_eq!(closed.is_some(), general.is_some());
            let Some(bound) = closed.map(T::widen) else {
                continue;
            };
            all += 1;
            let bounds = bound / general.unwrap().widen();
            // Each has a rounding of J amplified by its inverse, so does what comes of it.
            let amplified = 40.0 * T::EPSILON.widen() * bound.sqrt();
            if amplified > 0.1 {
                continue;
            }
            clear += 1;
            assert!((bounds - 1.0).abs() < 0.1, "{bounds}");
            let size = slow
                .iter()
                .fold(0.0_f64, |most, p| most.max(p.widen().abs()));
            for (fast, slow) in fast.iter().zip(slow) {
                let apart = (*fast - slow).abs().widen();
                assert!(apart <= amplified * size, "{apart:e} of {size}, {bound}");
            }
        }
        assert!(clear > 2900, "{clear}");
    }

    #[test]
    fn is_the_general_step_in_single_precision() {
        is_the_general_step::<f32>();
    }

    #[test]
    fn is_the_general_step_in_double_precision() {
        is_the_general_step::<f64>();
    }

    #[test]
    fn bounds_the_inverse() {
        let mut next = draws(12);
        let (mut all, mut close) = (0, 0);
        while all < 3000 {
            let (joints, tip, q, near) = somewhere(&mut next);
            let (rest, columns) = pass::<f64>(&joints, &tip, &q, &near);
            let wrist = Wrist::of(tip.norm(), 0.0, 0.0);
            let (mut steps, e) = ([0.0; 6], Twist::zero());
            let off = rest.squares[0];
            let bound = step(&columns, &rest.way, &e, &mut steps, Some(&wrist), off);
            let Some(bound) = bound else {
                continue;
            };
            let matrix = Matrix6::from_columns(&columns.map(|c| Vector6::from(c.rows())));
            let ratio = bound / matrix.try_inverse().unwrap().norm_squared();
            assert!(ratio >= 1.0, "{ratio}");
            all += 1;
            close += usize::from(ratio < 2.0);
        }
        // Near enough to be of use.
        assert!(close > 1500, "{close}");
    }

    #[test]
    fn says_where_the_last_axes_lie_in_a_plane() {
        let (joints, tip, mut q, near) = somewhere(&mut draws(13));
        let taken = |columns: &[Twist<f64>; 6]| {
            let mut steps = [0.0; 6];
            step(columns, &tip, &Twist::zero(), &mut steps, None, 0.0).is_some()
        };
        q[4] = 0.9;
        let (_, mut columns) = pass::<f64>(&joints, &tip, &q, &near);
        assert!(taken(&columns));
        columns[5].angular = columns[3].angular;
        assert!(!taken(&columns));
        columns[5].angular.x = f64::NAN;
        assert!(!taken(&columns));
    }

    /// The elbow arm of MRD table 5.1: lengths l, m, n (m).
    const LENGTHS: [f64; 3] = [0.149_09, 0.431_8, 0.433_07];

    fn elbow() -> [BakedJoint<f64>; 6] {
        let [l, m, n] = LENGTHS;
        let rows = [
            [0.0, 0.0, FRAC_PI_2],
            [l, m, 0.0],
            [0.0, n, 0.0],
            [0.0, 0.0, FRAC_PI_2],
            [0.0, 0.0, FRAC_PI_2],
            [0.0, 0.0, 0.0],
        ];
        let joints = rows.map(|[d, a, alpha]| Joint::dh(JointKind::Revolute, 0.0, d, a, alpha));
        let mut baked = [BakedJoint::identity(); 6];
        let (o, mut gauges) = (Pose::identity(), [Pose::identity(); 6]);
        bake(
            &o,
            &joints,
            &[LinkMass::none(); 6],
            &o,
            &mut baked,
            &mut gauges,
        );
        baked
    }

    /// MRD 5.46 to 5.48 as printed, in the frame of link 3.
    #[test]
    fn the_first_three_are_those_of_the_printed_equations() {
        let [l, m, n] = LENGTHS;
        let (joints, mut next) = (elbow(), draws(102));
        for _ in 0..200 {
            let q: [f64; 6] = core::array::from_fn(|_| 2.8 * next());
            let mut frames = [crate::Frame::identity(); 6];
            crate::forward(&Pose::identity(), &joints, &q, &mut frames);
            let centre = frames[4].origin;
            let tool = centre + Vector3::new(next(), next(), next()) * 0.1;
            let target = Pose::new(frames[5].rotation, tool);
            let tip = target.rotation.tr_mul(&(tool - centre));
            let (rest, columns) = pass::<f64>(&joints, &tip, &q, &target);
            assert!((rest.way - (tool - centre)).norm() < 1e-14);
            let mut part = || Vector3::new(next(), next(), next()) * 0.01;
            let twist = Twist::new(part(), part());
            let mut found = [0.0; 6];
            if step(&columns, &rest.way, &twist, &mut found, None, 0.0).is_none() {
                continue;
            }
            // x of link 3 along the link, z along its joint.
            let z = frames[2].axis();
            let x = (centre - frames[2].origin).normalize();
            let y = z.cross(&x);
            let mu = twist.linear + twist.angular.cross(&(centre - tool));
            let (mx, my, mz) = (mu.dot(&x), mu.dot(&y), mu.dot(&z));
            let (s3, c3) = q[2].sin_cos();
            let (s23, c23) = (q[1] + q[2]).sin_cos();
            let d1 = -mz / (m * q[1].cos() + n * c23);
            let d2 = (mx - d1 * l * c23) / (m * s3);
            let d3 = (d1 * l * s23 - d2 * (n + m * c3) + my) / n;
            for (found, printed) in found.iter().zip([d1, d2, d3]) {
                let scale = 1.0 + printed.abs() / s3.abs();
                assert!(
                    (found - printed).abs() < 1e-11 * scale,
                    "{found:?} {printed}"
                );
            }
        }
    }

    /// Links 2 and 3 in line: whatever it says is not clear of a singularity.
    #[test]
    fn is_not_clear_where_the_arm_is_stretched() {
        let q = [0.0, 0.3, 0.0, 0.4, 0.9, 0.2];
        let target = Pose::translate(0.1, 0.2, 0.3);
        let (rest, columns) = pass::<f64>(&elbow(), &Vector3::zeros(), &q, &target);
        let wrist = Wrist::of(0.0, 0.0, 0.0);
        let (mut steps, e) = ([0.0; 6], Twist::new([1e-3; 3].into(), [1e-3; 3].into()));
        let bound = step(&columns, &rest.way, &e, &mut steps, Some(&wrist), 0.0).unwrap();
        assert!(!bound.is_finite() || bound > 1e20, "{bound}");
    }
}
