//! A revolute axis that tilts or shifts as it turns.

use serde::{Deserialize, Serialize};

use super::{
    Anchor, Description, Displacement, EffectModel, Posture, Selector, Stage, entry,
    gear_eccentricity::harmonic, one_way,
};
use crate::Scalar;
use crate::vector::{along, times};

/// Axis wobble, a higher pair: tilts (or shifts) everything beyond the joint across its axis, a
/// harmonic of the reading in each of two directions, about the described joint frame's
/// origin. MRD 2.8.5.
///
/// A fault of the standing ring has its directions fixed in the link before: x and y of the
/// described frame at zero reading. A fault of the turning ring carries them along; seen from
/// the link before its order h is two turning parts, of orders h + 1 and 1 - h.
///
/// The cosine is counted from its value at zero reading; a constant is the axis itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisWobble<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Tilts or shifts.
    pub motion: Wobble,
    /// Periods per joint turn.
    pub order: T,
    /// Sine and cosine about (or along) x, then y; rad or m.
    pub amplitude: [T; 4],
    /// Described joint frame, see [`EffectModel::attach`].
    #[serde(skip, default = "Anchor::default")]
    pub anchor: Anchor<T>,
}

impl<T: Scalar> AxisWobble<T> {
    /// A true axis of `joint` (from 0).
    pub fn new(joint: u8, motion: Wobble, order: T) -> Self {
        Self {
            joint,
            motion,
            order,
            amplitude: [T::zero(); 4],
            anchor: Anchor::default(),
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> AxisWobble<U> {
        AxisWobble {
            joint: self.joint,
            motion: self.motion,
            order: U::of(self.order.widen()),
            amplitude: self.amplitude.map(|x| U::of(x.widen())),
            anchor: self.anchor.cast(),
        }
    }
}

impl<T: Scalar> EffectModel<T> for AxisWobble<T> {
    fn kind(&self) -> &'static str {
        "axis-wobble"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            order: Some(self.order.widen()),
            component: Wobble::ALL
                .iter()
                .position(|&w| w == self.motion)
                .and_then(|i| u8::try_from(i).ok()),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        match self.motion {
            Wobble::Tilt | Wobble::TurningTilt => &[
                ("x sin", "rad"),
                ("x cos", "rad"),
                ("y sin", "rad"),
                ("y cos", "rad"),
            ],
            Wobble::Shift | Wobble::TurningShift => &[
                ("x sin", "m"),
                ("x cos", "m"),
                ("y sin", "m"),
                ("y cos", "m"),
            ],
        }
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

    fn attach(&mut self, to: &Description<'_>) {
        self.anchor = Anchor::of(to, usize::from(self.joint));
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.anchor.numbers_mut()
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    #[inline]
    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let angle = self.order * entry(at.q, usize::from(self.joint));
        let amount = harmonic(k % 2, angle);
        let (x, y) = if k < 2 {
            (amount, T::zero())
        } else {
            (T::zero(), amount)
        };
        self.wobbled(at, x, y)
    }

    #[inline(never)]
    fn displacement(&self, at: &Posture<'_, T>) -> Displacement<T> {
        let angle = self.order * entry(at.q, usize::from(self.joint));
        let [a, b, c, d] = self.amplitude;
        let (sine, cosine) = angle.sincos();
        let less = cosine - T::one();
        self.wobbled(at, a * sine + b * less, c * sine + d * less)
    }
}

impl<T: Scalar> AxisWobble<T> {
    /// A tilt about (or a shift along) the two directions by these amounts.
    #[inline]
    fn wobbled(&self, at: &Posture<'_, T>, along_x: T, along_y: T) -> Displacement<T> {
        let j = usize::from(self.joint);
        let Some(frame) = at.frames.get(j) else {
            return Displacement::zero();
        };
        let (mut u, mut v) = (along_x, along_y);
        if !self.motion.turns() {
            // The directions are those of the link before: turned back by the reading.
            let (s, c) = entry(at.q, j).sincos();
            (u, v) = (along_x * c + along_y * s, along_y * c - along_x * s);
        }
        let [x, y] = self.anchor.axes(frame);
        let wobble = along(&times(&x, u), &y, v);
        let tilts = matches!(self.motion, Wobble::Tilt | Wobble::TurningTilt);
        one_way(tilts, &wobble, &self.anchor.origin(frame))
    }
}

/// What an axis does as it turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wobble {
    /// Leans over, in directions of the link before.
    Tilt,
    /// Moves sideways, in directions of the link before.
    Shift,
    /// Leans over, in directions that turn with the joint.
    TurningTilt,
    /// Moves sideways, in directions that turn with the joint.
    TurningShift,
}

impl Wobble {
    /// In the order of the variants.
    pub const ALL: [Self; 4] = [
        Self::Tilt,
        Self::Shift,
        Self::TurningTilt,
        Self::TurningShift,
    ];

    /// Their names, in the same order.
    pub const NAMES: [&str; 4] = ["tilt", "shift", "turning tilt", "turning shift"];

    fn turns(self) -> bool {
        matches!(self, Self::TurningTilt | Self::TurningShift)
    }
}
