//! A joint that tilts across its axis under gravity.

use serde::{Deserialize, Serialize};

use super::{Anchor, Description, Displacement, EffectModel, Posture, Stage, one_way};
use crate::Scalar;
use crate::vector::{add_cross, along, dot, less};

/// Cross-axis compliance: tilts everything beyond the joint by `compliance` times gravity's
/// moment across the joint's axis. Equal in all directions across it.
///
/// ```text
/// tilt = compliance * (M - (M · z) z),  M about the described joint frame's origin
/// ```
/// Needs link masses or a payload; with neither it is zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CrossAxisCompliance<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// rad/(N m).
    pub compliance: [T; 1],
    /// Described joint frame, see [`EffectModel::attach`].
    #[serde(skip, default = "Anchor::default")]
    pub anchor: Anchor<T>,
}

impl<T: Scalar> CrossAxisCompliance<T> {
    /// A stiff joint (from 0).
    pub fn new(joint: u8) -> Self {
        Self {
            joint,
            compliance: [T::zero()],
            anchor: Anchor::default(),
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> CrossAxisCompliance<U> {
        CrossAxisCompliance {
            joint: self.joint,
            compliance: self.compliance.map(|x| U::of(x.widen())),
            anchor: self.anchor.cast(),
        }
    }
}

impl<T: Scalar> EffectModel<T> for CrossAxisCompliance<T> {
    fn kind(&self) -> &'static str {
        "cross-axis-compliance"
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

    fn attach(&mut self, to: &Description<'_>) {
        self.anchor = Anchor::of(to, usize::from(self.joint));
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.anchor.numbers_mut()
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
        let (Some(frame), Some(moment), Some(force)) =
            (at.frames.get(j), at.moments.get(j), at.forces.get(j))
        else {
            return Displacement::zero();
        };
        let origin = self.anchor.origin(frame);
        let moment = add_cross(moment, &less(&frame.origin, &origin), force);
        let z = frame.axis();
        one_way(true, &along(&moment, &z, -dot(&moment, &z)), &origin)
    }
}
