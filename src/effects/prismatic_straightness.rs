//! A slide that is not straight.

use serde::{Deserialize, Serialize};

use super::{
    Anchor, Description, Displacement, EffectModel, Posture, Selector, Stage, entry, one_way,
};
use crate::Scalar;
use crate::vector::times;

/// Prismatic straightness, one of the six components: displaces what the slide carries along or
/// about one axis of its described frame, about that frame's origin, by a quadratic in the
/// reading s. MRD 2.91.
///
/// ```text
/// delta = linear s + quadratic s^2
/// ```
/// The constant K3 of MRD 2.91 is left out: it is the axis itself, which the geometry has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PrismaticStraightness<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// 0 to 2: along x, y, z; 3 to 5: about them.
    pub axis: u8,
    /// m/m and m/m^2, or rad/m and rad/m^2.
    pub shape: [T; 2],
    /// Described joint frame, see [`EffectModel::attach`].
    #[serde(skip, default = "Anchor::default")]
    pub anchor: Anchor<T>,
}

impl<T: Scalar> PrismaticStraightness<T> {
    /// A straight slide of `joint` (from 0), component `axis`.
    pub fn new(joint: u8, axis: u8) -> Self {
        Self {
            joint,
            axis,
            shape: [T::zero(); 2],
            anchor: Anchor::default(),
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> PrismaticStraightness<U> {
        PrismaticStraightness {
            joint: self.joint,
            axis: self.axis,
            shape: self.shape.map(|x| U::of(x.widen())),
            anchor: self.anchor.cast(),
        }
    }
}

impl<T: Scalar> EffectModel<T> for PrismaticStraightness<T> {
    fn kind(&self) -> &'static str {
        "prismatic-straightness"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            component: Some(self.axis),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        if self.axis < 3 {
            &[("linear", "1"), ("quadratic", "1/m")]
        } else {
            &[("linear", "rad/m"), ("quadratic", "rad/m^2")]
        }
    }

    fn values(&self) -> &[T] {
        &self.shape
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.shape
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

    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let s = entry(at.q, usize::from(self.joint));
        self.carried(at, if k == 0 { s } else { s * s })
    }

    #[inline(never)]
    fn displacement(&self, at: &Posture<'_, T>) -> Displacement<T> {
        let s = entry(at.q, usize::from(self.joint));
        let [linear, quadratic] = self.shape;
        self.carried(at, linear * s + quadratic * (s * s))
    }
}

impl<T: Scalar> PrismaticStraightness<T> {
    /// Along or about its axis by this amount.
    fn carried(&self, at: &Posture<'_, T>, amount: T) -> Displacement<T> {
        let j = usize::from(self.joint);
        let Some(frame) = at.frames.get(j) else {
            return Displacement::zero();
        };
        let [x, y] = self.anchor.axes(frame);
        let direction = match self.axis % 3 {
            0 => x,
            1 => y,
            _ => frame.axis(),
        };
        let error = times(&direction, amount);
        one_way(self.axis >= 3, &error, &self.anchor.origin(frame))
    }
}
