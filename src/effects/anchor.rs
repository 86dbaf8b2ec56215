//! Directions and points that are fixed in a link, in spite of the baked frames' freedom.
//!
//! Baked frames may be turned about and slid along their axes by every new bake. What an
//! effect fixes in a link is therefore given in the *described* frames and kept as constants
//! in the baked ones, set anew by [`super::EffectModel::attach`] after each bake. A blob has them
//! behind the effect, with what else is baked ([`super::EffectModel::fixed_mut`]).

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Displacement, Posture};
use crate::chain::{Frame, Gauge};
use crate::jacobian::carried;
use crate::pose::{added, columns, rotated};
use crate::vector::{along, times};
use crate::{Convention, Joint, Pose, Scalar, Twist};

/// The described arm beside its baked form, for effects to attach themselves to. In double
/// precision whatever the effects are in: they round once.
#[derive(Clone, Copy, Debug)]
pub struct Description<'d> {
    /// Described robot base, seen from the baked base.
    pub base: &'d Pose<f64>,
    /// Joints as described.
    pub joints: &'d [Joint<f64>],
    /// From [`crate::bake`]: described joint frames after the motion, seen from the baked ones.
    pub gauges: &'d [Gauge<f64>],
    /// Tool as described: last link's distal frame to tool.
    pub tool: &'d Pose<f64>,
}

impl Description<'_> {
    /// The link beyond joint `j`: the next joint's described frame before its motion, seen
    /// from joint `j`'s described frame after the motion. Beyond the last joint: the link's
    /// distal frame, or the tool where zero reference knows no such frame.
    pub fn link(&self, j: usize) -> Option<Pose<f64>> {
        let joint = self.joints.get(j)?;
        let after = joint.after();
        Some(match self.joints.get(j + 1) {
            Some(next) => after.then(&next.before()),
            None if joint.convention == Convention::ZeroReference => after.then(self.tool),
            None => after,
        })
    }
}

/// A described joint frame after the motion, seen from the baked one: cosine and sine of its
/// turn about z, and its origin, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor<T: Scalar>([T; 5]);

impl<T: Scalar> Default for Anchor<T> {
    /// On the baked frame.
    fn default() -> Self {
        let o = T::zero();
        Self([T::one(), o, o, o, o])
    }
}

impl<T: Scalar> Anchor<T> {
    /// On the described frame of joint `j`; left on the baked frame if there is no such joint.
    pub(super) fn of(to: &Description<'_>, j: usize) -> Self {
        to.gauges.get(j).map_or_else(Self::default, |gauge| {
            let (r, p) = (&gauge.rotation, &gauge.translation);
            Self([r[(0, 0)], r[(1, 0)], p.x, p.y, p.z].map(T::of))
        })
    }

    pub(super) fn cast<U: Scalar>(&self) -> Anchor<U> {
        Anchor(self.0.map(|x| U::of(x.widen())))
    }

    pub(super) fn numbers_mut(&mut self) -> &mut [T] {
        &mut self.0
    }

    /// Origin of the described frame, given the baked one.
    #[inline(never)]
    pub(super) fn origin(&self, frame: &Frame<T>) -> Vector3<T> {
        let [_, _, x, y, z] = self.0;
        added(
            &frame.origin,
            &rotated(&frame.rotation, &Vector3::new(x, y, z)),
            T::one(),
        )
    }

    /// x and y axes of the described frame, given the baked one.
    #[inline(never)]
    pub(super) fn axes(&self, frame: &Frame<T>) -> [Vector3<T>; 2] {
        let [c, s, ..] = self.0;
        let [x, y, _] = columns(&frame.rotation);
        [along(&times(&x, c), &y, s), along(&times(&y, c), &x, -s)]
    }
}

/// What a drift moves: a joint's zero, or the base along or about one of its axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Place<T: Scalar> {
    /// The reading of a joint, counted from 0.
    Joint(u8),
    /// The robot base.
    Base {
        /// 0 to 2: along x, y, z of the described base; 3 to 5: about them.
        axis: u8,
        /// That unit displacement in the axes and at the origin of the baked base, as
        /// [`Twist::rows`]; see [`super::EffectModel::attach`].
        #[serde(skip, default = "nowhere")]
        unit: [T; 6],
    },
}

/// Before it is attached.
fn nowhere<T: Scalar>() -> [T; 6] {
    [T::zero(); 6]
}

/// Names of the six displacements of a frame.
pub const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Unit displacement number `axis` of a frame: along x, y, z, then about them.
pub(super) fn unit_twist<T: Scalar>(axis: u8) -> Twist<T> {
    let mut twist = Twist::zero();
    let half = if axis < 3 {
        &mut twist.linear
    } else {
        &mut twist.angular
    };
    if let Some(entry) = half.get_mut(usize::from(axis % 3)) {
        *entry = T::one();
    }
    twist
}

impl<T: Scalar> Place<T> {
    /// The base along (0 to 2) or about (3 to 5) one of its axes.
    pub fn base(axis: u8) -> Self {
        Self::Base {
            axis,
            unit: unit_twist(axis).rows(),
        }
    }

    pub(super) fn joint(&self) -> Option<usize> {
        match self {
            Self::Joint(j) => Some(usize::from(*j)),
            Self::Base { .. } => None,
        }
    }

    pub(super) fn axis(&self) -> Option<u8> {
        match self {
            Self::Joint(_) => None,
            Self::Base { axis, .. } => Some(*axis),
        }
    }

    pub(super) fn stage(&self) -> super::Stage {
        match self {
            Self::Joint(_) => super::Stage::Reading,
            Self::Base { .. } => super::Stage::Posture,
        }
    }

    /// The base's displacement times `factor`.
    #[inline(never)]
    pub(super) fn displaced(&self, at: &Posture<'_, T>, factor: T) -> Displacement<T> {
        let twist = match self {
            Self::Joint(_) => Twist::zero(),
            Self::Base { unit, .. } => {
                let r = &at.base.rotation;
                let unit = Twist::from_rows(*unit);
                Twist::new(rotated(r, &unit.linear), rotated(r, &unit.angular)).scaled(factor)
            }
        };
        Displacement {
            twist,
            origin: at.base.translation,
        }
    }

    pub(super) fn attach(&mut self, to: &Description<'_>) {
        if let Self::Base { axis, unit } = self {
            *unit = carried(to.base, &unit_twist(*axis)).rows().map(T::of);
        }
    }

    pub(super) fn fixed_mut(&mut self) -> &mut [T] {
        match self {
            Self::Joint(_) => &mut [],
            Self::Base { unit, .. } => unit,
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> Place<U> {
        match self {
            Self::Joint(j) => Place::Joint(*j),
            Self::Base { axis, unit } => Place::Base {
                axis: *axis,
                unit: unit.map(|x| U::of(x.widen())),
            },
        }
    }
}
