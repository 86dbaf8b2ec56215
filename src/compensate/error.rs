//! The pose error that a compensator takes away.

use nalgebra::Vector3;

use crate::jacobian::joint_column;
use crate::model::Prediction;
use crate::pose::columns;
use crate::vector::{add_cross, cross, dot, less, square, times};
use crate::{BakedJoint, Frame, Pose, Scalar, Settings, Twist};

/// Size of a pose error.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PoseError<T> {
    /// Distance of the tool points, m.
    pub position: T,
    /// Angle between the orientations, rad.
    pub orientation: T,
}

/// The twist from `predicted` to `desired`: [`Pose::twist_to`], with the logarithm of small
/// rotations by a series that needs no arc tangent.
pub(crate) fn between<T: Scalar>(predicted: &Pose<T>, desired: &Pose<T>) -> Twist<T> {
    // Half the sum of the cross products of the columns: sine of the angle times the axis.
    let (mut sine, mut trace) = (Vector3::zeros(), T::zero());
    let axes = columns(&predicted.rotation);
    for (a, b) in axes.iter().zip(&columns(&desired.rotation)) {
        sine = add_cross(&sine, a, b);
        trace += dot(a, b);
    }
    let sine = times(&sine, T::of(0.5));
    let square = square(&sine);
    // Angles below 0.1 rad, those near pi excluded by the trace. The next term of the series
    // of asin(s)/s, 35/1152 s^8, is below 4e-10 there and gone where the iterations end.
    if square < T::of(0.01) && trace > T::one() {
        let series = T::one()
            + square
                * (T::of(1.0 / 6.0) + square * (T::of(3.0 / 40.0) + square * T::of(15.0 / 336.0)));
        Twist::new(
            less(&desired.translation, &predicted.translation),
            times(&sine, series),
        )
    } else {
        predicted.twist_to(desired)
    }
}

/// Whether `pose` is finite and its rotation one, to a thousandth.
pub(super) fn is_pose<T: Scalar>(pose: &Pose<T>) -> bool {
    let tolerance = T::of(1e-3);
    let axes = columns(&pose.rotation);
    let [x, y, z] = &axes;
    let mut whole = dot(x, &cross(y, z)) > T::zero();
    for (i, a) in axes.iter().enumerate() {
        for (j, b) in axes.iter().enumerate() {
            let one = if i == j { T::one() } else { T::zero() };
            // NaN and infinity fail.
            whole &= (dot(a, b) - one).abs() <= tolerance;
        }
    }
    whole && pose.translation.iter().all(|x| x.finite())
}

/// The twist from what is predicted to `desired`.
///
/// Of a small displacement t it is that from the rigid chain's pose, e, less t: the logarithm of
/// `exp(e) exp(-t)` is `e - t - e x t / 2`, and what is left out is below |t|² / 6 of the result.
pub(super) fn rest<T: Scalar>(prediction: &Prediction<T>, desired: &Pose<T>) -> Twist<T> {
    let t = &prediction.twist;
    if square(&t.angular) > T::of(1e-4) {
        return T::between(&prediction.pose(), desired);
    }
    let e = T::between(&prediction.rigid, desired);
    let half = times(&cross(&e.angular, &t.angular), T::of(0.5));
    Twist::new(
        less(&e.linear, &t.linear),
        less(&less(&e.angular, &t.angular), &half),
    )
}

/// Whether errors with these `squares` are below the tolerances, or below what can be told
/// apart where the tool is.
#[inline(never)]
pub(super) fn below<T: Scalar>(
    settings: &Settings<T>,
    squares: &[T; 2],
    tool: &Vector3<T>,
) -> bool {
    let far = tool.x.abs() + tool.y.abs() + tool.z.abs();
    let floor = T::EPSILON * (T::one() + far);
    let below =
        |square: T, tolerance: T| square <= tolerance * tolerance || square <= floor * floor;
    let [position, orientation] = *squares;
    below(position, settings.position_tolerance)
        && below(orientation, settings.orientation_tolerance)
}

/// Of squares of position and orientation error.
#[inline(never)]
pub(super) fn size<T: Scalar>([position, orientation]: [T; 2]) -> PoseError<T> {
    PoseError {
        position: position.rough_root(),
        orientation: orientation.rough_root(),
    }
}

/// Position rows by the first weight, orientation rows by the second.
#[inline]
pub(super) fn weighted<T: Scalar>(twist: &Twist<T>, [p, o]: [T; 2]) -> [T; 6] {
    let [a, b, c, d, e, f] = twist.rows();
    [a * p, b * p, c * p, d * o, e * o, f * o]
}

/// Columns of the weighted joint Jacobian about `tool`.
pub(crate) fn weighted_jacobian<T: Scalar>(
    joints: &[BakedJoint<T>],
    frames: &[Frame<T>],
    tool: &Vector3<T>,
    weights: [T; 2],
    columns: &mut [[T; 6]],
) {
    for (column, (joint, frame)) in columns.iter_mut().zip(joints.iter().zip(frames)) {
        *column = weighted(&joint_column(joint.kind, frame, tool), weights);
    }
}
