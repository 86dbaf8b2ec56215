//! A tool's pose from three targets whose places on the tool are known.

use nalgebra::{Matrix4, Vector3};
use truepose::Pose;

use super::align::nearest_rotation;
use super::observation::Observation;

/// The pose that takes three points known on the tool to where they were measured: MRD 6.12 to
/// 6.15, with the book's fourth point, `(x2 - x1) × (x3 - x1) + x1`, which any frame agrees on.
/// Noise makes 6.15 a matrix that is nearly a rotation; the nearest one is returned, with the
/// translation that suits the three points' mean. `None` where they lie on a line.
pub fn pose_of_three(
    on_tool: &[Vector3<f64>; 3],
    measured: &[Vector3<f64>; 3],
) -> Option<Pose<f64>> {
    let columns = |x: &[Vector3<f64>; 3]| {
        // scaled to the triangle's size, so that the fourth point weighs like the others
        let across = (x[1] - x[0]).cross(&(x[2] - x[0]));
        let fourth = x[0] + across / across.norm().sqrt().max(f64::MIN_POSITIVE);
        Matrix4::from_columns(&[
            x[0].push(1.0),
            x[1].push(1.0),
            x[2].push(1.0),
            fourth.push(1.0),
        ])
    };
    let [a, b, c] = on_tool;
    let (side, across) = ((b - a).norm(), (b - a).cross(&(c - a)).norm());
    if across < 1e-6 * side * side || side <= 0.0 {
        return None;
    }
    let t = columns(measured) * columns(on_tool).try_inverse()?;
    let r = nearest_rotation(&t.fixed_view::<3, 3>(0, 0).into_owned())?;
    let mean = |x: &[Vector3<f64>; 3]| (x[0] + x[1] + x[2]) / 3.0;
    Some(Pose::new(r, mean(measured) - r * mean(on_tool)))
}

/// The same for an observation: the tool point and the first two targets that were measured.
pub(super) fn pose_of(o: &Observation, offsets: &[Vector3<f64>]) -> Option<Pose<f64>> {
    let tool = o.position.map(|p| (Vector3::zeros(), p));
    let targets = offsets.iter().zip(&o.targets);
    let targets = targets.filter_map(|(offset, p)| Some((*offset, (*p)?)));
    let mut points = tool.into_iter().chain(targets);
    let three = [points.next()?, points.next()?, points.next()?];
    pose_of_three(&three.map(|p| p.0), &three.map(|p| p.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> [Vector3<f64>; 3] {
        [
            Vector3::new(0.0, 0.0, 0.0),
            Vector3::new(0.05, 0.08, -0.03),
            Vector3::new(-0.06, 0.04, 0.07),
        ]
    }

    #[test]
    fn three_points_give_the_pose() {
        let pose = Pose::from_xyz_rpy(Vector3::new(0.4, -0.2, 0.9), Vector3::new(0.3, -1.0, 2.2));
        let measured = triangle().map(|p| pose.point(&p));
        let found = pose_of_three(&triangle(), &measured).unwrap();
        let off = pose.twist_to(&found);
        assert!(off.linear.norm() < 1e-14 && off.angular.norm() < 1e-14);
    }

    #[test]
    fn noise_of_a_point_turns_it_by_noise_over_lever() {
        let pose = Pose::<f64>::identity();
        let mut measured = triangle();
        measured[1].x += 1e-5;
        let off = pose.twist_to(&pose_of_three(&triangle(), &measured).unwrap());
        // 10 um over a tenth of a metre, and never more than a few times that
        assert!(off.angular.norm() > 1e-5 && off.angular.norm() < 4e-4);
        let r = pose_of_three(&triangle(), &measured).unwrap().rotation;
        assert!((r * r.transpose() - nalgebra::Matrix3::identity()).norm() < 1e-14);
    }

    #[test]
    fn points_on_a_line_give_none() {
        let line = [Vector3::zeros(), Vector3::x(), Vector3::x() * 2.0];
        assert!(pose_of_three(&line, &line).is_none());
    }
}
