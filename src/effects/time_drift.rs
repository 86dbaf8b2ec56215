//! A joint zero or a base that moves steadily.

use serde::{Deserialize, Serialize};

use super::{
    Ambient, Description, Displacement, EffectModel, Place, Posture, Reading, Selector, Stage,
    since,
};
use crate::Scalar;

/// Time drift: moves a joint's zero or the base by `drift` per second, from time 0 on.
/// MRD 7.6.
///
/// Zero where the time is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeDrift<T: Scalar> {
    /// What drifts.
    pub place: Place<T>,
    /// rad/s or m/s.
    pub drift: [T; 1],
}

impl<T: Scalar> TimeDrift<T> {
    /// No drift yet.
    pub fn new(place: Place<T>) -> Self {
        Self {
            place,
            drift: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> TimeDrift<U> {
        TimeDrift {
            place: self.place.cast(),
            drift: self.drift.map(|x| U::of(x.widen())),
        }
    }

    #[inline]
    pub(crate) fn factor(&self, ambient: &Ambient<T>) -> T {
        since(ambient.time, T::zero())
    }
}

impl<T: Scalar> EffectModel<T> for TimeDrift<T> {
    fn kind(&self) -> &'static str {
        "time-drift"
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
        &[("drift", "rad/s")]
    }

    fn values(&self) -> &[T] {
        &self.drift
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.drift
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
