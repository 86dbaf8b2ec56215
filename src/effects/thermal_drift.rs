//! A joint zero or a base that moves with the temperature.

use serde::{Deserialize, Serialize};

use super::{
    Ambient, Description, Displacement, EffectModel, Place, Posture, Reading, Selector, Stage,
};
use crate::Scalar;

/// Thermal drift: moves a joint's zero or the base by `drift` per K. MRD 7.6.
///
/// Zero where the temperature is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThermalDrift<T: Scalar> {
    /// What drifts.
    pub place: Place<T>,
    /// Temperature sensor, from 0.
    pub sensor: u8,
    /// degC.
    pub reference: T,
    /// rad/K or m/K.
    pub drift: [T; 1],
}

impl<T: Scalar> ThermalDrift<T> {
    /// No drift yet, counted from 20 degC.
    pub fn new(place: Place<T>, sensor: u8) -> Self {
        Self {
            place,
            sensor,
            reference: T::of(20.0),
            drift: [T::zero()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> ThermalDrift<U> {
        ThermalDrift {
            place: self.place.cast(),
            sensor: self.sensor,
            reference: U::of(self.reference.widen()),
            drift: self.drift.map(|x| U::of(x.widen())),
        }
    }

    #[inline]
    pub(crate) fn factor(&self, ambient: &Ambient<T>) -> T {
        ambient.warming(self.sensor, self.reference)
    }
}

impl<T: Scalar> EffectModel<T> for ThermalDrift<T> {
    fn kind(&self) -> &'static str {
        "thermal-drift"
    }

    fn joint(&self) -> Option<usize> {
        self.place.joint()
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            component: self.place.axis(),
            sensor: Some(self.sensor),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("drift", "rad/K")]
    }

    fn values(&self) -> &[T] {
        &self.drift
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.drift
    }

    fn constant_names(&self) -> &'static [(&'static str, &'static str)] {
        &[("reference", "degC")]
    }

    fn constants(&self) -> &[T] {
        core::slice::from_ref(&self.reference)
    }

    fn constants_mut(&mut self) -> &mut [T] {
        core::slice::from_mut(&mut self.reference)
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
