//! One physical robot in another convention.
//!
//! Every convention says the same three things of an arm: where its axes are when all joints
//! read zero, where its tool is then, and what each link weighs ([`ZeroPosition`]). From there
//! any convention is built again, link by link ([`link`]). Readings mean the same before and
//! after, so poses agree to rounding at every reading. MRD 6.3.4.

mod chain;
pub mod link;
mod zero_position;

use std::fmt;

use truepose::params::Blob;
use truepose::{Convention, Pose};

use crate::description::{Robot, RobotJoint};
pub use chain::convert;
pub(crate) use chain::{placed, shortest_turn};
pub use zero_position::{Axis, ZeroPosition};

/// A convention for a whole arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Standard DH throughout.
    Dh,
    /// Standard DH, and Hayati's form from each axis to one that is nearly parallel to it
    /// (what MRD 6.1 calls modified DH).
    Hayati,
    /// Craig's form throughout.
    Mdh,
    /// Zero reference throughout.
    ZeroReference,
}

impl Form {
    /// Every form.
    pub const ALL: [Self; 4] = [Self::Dh, Self::Hayati, Self::Mdh, Self::ZeroReference];

    /// As the robot description calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dh => convention_name(Convention::Dh),
            Self::Hayati => convention_name(Convention::Hayati),
            Self::Mdh => convention_name(Convention::Mdh),
            Self::ZeroReference => convention_name(Convention::ZeroReference),
        }
    }
}

/// A convention as the robot description calls it.
pub fn convention_name(convention: Convention) -> &'static str {
    match convention {
        Convention::Dh => "dh",
        Convention::Hayati => "hayati",
        Convention::Mdh => "mdh",
        Convention::ZeroReference => "zero-reference",
    }
}

/// A robot in the form that was asked for.
#[derive(Clone, Debug)]
pub struct Converted {
    /// The same robot; base, tool and gravity follow the new base frame.
    pub robot: Robot,
    /// Neighbours that got Hayati's form.
    pub nearly_parallel: Vec<NearlyParallel>,
}

/// Two neighbouring axes that are nearly parallel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearlyParallel {
    /// Joint of the first of them, from 0.
    pub first: usize,
    /// rad, in [0, pi/2].
    pub angle: f64,
}

/// Why a form cannot express a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refused {
    /// The form.
    pub form: Form,
    /// Joint of the first of the two axes, from 0.
    pub first: usize,
    /// Angle between them, rad.
    pub angle: f64,
    /// Where their common normal leaves the first axis, m along it.
    pub distance: f64,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "axes {} and {} are {:.6} deg from parallel, so their common normal is {:.0} m away \
             and {} cannot express them; use hayati or zero-reference",
            self.first + 1,
            self.first + 2,
            self.angle.to_degrees(),
            self.distance.abs(),
            self.form.name()
        )
    }
}

impl std::error::Error for Refused {}

/// The arm that `blob` says was identified, with what only its description knows. `None` where
/// the two are not the same robot by number and kinds of joints.
pub fn calibrated(robot: &Robot, blob: &Blob<'_>) -> Option<Robot> {
    let found = &blob.calibrated;
    let kinds = found.joints.iter().map(|j| j.kind);
    if !kinds.eq(robot.joints.iter().map(|j| j.joint.kind)) {
        return None;
    }
    let masses = found.masses.iter().copied();
    Some(Robot {
        base: Pose::from(&found.base),
        joints: (robot.joints.iter().zip(&found.joints).zip(masses))
            .map(|((drawn, joint), mass)| RobotJoint {
                joint: *joint,
                link: drawn.link.map(|_| mass),
                ..drawn.clone()
            })
            .collect(),
        tool: Pose::from(&found.tool),
        gravity: blob.gravity.into(),
        ..robot.clone()
    })
}
