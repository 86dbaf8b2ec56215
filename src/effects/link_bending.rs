//! A link that bends like a beam.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Description, Displacement, EffectModel, Posture, Stage};
use crate::{Scalar, Twist};

/// Link bending: a uniform beam between the described joint frames, held at the joint, under
/// gravity's force F and moment M of all that lies beyond the joint. Euler and Bernoulli's
/// beam, exact for loads at its ends, seen from its middle:
///
/// ```text
/// tilt = L / EI (M_middle · a) a,    deflection = L^3 / (12 EI) (F · b) b
/// ```
/// once for each of two bending axes a, with b across it and across the beam. The first axis is
/// the joint's own as far as it is across the beam, or else the next joint's. MRD 7.7.
///
/// Needs link masses or a payload; with neither it is zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkBending<T: Scalar> {
    /// Joint before the link, from 0.
    pub joint: u8,
    /// 1/EI about either axis, 1/(N m^2).
    pub flexibility: [T; 2],
    /// Length of the beam, m.
    pub length: T,
    /// In the baked joint frame: middle of the beam (m) and the two axes.
    pub beam: [Vector3<T>; 3],
}

impl<T: Scalar> LinkBending<T> {
    /// A stiff link beyond `joint` (from 0); no beam before it is attached to one.
    pub fn new(joint: u8) -> Self {
        Self {
            joint,
            flexibility: [T::zero(); 2],
            length: T::zero(),
            beam: [Vector3::zeros(), Vector3::x(), Vector3::y()],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> LinkBending<U> {
        LinkBending {
            joint: self.joint,
            flexibility: self.flexibility.map(|x| U::of(x.widen())),
            length: U::of(self.length.widen()),
            beam: self.beam.map(|v| v.map(|x| U::of(x.widen()))),
        }
    }
}

impl<T: Scalar> EffectModel<T> for LinkBending<T> {
    fn kind(&self) -> &'static str {
        "link-bending"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("first", "1/(N m^2)"), ("second", "1/(N m^2)")]
    }

    fn values(&self) -> &[T] {
        &self.flexibility
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.flexibility
    }

    fn attach(&mut self, to: &Description<'_, T>) {
        let j = usize::from(self.joint);
        let (Some(link), Some(gauge)) = (to.link(j), to.gauges.get(j)) else {
            return;
        };
        let tip = link.translation;
        self.length = tip.norm_squared().root();
        if self.length <= T::EPSILON {
            // No beam: nothing to bend.
            self.length = T::zero();
            return;
        }
        let along = tip / self.length;
        let next = link.rotation.column(2).into_owned();
        let first = across(&along, &[Vector3::z(), next, Vector3::x(), Vector3::y()]);
        let second = along.cross(&first);
        self.beam = [
            gauge.point(&(tip * T::of(0.5))),
            gauge.rotation * first,
            gauge.rotation * second,
        ];
    }

    fn anchors_are_finite(&self) -> bool {
        self.length.finite() && self.beam.iter().all(|v| v.iter().all(|x| x.finite()))
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    #[inline]
    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let j = usize::from(self.joint);
        let (Some(frame), Some(moment), Some(force)) =
            (at.frames.get(j), at.moments.get(j), at.forces.get(j))
        else {
            return Displacement::zero();
        };
        let [middle, first, second] = &self.beam;
        let (a, b) = if k == 0 {
            (first, second)
        } else {
            (second, first)
        };
        let (a, b) = (frame.rotation * a, frame.rotation * b);
        let lever = frame.rotation * middle;
        let moment = moment - lever.cross(force);
        let l = self.length;
        Displacement {
            twist: Twist::new(
                b * (l * l * l * T::of(1.0 / 12.0) * force.dot(&b)),
                a * (l * moment.dot(&a)),
            ),
            origin: frame.origin + lever,
        }
    }
}

/// Unit vector across `along`: of the first candidate that is at least 30 degrees away from
/// it, as far as it is across.
fn across<T: Scalar>(along: &Vector3<T>, candidates: &[Vector3<T>]) -> Vector3<T> {
    for candidate in candidates {
        let rest = candidate - along * along.dot(candidate);
        let square = rest.norm_squared();
        if square > T::of(0.25) {
            return rest / square.root();
        }
    }
    Vector3::zeros()
}
