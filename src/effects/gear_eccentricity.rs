//! A gear or encoder disc that runs out of true.

use serde::{Deserialize, Serialize};

use super::{EffectModel, Reading, Selector, Stage, entry};
use crate::Scalar;

/// Harmonic error: adds `sin * sin(order q) + cos * (cos(order q) - 1)` to the reading.
/// MRD 4.22.
///
/// The cosine is counted from its value at zero reading, so that the term does not move the
/// joint's zero; a constant is the joint's offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GearEccentricity<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Periods per joint turn (revolute) or per metre times 2 pi (prismatic); any number.
    pub order: T,
    /// Amplitudes of sine and cosine, rad or m.
    pub amplitude: [T; 2],
}

impl<T: Scalar> GearEccentricity<T> {
    /// No error yet on `joint` (from 0).
    pub fn new(joint: u8, order: T) -> Self {
        Self {
            joint,
            order,
            amplitude: [T::zero(); 2],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> GearEccentricity<U> {
        GearEccentricity {
            joint: self.joint,
            order: U::of(self.order.widen()),
            amplitude: self.amplitude.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> EffectModel<T> for GearEccentricity<T> {
    fn kind(&self) -> &'static str {
        "gear-eccentricity"
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

/// Sine (`k` = 0) or cosine less 1 of an angle in rad.
#[inline]
pub(super) fn harmonic<T: Scalar>(k: usize, angle: T) -> T {
    let (s, c) = angle.sincos();
    if k == 0 { s } else { c - T::one() }
}

/// Sine and cosine less 1 of an angle in rad, in these amounts.
#[inline(never)]
pub(super) fn harmonics<T: Scalar>(amplitude: &[T; 2], angle: T) -> T {
    let (s, c) = angle.sincos();
    amplitude[0] * s + amplitude[1] * (c - T::one())
}
