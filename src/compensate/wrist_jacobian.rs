//! Joint steps of arms with a spherical wrist without a 6 x 6 solution. MRD 5.45 to 5.52.
//!
//! About the wrist centre only the first three joints move a point, and with the second and
//! third axes parallel they come one after the other:
//!
//! ```text
//! J = [ J11 0 ; J21 J22 ]                                             MRD 5.45
//! dq1 = m · z2 / (z1 x r1) · z2                                       in kind of 5.46
//! dq2 = m' · r3 / (z2 x r2) · r3,   dq3 = m' · r2 / (z2 x r3) · r2    5.47, 5.48
//! ```
//! with m the displacement of the wrist centre, m' what joint 1 leaves of it, and r_k the way
//! from axis k to the centre; what these three leave of the rotation is shared out among the
//! last three axes by their reciprocal vectors (5.49 to 5.51). In vectors it needs no frame of
//! its own, and holds for every arm of the kind, whatever its offsets and twists.
//!
//! The book's compensation by the nominal Jacobian takes this and no more. The compensators use
//! the calibrated Jacobian, whose axes do not meet, by the same blocks: `direct.rs` beside this takes
//! 28 instructions more than this on a Cortex-M4F and leaves the error squared, this one the
//! error times the deviations. It is for controllers that have nominal frames only, as
//! `tests/elbow_arm.rs` shows.

use nalgebra::Vector3;

use super::damped::cross;
use crate::chain::Frame;
use crate::{Scalar, Twist};

/// The joint step (rad) that moves the tool by `twist`: desired minus predicted, world axes at
/// the tool point `tool` (m).
///
/// `frames`: of the six joints after their motion, of an arm that
/// [`super::spherical_wrist::SphericalWrist`] takes; on an arm that is off from that by a part
/// e of its length the step is off by the same part. `None` at a singular configuration, where
/// a denominator is zero or the step not finite.
///
/// Cost: `wrist_step` in `docs/COST.md`, of any arm by damped normal equations `general_step`.
pub fn step<T: Scalar>(
    frames: &[Frame<T>; 6],
    tool: &Vector3<T>,
    twist: &Twist<T>,
) -> Option<[T; 6]> {
    let [f1, f2, f3, f4, f5, f6] = frames;
    let (z1, z2) = (f1.axis(), f2.axis());
    let (z4, z5, z6) = (f4.axis(), f5.axis(), f6.axis());
    // The wrist centre: baked frames of the last three joints begin on their axes, the fifth
    // in the point where they meet.
    let centre = &f5.origin;
    let m = twist.linear + cross(&twist.angular, &(centre - tool));
    let (r2, r3) = (centre - f2.origin, centre - f3.origin);
    let v1 = cross(&z1, &(centre - f1.origin));
    let q1 = m.dot(&z2) / v1.dot(&z2);
    let rest = m - v1 * q1;
    let (v2, v3) = (cross(&z2, &r2), cross(&z2, &r3));
    let q2 = rest.dot(&r3) / v2.dot(&r3);
    // About z2: the third axis may point the other way.
    let turn = rest.dot(&r2) / v3.dot(&r2);
    let w = twist.angular - z1 * q1 - z2 * (q2 + turn);
    let volume = z4.dot(&cross(&z5, &z6));
    let step = [
        q1,
        q2,
        if z2.dot(&f3.axis()) < T::zero() {
            -turn
        } else {
            turn
        },
        w.dot(&cross(&z5, &z6)) / volume,
        w.dot(&cross(&z6, &z4)) / volume,
        w.dot(&cross(&z4, &z5)) / volume,
    ];
    step.iter().all(|p| p.finite()).then_some(step)
}
