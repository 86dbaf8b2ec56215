//! A joint that gives way under gravity.

use serde::{Deserialize, Serialize};

use super::{Displacement, EffectModel, Posture, Stage, about_joint};
use crate::Scalar;
use crate::vector::dot;

/// Joint compliance: turns (or slides) the joint by `compliance` times gravity's torque (or
/// force) on it, link masses and payload included. MRD 7.7.
///
/// Needs link masses or a payload; with neither it is zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointCompliance<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// rad/(N m) or m/N.
    pub compliance: [T; 1],
}

impl<T: Scalar> JointCompliance<T> {
    /// A stiff joint (from 0).
    pub fn new(joint: u8) -> Self {
        Self {
            joint,
            compliance: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> JointCompliance<U> {
        JointCompliance {
            joint: self.joint,
            compliance: self.compliance.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for JointCompliance<T> {
    fn kind(&self) -> &'static str {
        "joint-compliance"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("compliance", "rad/(N m)")]
    }

    fn values(&self) -> &[T] {
        &self.compliance
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.compliance
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    fn loaded(&self) -> bool {
        true
    }

    #[inline(never)]
    fn posture_partial(&self, _k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let j = usize::from(self.joint);
        let mut d = about_joint(at, j);
        if let (Some(moment), Some(force)) = (at.moments.get(j), at.forces.get(j)) {
            // The turn's axis picks the torque, the slide's axis the force.
            let load = dot(&d.twist.angular, moment) + dot(&d.twist.linear, force);
            d.twist = d.twist.scaled(load);
        }
        d
    }
}
