//! A link that bends like a beam.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Description, Displacement, EffectModel, Posture, Selector, Stage, unit};
use crate::pose::{added, columns, crossed, dotted, rotated, seen};
use crate::vector::{add_cross, along, cross, dot, less, plus, times};
use crate::{Scalar, Twist};

/// Link bending under gravity's force F and moment M of what lies beyond the link. MRD 7.7.
///
/// ```text
/// at its end:  tilt = c (M_end · a) a                        about the end
/// as a beam:   tilt = L c (M_middle · a) a                   about the middle, and there
///              deflection = L^3 c / 12 (F · b) b
/// ```
/// once for each of two bending axes a, with b across it and across the link. At its end bends
/// a link that is soft where the next joint is mounted; the beam is Euler and Bernoulli's,
/// uniform, with c = 1 / EI, exact for loads at its end. The first axis is the joint's own as
/// far as it is across the link, or else the next joint's. The link's own weight does not
/// count.
///
/// Needs link masses or a payload; with neither it is zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkBending<T: Scalar> {
    /// Joint before the link, from 0.
    pub joint: u8,
    /// Where it bends.
    pub bends: Bends,
    /// c about either axis: rad/(N m), of a beam 1/(N m^2).
    pub flexibility: [T; 2],
    /// Where the link is, see [`EffectModel::attach`].
    #[serde(skip, default = "Link::none")]
    pub link: Link<T>,
}

/// Where a link bends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bends {
    /// At its far end.
    AtEnd,
    /// All along.
    Beam,
}

impl Bends {
    /// Their names, in the order of the variants.
    pub const NAMES: [&str; 2] = ["end", "beam"];
}

/// A link in its baked joint frame: its end, m; the unit vector from joint to end, and across it the
/// two bending axes; from joint to end, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T: Scalar>([T; 13]);

impl<T: Scalar> Link<T> {
    /// No link: nothing bends.
    fn none() -> Self {
        Self([T::zero(); 13])
    }

    fn cast<U: Scalar>(&self) -> Link<U> {
        Link(self.0.map(|x| U::of(x.widen())))
    }

    /// The four vectors, and the length.
    #[inline]
    fn parts(&self) -> ([Vector3<T>; 4], T) {
        let [ex, ey, ez, x, y, z, fx, fy, fz, sx, sy, sz, length] = self.0;
        let vectors = [[ex, ey, ez], [x, y, z], [fx, fy, fz], [sx, sy, sz]];
        (vectors.map(Vector3::from), length)
    }
}

