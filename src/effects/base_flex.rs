//! A base that tilts under the arm's weight.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Description, Displacement, EffectModel, Posture, Stage, one_way, unit};
use crate::Scalar;
use crate::pose::{columns, rotated};
use crate::vector::{add_cross, along, dot, less};

/// Base flex: tilts the robot base about its own x and y axes, each by `compliance` times
/// gravity's moment about that axis, about the described base's origin.
///
/// Needs link masses or a payload; with neither it is zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseFlex<T: Scalar> {
    /// About x and about y, rad/(N m).
    pub compliance: [T; 2],
    /// x, y and origin (m) of the described base in the baked one, see
    /// [`EffectModel::attach`].
    #[serde(skip, default = "no_base")]
    pub base: [[T; 3]; 3],
}

/// Before it is attached: no axes to tilt about.
fn no_base<T: Scalar>() -> [[T; 3]; 3] {
    [[T::zero(); 3]; 3]
}

impl<T: Scalar> Default for BaseFlex<T> {
    /// A stiff base.
    fn default() -> Self {
        Self {
            compliance: [T::zero(); 2],
            base: no_base(),
        }
    }
}

impl<T: Scalar> BaseFlex<T> {
    pub(super) fn cast<U: Scalar>(&self) -> BaseFlex<U> {
        BaseFlex {
            compliance: self.compliance.map(|x| U::of(x.widen())),
            base: self.base.map(|v| v.map(|x| U::of(x.widen()))),
        }
    }
}

impl<T: Scalar> EffectModel<T> for BaseFlex<T> {
    fn kind(&self) -> &'static str {
        "base-flex"
    }

    fn joint(&self) -> Option<usize> {
        None
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("x", "rad/(N m)"), ("y", "rad/(N m)")]
    }

    fn values(&self) -> &[T] {
        &self.compliance
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.compliance
    }

    fn attach(&mut self, to: &Description<'_>) {
        let [x, y, _] = columns(&to.base.rotation);
        self.base = [x, y, to.base.translation].map(|v| v.map(T::of).into());
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.base.as_flattened_mut()
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    fn loaded(&self) -> bool {
        true
    }

    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        self.tilted(at, unit(k))
    }

    fn displacement(&self, at: &Posture<'_, T>) -> Displacement<T> {
        self.tilted(at, self.compliance)
    }
}

impl<T: Scalar> BaseFlex<T> {
    /// The displacement with these compliances.
    #[inline(never)]
    fn tilted(&self, at: &Posture<'_, T>, compliance: [T; 2]) -> Displacement<T> {
        let (Some(frame), Some(moment), Some(force)) =
            (at.frames.first(), at.moments.first(), at.forces.first())
        else {
            return Displacement::zero();
        };
        let [x, y, origin] = self.base.map(Vector3::from);
        let origin = at.base.point(&origin);
        let moment = add_cross(moment, &less(&frame.origin, &origin), force);
        let mut turn = Vector3::zeros();
        for (axis, c) in [x, y].into_iter().zip(compliance) {
            let axis = rotated(&at.base.rotation, &axis);
            turn = along(&turn, &axis, dot(&moment, &axis) * c);
        }
        one_way(true, &turn, &origin)
    }
}
