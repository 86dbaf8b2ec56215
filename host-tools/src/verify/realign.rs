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

/// The fixed end of a wire whose lengths to known points were measured: Gauss-Newton from the
/// corners of a cube about the points, the best of all.
pub(super) fn anchor(lengths: &[(Vector3<f64>, f64)]) -> Vector3<f64> {
    let count = lengths.len().max(1) as f64;
    let middle: Vector3<f64> = lengths.iter().map(|(p, _)| p / count).sum();
    let far = lengths.iter().map(|(_, l)| l / count).sum::<f64>() / 3.0_f64.sqrt();
    let cost = |at: &Vector3<f64>| -> f64 {
        let miss = lengths.iter().map(|(p, l)| l - (p - at).norm());
        miss.map(|x| x * x).sum()
    };
    let mut best = (f64::INFINITY, middle);
    for corner in 0..8 {
        let sign = |bit: usize| if corner >> bit & 1 == 0 { -far } else { far };
        let mut at = middle + Vector3::new(sign(0), sign(1), sign(2));
        for _ in 0..50 {
            let mut normal = Matrix3::identity() * 1e-12;
            let mut gradient = Vector3::zeros();
            for (p, l) in lengths {
                let wire = p - at;
                let length = wire.norm().max(1e-9);
                let u = wire / length;
                // Moving the end along u shortens the wire.
                normal += u * u.transpose();
                gradient -= u * (l - length);
            }
            let Some(step) = normal.cholesky().map(|c| c.solve(&gradient)) else {
                break;
            };
            // Never farther than a wire's length at once.
            let step = step * (far / step.norm().max(far));
            at += step;
            if step.norm() < 1e-12 {
                break;
            }
        }
        let value = cost(&at);
        if value < best.0 {
            best = (value, at);
        }
    }
    best.1
}
