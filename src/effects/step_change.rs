//! A joint zero or a base that is moved once.

use serde::{Deserialize, Serialize};

use super::{
    Ambient, Description, Displacement, EffectModel, Place, Posture, Reading, Selector, Stage,
};
use crate::Scalar;

/// Step change: moves a joint's zero or the base by `drift` from `time` on, as after a
/// collision or a re-mounting.
///
/// Zero where the time is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepChange<T: Scalar> {
    /// What drifts.
    pub place: Place<T>,
    /// When it happened, s.
    pub time: T,
    /// rad or m.
    pub drift: [T; 1],
}

impl<T: Scalar> StepChange<T> {
    /// No step yet; `time` in s.
    pub fn new(place: Place<T>, time: T) -> Self {
        Self {
            place,
            time,
            drift: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> StepChange<U> {
        StepChange {
            place: self.place.cast(),
            time: U::of(self.time.widen()),
            drift: self.drift.map(|x| U::of(x.widen())),
        }
    }

    #[inline]
    pub(crate) fn factor(&self, ambient: &Ambient<T>) -> T {
        // False for a time that is not known.
        if ambient.time >= self.time {
            T::one()
        } else {
            T::zero()
        }
    }
}

impl<T: Scalar> EffectModel<T> for StepChange<T> {
    fn kind(&self) -> &'static str {
        "step-change"
    }

    fn joint(&self) -> Option<usize> {
        self.place.joint()
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            component: self.place.axis(),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("drift", "rad")]
    }

    fn values(&self) -> &[T] {
        &self.drift
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.drift
    }

    fn constant_names(&self) -> &'static [(&'static str, &'static str)] {
        &[("time", "s")]
    }

    fn constants(&self) -> &[T] {
        core::slice::from_ref(&self.time)
    }

    fn constants_mut(&mut self) -> &mut [T] {
        core::slice::from_mut(&mut self.time)
    }

    fn attach(&mut self, to: &Description<'_>) {
        self.place.attach(to);
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.place.fixed_mut()
    }

    fn stage(&self) -> Stage {
        self.place.stage()
    }

    #[inline]
    fn reading_partial(&self, _k: usize, at: &Reading<'_, T>) -> T {
        self.factor(at.ambient)
    }

    #[inline]
    fn posture_partial(&self, _k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        self.place.displaced(at, self.factor(at.ambient))
    }
}
