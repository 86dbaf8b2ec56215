//! A robot description from axes.

use std::path::Path;

use nalgebra::Vector3;
use truepose::{Convention, Joint, JointKind, Pose};

use super::{Analysis, Method};
use crate::convert::link::Link;
use crate::convert::{Axis, placed};
use crate::description::{GRAVITY, Robot, RobotJoint};
use crate::identify::structure::NEARLY_PARALLEL;

/// How two neighbouring axes stand to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Neighbours {
    /// A common normal within reach.
    Apart,
    /// Nearly parallel, the second has a place: Hayati's form.
    Parallel,
    /// Nearly parallel, the second is a slide and starts where the first ends.
    ParallelSlide,
}

impl Neighbours {
    pub(super) fn of(axis: &Axis, next: &Axis) -> Self {
        let sine = axis.direction.cross(&next.direction).norm();
        match next.kind {
            _ if sine >= NEARLY_PARALLEL.sin() => Self::Apart,
            JointKind::Revolute => Self::Parallel,
            JointKind::Prismatic => Self::ParallelSlide,
        }
    }
}

/// The robot that an analysis found. Its base frame stands in the instrument's frame on the
/// first axis, where the first link begins; its tool is the last joint's target, unturned.
/// Masses and limits are not known; gravity is along the base's -z.
pub fn describe(name: &str, file: &Path, analysis: &Analysis, method: Method) -> Robot {
    let axes = placed(&analysis.axes, &analysis.target);
    let (base, links) = method.links(&axes);
    let ends = std::iter::once((Convention::Dh, Link::default()));
    let joints: Vec<RobotJoint> = (axes.iter().zip(links.into_iter().chain(ends)))
        .map(|(axis, (convention, link))| RobotJoint {
            joint: Joint {
                theta: link.theta,
                d: link.d,
                a: link.a,
                alpha: link.alpha,
                beta: link.beta,
                ..Joint::new(axis.kind, convention)
            },
            limits: None,
            ratio: None,
            resolution: None,
            link: None,
        })
        .collect();
    let flange = joints
        .iter()
        .fold(base, |pose, j| pose.then(&j.joint.transform(0.0)));
    let tool = flange.inverse().point(&analysis.target);
    Robot {
        name: name.to_owned(),
        base,
        joints,
        tool: Pose::translate(tool.x, tool.y, tool.z),
        gravity: Vector3::from(GRAVITY),
        source: file.to_path_buf(),
    }
}
