//! Measurements mean what the file format says.

use std::fs;
use std::path::{Path, PathBuf};

use truepose::JointKind::{Prismatic, Revolute};
use truepose_host::error::Error;
use truepose_host::measurement::{Dataset, Expected, Measured, Purpose, Set, read};
use truepose_host::warning::Warning;

/// A table of its own, with a sidecar unless that is empty.
fn file(name: &str, text: &str, sidecar: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("measurements");
    fs::create_dir_all(&folder).unwrap();
    let file = folder.join(format!("{name}.csv"));
    fs::write(&file, text).unwrap();
    let beside = file.with_extension("toml");
    let _ = fs::remove_file(&beside);
    if !sidecar.is_empty() {
        fs::write(&beside, sidecar).unwrap();
    }
    file
}

/// One revolute joint within +-3 rad, one sliding joint within 0 to 0.5 m.
fn two_joints() -> Expected {
    Expected {
        kinds: vec![Revolute, Prismatic],
        limits: vec![Some([-3.0, 3.0]), Some([0.0, 0.5])],
        reach: Some(1.0),
    }
}

fn check(name: &str, text: &str, sidecar: &str) -> Result<Dataset, Error> {
    read(&file(name, text, sidecar), &two_joints(), Purpose::Check)
}

/// Numbers that went through one unit.
fn near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-15 + 1e-15 * b.abs(), "{a} {b}");
}

#[test]
fn every_column_arrives_in_si() {
    let text = "# measured on the third floor
q1_deg, q2_mm ,qcmd1,qcmd2_um,x_mm,y_um,z,qw,qx,qy,qz,x2_mm,y2,z2,dir1,dir2,payload,\
payload_com_x_mm,payload_com_y,payload_com_z,temp1,temp2,t,session,set
# a comment between
90,250,1.5,249000,1000,2000000,3,0,0,0,-2e0,1,2,3,-1,1,2.5,10,0.02,0.03,20.5,21,100,-7,verify
"
    .replace("-2e0", "-1");
    let data = check("si", &text, "").unwrap();
    assert_eq!(data.measured, Measured::Pose);
    let [row] = &data.rows[..] else {
        panic!("one row")
    };
    assert_eq!((row.number, row.line), (1, 4));
    near(row.q[0], std::f64::consts::FRAC_PI_2);
    near(row.q[1], 0.25);
    let command = row.q_command.as_ref().unwrap();
    near(command[0], 1.5);
    near(command[1], 0.249);
    assert_eq!(row.position, Some([1.0, 2.0, 3.0]));
    assert_eq!(row.orientation, Some([0.0, 0.0, 0.0, -1.0]));
    assert_eq!(row.targets, [Some([0.001, 2.0, 3.0])]);
    assert_eq!(row.direction, [-1.0, 1.0]);
    assert_eq!(row.payload, Some(2.5));
    assert_eq!(row.payload_com, Some([0.01, 0.02, 0.03]));
    assert_eq!(row.temperature, [20.5, 21.0]);
    assert_eq!((row.time, row.session), (Some(100.0), Some(-7)));
    let a = data.available;
    assert!(a.command && a.direction && a.payload && a.payload_com && a.time && a.session);
    assert_eq!(a.temperature, 2);
    let ambient = row.ambient();
    near(ambient.payload_com.x, 0.01);
    near(ambient.temperature[1], 21.0);
    assert!(ambient.temperature[2].is_nan(), "there is no third sensor");
}

#[test]
fn what_is_not_there_is_not_available() {
    let data = check("least", "q1,q2,length_mm\n0,0,500\n0.1,0.1,600\n", "").unwrap();
    assert_eq!(data.measured, Measured::Length);
    near(data.rows[1].length.unwrap(), 0.6);
    assert_eq!(data.available, Default::default());
    assert_eq!(data.rows[0].direction, [0.0, 0.0]);
    assert_eq!(data.warnings, []);
    assert_eq!(data.noise, Default::default());
}

#[test]
fn blank_cells_are_not_measured_and_said() {
    let text = "q1,q2,x,y,z,temp,order
0.0,0,1,2,3,,1
,0,1,2,3,20,2
0.2,0,,,,21,3
0.3,0,1,,3,22,4
0.4,0,1,2,3,23,5
0.5,0,1,2,3,,6
";
    let data = check("blank", text, "").unwrap();
    let numbers: Vec<usize> = data.rows.iter().map(|r| r.number).collect();
    assert_eq!(numbers, [1, 5, 6]);
    assert_eq!(data.left_out, [2, 3, 4]);
    let unknown: Vec<bool> = data
        .rows
        .iter()
        .map(|r| r.ambient().temperature[0].is_nan())
        .collect();
    assert_eq!(unknown, [true, false, true]);
    let text: Vec<String> = data.warnings.iter().map(Warning::to_string).collect();
    let said = |what: &str| assert!(text.iter().any(|w| w.contains(what)), "{what}: {text:?}");
    said("columns order are not known");
    said("row 4 with only some of x, y, z");
    said("rows 2, 3, 4 without joints or without any measured value left out");
    said("rows 1, 6 blank in temp: effects that depend on it stay out");
}

