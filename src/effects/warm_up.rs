//! A joint zero or a base that settles while the arm warms up.

use serde::{Deserialize, Serialize};

use super::{
    Ambient, Description, Displacement, EffectModel, Place, Posture, Reading, Selector, Stage,
};
use crate::Scalar;

/// Warm-up: moves a joint's zero or the base by `drift * exp(-time / tau)`. MRD 7.6.
///
/// Zero where the time is not known, which is the arm that has warmed up. Before time 0 as at
/// time 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WarmUp<T: Scalar> {
    /// What drifts.
    pub place: Place<T>,
    /// Time constant, s.
    pub tau: T,
    /// Displacement at time 0, rad or m.
    pub drift: [T; 1],
}

impl<T: Scalar> WarmUp<T> {
    /// No drift yet; `tau` in s.
    pub fn new(place: Place<T>, tau: T) -> Self {
        Self {
            place,
            tau,
            drift: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> WarmUp<U> {
        WarmUp {
            place: self.place.cast(),
            tau: U::of(self.tau.widen()),
            drift: self.drift.map(|x| U::of(x.widen())),
        }
    }

    #[inline]
    pub(crate) fn factor(&self, ambient: &Ambient<T>) -> T {
        let time = ambient.time;
        if !time.finite() || self.tau <= T::zero() {
            return T::zero();
        }
        (-time.max(T::zero()) / self.tau).exponential()
    }
}

impl<T: Scalar> EffectModel<T> for WarmUp<T> {
    fn kind(&self) -> &'static str {
        "warm-up"
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
        &[("tau", "s")]
    }

    fn constants(&self) -> &[T] {
        core::slice::from_ref(&self.tau)
    }

    fn constants_mut(&mut self) -> &mut [T] {
        core::slice::from_mut(&mut self.tau)
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
