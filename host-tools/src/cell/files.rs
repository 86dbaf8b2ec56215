//! The cell's robot and measurements as the files that anyone would hand over.

use std::fmt::Write as _;

use super::Cell;
use super::drawing::{Kind, Link};
use super::instrument::{Measured, Seen};
use super::physics::GRAVITY;

/// The three files of one measured series.
#[derive(Clone, Debug, PartialEq)]
pub struct Files {
    /// Robot description, TOML.
    pub robot: String,
    /// Measurements, CSV.
    pub data: String,
    /// What the instrument declares, TOML, beside the measurements.
    pub sidecar: String,
}

impl Cell {
    /// The arm as drawn: what its controller believes. `base`: nominal placement, xyz in m
    /// and roll, pitch, yaw in rad; `None` leaves it out.
    pub fn robot_toml(&self, base: Option<[f64; 6]>) -> String {
        let mut text = format!("name = \"{}\"\n", self.drawing().name);
        if let Some([x, y, z, roll, pitch, yaw]) = base {
            text += &section("base", [x, y, z], [roll, pitch, yaw]);
        }
        for link in &self.drawing().links {
            text += &joint_toml(link);
        }
        let [x, y, z, roll, pitch, yaw] = self.drawing().tool;
        text += &section("tool", [x, y, z], [roll, pitch, yaw]);
        text += &format!("\n[gravity]\nxyz = {}\n", list(&GRAVITY));
        text
    }

    /// All three files of a series that this cell measured.
    pub fn files(&self, measured: &Measured) -> Files {
        Files {
            robot: self.robot_toml(None),
            data: measured.csv(),
            sidecar: measured.sidecar(),
        }
    }
}

impl Measured {
    /// The measurements as a file: joints, values and what the conditions say is written
    /// down.
    pub fn csv(&self) -> String {
        let written = &self.conditions;
        let joints = self.rows.first().map_or(0, |row| row.reading.len());
        let mut names: Vec<String> = (1..=joints).map(|j| format!("q{j}")).collect();
        names.extend(self.columns());
        if written.commands {
            names.extend((1..=joints).map(|j| format!("qcmd{j}")));
        }
        if written.direction {
            names.extend((1..=joints).map(|j| format!("dir{j}")));
        }
        let mut more = |on: bool, columns: &[&str]| {
            if on {
                names.extend(columns.iter().map(ToString::to_string));
            }
        };
        more(
            !written.payloads.is_empty(),
            &["payload", "payload_com_x", "payload_com_y", "payload_com_z"],
        );
        more(written.temperature, &["temp"]);
        more(written.time, &["t"]);
        more(written.sessions > 1, &["session"]);
        let split = self.rows.iter().any(|row| row.visit.verify);
        more(split, &["set"]);
        let mut text = names.join(",") + "\n";
        for row in &self.rows {
            let visit = &row.visit;
            let mut cells: Vec<String> = Vec::with_capacity(names.len());
            let mut numbers = |values: &[f64]| cells.extend(values.iter().map(f64::to_string));
            numbers(&row.reading);
            numbers(&row.values);
            if written.commands {
                numbers(&visit.q);
            }
            if written.direction {
                numbers(&(0..joints).map(|j| visit.direction(j)).collect::<Vec<_>>());
            }
            if !written.payloads.is_empty() {
                numbers(&[visit.payload]);
                numbers(&visit.payload_com);
            }
            if written.temperature {
                numbers(&[visit.temperature]);
            }
            if written.time {
                numbers(&[visit.time]);
            }
            if written.sessions > 1 {
                cells.push(visit.session.to_string());
            }
            if split {
                cells.push(if visit.verify { "verify" } else { "identify" }.to_string());
            }
            text += &cells.join(",");
            text.push('\n');
        }
        text
    }

    /// What the instrument declares of its noise, and the targets' nominal offsets.
    pub fn sidecar(&self) -> String {
        let mut text = String::new();
        let instrument = &self.instrument;
        if let Some([position, orientation]) = instrument.declared {
            let length = if instrument.seen == Seen::Length {
                "length"
            } else {
                "position"
            };
            let sigma_mm = instrument.position_sigma * position * 1e3;
            text += &format!("{length}_sigma_mm = {sigma_mm:?}\n");
            if instrument.seen == Seen::Pose {
                let sigma_deg = (instrument.orientation_sigma * orientation).to_degrees();
                text += &format!("orientation_sigma_deg = {sigma_deg:?}\n");
            }
        }
        if let Seen::Targets(offsets) = &instrument.seen {
            let mm: Vec<String> = offsets.iter().map(|o| list(&o.map(|x| x * 1e3))).collect();
            text += &format!("targets_mm = [{}]\n", mm.join(", "));
        }
        text
    }
}

fn joint_toml(link: &Link) -> String {
    let mut text = String::from("\n[[joint]]\n");
    let (kind, limits) = match link.kind {
        Kind::Revolute => ("revolute", ("limits_deg", link.limits.map(f64::to_degrees))),
        Kind::Prismatic => ("prismatic", ("limits_mm", link.limits.map(|x| x * 1e3))),
    };
    let convention = if link.proximal { "mdh" } else { "dh" };
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "type = \"{kind}\"\nconvention = \"{convention}\"\ntheta_deg = {:?}\nd_mm = {:?}\n\
         a_mm = {:?}\nalpha_deg = {:?}\n{} = {}\n",
        link.theta.to_degrees(),
        link.d * 1e3,
        link.a * 1e3,
        link.alpha.to_degrees(),
        limits.0,
        list(&limits.1),
    );
    if link.ratio > 0.0 {
        text += &format!("ratio = {:?}\n", link.ratio);
    }
    let com_mm = link.com.map(|x| x * 1e3);
    text + &format!(
        "\n[joint.link]\nmass = {:?}\ncom_mm = {}\n",
        link.mass,
        list(&com_mm)
    )
}

fn section(name: &str, xyz: [f64; 3], rpy: [f64; 3]) -> String {
    format!(
        "\n[{name}]\nxyz_mm = {}\nrpy_deg = {}\n",
        list(&xyz.map(|x| x * 1e3)),
        list(&rpy.map(f64::to_degrees))
    )
}

fn list(numbers: &[f64]) -> String {
    let cells: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    format!("[{}]", cells.join(", "))
}
