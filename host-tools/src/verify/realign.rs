//! Where the instrument stands this time, from the new rows alone.

use nalgebra::{Matrix3, Vector3};
use truepose::Pose;

/// The rigid motion of the predicted points onto the measured ones, least squares (Kabsch;
/// Umeyama's sign). Pairs: predicted, measured, m.
pub(super) fn placement(points: &[(Vector3<f64>, Vector3<f64>)]) -> Pose<f64> {
    let count = points.len().max(1) as f64;
    let mut from = Vector3::zeros();
    let mut to = Vector3::zeros();
    for (p, m) in points {
        from += p / count;
        to += m / count;
    }
    let mut cross = Matrix3::zeros();
    for (p, m) in points {
        cross += (m - to) * (p - from).transpose();
    }
    let svd = cross.svd(true, true);
    let rotation = match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => {
            // A reflection is no placement: turn the weakest direction round.
            let sign = (u * v_t).determinant().signum();
            let mut middle = Matrix3::identity();
            middle[(2, 2)] = sign;
            u * middle * v_t
        }
        _ => Matrix3::identity(),
    };
    Pose::new(rotation, to - rotation * from)
}

/// `pose` in the moved world.
pub(super) fn moved(place: &Pose<f64>, pose: &Pose<f64>) -> Pose<f64> {
    place.then(pose)
}
