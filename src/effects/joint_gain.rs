//! A joint that turns a little more or less than its reading says.

use serde::{Deserialize, Serialize};

use super::{EffectModel, Reading, Stage, entry};
use crate::Scalar;

/// Gain error: adds `gain * q` to the reading. MRD 4.20, NH 19.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointGain<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// rad per rad or m per m.
    pub gain: [T; 1],
}

impl<T: Scalar> JointGain<T> {
    /// No error yet on `joint` (from 0).
    pub fn new(joint: u8) -> Self {
        Self {
            joint,
            gain: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> JointGain<U> {
        JointGain {
            joint: self.joint,
            gain: self.gain.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for JointGain<T> {
    fn kind(&self) -> &'static str {
        "joint-gain"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("gain", "1")]
    }

    fn values(&self) -> &[T] {
        &self.gain
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.gain
    }

    fn stage(&self) -> Stage {
        Stage::Reading
    }

    #[inline]
    fn reading_partial(&self, _k: usize, at: &Reading<'_, T>) -> T {
        entry(at.q, usize::from(self.joint))
    }
}
