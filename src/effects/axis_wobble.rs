//! A revolute axis that tilts or shifts as it turns.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    Anchor, Description, Displacement, EffectModel, Posture, Selector, Stage, entry,
    gear_eccentricity::harmonic,
};
use crate::{Scalar, Twist};

/// Axis wobble, a higher pair: tilts (or shifts) everything beyond the joint across its axis, a
/// harmonic of the reading in each of two directions that are fixed in the link before: x and y
/// of the described joint frame at zero reading, about its origin. MRD 2.8.5.
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
    /// Described joint frame.
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
            component: Some(u8::from(self.motion == Wobble::Shift)),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        match self.motion {
            Wobble::Tilt => &[
                ("x sin", "rad"),
                ("x cos", "rad"),
                ("y sin", "rad"),
                ("y cos", "rad"),
            ],
            Wobble::Shift => &[
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

    fn attach(&mut self, to: &Description<'_, T>) {
        self.anchor = Anchor::of(to, usize::from(self.joint));
    }

    fn anchors_are_finite(&self) -> bool {
        self.anchor.is_finite()
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    #[inline]
    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let j = usize::from(self.joint);
        let Some(frame) = at.frames.get(j) else {
            return Displacement::zero();
        };
        let q = entry(at.q, j);
        // Directions of the link before: turned back by the reading.
        let (s, c) = q.sincos();
        let [x, y] = self.anchor.axes(frame);
        let direction = if k < 2 { x * c - y * s } else { y * c + x * s };
        let wobble = direction * harmonic(k % 2, self.order * q);
        Displacement {
            twist: match self.motion {
                Wobble::Tilt => Twist::new(Vector3::zeros(), wobble),
                Wobble::Shift => Twist::new(wobble, Vector3::zeros()),
            },
            origin: self.anchor.origin(frame),
        }
    }
}

/// What an axis does as it turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wobble {
    /// Leans over.
    Tilt,
    /// Moves sideways.
    Shift,
}

impl Wobble {
    /// Their names, in the order of the variants.
    pub const NAMES: [&str; 2] = ["tilt", "shift"];
}
