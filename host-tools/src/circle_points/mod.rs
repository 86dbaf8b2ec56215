//! Circle point analysis: the arm from sweeps of single joints, without any drawing. MRD 4.6.
//!
//! 1. runs of rows in which one joint alone moves ([`mod@sweeps`]);
//! 2. what the target draws in each: a circle about a revolute joint's axis, a line along a
//!    slide ([`fits`], [`axes`]);
//! 3. every axis carried back to where it is when all joints read zero, from the first joint
//!    on: so each sweep may be of any target and in any posture;
//! 4. link parameters from the axes, after [`stone`] or after [`sklar`].
//!
//! The rest is identification's: a circle knows nothing of the other circles.

pub mod axes;
mod describe;
pub mod fits;
pub mod sklar;
pub mod stone;
pub mod sweeps;

use std::path::Path;

use nalgebra::Vector3;
use truepose::{Convention, JointKind, Pose};

use crate::convert::Axis;
use crate::convert::link::Link;
use crate::error::{Error, Place};
use crate::measurement::Dataset;
pub use axes::{Drawn, Traced};
pub use describe::describe;
use sweeps::{Point, sweeps};

/// How link parameters are got from axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// By frames on the axes and their relative transforms.
    Stone,
    /// By the axes' common normals.
    Sklar,
}

impl Method {
    /// The arm's first frame, and a link a joint but the last, by this method. `axes` as they
    /// are at zero, slides where [`crate::convert`] puts them.
    pub fn links(self, axes: &[Axis]) -> (Pose<f64>, Vec<(Convention, Link)>) {
        match self {
            Self::Stone => stone::links(axes),
            Self::Sklar => sklar::links(axes),
        }
    }
}

/// What sweeps say of an arm.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// Every sweep that was used.
    pub traced: Vec<Traced>,
    /// One a joint, in the instrument's frame, all joints at zero.
    pub axes: Vec<Axis>,
    /// The last joint's target, likewise, m.
    pub target: Vector3<f64>,
    /// Root mean square distance of all swept points from where this arm puts them, m; every
    /// sweep with its own target.
    pub rms: f64,
    /// Numbers of the rows that belong to no sweep.
    pub unused: Vec<usize>,
}

/// Why there is no arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// No sweep of this joint (from 0), or none of enough points.
    NeverAlone(usize),
    /// The sweep that begins in this row draws neither a circle nor a line of its reading's
    /// scale: joint, row, angle (rad) or length (m) over reading.
    NoShape(usize, usize, Option<f64>),
    /// The instrument was moved.
    Sessions,
    /// No tool point.
    NoPosition,
}

impl Failure {
    /// With the file in which it shows.
    pub fn explain(self, file: &Path) -> Error {
        let place = |joint: usize| Place::file(file).column(&format!("q{}", joint + 1));
        match self {
            Self::NeverAlone(joint) => place(joint).bad(
                "no run of rows in which this joint alone moves",
                format!(
                    "at least {} rows of such a sweep, of each joint",
                    sweeps::FEWEST
                ),
                "measure one, all other joints at rest, through as much of a circle as can be",
            ),
            Self::NoShape(joint, row, scale) => Place {
                row: Some(row),
                ..place(joint)
            }
            .bad(
                match scale {
                    Some(scale) => format!(
                        "a sweep from here on whose target moves {scale:.3} times what is read"
                    ),
                    None => "a sweep from here on that draws neither circle nor line".to_owned(),
                },
                "a circle turned, or a line moved, by as much as the joint's reading",
                "check the column's unit, sweep farther, or put the target farther from the axis",
            ),
            Self::Sessions => Place::file(file).column("session").bad(
                "several placements of the instrument",
                "all sweeps from one",
                "analyse one session, and give all of them to identify",
            ),
            Self::NoPosition => Place::file(file).bad(
                "rows without x, y and z",
                "the position of a target on the arm",
                "measure points",
            ),
        }
    }
}

/// Finds the arm in a table of sweeps. `kinds`: what the columns' units say of the joints,
/// where they say anything.
pub fn analyse(data: &Dataset, kinds: &[Option<JointKind>]) -> Result<Analysis, Failure> {
    let mut sessions = data.rows.iter().map(|row| row.session);
    let first = sessions.next();
    if sessions.any(|session| Some(session) != first) {
        return Err(Failure::Sessions);
    }
    let points: Vec<Point> = (data.rows.iter())
        .filter_map(|row| {
            Some(Point {
                row: row.number,
                q: row.q.clone(),
                position: Vector3::from(row.position?),
            })
        })
        .collect();
    if points.is_empty() {
        return Err(Failure::NoPosition);
    }
    let sweeps = sweeps(&points);
    let mut traced: Vec<Traced> = Vec::new();
    let mut found: Vec<Axis> = Vec::new();
    for joint in 0..data.joints {
        let kind = kinds.get(joint).copied().flatten();
        let mut seen = Vec::new();
        for sweep in sweeps.iter().filter(|s| s.joint == joint) {
            seen.push(Traced::of(sweep, kind)?);
        }
        let axis = axes::at_zero(&found, &seen).ok_or(Failure::NeverAlone(joint))?;
        found.push(axis);
        traced.extend(seen);
    }
    // Where each sweep's target is at zero.
    let carry = |point: &Point| at(&found, &point.q).inverse().point(&point.position);
    let (mut squares, mut count) = (0.0, 0.0);
    let mut target = (Vector3::zeros(), 0.0);
    for sweep in &sweeps {
        let carried = sweep.points.iter().map(|p| carry(p));
        let home = carried.sum::<Vector3<f64>>() / sweep.points.len() as f64;
        for point in &sweep.points {
            squares += (at(&found, &point.q).point(&home) - point.position).norm_squared();
            count += 1.0;
        }
        if sweep.joint + 1 == data.joints {
            let weight = sweep.points.len() as f64;
            target.0 += home * weight;
            target.1 += weight;
        }
    }
    let used: Vec<usize> = sweeps
        .iter()
        .flat_map(|s| s.points.iter().map(|p| p.row))
        .collect();
    Ok(Analysis {
        traced,
        axes: found,
        target: target.0 / f64::max(target.1, 1.0),
        rms: (squares / f64::max(count, 1.0)).sqrt(),
        unused: points
            .iter()
            .map(|p| p.row)
            .filter(|row| !used.contains(row))
            .collect(),
    })
}

/// Motion of what lies beyond the axes at the readings `q`.
fn at(axes: &[Axis], q: &[f64]) -> Pose<f64> {
    axes.iter()
        .zip(q)
        .fold(Pose::identity(), |pose, (axis, &q)| {
            pose.then(&axis.motion(q))
        })
}
