//! `verify` on measurements that are known to be so far from either model, and on poses that
//! were measured several times.

use std::fmt::Write as _;
use std::path::Path;

use crate::support::{folder, said, truepose, write_blob};
use nalgebra::Vector3;
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

/// Writes NEW.csv of `columns`, what `more` says of each commanded tool point and its number.
fn new_table(
    folder: &Path,
    commands: &[[f64; 6]],
    columns: &str,
    mut more: impl FnMut(usize, Vector3<f64>) -> String,
) {
    let blob = write_blob(folder);
    let model = blob.model::<f64, 6>().unwrap();
    let mut csv = format!("q1,q2,q3,q4,q5,q6,{columns}\n");
    for (row, q) in commands.iter().enumerate() {
        let p = model.predict(q, &Conditions::default()).translation;
        let cells: Vec<String> = q.iter().map(ToString::to_string).collect();
        writeln!(csv, "{},{}", cells.join(","), more(row, p)).unwrap();
    }
    std::fs::write(folder.join("NEW.csv"), csv).unwrap();
}

#[test]
fn distances_between_poses_are_compared_as_they_are() {
    let folder = folder("verify-distance");
    let mut first = Vector3::zeros();
    new_table(&folder, &commands(80, 1), "pair,distance_mm", |row, p| {
        if row % 2 == 0 {
            first = p;
            return format!("{},", row / 2);
        }
        // every second distance 0.02 mm too long, the others too short
        let off = if row % 4 == 1 { 2e-5 } else { -2e-5 };
        format!("{},{}", row / 2, ((p - first).norm() + off) * 1e3)
    });
    let (status, out, err) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0, "{out}{err}");
    let v = json(&folder);
    assert_eq!(v["measured"], "distance");
    assert_eq!((&v["rows"], &v["realigned"]), (&40.into(), &false.into()));
    let after = v["error_mm"]["after"]["rms"].as_f64().unwrap();
    assert!((after - 0.02).abs() < 1e-9, "{v}");
    assert!(
        v["error_mm"]["before"]["rms"].as_f64().unwrap() > 0.1,
        "{v}"
    );
    // of two points, along one of three axes
    let tool = v["tool_point_mm"]["after"].as_f64().unwrap();
    assert!((tool - 0.02 * 1.5_f64.sqrt()).abs() < 1e-9, "{v}");
    assert!(
        out.contains("distance error") && out.contains("tool point"),
        "{out}"
    );
}

#[test]
fn touches_are_compared_where_their_point_and_planes_must_be() {
    let folder = folder("verify-touch");
    // The tool point is where it is: a plane through every three rows and a fourth, off it.
    let q = commands(1, 6);
    new_table(&folder, &q, "point", |_, _| "4".to_owned());
    let (status, out, err) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0, "{out}{err}");
    let v = json(&folder);
    // six times the same command: the point is there, for either model
    assert_eq!(v["measured"], "point");
    assert!(
        v["error_mm"]["after"]["max"].as_f64().unwrap() < 1e-9,
        "{v}"
    );
    assert!(
        v["error_mm"]["before"]["max"].as_f64().unwrap() < 1e-9,
        "{v}"
    );
    assert_eq!(v["realigned"], true);
    // One touch shows nothing of a point that is unknown.
    new_table(&folder, &q[..1], "point", |_, _| "4".to_owned());
    let (status, _, err) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 2);
    assert!(
        err.contains("1 rows with point 4") && err.contains("at least 2"),
        "{err}"
    );

    // Four corners of a tetrahedron: half of a quarter of its height above and below the plane
    // that fits them best, which no three of them lie in.
    let q = commands(4, 1);
    let mut corners = Vec::new();
    new_table(&folder, &q, "plane", |_, p| {
        corners.push(p);
        "1".to_owned()
    });
    let (status, out, err) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0, "{out}{err}");
    let after = json(&folder)["error_mm"]["after"]["rms"].as_f64().unwrap();
    let mean = corners.iter().sum::<Vector3<f64>>() / 4.0;
    let spread: nalgebra::Matrix3<f64> = (corners.iter())
        .map(|p| (p - mean) * (p - mean).transpose())
        .sum();
    // total least squares: the smallest eigenvalue is the sum of squared distances
    let least = spread.symmetric_eigenvalues().min();
    assert!((after - 1e3 * (least / 4.0).sqrt()).abs() < 1e-6, "{after}");
}

#[test]
fn bearings_are_compared_in_degrees_and_across_the_sight() {
    use truepose_host::identify::relation::bearing;
    let folder = folder("verify-bearing");
    let second = Pose::from_xyz_rpy(Vector3::new(2.0, 4.0, 0.3), Vector3::new(0.01, 0.0, -1.7));
    let sight = |station: &Pose<f64>, p: &Vector3<f64>, off: f64| {
        let [azimuth, elevation] = bearing(station, p);
        let elevation = (elevation + off).to_degrees();
        format!("{},{elevation}", azimuth.to_degrees())
    };
    let columns = "azimuth_deg,elevation_deg,azimuth2_deg,elevation2_deg";
    // where the world's own station is, and where it stands when it was moved
    let moved = Pose::from_xyz_rpy(Vector3::new(-3.0, 1.0, 0.2), Vector3::new(0.02, -0.01, 0.3));
    for (first, arguments) in [(Pose::identity(), &[][..]), (moved, &["--realign"][..])] {
        new_table(&folder, &commands(60, 1), columns, |row, p| {
            let off = if row % 2 == 0 { 1e-5 } else { -1e-5 };
            format!("{},{}", sight(&first, &p, off), sight(&second, &p, 0.0))
        });
        let all: Vec<&str> = VERIFY.iter().chain(arguments).copied().collect();
        let (status, out, err) = said(&truepose(&folder, &all));
        assert_eq!(status, 0, "{out}{err}");
        let v = json(&folder);
        assert_eq!(v["measured"], "bearing");
        let of = |which: &str, unit: &str| v[unit][which]["rms"].as_f64().unwrap();
        // half of the sights are 10 urad off; what is fitted takes a little of it
        let theory = (1e-5_f64 / 2.0_f64.sqrt()).to_degrees();
        let after = of("after", "error_deg");
        assert!(
            after > 0.8 * theory && after < 1.001 * theory,
            "{after} {theory}"
        );
        assert!(of("after", "error_mm") < 0.05, "{v}");
        assert!(
            of("before", "error_mm") > 5.0 * of("after", "error_mm"),
            "{v}"
        );
        assert!(
            out.contains("deg") && out.contains("across the sight"),
            "{out}"
        );
    }
    // A moved instrument that is not asked for shows.
    let (status, _, _) = said(&truepose(&folder, &VERIFY));
    assert_eq!(status, 0);
    assert!(json(&folder)["error_mm"]["after"]["rms"].as_f64().unwrap() > 100.0);
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
