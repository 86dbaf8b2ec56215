//! A joint that gives way under gravity, the masses unknown.

use serde::{Deserialize, Serialize};

use super::{
    Anchor, Description, Displacement, EffectModel, Posture, Selector, Stage, about_joint, unit,
};
use crate::Scalar;
use crate::vector::{along, cross, dot, times};

/// Free gravity lever: the part of a joint's compliance that comes from one link beyond it (or
/// its own), as the product of compliance, mass and centre of mass.
///
/// ```text
/// delta_q = sum over c of lever[c] z_joint · (e_c x g),  e_c = x and y of the link's described frame
/// ```
/// The sum over all links from the joint on is the compliance of a joint whose links have any
/// masses anywhere. The z axis of a link is fixed in the link before it as well, so x and y are
/// enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GravityLever<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Link whose mass pulls, from 0, `joint` or beyond.
    pub link: u8,
    /// rad s^2/m.
    pub lever: [T; 2],
    /// The described joint frame of the link, see [`EffectModel::attach`].
    #[serde(skip, default = "Anchor::default")]
    pub anchor: Anchor<T>,
}

impl<T: Scalar> GravityLever<T> {
    /// No load yet on `joint` from `link` (both from 0).
    pub fn new(joint: u8, link: u8) -> Self {
        Self {
            joint,
            link,
            lever: [T::zero(); 2],
            anchor: Anchor::default(),
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> GravityLever<U> {
        GravityLever {
            joint: self.joint,
            link: self.link,
            lever: self.lever.map(|x| U::of(x.widen())),
            anchor: self.anchor.cast(),
        }
    }
}

impl<T: Scalar> EffectModel<T> for GravityLever<T> {
    fn kind(&self) -> &'static str {
        "joint-compliance"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            from: Some(usize::from(self.link)),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("lever x", "rad s^2/m"), ("lever y", "rad s^2/m")]
    }

    fn values(&self) -> &[T] {
        &self.lever
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.lever
    }

    fn attach(&mut self, to: &Description<'_>) {
        self.anchor = Anchor::of(to, usize::from(self.link));
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.anchor.numbers_mut()
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        self.turned(at, unit(k))
    }

    fn displacement(&self, at: &Posture<'_, T>) -> Displacement<T> {
        self.turned(at, self.lever)
    }
}

impl<T: Scalar> GravityLever<T> {
    /// The displacement with this lever.
    #[inline(never)]
    fn turned(&self, at: &Posture<'_, T>, [x, y]: [T; 2]) -> Displacement<T> {
        let mut d = about_joint(at, usize::from(self.joint));
        let Some(frame) = at.frames.get(usize::from(self.link)) else {
            return Displacement::zero();
        };
        let axes = self.anchor.axes(frame);
        let lever = along(&times(&axes[0], x), &axes[1], y);
        d.twist = d
            .twist
            .scaled(dot(&d.twist.angular, &cross(&lever, at.gravity)));
        d
    }
}
