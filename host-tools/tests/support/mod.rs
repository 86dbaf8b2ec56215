//! What the tests of the command share.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use truepose::effects::{Effect, GearEccentricity, JointCompliance};
use truepose::params::{Blob, Description, Provenance};
use truepose::taught::Taught;
use truepose::{Settings, StoredPose};
use truepose_host::description::Robot;

/// An empty folder for one test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// The names of the files in a folder.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let name = |e: std::io::Result<fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

/// Runs the command in `folder`.
pub(crate) fn truepose(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_truepose"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Its exit status, stdout and stderr.
pub(crate) fn said(output: &Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (
        output.status.code().unwrap(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

/// A small six-axis arm with a spherical wrist.
pub(crate) const ROBOT: &str = r#"
name = "six"
[base]
xyz_mm = [1000.0, -200.0, 50.0]
rpy_deg = [1.0, -2.0, 30.0]
[[joint]]
type = "revolute"
convention = "dh"
d_mm = 290.0
alpha_deg = -90.0
limits_deg = [-165.0, 165.0]
[joint.link]
mass = 3.0
com_mm = [0.0, 43.0, 0.0]
[[joint]]
type = "revolute"
convention = "dh"
theta_deg = -90.0
a_mm = 270.0
limits_deg = [-110.0, 110.0]
[joint.link]
mass = 4.0
com_mm = [-169.0, 0.0, 1.0]
[[joint]]
type = "revolute"
convention = "dh"
a_mm = 70.0
alpha_deg = -90.0
limits_deg = [-110.0, 70.0]
[[joint]]
type = "revolute"
convention = "dh"
d_mm = 302.0
alpha_deg = 90.0
limits_deg = [-160.0, 160.0]
resolution_deg = 0.001
[[joint]]
type = "revolute"
convention = "dh"
alpha_deg = -90.0
limits_deg = [-120.0, 120.0]
[[joint]]
type = "revolute"
convention = "dh"
theta_deg = 180.0
d_mm = 72.0
[tool]
xyz_mm = [0.0, 10.0, 120.0]
"#;

/// The robot of [`ROBOT`], read from `folder`.
pub(crate) fn robot(folder: &Path) -> Robot {
    let file = folder.join("robot.toml");
    fs::write(&file, ROBOT).unwrap();
    Robot::read(&file).unwrap()
}

/// Parameters of `robot`, as drawn and with every parameter a little off, and two effects.
pub(crate) fn blob(robot: &Robot) -> Blob<'static> {
    let nominal = Description {
        base: StoredPose::from(&robot.base),
        joints: robot.joints.iter().map(|j| j.joint).collect(),
        masses: robot.masses().into_iter().collect(),
        tool: StoredPose::from(&robot.tool),
    };
    let mut calibrated = nominal.clone();
    let mut off = 1e-4;
    for joint in &mut calibrated.joints {
        for &parameter in joint.parameters() {
            off *= -1.1;
            *joint.parameter_mut(parameter) += off;
        }
    }
    let unlimited = truepose::params::UNLIMITED;
    Blob {
        robot: robot.name.as_str().try_into().unwrap(),
        nominal,
        calibrated,
        limits: robot
            .joints
            .iter()
            .map(|j| j.limits.unwrap_or(unlimited))
            .collect(),
        resolution: robot
            .joints
            .iter()
            .map(|j| j.resolution.unwrap_or(0.0))
            .collect(),
        gravity: robot.gravity.into(),
        effects: [
            Effect::GearEccentricity(GearEccentricity {
                joint: 1,
                order: 1.0,
                amplitude: [3.1e-4, -1.0e-4],
            }),
            Effect::JointCompliance(JointCompliance {
                joint: 2,
                compliance: [2e-5],
            }),
        ]
        .into_iter()
        .collect(),
        settings: Settings::default(),
        provenance: Provenance {
            tool: "truepose 0.1.0".try_into().unwrap(),
            data: "tracker.csv".try_into().unwrap(),
            date: "2020-02-02".try_into().unwrap(),
            rows_identify: 70,
            rows_verify: 30,
            rms_before: 1.21e-3,
            rms_after: 5e-5,
        },
        taught: Taught::default(),
    }
}

/// Writes [`blob`] of [`robot`] to `P.tpb` in `folder`.
pub(crate) fn write_blob(folder: &Path) -> Blob<'static> {
    let blob = blob(&robot(folder));
    let mut buffer = vec![0; 8192];
    fs::write(folder.join("P.tpb"), blob.encode(&mut buffer).unwrap()).unwrap();
    blob
}
