//! A tool whose mass nobody declared, on a compliant joint.

use serde::{Deserialize, Serialize};

use super::{Displacement, EffectModel, Posture, Stage, about_joint, moved};
use crate::{JointKind, Scalar, Twist};

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

    #[inline]
    fn posture_partial(&self, _k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let mut d = about_joint(at, usize::from(self.joint));
        let moment = (at.tool.translation - d.origin).cross(at.gravity);
        let load = d.twist.angular.dot(&moment) + d.twist.linear.dot(at.gravity);
        d.twist = d.twist.scaled(load);
        d
    }

    #[inline]
    fn displacement(&self, at: &Posture<'_, T>) -> Twist<T> {
        moved(at, usize::from(self.joint), |kind, frame| {
            let load = match kind {
                JointKind::Revolute => (at.tool.translation - frame.origin).cross(at.gravity),
                JointKind::Prismatic => *at.gravity,
            };
            frame.axis().dot(&load) * self.load[0]
        })
    }
}
