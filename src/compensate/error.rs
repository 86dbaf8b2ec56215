//! The pose error that a compensator takes away.

use nalgebra::Matrix3;
use nalgebra::Vector3;

use crate::{Pose, Scalar, Twist};

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
#[inline(never)]
pub(super) fn between<T: Scalar>(predicted: &Pose<T>, desired: &Pose<T>) -> Twist<T> {
    let (a, b) = (&predicted.rotation, &desired.rotation);
    // Half the sum of the cross products of the columns: sine of the angle times the axis.
    let column = |m: &Matrix3<T>, k| Vector3::new(m[(0, k)], m[(1, k)], m[(2, k)]);
    let sine = (column(a, 0).cross(&column(b, 0))
        + column(a, 1).cross(&column(b, 1))
        + column(a, 2).cross(&column(b, 2)))
        * T::of(0.5);
    let trace = a.component_mul(b).sum();
    let square = sine.norm_squared();
    // Angles below 0.1 rad, those near pi excluded by the trace. The next term of the series
    // of asin(s)/s, 35/1152 s^8, is below 4e-10 there and gone where the iterations end.
    if square < T::of(0.01) && trace > T::one() {
        let series = T::one()
            + square
                * (T::of(1.0 / 6.0) + square * (T::of(3.0 / 40.0) + square * T::of(15.0 / 336.0)));
        Twist::new(desired.translation - predicted.translation, sine * series)
    } else {
        predicted.twist_to(desired)
    }
}

/// Whether `pose` is finite and its rotation one, to a thousandth.
pub(super) fn is_pose<T: Scalar>(pose: &Pose<T>) -> bool {
    let off = pose.rotation.tr_mul(&pose.rotation) - Matrix3::identity();
    let tolerance = T::of(1e-3);
    // NaN and infinity in the rotation fail the comparisons.
    pose.translation.iter().all(|x| x.finite())
        && off.iter().all(|x| x.abs() <= tolerance)
        && pose.rotation.determinant() > T::zero()
}
