//! A link that grows with the temperature.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    Ambient, Description, Displacement, EffectModel, Posture, Selector, Stage, entry, one_way,
};
use crate::pose::rotated;
use crate::vector::times;
use crate::{JointKind, Scalar};

/// Thermal growth: lengthens the link beyond the joint by `growth` of its length per K, along
/// the line between the described joint frames; or, of a slide, what it has travelled,
/// MRD 7.1.
///
/// Zero where the temperature is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThermalGrowth<T: Scalar> {
    /// Joint before the link, from 0.
    pub joint: u8,
    /// What grows.
    pub grows: Grows,
    /// Temperature sensor, from 0.
    pub sensor: u8,
    /// degC.
    pub reference: T,
    /// 1/K.
    pub growth: [T; 1],
    /// The link in the baked joint frame, m, see [`EffectModel::attach`].
    #[serde(skip, default = "Vector3::zeros")]
    pub link: Vector3<T>,
}

/// What grows with the temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Grows {
    /// The link beyond the joint.
    Link,
    /// The way of a slide, counted from its zero.
    Travel,
}

impl Grows {
    /// Their names, in the order of the variants.
    pub const NAMES: [&str; 2] = ["link", "travel"];
}

impl<T: Scalar> ThermalGrowth<T> {
    /// No growth yet, counted from 20 degC; no link before it is attached to one.
    pub fn new(joint: u8, grows: Grows, sensor: u8) -> Self {
        Self {
            joint,
            grows,
            sensor,
            reference: T::of(20.0),
            growth: [T::zero()],
            link: Vector3::zeros(),
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> ThermalGrowth<U> {
        ThermalGrowth {
            joint: self.joint,
            grows: self.grows,
            sensor: self.sensor,
            reference: U::of(self.reference.widen()),
            growth: self.growth.map(|x| U::of(x.widen())),
            link: self.link.map(|x| U::of(x.widen())),
        }
    }
}

impl<T: Scalar> ThermalGrowth<T> {
    /// Growth by the present warming, m per m.
    #[inline]
    pub(crate) fn longer(&self, ambient: &Ambient<T>) -> T {
        ambient.warming(self.sensor, self.reference) * self.growth[0]
    }
}

impl<T: Scalar> EffectModel<T> for ThermalGrowth<T> {
    fn kind(&self) -> &'static str {
        "thermal-growth"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            component: Some(u8::from(self.grows == Grows::Travel)),
            sensor: Some(self.sensor),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("growth", "1/K")]
    }

    fn values(&self) -> &[T] {
        &self.growth
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.growth
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
        let j = usize::from(self.joint);
        if let (Some(link), Some(gauge)) = (to.link(j), to.gauges.get(j)) {
            self.link = rotated(&gauge.rotation, &link.translation).map(T::of);
        }
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.link.as_mut_slice()
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    #[inline(never)]
    fn posture_partial(&self, _k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let j = usize::from(self.joint);
        let (Some(joint), Some(frame)) = (at.joints.get(j), at.frames.get(j)) else {
            return Displacement::zero();
        };
        let link = match (self.grows, joint.kind) {
            (Grows::Link, _) => self.link,
            (Grows::Travel, JointKind::Prismatic) => {
                Vector3::new(T::zero(), T::zero(), entry(at.q, j))
            }
            (Grows::Travel, JointKind::Revolute) => return Displacement::zero(),
        };
        let warming = at.ambient.warming(self.sensor, self.reference);
        let link = times(&rotated(&frame.rotation, &link), warming);
        one_way(false, &link, &frame.origin)
    }
}
