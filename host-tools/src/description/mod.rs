//! The nominal robot, as its drawing and its controller describe it.
//!
//! A TOML file in the project's own form or a URDF file; both come out as a [`Robot`].

mod toml;
mod urdf;
mod write_toml;
mod write_urdf;
mod zero_reference;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use truepose::{Joint, JointKind, LinkMass, Pose};

use crate::error::{Error, Place, read_text};

/// A robot as described, in m and rad.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// As the file calls it.
    pub name: String,
    /// World (measurement) frame to robot base frame, nominal.
    pub base: Pose<f64>,
    /// From the base to the tool.
    pub joints: Vec<RobotJoint>,
    /// Last joint's distal frame to tool frame, nominal.
    pub tool: Pose<f64>,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: Vector3<f64>,
    /// The file that it was read from.
    pub source: PathBuf,
}

/// One joint with what is known of it besides its geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotJoint {
    /// Geometry. A zero-reference axis is in the frame before the joint.
    pub joint: Joint<f64>,
    /// Lower and upper end of its reading, rad or m.
    pub limits: Option<[f64; 2]>,
    /// Motor turns per joint turn, signed.
    pub ratio: Option<f64>,
    /// Smallest step of the joint command, rad or m.
    pub resolution: Option<f64>,
    /// What gravity acts on, in the link's distal frame.
    pub link: Option<LinkMass<f64>>,
}

/// The file, and the link named behind a `#`.
fn with_tip<'a>(file: &'a Path, name: &'a str) -> (&'a Path, Option<&'a str>) {
    match name.rsplit_once('#') {
        Some((path, tip)) if !file.exists() => (Path::new(path), Some(tip)),
        _ => (file, None),
    }
}

/// Gravity where a description says nothing, m/s^2 in the base frame.
pub const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

impl Robot {
    /// Reads a description, TOML or URDF, whichever the file holds. `arm.urdf#LINK` ends the
    /// arm at that link of a URDF file.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let name = file.to_string_lossy();
        let (path, tip) = with_tip(file, &name);
        let text = read_text(path)?;
        if urdf::is_xml(&text) {
            return urdf::parse(path, &text, tip);
        }
        if let Some(tip) = tip {
            return Err(Place::file(path).bad(
                format!("TOML, and #{tip} after its name"),
                "a URDF file where a link is named",
                "leave the link out: a TOML file describes one arm",
            ));
        }
        toml::parse(path, &text)
    }

    /// The description as TOML. Angles in deg and lengths in mm to the thirteenth decimal.
    pub fn to_toml(&self) -> String {
        write_toml::write(self)
    }

    /// The description as a new URDF file, its tip `tool0`. A slide needs its limits.
    pub fn to_urdf(&self) -> Result<String, Error> {
        write_urdf::write(self)
    }

    /// The URDF file that this robot was read from, named as it was then, with its joints and
    /// tool where `calibrated` has them; `None` where it is not a URDF file. Poses are those of
    /// `calibrated` from its base on: the root link stands at the robot's base.
    pub fn rewrite_urdf(&self, file: &Path, calibrated: &Self) -> Result<Option<String>, Error> {
        let name = file.to_string_lossy();
        let (path, tip) = with_tip(file, &name);
        let text = read_text(path)?;
        match urdf::is_xml(&text) {
            true => write_urdf::rewrite(path, &text, tip, self, calibrated).map(Some),
            false => Ok(None),
        }
    }

    /// Joints without what else is known of them.
    pub fn geometry(&self) -> Vec<Joint<f64>> {
        self.joints.iter().map(|j| j.joint).collect()
    }

    /// Masses of the links, zero where the description has none.
    pub fn masses(&self) -> Vec<LinkMass<f64>> {
        self.joints
            .iter()
            .map(|j| j.link.unwrap_or_else(LinkMass::none))
            .collect()
    }

    /// Tool pose in the world frame at the readings `q` (rad or m), by the plain product of
    /// the described transforms.
    pub fn forward(&self, q: &[f64]) -> Pose<f64> {
        self.joints
            .iter()
            .zip(q)
            .fold(self.base, |pose, (j, &q)| pose.then(&j.joint.transform(q)))
            .then(&self.tool)
    }

    /// The farthest that the tool point can be from the base, m: all link lengths laid end to
    /// end, sliding joints at the farther limit (0 where there is none).
    pub fn reach(&self) -> f64 {
        let mut sum = self.tool.translation.norm();
        for RobotJoint { joint, limits, .. } in &self.joints {
            sum += joint.transform(0.0).translation.norm() + joint.point.norm();
            if joint.kind == JointKind::Prismatic {
                sum += limits.map_or(0.0, |[low, high]| low.abs().max(high.abs()));
            }
        }
        sum
    }
}
