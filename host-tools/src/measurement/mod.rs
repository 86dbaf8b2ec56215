//! Measured poses and targets to reach: CSV tables with a sidecar for the instrument.
//!
//! [`read`] checks a table against the robot that it is for, in SI from there on.

mod columns;
mod lines;
mod plausible;
mod relations;
mod rows;
mod sidecar;
mod split;
mod unknown_robot;

use std::path::{Path, PathBuf};

use truepose::effects::Ambient;
use truepose::{JointKind, Pose};

use crate::description::Robot;
use crate::error::{Error, read_text};
use crate::warning::Warning;

/// What a table is read for, which decides what each row needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Measured poses to fit. Rows without joints or without any measured value are left out,
    /// some are held back, and the rest must be enough to fit anything.
    Fit,
    /// Measured poses to compare with; rows are left out as for [`Self::Fit`], none is held
    /// back.
    Check,
    /// Joints to predict poses for. Every row needs its joints, no row is left out.
    Joints,
    /// Poses to reach. Every row needs its pose and its joints.
    Targets,
}

/// What a table must fit: the robot as far as a row of joints is concerned.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    /// One a joint.
    pub kinds: Vec<JointKind>,
    /// Lower and upper end of each reading, rad or m.
    pub limits: Vec<Option<[f64; 2]>>,
    /// The farthest that the tool point can be from the base, m, where it is known.
    pub reach: Option<f64>,
}

/// What was measured at each pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Positions of one or more targets.
    Position,
    /// Position and orientation.
    Pose,
    /// Distance to an unknown fixed point.
    Length,
    /// Bearings from one or more stations.
    Bearing,
    /// Distances between pairs of poses.
    Distance,
    /// Fixed points that the tool point touches.
    Point,
    /// Fixed planes that the tool point touches.
    Plane,
    /// The pose of a fixed board, by an instrument on the tool.
    Board,
    /// Positions of fixed points, by an instrument on the tool.
    Mark,
    /// Bearings of fixed points, by an instrument on the tool.
    Sight,
    /// Nothing ([`Purpose::Joints`] only).
    Nothing,
}

/// What binds the tool point without giving it. Numbers are labels: equal ones belong
/// together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Relations {
    /// The pair of rows that a distance is between.
    pub pair: Option<i64>,
    /// Distance between the tool points of the two rows of the pair, m; on one row of the two,
    /// or on both.
    pub distance: Option<f64>,
    /// The fixed point that the tool point touches.
    pub point: Option<i64>,
    /// The fixed plane that the tool point touches.
    pub plane: Option<i64>,
    /// Azimuth and elevation of the tool point from every station, rad.
    pub bearings: Vec<Option<[f64; 2]>>,
    /// What an instrument on the tool sees of every fixed thing.
    pub seen: Vec<Seen>,
    /// Orientation of the first of them in the tool's frame, unit quaternion w, x, y, z.
    pub seen_turn: Option<[f64; 4]>,
}

/// A fixed thing in the tool's own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// m.
    pub position: Option<[f64; 3]>,
    /// Azimuth from x towards y about z, and elevation above the x-y plane, rad.
    pub bearing: Option<[f64; 2]>,
}

impl Relations {
    /// True if the row says none of it.
    pub fn is_empty(&self) -> bool {
        self.pair.is_none()
            && self.point.is_none()
            && self.plane.is_none()
            && self.bearings.iter().all(Option::is_none)
            && self.seen_turn.is_none()
            && self.seen.iter().all(|s| *s == Seen::default())
    }
}

/// Which side of the split a row is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// The fit may use it.
    Identify,
    /// No fit ever sees it.
    Verify,
}

/// One pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number in the table as it was read, from 1; header and comments not counted.
    pub number: usize,
    /// Line of the file, from 1.
    pub line: usize,
    /// Joint readings, rad or m.
    pub q: Vec<f64>,
    /// Position of the tool point in the world frame, m.
    pub position: Option<[f64; 3]>,
    /// Orientation of the tool in the world frame, unit quaternion w, x, y, z.
    pub orientation: Option<[f64; 4]>,
    /// Distance from an unknown fixed point to the tool point, m.
    pub length: Option<f64>,
    /// Positions of the further targets in the world frame, `x2` first, m.
    pub targets: Vec<Option<[f64; 3]>>,
    /// What else binds the tool point.
    pub relations: Relations,
    /// Commanded joints, rad or m.
    pub q_command: Option<Vec<f64>>,
    /// Sign of the last move of each joint, 0 unknown; one a joint always.
    pub direction: Vec<f64>,
    /// kg.
    pub payload: Option<f64>,
    /// Centre of mass of the payload in the tool frame, m.
    pub payload_com: Option<[f64; 3]>,
    /// degC, one a sensor; NaN where it was not measured.
    pub temperature: Vec<f64>,
    /// s since the start.
    pub time: Option<f64>,
    /// Placement of the instrument.
    pub session: Option<i64>,
    /// Side of the split.
    pub set: Set,
}