impl<T: Scalar> LinkBending<T> {
    /// A stiff link beyond `joint` (from 0); no link before it is attached to one.
    pub fn new(joint: u8, bends: Bends) -> Self {
        Self {
            joint,
            bends,
            flexibility: [T::zero(); 2],
            link: Link::none(),
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> LinkBending<U> {
        LinkBending {
            joint: self.joint,
            bends: self.bends,
            flexibility: self.flexibility.map(|x| U::of(x.widen())),
            link: self.link.cast(),
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

    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            component: Some(u8::from(self.bends == Bends::Beam)),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        match self.bends {
            Bends::AtEnd => &[("first", "rad/(N m)"), ("second", "rad/(N m)")],
            Bends::Beam => &[("first", "1/(N m^2)"), ("second", "1/(N m^2)")],
        }
    }

    fn values(&self) -> &[T] {
        &self.flexibility
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.flexibility
    }

    fn attach(&mut self, to: &Description<'_>) {
        let j = usize::from(self.joint);
        let (Some(link), Some(gauge)) = (to.link(j), to.gauges.get(j)) else {
            return;
        };
        let [x, _, next] = columns(&link.rotation);
        let end = link.translation;
        let length = dotted(&end, &end).root();
        // Where the joint frames fall together the link points along x, by convention.
        let ahead = if length > SHORT {
            added(&Vector3::zeros(), &end, 1.0 / length)
        } else {
            x
        };
        let first = across(&ahead, &[Vector3::z(), next, Vector3::x(), Vector3::y()]);
        let second = crossed(&ahead, &first);
        let end = seen(gauge, &end);
        let [a, f, s] = [ahead, first, second].map(|v| rotated(&gauge.rotation, &v));
        self.link = Link([
            end.x, end.y, end.z, a.x, a.y, a.z, f.x, f.y, f.z, s.x, s.y, s.z, length,
        ])
        .cast();
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        &mut self.link.0
    }

    fn stage(&self) -> Stage {
        Stage::Posture
    }

    fn loaded(&self) -> bool {
        true
    }

    fn posture_partial(&self, k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        self.bent(at, unit(k))
    }

    fn displacement(&self, at: &Posture<'_, T>) -> Displacement<T> {
        self.bent(at, self.flexibility)
    }
}

impl<T: Scalar> LinkBending<T> {
    /// The displacement with these flexibilities.
    #[inline(never)]
    fn bent(&self, at: &Posture<'_, T>, flexibility: [T; 2]) -> Displacement<T> {
        let j = usize::from(self.joint);
        let Some(frame) = at.frames.get(j) else {
            return Displacement::zero();
        };
        let of_link = |v| rotated(&frame.rotation, v);
        let (vectors, length) = self.link.parts();
        let [end, ahead, first, second] = vectors.each_ref().map(of_link);
        let mut origin = plus(&frame.origin, &end);
        let (mut moment, force) = beyond(at, j, &origin);
        let [f, s] = flexibility;
        let (mut linear, mut scale) = (Vector3::zeros(), T::one());
        if self.bends == Bends::Beam {
            scale = length;
            let half = times(&ahead, scale * T::of(0.5));
            moment = add_cross(&moment, &half, &force);
            let cubed = scale * scale * scale * T::of(1.0 / 12.0);
            let [f, s] = [f * cubed, s * cubed];
            linear = both(
                &second,
                f * dot(&force, &second),
                &first,
                s * dot(&force, &first),
            );
            origin = less(&origin, &half);
        }
        let [f, s] = [f * scale, s * scale];
        let angular = both(
            &first,
            f * dot(&moment, &first),
            &second,
            s * dot(&moment, &second),
        );
        Displacement {
            twist: Twist::new(linear, angular),
            origin,
        }
    }
}

/// `a x + b y`.
#[inline(always)]
fn both<T: Scalar>(a: &Vector3<T>, x: T, b: &Vector3<T>, y: T) -> Vector3<T> {
    along(&times(a, x), b, y)
}

/// Below this length, m, a link has no direction of its own.
const SHORT: f64 = 0.01;

/// Gravity's moment about `point` and force of what lies beyond link `j`.
#[inline]
fn beyond<T: Scalar>(
    at: &Posture<'_, T>,
    j: usize,
    point: &Vector3<T>,
) -> (Vector3<T>, Vector3<T>) {
    let next = j + 1;
    match (
        at.frames.get(next),
        at.moments.get(next),
        at.forces.get(next),
    ) {
        (Some(frame), Some(moment), Some(force)) => (
            add_cross(moment, &less(&frame.origin, point), force),
            *force,
        ),
        _ => {
            let force = times(at.gravity, at.ambient.payload);
            let payload = seen(at.tool, &at.ambient.payload_com);
            (cross(&less(&payload, point), &force), force)
        }
    }
}

/// Unit vector across `ahead`: of the first candidate that is at least 30 degrees away from
/// it, as far as it is across.
fn across(ahead: &Vector3<f64>, candidates: &[Vector3<f64>]) -> Vector3<f64> {
    for candidate in candidates {
        let rest = added(candidate, ahead, -dotted(ahead, candidate));
        let square = dotted(&rest, &rest);
        if square > 0.25 {
            return added(&Vector3::zeros(), &rest, 1.0 / square.root());
        }
    }
    Vector3::zeros()
}
