//! `verify` on measurements that are known to be so far from either model, and on poses that
//! were measured several times.

#![expect(clippy::unwrap_used, reason = "helpers of tests stop the test")]

mod support;

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Vector3;
use support::{folder, said, truepose, write_blob};
use truepose::Pose;
use truepose::effects::Conditions;
use truepose_host::random::Random;

/// Commands within the limits of the support arm; every one `repeats` times.
fn commands(count: usize, repeats: usize) -> Vec<[f64; 6]> {
    let mut random = Random::new(3, 0);
    let limits = [2.5, 1.8, 1.0, 2.7, 2.0, 2.0];
    (0..count)
        .flat_map(|_| {
            let q = limits.map(|limit| random.between(-limit, limit));
            std::iter::repeat_n(q, repeats)
        })
        .collect()
}

/// Writes P.tpb and NEW.csv: full poses of the calibrated arm, seen through `see`, which gets
/// the row's number.
fn new_rows(
    folder: &Path,
    commands: &[[f64; 6]],
    mut see: impl FnMut(usize, Pose<f64>) -> Pose<f64>,
) {
    let blob = write_blob(folder);
    let model = blob.model::<f64, 6>().unwrap();
    let mut csv = String::from("q1,q2,q3,q4,q5,q6,x,y,z,qw,qx,qy,qz\n");
    for (row, q) in commands.iter().enumerate() {
        let pose = see(row, model.predict(q, &Conditions::default()));
        let p = pose.translation;
        let numbers = (q.iter().copied())
            .chain([p.x, p.y, p.z])
            .chain(pose.quaternion());
        let cells: Vec<String> = numbers.map(|x| x.to_string()).collect();
        writeln!(csv, "{}", cells.join(",")).unwrap();
    }
    std::fs::write(folder.join("NEW.csv"), csv).unwrap();
}

fn json(folder: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("v.json")).unwrap()).unwrap()
}

const VERIFY: [&str; 7] = [
    "verify", "--params", "P.tpb", "--data", "NEW.csv", "--json", "v.json",
];

#[test]
fn error_after_is_what_the_instrument_added_and_before_is_the_calibration() {
    let folder = folder("verify-errors");
    let mut random = Random::new(1, 0);
    new_rows(&folder, &commands(40, 1), |_, pose| {
        // 0.03 mm in a random direction
        let away = Vector3::from(random.direction()) * 3e-5;
        Pose::new(pose.rotation, pose.translation + away)
    });
    let (status, out, _) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0, "{out}");
    let v = json(&folder);
    let rms = |which: &str| v["error_mm"][which]["rms"].as_f64().unwrap();
    assert!((rms("after") - 0.03).abs() < 1e-9, "{v}");
    // Parameters a few tenths of a milliradian off, at half a metre.
    assert!(rms("before") > 0.3 && rms("before") < 5.0, "{v}");
    assert!(
        v["error_deg"]["after"]["max"].as_f64().unwrap() < 1e-6,
        "{v}"
    );
    assert!(
        v["error_deg"]["before"]["rms"].as_f64().unwrap() > 1e-3,
        "{v}"
    );
    assert_eq!(v["accepted"], serde_json::Value::Null);
    assert!(v.get("iso9283").is_none(), "nothing was measured twice");
    assert!(out.contains("0.0300"), "{out}");
}

#[test]
fn accuracy_that_is_not_met_is_exit_status_1() {
    let folder = folder("verify-accept");
    new_rows(&folder, &commands(20, 1), |row, pose| {
        // one row is worse than the others
        let away = if row == 7 { 2e-4 } else { 5e-5 };
        Pose::new(
            pose.rotation,
            pose.translation + Vector3::new(away, 0.0, 0.0),
        )
    });
    let with = |limits: &[&str]| {
        let arguments: Vec<&str> = VERIFY.iter().chain(limits).copied().collect();
        let (status, out, err) = said(&truepose(&folder, &arguments));
        (
            status,
            format!("{out}{err}"),
            json(&folder)["accepted"].clone(),
        )
    };
    let (status, text, accepted) = with(&["--accept-mm", "0.21"]);
    assert_eq!((status, accepted), (0, true.into()), "{text}");
    let (status, text, accepted) = with(&["--accept-mm", "0.19"]);
    assert_eq!((status, accepted), (1, false.into()), "{text}");
    assert!(text.contains("NOT accepted"), "{text}");
    let (status, text, _) = with(&["--accept-mm", "0.21", "--accept-deg", "0.000001"]);
    assert_eq!(status, 0, "{text}");
    for wrong in ["0", "-1", "NaN", "far"] {
        let (status, text, _) = with(&[&format!("--accept-mm={wrong}")]);
        assert_eq!(status, 2, "{text}");
    }
}

