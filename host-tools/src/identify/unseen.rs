//! What a kind of measurement cannot show, and why, in words.
//!
//! MRD 4.7.5 says of base and tool which of their parameters positions and poses leave
//! unobservable; the same holds, with other parameters, of distances, touches and bearings.
//! Rank decides ([`super::solve::distinguishable`]); this module gives the reasons, and keeps
//! out what no set of poses could show, where the rank would hang on rounding.

use truepose::{JointKind, Parameter};

use super::arm::ArmModel;
use super::held::Held;
use super::observation::Observation;
use super::structure::Structure;
use super::unknown::Unknown;

/// What the rows to fit measure, as far as observability goes.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    /// Some row says where the arm stands.
    pub(crate) placed: bool,
    /// Some row says how large anything is.
    scale: bool,
    /// The tool's turn is measured.
    turned: bool,
    /// Fixed things are seen from the tool.
    view: bool,
    /// One a joint: it moves.
    moves: Vec<bool>,
    /// The tool point lies on the last axis, which is revolute.
    on_axis: bool,
}

/// A tool point nearer to the last axis is on it, m.
const ON_AXIS: f64 = 1e-4;

impl Shown {
    /// By the rows to fit. `arm`: aligned.
    pub(crate) fn by(arm: &ArmModel, observations: &[Observation]) -> Self {
        let moves = (0..arm.joint_count())
            .map(|j| {
                let of = |o: &Observation| o.q.get(j).copied().unwrap_or(0.0);
                let first = observations.first().map_or(0.0, of);
                observations.iter().any(|o| (of(o) - first).abs() > 1e-6)
            })
            .collect();
        let revolute = arm.joints.last().map(|j| j.kind) == Some(JointKind::Revolute);
        Self {
            placed: observations.iter().any(Observation::is_placed),
            scale: observations.iter().any(Observation::has_scale),
            turned: observations
                .iter()
                .any(|o| o.rotation.is_some() || o.is_view()),
            view: observations.iter().any(Observation::is_view),
            moves,
            on_axis: revolute && arm.tool_off_axis() < ON_AXIS,
        }
    }

    /// Unknowns that no set of such measurements shows, with the reason.
    pub(crate) fn never(
        &self,
        arm: &ArmModel,
        structure: &Structure,
        held: &Held,
    ) -> Vec<(Unknown, String)> {
        let mut never = Vec::new();
        if !self.placed {
            never.extend((0..6).map(|axis| {
                let why = match self.view {
                    true => {
                        "points seen from the tool say nothing of where the arm stands: the base \
                         is as drawn, and what it sees is placed from there"
                    }
                    false => {
                        "lengths, distances and touches say nothing of where the arm stands: \
                         the base is as drawn, and what it touches is placed from there"
                    }
                };
                (Unknown::Base { session: 0, axis }, why.to_owned())
            }));
        }
        if !self.scale && !held.gives_size(arm) {
            let length = |u: &&Unknown| matches!(u, Unknown::Joint(..)) && u.unit(arm) == "m";
            let longest = structure
                .unknowns
                .iter()
                .filter(length)
                .max_by(|a, b| a.value(arm).abs().total_cmp(&b.value(arm).abs()));
            if let Some(&unknown) = longest {
                let more = match self.view {
                    true => "see a board's pose or a point's position once",
                    false => "measure one distance",
                };
                let why = format!(
                    "touches and bearings show the arm's proportions and not its size: its \
                     longest length is taken from the drawing; {more} to find it"
                );
                never.push((unknown, why));
            }
        }
        never
    }

    /// Why an unknown does not show, or only with others; `None` where nothing general says.
    pub(crate) fn because(&self, unknown: &Unknown) -> Option<String> {
        let still = |j: usize| self.moves.get(j).is_some_and(|moves| !moves);
        match *unknown {
            Unknown::Tool { axis } if axis >= 3 && !self.turned => Some(
                "no orientation is measured, and the tool point stays where it is when the \
                 tool turns about it (MRD 4.7.3)"
                    .to_owned(),
            ),
            Unknown::Joint(j, Parameter::Theta | Parameter::D) if still(j) => {
                Some(format!("joint {} does not move here", j + 1))
            }
            Unknown::Joint(j, _) if still(j) => Some(format!(
                "joint {} does not move here, so its link and the next are one piece",
                j + 1
            )),
            Unknown::Joint(j, _) if still(j + 1) => Some(format!(
                "joint {} does not move here, so its link and the one before are one piece",
                j + 2
            )),
            Unknown::Tool { .. } | Unknown::Joint(..) if self.on_axis && !self.turned => {
                let last = self.moves.len();
                let near = match *unknown {
                    Unknown::Joint(j, _) => j + 2 >= last,
                    _ => true,
                };
                near.then(|| {
                    "the tool point lies on the last axis, and no orientation is measured \
                     (MRD 4.7.3)"
                        .to_owned()
                })
            }
            _ => None,
        }
    }
}
