//! The arm of the programs: a PUMA 560 whose every link deviates from its drawing.

use core::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;
use truepose::model::BakedChain;
use truepose::{BakedJoint, Joint, JointKind, LinkMass, Pose, bake};

use crate::draws::Draws;

/// Joints of the arm.
pub const JOINTS: usize = 6;

/// Joints clear of singular poses, rad.
pub const CLEAR_OF_SINGULAR: [f32; JOINTS] = [0.3, 0.1, -0.6, 0.3, 1.0, 0.3];

/// One DH row a joint: d and a in m, alpha in rad.
const DRAWING: [(f64, f64, f64); JOINTS] = [
    (0.0, 0.0, FRAC_PI_2),
    (0.0, 0.4318, 0.0),
    (0.15005, 0.0203, -FRAC_PI_2),
    (0.4318, 0.0, FRAC_PI_2),
    (0.0, 0.0, -FRAC_PI_2),
    (0.0, 0.0, 0.0),
];

/// Half the travel of each joint, rad.
pub const TRAVEL: [f32; JOINTS] = [2.7, 2.2, 2.3, 2.4, 1.7, 4.6];

/// Largest deviation of an angle, rad, and of a length, m.
const DEVIATION: (f64, f64) = (2e-3, 0.5e-3);

/// A described arm.
#[derive(Clone, Debug)]
pub struct Arm {
    /// World to robot base.
    pub base: Pose<f64>,
    /// Base to tool.
    pub joints: [Joint<f64>; JOINTS],
    /// Last link to tool.
    pub tool: Pose<f64>,
}

/// As drawn.
pub fn nominal() -> Arm {
    Arm {
        base: Pose::translate(0.2, -0.1, 0.4),
        joints: DRAWING.map(|(d, a, alpha)| Joint::dh(JointKind::Revolute, 0.0, d, a, alpha)),
        tool: Pose::translate(0.0, 0.0, 0.05625),
    }
}

/// As built: five deviations a link, the tool displaced as well. It stands where it is drawn:
/// a nominal base is aligned with the measurements.
pub fn built() -> Arm {
    let mut draws = Draws::seeded(560);
    let mut draw = || f64::from(draws.symmetric());
    let mut arm = nominal();
    let (angle, length) = DEVIATION;
    for joint in &mut arm.joints {
        joint.theta += angle * draw();
        joint.d += length * draw();
        joint.a += length * draw();
        joint.alpha += angle * draw();
        joint.beta += angle * draw();
    }
    let mut vector = |scale| Vector3::new(draw(), draw(), draw()) * scale;
    arm.tool = arm
        .tool
        .then(&Pose::from_xyz_rpy(vector(length), vector(angle)));
    arm
}

/// As built, if only joint offsets and the tool were off: a spherical wrist still, its second and
/// third axes `skew` (rad) from parallel.
pub fn offset(skew: f64) -> Arm {
    let built = built();
    let mut arm = nominal();
    for (joint, built) in arm.joints.iter_mut().zip(&built.joints) {
        joint.theta = built.theta;
    }
    arm.joints[1].alpha += skew;
    Arm {
        tool: built.tool,
        ..arm
    }
}

/// In the form that the loop computes with.
pub fn baked(arm: &Arm) -> BakedChain<f64, JOINTS> {
    let mut joints = [BakedJoint::identity(); JOINTS];
    let mut gauges = [Pose::identity(); JOINTS];
    let masses = [LinkMass::none(); JOINTS];
    let (base, tool) = bake(
        &arm.base,
        &arm.joints,
        &masses,
        &arm.tool,
        &mut joints,
        &mut gauges,
    );
    BakedChain {
        base,
        joints,
        tool,
        gravity: Vector3::new(0.0, 0.0, -9.81),
    }
}
