//! Strain-wave gears and encoder lines: a fine ripple on the reading.

use serde::{Deserialize, Serialize};

use super::{
    EffectModel, Reading, Selector, Stage, entry,
    gear_eccentricity::{harmonic, harmonics},
};
use crate::Scalar;

/// Ripple: the same harmonic error as [`super::GearEccentricity`], of high order: 1, 2 or 4
/// periods per motor turn of a strain-wave gear, or the number of lines of an encoder.
/// MRD 4.22.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GearRipple<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Periods per joint turn; negative where the motor turns the other way.
    pub order: T,
    /// Amplitudes of sine and cosine, rad or m.
    pub amplitude: [T; 2],
}

impl<T: Scalar> GearRipple<T> {
    /// No ripple yet on `joint` (from 0).
    pub fn new(joint: u8, order: T) -> Self {
        Self {
            joint,
            order,
            amplitude: [T::zero(); 2],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> GearRipple<U> {
        GearRipple {
            joint: self.joint,
            order: U::of(self.order.widen()),
            amplitude: self.amplitude.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for GearRipple<T> {
    fn kind(&self) -> &'static str {
        "gear-ripple"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            order: Some(self.order.widen()),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("sin", "rad"), ("cos", "rad")]
    }

    fn values(&self) -> &[T] {
        &self.amplitude
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.amplitude
    }

    fn constant_names(&self) -> &'static [(&'static str, &'static str)] {
        &[("order", "1")]
    }

    fn constants(&self) -> &[T] {
        core::slice::from_ref(&self.order)
    }

    fn constants_mut(&mut self) -> &mut [T] {
        core::slice::from_mut(&mut self.order)
    }

    fn stage(&self) -> Stage {
        Stage::Reading
    }

    #[inline]
    fn reading_partial(&self, k: usize, at: &Reading<'_, T>) -> T {
        harmonic(k, self.order * entry(at.q, usize::from(self.joint)))
    }

    #[inline]
    fn addition(&self, at: &Reading<'_, T>) -> T {
        let q = entry(at.q, usize::from(self.joint));
        harmonics(&self.amplitude, self.order * q)
    }
}
