//! A tool whose mass nobody declared, on a compliant joint.

use serde::{Deserialize, Serialize};

use super::{Displacement, EffectModel, Posture, Stage, one_way};
use crate::vector::{cross, dot, less, times};
use crate::{JointKind, Scalar};

/// Tool load: turns (or slides) the joint by `load` times the torque (or force) of a unit mass
/// at the tool point. `load` is the tool's mass times the joint's
/// compliance, which cannot be told apart without link masses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToolLoad<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// kg rad/(N m) or kg m/N.
    pub load: [T; 1],
}

impl<T: Scalar> ToolLoad<T> {
    /// No load yet on `joint` (from 0).
    pub fn new(joint: u8) -> Self {
        Self {
            joint,
            load: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> ToolLoad<U> {
        ToolLoad {
            joint: self.joint,
            load: self.load.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for ToolLoad<T> {
    fn kind(&self) -> &'static str {
        "tool-load"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("load", "kg rad/(N m)")]
    }

    fn values(&self) -> &[T] {
        &self.load
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.load
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    #[inline(never)]
    fn posture_partial(&self, _k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let j = usize::from(self.joint);
        let (Some(joint), Some(frame)) = (at.joints.get(j), at.frames.get(j)) else {
            return Displacement::zero();
        };
        let z = frame.axis();
        let turns = joint.kind == JointKind::Revolute;
        let load = match turns {
            true => cross(&less(&at.tool.translation, &frame.origin), at.gravity),
            false => *at.gravity,
        };
        one_way(turns, &times(&z, dot(&z, &load)), &frame.origin)
    }
}
