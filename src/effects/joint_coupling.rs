//! A motor that leaks into another joint.

use serde::{Deserialize, Serialize};

use super::{EffectModel, Reading, Selector, Stage, entry};
use crate::Scalar;

/// Joint coupling: adds `coupling` times another joint's reading, as in wrists whose motors sit
/// in the forearm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointCoupling<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// The joint whose motion leaks, from 0.
    pub from: u8,
    /// rad per rad (m for a slide).
    pub coupling: [T; 1],
}

impl<T: Scalar> JointCoupling<T> {
    /// No leak yet into `joint` from `from` (both from 0).
    pub fn new(joint: u8, from: u8) -> Self {
        Self {
            joint,
            from,
            coupling: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> JointCoupling<U> {
        JointCoupling {
            joint: self.joint,
            from: self.from,
            coupling: self.coupling.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for JointCoupling<T> {
    fn kind(&self) -> &'static str {
        "joint-coupling"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            from: Some(usize::from(self.from)),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("coupling", "1")]
    }

    fn values(&self) -> &[T] {
        &self.coupling
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.coupling
    }

    fn stage(&self) -> Stage {
        Stage::Reading
    }

    #[inline]
    fn reading_partial(&self, _k: usize, at: &Reading<'_, T>) -> T {
        entry(at.q, usize::from(self.from))
    }
}
