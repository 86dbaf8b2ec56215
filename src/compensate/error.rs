//! The pose error that a compensator takes away.

use nalgebra::Vector3;

use crate::pose::columns;
use crate::vector::{add_cross, cross, dot, less, square, times};
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
