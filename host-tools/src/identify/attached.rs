//! Columns of all unknowns whose twists are constant in some frame, at once.
//!
//! The lever from the frame to the tool point, seen in the frame, serves all that are attached
//! to it: one cross product and one rotation a column.

use nalgebra::{Matrix3, Vector3};
use truepose::jacobian::{AttachedTwist, Attachment};
use truepose::{Frame, Pose, Twist};

/// A frame that twists are attached to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    BakedBase,
    /// World axes at the origin of the described base.
    DescribedBase,
    Joint(usize),
}

/// A twist of an unknown in a frame, times the unknown's scale.
struct Part {
    column: usize,
    linear: Vector3<f64>,
    /// `None` where all of it is zero.
    angular: Option<Vector3<f64>>,
}

/// What is known of the unknowns before any observation, frame by frame.
#[derive(Default)]
pub(super) struct Attached {
    parts: Vec<(Place, Vec<Part>)>,
    /// Of unknowns that have a twist in two frames.
    second: Vec<(Place, Vec<Part>)>,
}

/// Where an arm is at one observation.
pub(super) struct At<'a> {
    pub(super) baked_base: &'a Pose<f64>,
    pub(super) base: &'a Vector3<f64>,
    pub(super) frames: &'a [Frame<f64>],
    pub(super) tool: &'a Vector3<f64>,
}

fn add(
    parts: &mut Vec<(Place, Vec<Part>)>,
    place: Place,
    column: usize,
    twist: &Twist<f64>,
    scale: f64,
) {
    let turns = twist.angular != Vector3::zeros();
    let part = Part {
        column,
        linear: twist.linear * scale,
        angular: turns.then_some(twist.angular * scale),
    };
    match parts.iter_mut().find(|(at, _)| *at == place) {
        Some((_, there)) => there.push(part),
        None => parts.push((place, vec![part])),
    }
}

impl Attached {
    /// Takes the twists of unknown `column` in, one or two.
    pub(super) fn push(
        &mut self,
        column: usize,
        twists: &[Option<AttachedTwist<f64>>; 2],
        scale: f64,
    ) {
        let lists = [&mut self.parts, &mut self.second];
        for (twist, list) in twists.iter().flatten().zip(lists) {
            let place = match twist.at {
                Attachment::Base => Place::BakedBase,
                Attachment::Joint(j) => Place::Joint(j),
            };
            add(list, place, column, &twist.twist, scale);
        }
    }

    /// The same for a twist in world axes at the origin of the described base.
    pub(super) fn push_base(&mut self, column: usize, twist: &Twist<f64>, scale: f64) {
        add(&mut self.parts, Place::DescribedBase, column, twist, scale);
    }

    /// Displacement of the tool per scaled unit of every unknown taken in, world axes at the
    /// tool point; their turns only where `turns`, zero otherwise.
    #[inline]
    pub(super) fn twists(&self, at: &At<'_>, turns: bool, each: impl FnMut(usize, &Twist<f64>)) {
        carried(&self.parts, at, turns, each);
    }

    /// What is to be added to that, of unknowns that have a twist in two frames.
    pub(super) fn second_twists(
        &self,
        at: &At<'_>,
        turns: bool,
        each: impl FnMut(usize, &Twist<f64>),
    ) {
        carried(&self.second, at, turns, each);
    }
}

#[inline]
fn carried(
    parts: &[(Place, Vec<Part>)],
    at: &At<'_>,
    turns: bool,
    mut each: impl FnMut(usize, &Twist<f64>),
) {
    let upright = Matrix3::identity();
    for (place, parts) in parts {
        let (rotation, origin) = match *place {
            Place::BakedBase => (&at.baked_base.rotation, &at.baked_base.translation),
            Place::DescribedBase => (&upright, at.base),
            Place::Joint(j) => match at.frames.get(j) {
                Some(frame) => (&frame.rotation, &frame.origin),
                None => continue,
            },
        };
        let lever = rotation.tr_mul(&(at.tool - origin));
        for part in parts {
            let twist = match &part.angular {
                None => Twist::new(rotation * part.linear, Vector3::zeros()),
                Some(angular) => {
                    let linear = rotation * (part.linear + angular.cross(&lever));
                    let angular = match turns {
                        true => rotation * angular,
                        false => Vector3::zeros(),
                    };
                    Twist::new(linear, angular)
                }
            };
            each(part.column, &twist);
        }
    }
}