#[test]
fn predicting_and_reaching_leave_no_row_out() {
    let joints = file("joints", "q1,q2,x,y,z\n0,0,,,\n0.1,0,1,2,3\n", "");
    let data = read(&joints, &two_joints(), Purpose::Joints).unwrap();
    assert_eq!(data.rows.len(), 2);
    let blank = file("joints2", "q1,q2\n0,0\n0.1,\n", "");
    let error = read(&blank, &two_joints(), Purpose::Joints)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("joints2.csv:3: row 2, column q: found a blank cell"),
        "{error}"
    );
    let targets = file("targets", "q1,q2,x,y,z,qw,qx,qy,qz\n0,0,1,2,3,1,0,0,\n", "");
    let error = read(&targets, &two_joints(), Purpose::Targets)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("found a blank cell, expected a row with its pose"),
        "{error}"
    );
    let no_pose = file("targets2", "q1,q2,x,y,z\n0,0,1,2,3\n", "");
    let error = read(&no_pose, &two_joints(), Purpose::Targets)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("targets2.csv:1: qw: found no such column"),
        "{error}"
    );
}

#[test]
fn the_sidecar_gives_noise_and_targets() {
    let text = "q1,q2,x,y,z,x2,y2,z2,x3,y3,z3\n0,0,1,2,3,1,2,3,1,2,3\n";
    let sidecar = "position_sigma_mm = 0.05\norientation_sigma_deg = 0.02\nlength_sigma_um = 7\n\
                   targets_mm = [[75.0, 90.0, 95.0]]\n";
    let data = check("sidecar", text, sidecar).unwrap();
    near(data.noise.position.unwrap(), 5e-5);
    near(data.noise.orientation.unwrap(), 0.02_f64.to_radians());
    near(data.noise.length.unwrap(), 7e-6);
    assert_eq!(data.target_offsets.len(), 2);
    near(data.target_offsets[0][0], 0.075);
    near(data.target_offsets[1][0], 0.0);
    let warning = data.warnings[0].to_string();
    assert!(
        warning.contains("no nominal offset of the targets x3"),
        "{warning}"
    );

    for (sidecar, expected) in [
        (
            "position_sigma_mm = 0.0\n",
            "sidecar.toml:1:1: position_sigma_mm: found 0, expected a",
        ),
        (
            "sigma = 1\n",
            "sidecar.toml:1:1: found the unknown key sigma, expected one of position",
        ),
        (
            "targets_mm = [[1, 2]]\n",
            "sidecar.toml:1:15: targets_mm: found [1, 2], expected a list",
        ),
        (
            "targets = [[0,0,0],[0,0,0],[0,0,0]]\n",
            "found offsets of 3 further targets, expected 2",
        ),
    ] {
        let error = check("sidecar", text, sidecar).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let robot = "[[joint]]\ntype = \"revolute\"\n";
    let data = check("sidecar", text, robot).unwrap();
    assert!(matches!(data.warnings[0], Warning::NotASidecar { .. }));
}

/// `rows` poses in joint space, each measured `times` times with a little scatter.
fn repeated(rows: usize, times: usize, set: impl Fn(usize) -> &'static str) -> String {
    let mut text = String::from("q1,q2,x,y,z,set\n");
    for k in 0..rows * times {
        let pose = (k % rows) as f64;
        let scatter = 1e-4 * (k / rows) as f64;
        let q1 = (pose * 0.37).sin() * 2.0 + scatter;
        text += &format!("{q1},{},1,2,3,{}\n", 0.01 * (pose % 7.0), set(k));
    }
    text
}

#[test]
fn a_share_is_held_back_and_repeats_stay_on_one_side() {
    let text = repeated(50, 4, |_| "");
    let fit =
        |name: &str, text: &str| read(&file(name, text, ""), &two_joints(), Purpose::Fit).unwrap();
    let data = fit("split", &text);
    assert_eq!(data.held_back.len(), 60, "30 % of 200");
    for (k, row) in data.rows.iter().enumerate() {
        assert_eq!(row.set, data.rows[k % 50].set, "row {}", row.number);
        assert_eq!(row.set == Set::Verify, data.held_back.contains(&row.number));
    }
    assert_eq!(
        fit("split2", &text).held_back,
        data.held_back,
        "the same every time"
    );
    let warned = data
        .warnings
        .iter()
        .any(|w| matches!(w, Warning::HeldBack { of: 200, .. }));
    assert!(warned);

    // The split is by the rows' order alone: the first few of them, for every platform.
    assert_eq!(data.held_back[..6], [4, 6, 8, 11, 12, 17]);
}

#[test]
fn rows_that_say_their_set_keep_it_and_draw_their_repeats_along() {
    let set = |k: usize| match k {
        0..40 => "identify",
        40..50 => "verify",
        _ => "",
    };
    let text = repeated(50, 2, set);
    let data = read(&file("set", &text, ""), &two_joints(), Purpose::Fit).unwrap();
    for (k, row) in data.rows.iter().enumerate().take(50) {
        assert_eq!(row.set == Set::Verify, k >= 40, "row {}", row.number);
    }
    for row in data.rows.iter().skip(90) {
        assert_eq!(
            row.set,
            Set::Verify,
            "row {} repeats a verify row",
            row.number
        );
    }
    assert_eq!(data.held_back.len(), 15, "30 % of 50");
}
