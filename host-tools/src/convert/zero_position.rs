//! The arm with all joints at zero.

use nalgebra::Vector3;
use truepose::{JointKind, Pose};

use crate::description::Robot;

/// A joint's axis in the base frame, all joints at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Turns or slides.
    pub kind: JointKind,
    /// Unit vector, in the sense of a growing reading.
    pub direction: Vector3<f64>,
    /// A point on it, m. Without meaning for a slide, which has no place.
    pub point: Vector3<f64>,
}

/// Everything that a description says of an arm, free of its convention: MRD 2.7.
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroPosition {
    /// From base to tool.
    pub axes: Vec<Axis>,
    /// The links' distal frames in the base frame.
    pub links: Vec<Pose<f64>>,
    /// The tool in the base frame.
    pub tool: Pose<f64>,
}

impl ZeroPosition {
    /// Of a described robot.
    pub fn of(robot: &Robot) -> Self {
        let mut at = Pose::identity();
        let (mut axes, mut links) = (Vec::new(), Vec::new());
        for described in &robot.joints {
            let joint = &described.joint;
            let frame = at.then(&joint.before());
            axes.push(Axis {
                kind: joint.kind,
                direction: frame.rotation.column(2).into_owned(),
                point: frame.translation,
            });
            at = at.then(&joint.transform(0.0));
            links.push(at);
        }
        Self {
            axes,
            links,
            tool: at.then(&robot.tool),
        }
    }

    /// Last link's distal frame in the base frame.
    pub fn flange(&self) -> Pose<f64> {
        self.links.last().copied().unwrap_or_else(Pose::identity)
    }
}

impl Axis {
    /// What the joint does to everything beyond it, at a reading of `q` (rad or m).
    pub fn motion(&self, q: f64) -> Pose<f64> {
        match self.kind {
            JointKind::Revolute => {
                let turn = Pose::from_rotation_vector(&(self.direction * q)).rotation;
                Pose::new(turn, self.point - turn * self.point)
            }
            JointKind::Prismatic => {
                let way = self.direction * q;
                Pose::translate(way.x, way.y, way.z)
            }
        }
    }

    /// The same axis after a rigid motion.
    pub fn moved(&self, by: &Pose<f64>) -> Self {
        Self {
            kind: self.kind,
            direction: by.rotation * self.direction,
            point: by.point(&self.point),
        }
    }
}