/// Which conditions the table has a column for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Available {
    /// `qcmd1` ...
    pub command: bool,
    /// `dir1` ...
    pub direction: bool,
    /// `payload`.
    pub payload: bool,
    /// `payload_com_x` ...
    pub payload_com: bool,
    /// Number of `temp` columns.
    pub temperature: usize,
    /// `t`.
    pub time: bool,
    /// `session`.
    pub session: bool,
    /// `set`.
    pub set: bool,
}

/// The instrument's noise, one standard deviation per axis; what the sidecar does not say is
/// `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// m.
    pub position: Option<f64>,
    /// rad.
    pub orientation: Option<f64>,
    /// m.
    pub length: Option<f64>,
    /// Of a distance between two poses, m.
    pub distance: Option<f64>,
    /// Of a touch on a point or plane, m.
    pub contact: Option<f64>,
    /// rad.
    pub bearing: Option<f64>,
}

/// A table that was read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// The table's file.
    pub file: PathBuf,
    /// Number of joints, the length of each row's `q`.
    pub joints: usize,
    /// What the rows measure.
    pub measured: Measured,
    /// Usable rows in the table's order.
    pub rows: Vec<Row>,
    /// Numbers of the rows that were left out, from 1.
    pub left_out: Vec<usize>,
    /// Numbers of the rows that the program itself held back, from 1.
    pub held_back: Vec<usize>,
    /// Which conditions there are.
    pub available: Available,
    /// From the sidecar.
    pub noise: Noise,
    /// Nominal offsets of the further targets from the tool point in the tool frame, `x2`
    /// first, m; zero where the sidecar has none.
    pub target_offsets: Vec<[f64; 3]>,
    /// The sidecar says that the offsets were calibrated: they are not identified.
    pub targets_known: bool,
    /// What was noticed.
    pub warnings: Vec<Warning>,
}

impl Purpose {
    /// Rows that lack something are left out, not refused.
    fn leaves_out(self) -> bool {
        matches!(self, Self::Fit | Self::Check)
    }
}

impl Expected {
    /// Of a described robot.
    pub fn of(robot: &Robot) -> Self {
        Self {
            kinds: robot.joints.iter().map(|j| j.joint.kind).collect(),
            limits: robot.joints.iter().map(|j| j.limits).collect(),
            reach: Some(robot.reach()),
        }
    }
}

impl Row {
    /// Measured pose in the world frame, where both halves were measured.
    pub fn pose(&self) -> Option<Pose<f64>> {
        Pose::from_quaternion(self.orientation?, self.position?.into())
    }

    /// Payload, temperatures and time as the model takes them. What was not measured is at
    /// the model's default: no payload, its centre at the tool point, temperatures and time
    /// not known.
    pub fn ambient(&self) -> Ambient<f64> {
        let mut ambient = Ambient::default();
        for (to, from) in ambient.temperature.iter_mut().zip(&self.temperature) {
            *to = *from;
        }
        ambient.payload = self.payload.unwrap_or(ambient.payload);
        ambient.payload_com = self.payload_com.unwrap_or_default().into();
        ambient.time = self.time.unwrap_or(ambient.time);
        ambient
    }
}

impl Dataset {
    /// True if some row gives the whole pose of the first fixed thing: a board, which is the
    /// world then.
    pub fn has_board(&self) -> bool {
        self.rows
            .iter()
            .any(|row| row.relations.seen_turn.is_some())
    }

    /// Rows of one side of the split.
    pub fn set(&self, set: Set) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.set == set)
    }
}

/// Reads a table and, if it is measured, its sidecar.
pub fn read(file: &Path, expected: &Expected, purpose: Purpose) -> Result<Dataset, Error> {
    let text = read_text(file)?;
    let mut parsed = rows::parse(file, &text, expected, purpose)?;
    plausible::check(&mut parsed, expected)?;
    let mut dataset = parsed.dataset;
    if purpose.leaves_out() {
        sidecar::read(&mut dataset)?;
        relations::check(&mut dataset)?;
    }
    if purpose == Purpose::Fit {
        split::hold_back(&mut dataset, &parsed.sets);
        relations::check_sets(&dataset)?;
        plausible::check_enough(&dataset, expected)?;
    }
    Ok(dataset)
}
