//! A straight path of a PUMA 560 through its wrist singularity.

use nalgebra::{DMatrix, DVector, Vector3};
use truepose::jacobian::joint_column;
use truepose::{Frame, Model, Pose, Twist, forward};

/// Points of a path, 0.1 mm apart.
const POINTS: i32 = 1200;

/// A straight line in the arm's plane without turning the tool, through the configuration
/// where the fifth joint is zero. Joints 4 and 6 stay where they are; the others are found by
/// least squares, which is well conditioned here. Returns nominal joints.
pub(crate) fn path(model: &Model<'_, f64, 6>, roll: f64, along: &Vector3<f64>) -> Vec<[f64; 6]> {
    let chain = &model.nominal;
    let singular = [0.3, -0.6, 0.2, 0.0, 0.0, roll];
    let middle = model.nominal_pose(&singular);
    let mut q = singular;
    let mut walk = |steps: &mut dyn Iterator<Item = i32>| {
        q = singular;
        let mut out = Vec::new();
        for k in steps {
            let goal = Pose::new(
                middle.rotation,
                middle.translation + along * (f64::from(k) * 1e-4),
            );
            for _ in 0..5 {
                let mut frames = [Frame::identity(); 6];
                let tool = forward(&chain.base, &chain.joints, &q, &mut frames).then(&chain.tool);
                let error = DVector::from_row_slice(&tool.twist_to(&goal).rows());
                let free = [0, 1, 2, 4];
                let mut matrix = DMatrix::zeros(6, free.len());
                for (c, &j) in free.iter().enumerate() {
                    let column =
                        joint_column(chain.joints[j].kind, &frames[j], &tool.translation).rows();
                    matrix.set_column(c, &DVector::from_row_slice(&column));
                }
                let step = matrix.svd(true, true).solve(&error, 1e-12).unwrap();
                for (c, &j) in free.iter().enumerate() {
                    q[j] += step[c];
                }
            }
            assert!(tool_error(model, &q, &goal) < 1e-9);
            out.push(q);
        }
        out
    };
    let mut before = walk(&mut (1..POINTS / 2).map(|k| -k));
    before.reverse();
    before.extend(walk(&mut (0..POINTS / 2)));
    before
}

fn tool_error(model: &Model<'_, f64, 6>, q: &[f64; 6], goal: &Pose<f64>) -> f64 {
    size(&model.nominal_pose(q).twist_to(goal))
}

fn size(twist: &Twist<f64>) -> f64 {
    twist.linear.norm().hypot(twist.angular.norm())
}

/// Direction in the arm's plane: up and forward.
pub(crate) fn in_plane(first: f64) -> Vector3<f64> {
    Vector3::new(first.cos() * 0.6, first.sin() * 0.6, 0.8)
}
