//! The baked arm as it is stored: numbers that a controller rounds and does nothing else with.

use nalgebra::{Matrix3, Vector3};

use super::body::Body;
use super::{Description, Load, MAX_JOINTS};
use crate::chain::{BakedJoint, Gauge};
use crate::effects::{self, Effect};
use crate::{JointKind, Pose, Scalar};

/// A description in baked form, whatever its number of joints.
pub(super) struct Baked<'d> {
    description: &'d Description,
    pub(super) base: Pose<f64>,
    pub(super) tool: Pose<f64>,
    /// Acceleration of gravity in the world, m/s^2.
    pub(super) gravity: [f64; 3],
    joints: [BakedJoint<f64>; MAX_JOINTS],
    gauges: [Gauge<f64>; MAX_JOINTS],
}

impl<'d> Baked<'d> {
    /// `gravity`: in the base frame.
    pub(super) fn of(description: &'d Description, gravity: [f64; 3]) -> Self {
        let mut joints = [BakedJoint::identity(); MAX_JOINTS];
        let mut gauges = [Pose::identity(); MAX_JOINTS];
        let (base, tool) = description.bake(&mut joints, &mut gauges);
        Self {
            description,
            base,
            tool,
            gravity: description.in_world(gravity).into(),
            joints,
            gauges,
        }
    }

    pub(super) fn joints(&self) -> &[BakedJoint<f64>] {
        self.joints
            .get(..self.description.joints.len())
            .unwrap_or_default()
    }

    /// Attaches an effect to the arm.
    pub(super) fn attach(&self, effect: &mut Effect<'_, f64>) {
        let (base, tool) = (&self.description.base, &self.description.tool);
        effect.attach(&effects::Description {
            base: &self.base.inverse().then(&Pose::from(base)),
            joints: &self.description.joints,
            gauges: &self.gauges,
            tool: &Pose::from(tool),
        });
    }
}

/// Axes, one after the other, and origin, as they are stored.
pub(super) fn pose_numbers(pose: &Pose<f64>) -> [f64; 12] {
    let [x, y, z] = pose.rotation.data.0;
    let mut numbers = [0.0; 12];
    let stored = [x, y, z, pose.translation.into()];
    for (to, from) in numbers.iter_mut().zip(stored.as_flattened()) {
        *to = *from;
    }
    numbers
}

/// What is stored of a joint behind its kind.
pub(super) fn joint_numbers(joint: &BakedJoint<f64>) -> [f64; 11] {
    let ([sine, cosine], com) = (joint.sincos_theta, joint.mass.com);
    let [theta, tx, ty] = [joint.theta, joint.tx, joint.ty];
    let [sin, cos] = [joint.sin_alpha, joint.cos_alpha];
    let mass = joint.mass.mass;
    [
        theta, sine, cosine, tx, ty, sin, cos, mass, com.x, com.y, com.z,
    ]
}

impl<'a> Body<'a> {
    /// Real numbers, one a place, rounded once.
    pub(super) fn fill<T: Load>(&mut self, places: &mut [T]) {
        for place in places {
            *place = T::taken(self);
        }
    }

    /// A baked pose.
    #[inline(never)]
    pub(super) fn pose<T: Scalar>(&mut self) -> Pose<T> {
        let mut pose = Pose::new(Matrix3::zeros(), Vector3::zeros());
        self.fill(pose.rotation.as_mut_slice());
        self.fill(pose.translation.as_mut_slice());
        pose
    }

    /// A baked joint.
    #[inline(never)]
    pub(super) fn joint<T: Scalar>(&mut self) -> BakedJoint<T> {
        let mut joint = BakedJoint::identity();
        joint.kind = match self.byte() {
            0 => JointKind::Revolute,
            1 => JointKind::Prismatic,
            _ => {
                self.fail();
                JointKind::Revolute
            }
        };
        joint.theta = T::taken(self);
        self.fill(&mut joint.sincos_theta);
        joint.tx = T::taken(self);
        joint.ty = T::taken(self);
        joint.sin_alpha = T::taken(self);
        joint.cos_alpha = T::taken(self);
        joint.mass.mass = T::taken(self);
        self.fill(joint.mass.com.as_mut_slice());
        joint
    }
}
