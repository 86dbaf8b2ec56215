//! Play between a joint and what measures it.

use serde::{Deserialize, Serialize};

use super::{EffectModel, Reading, Stage, entry};
use crate::Scalar;

/// Backlash: adds `backlash` times the sign of the joint's last move to the reading; half of
/// the play. Negative where the joint lags behind its reading. MRD 1.3.1.
///
/// Zero where the direction is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Backlash<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Half of the play, rad or m.
    pub backlash: [T; 1],
}

impl<T: Scalar> Backlash<T> {
    /// No play yet on `joint` (from 0).
    pub fn new(joint: u8) -> Self {
        Self {
            joint,
            backlash: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> Backlash<U> {
        Backlash {
            joint: self.joint,
            backlash: self.backlash.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for Backlash<T> {
    fn kind(&self) -> &'static str {
        "backlash"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("backlash", "rad")]
    }

    fn values(&self) -> &[T] {
        &self.backlash
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.backlash
    }

    fn stage(&self) -> Stage {
        Stage::Reading
    }

    #[inline]
    fn reading_partial(&self, _k: usize, at: &Reading<'_, T>) -> T {
        entry(at.direction, usize::from(self.joint))
    }
}