#[test]
fn repeated_poses_give_accuracy_and_repeatability_of_iso_9283() {
    let folder = folder("verify-iso");
    // Two poses, five times each, along x: offsets whose figures are plain.
    let offsets = [0.1, 0.2, 0.3, 0.2, 0.2].map(|mm| mm * 1e-3);
    let commands = commands(2, 5);
    new_rows(&folder, &commands, |row, pose| {
        let scale = if row < 5 { 1.0 } else { 2.0 };
        let away = Vector3::new(scale * offsets[row % 5], 0.0, 0.0);
        Pose::new(pose.rotation, pose.translation + away)
    });
    let (status, out, _) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0, "{out}");
    let iso = json(&folder)["iso9283"].clone();
    let near = |value: &serde_json::Value, wanted: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - wanted).abs() < 1e-9, "{value} {wanted}: {iso}");
    };
    // Distances from the middle: 0.1, 0, 0.1, 0, 0 mm; mean 0.04, S = sqrt(0.003) / ... :
    // squares about the mean 2 * 0.06^2 + 3 * 0.04^2 = 0.012, over 4: 0.003.
    let rp = 0.04 + 3.0 * 0.003_f64.sqrt();
    let poses = iso["poses"].as_array().unwrap();
    assert_eq!(poses.len(), 2);
    near(&poses[0]["ap_mm"], 0.2);
    near(&poses[0]["rp_mm"], rp);
    near(&poses[1]["ap_mm"], 0.4);
    near(&poses[1]["rp_mm"], 2.0 * rp);
    near(&iso["ap_mm"], 0.4);
    assert_eq!(poses[1]["row"], 6);
    assert_eq!(poses[0]["repeats"], 5);
}

#[test]
fn instrument_that_stands_elsewhere_is_found_when_asked_for() {
    let folder = folder("verify-realign");
    let elsewhere = Pose::from_xyz_rpy(Vector3::new(1.0, -2.0, 0.3), Vector3::new(0.2, -0.1, 2.0));
    let mut random = Random::new(1, 0);
    new_rows(&folder, &commands(60, 1), |_, pose| {
        let away = Vector3::from(random.direction()) * 3e-5;
        elsewhere.then(&Pose::new(pose.rotation, pose.translation + away))
    });
    let (status, _, _) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0);
    assert!(json(&folder)["error_mm"]["after"]["rms"].as_f64().unwrap() > 100.0);
    let realign: Vec<&str> = VERIFY.iter().copied().chain(["--realign"]).collect();
    let (status, out, _) = said(&truepose(&folder, &realign));
    assert_eq!(status, 0);
    let v = json(&folder);
    let rms = v["error_mm"]["after"]["rms"].as_f64().unwrap();
    // Six parameters of 180 numbers take a little of the 0.03 mm away.
    assert!(rms < 0.03 && rms > 0.028, "{rms}");
    assert!(
        v["error_mm"]["before"]["rms"].as_f64().unwrap() > 5.0 * rms,
        "{v}"
    );
    assert_eq!(v["realigned"], true);
    assert!(out.contains("placement"), "{out}");
}

#[test]
fn lengths_of_a_wire_are_compared_from_where_its_end_must_be() {
    let folder = folder("verify-length");
    let blob = write_blob(&folder);
    let model = blob.model::<f64, 6>().unwrap();
    let anchor = Vector3::new(2.5, 0.7, 1.1);
    let mut csv = String::from("q1,q2,q3,q4,q5,q6,length\n");
    for q in commands(50, 1) {
        let wire = model.predict(&q, &Conditions::default()).translation - anchor;
        let cells: Vec<String> = q.iter().map(ToString::to_string).collect();
        writeln!(csv, "{},{}", cells.join(","), wire.norm()).unwrap();
    }
    std::fs::write(folder.join("NEW.csv"), csv).unwrap();
    let (status, out, err) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0, "{out}{err}");
    let v = json(&folder);
    assert_eq!(v["measured"], "length");
    assert!(
        v["error_mm"]["after"]["max"].as_f64().unwrap() < 1e-6,
        "{v}"
    );
    assert!(
        v["error_mm"]["before"]["rms"].as_f64().unwrap() > 0.1,
        "{v}"
    );
}

#[test]
fn orientation_asked_of_positions_is_an_error() {
    let folder = folder("verify-no-orientation");
    write_blob(&folder);
    let csv = "q1,q2,q3,q4,q5,q6,x,y,z\n0.1,0.2,0.3,0.1,0.2,0.3,1.4,0.2,0.5\n";
    std::fs::write(folder.join("NEW.csv"), csv).unwrap();
    let arguments: Vec<&str> = VERIFY
        .iter()
        .copied()
        .chain(["--accept-deg", "1"])
        .collect();
    let (status, _, err) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 2);
    assert!(
        err.contains("--accept-deg") && err.contains("NEW.csv"),
        "{err}"
    );
    assert!(!folder.join("v.json").exists());
}
