//! A described arm with its baked form and its effects, evaluated through the model.

use nalgebra::Vector3;
use truepose::effects::{Ambient, Description, Effect, Posture};
use truepose::model::Prediction;
use truepose::{
    Arm, BakedJoint, Frame, Gauge, Joint, LinkMass, Pose, PreparedJoint, Scalar, Scratch, bake,
};

/// A described arm.
#[derive(Clone)]
pub(crate) struct Described {
    pub(crate) base: Pose<f64>,
    pub(crate) joints: Vec<Joint<f64>>,
    pub(crate) masses: Vec<LinkMass<f64>>,
    pub(crate) tool: Pose<f64>,
    pub(crate) gravity: Vector3<f64>,
}

/// The same, baked.
pub(crate) struct Baked<T: Scalar> {
    pub(crate) base: Pose<T>,
    pub(crate) joints: Vec<BakedJoint<T>>,
    pub(crate) tool: Pose<T>,
    pub(crate) gravity: Vector3<T>,
}

/// One pose's inputs.
pub(crate) struct Given<T: Scalar> {
    pub(crate) q: Vec<T>,
    pub(crate) direction: Vec<T>,
    pub(crate) ambient: Ambient<T>,
}

impl Described {
    /// Bakes and attaches `effects`.
    pub(crate) fn bake(&self, effects: &mut [Effect<'_, f64>]) -> Baked<f64> {
        let mut joints = vec![BakedJoint::identity(); self.joints.len()];
        let mut gauges: Vec<Gauge<f64>> = vec![Pose::identity(); self.joints.len()];
        let (base, tool) = bake(
            &self.base,
            &self.joints,
            &self.masses,
            &self.tool,
            &mut joints,
            &mut gauges,
        );
        for effect in effects {
            effect.model_mut().attach(&Description {
                base: &base.inverse().then(&self.base),
                joints: &self.joints,
                gauges: &gauges,
                tool: &self.tool,
            });
        }
        Baked {
            base,
            joints,
            tool,
            gravity: self.gravity,
        }
    }
}

impl<T: Scalar> Baked<T> {
    /// The model's prediction; `look` sees the posture at the same readings.
    pub(crate) fn predict(
        &self,
        effects: &[Effect<'_, T>],
        given: &Given<T>,
        look: impl FnOnce(&Posture<'_, T>),
    ) -> Prediction<T> {
        let count = self.joints.len();
        let mut scratch = Scratch {
            readings: &mut vec![T::zero(); count],
            frames: &mut vec![Frame::identity(); count],
            moments: &mut vec![Vector3::zeros(); count],
            forces: &mut vec![Vector3::zeros(); count],
        };
        let arm = Arm {
            base: &self.base,
            joints: &self.joints,
            tool: &self.tool,
            gravity: &self.gravity,
            effects,
        };
        let (q, direction, ambient) = (&given.q, &given.direction, &given.ambient);
        let mut joints = vec![PreparedJoint::empty(); count];
        let prepared = arm.prepare(direction, ambient, &mut joints);
        let prediction = prepared.predict(q, &mut scratch);
        arm.with_posture(q, direction, ambient, &prediction.rigid, &mut scratch, look);
        prediction
    }
}
