//! The same as [`super::files`], in memory: for those who run hundreds of cells.

use std::path::PathBuf;

use nalgebra::Vector3;
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};

use super::Cell;
use super::drawing::Kind;
use super::instrument::{Measured, Seen};
use super::physics::GRAVITY;
use crate::description::{Robot, RobotJoint};
use crate::measurement::{self, Available, Dataset, Noise, Relations, Row, Set};

impl Cell {
    /// The arm as drawn, as [`Robot::read`] would read it from [`Cell::robot_toml`].
    pub fn robot(&self) -> Robot {
        let drawing = self.drawing();
        let [x, y, z, roll, pitch, yaw] = drawing.tool;
        Robot {
            name: drawing.name.to_owned(),
            base: Pose::identity(),
            joints: drawing
                .links
                .iter()
                .map(|link| {
                    let kind = match link.kind {
                        Kind::Revolute => JointKind::Revolute,
                        Kind::Prismatic => JointKind::Prismatic,
                    };
                    let convention = match link.proximal {
                        true => Convention::Mdh,
                        false => Convention::Dh,
                    };
                    RobotJoint {
                        joint: Joint {
                            theta: link.theta,
                            d: link.d,
                            a: link.a,
                            alpha: link.alpha,
                            ..Joint::new(kind, convention)
                        },
                        limits: Some(link.limits),
                        ratio: (link.ratio > 0.0).then_some(link.ratio),
                        resolution: None,
                        link: Some(LinkMass {
                            mass: link.mass,
                            com: Vector3::from(link.com),
                        }),
                    }
                })
                .collect(),
            tool: Pose::from_xyz_rpy(Vector3::new(x, y, z), Vector3::new(roll, pitch, yaw)),
            gravity: Vector3::from(GRAVITY),
            source: PathBuf::from("cell.toml"),
        }
    }
}

impl Measured {
    /// The measurements, as [`measurement::read`] would read them from [`Measured::csv`] and
    /// [`Measured::sidecar`].
    pub fn dataset(&self) -> Dataset {
        let written = &self.conditions;
        let joints = self.rows.first().map_or(0, |row| row.reading.len());
        let offsets = match &self.instrument.seen {
            Seen::Targets(offsets) => offsets.clone(),
            _ => Vec::new(),
        };
        let sigma = |sigma: f64, k: usize| {
            let factor = self.instrument.declared.and_then(|d| d.get(k).copied())?;
            Some(sigma * factor)
        };
        let position = sigma(self.instrument.position_sigma, 0);
        let length = self.instrument.seen == Seen::Length;
        Dataset {
            file: PathBuf::from("cell.csv"),
            joints,
            measured: match self.instrument.seen {
                Seen::Position | Seen::Targets(_) => measurement::Measured::Position,
                Seen::Pose => measurement::Measured::Pose,
                Seen::Length => measurement::Measured::Length,
            },
            rows: (0..)
                .zip(&self.rows)
                .map(|(i, row)| self.row(i, row))
                .collect(),
            left_out: Vec::new(),
            held_back: Vec::new(),
            available: Available {
                command: written.commands,
                direction: written.direction,
                payload: !written.payloads.is_empty(),
                payload_com: !written.payloads.is_empty(),
                temperature: usize::from(written.temperature),
                time: written.time,
                session: written.sessions > 1,
                set: self.rows.iter().any(|row| row.visit.verify),
            },
            noise: Noise {
                position: position.filter(|_| !length),
                orientation: sigma(self.instrument.orientation_sigma, 1)
                    .filter(|_| self.instrument.seen == Seen::Pose),
                length: position.filter(|_| length),
                ..Noise::default()
            },
            target_offsets: offsets,
            targets_known: false,
            warnings: Vec::new(),
        }
    }

    fn row(&self, index: usize, row: &super::Row) -> Row {
        let written = &self.conditions;
        let visit = &row.visit;
        let three =
            |from: usize| -> Option<[f64; 3]> { row.values.get(from..from + 3)?.try_into().ok() };
        let length = self.instrument.seen == Seen::Length;
        let targets = match &self.instrument.seen {
            Seen::Targets(offsets) => (1..=offsets.len()).map(|k| three(3 * k)).collect(),
            _ => Vec::new(),
        };
        let loaded = !written.payloads.is_empty();
        Row {
            number: index + 1,
            line: index + 2,
            q: row.reading.clone(),
            position: three(0).filter(|_| !length),
            orientation: row
                .values
                .get(3..7)
                .and_then(|q| q.try_into().ok())
                .filter(|_| self.instrument.seen == Seen::Pose),
            length: row.values.first().copied().filter(|_| length),
            targets,
            relations: Relations::default(),
            q_command: written.commands.then(|| visit.q.clone()),
            direction: (0..visit.q.len())
                .map(|j| {
                    if written.direction {
                        visit.direction(j)
                    } else {
                        0.0
                    }
                })
                .collect(),
            payload: loaded.then_some(visit.payload),
            payload_com: loaded.then_some(visit.payload_com),
            temperature: if written.temperature {
                vec![visit.temperature]
            } else {
                Vec::new()
            },
            time: written.time.then_some(visit.time),
            session: (written.sessions > 1).then_some(i64::from(visit.session)),
            set: if visit.verify {
                Set::Verify
            } else {
                Set::Identify
            },
        }
    }
}
