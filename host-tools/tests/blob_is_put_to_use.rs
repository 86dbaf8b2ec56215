//! `inspect` and `predict` say and compute what the blob holds.

use std::fs;

use crate::support::{folder, names, said, truepose, write_blob};
use truepose::Pose;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::effects::{Ambient, Conditions};
use truepose::params::Blob;
use truepose_host::measurement::{Expected, Purpose, read};

#[test]
fn inspect_says_what_was_identified() {
    let folder = folder("inspect");
    write_blob(&folder);
    let (status, text, talk) = said(&truepose(
        &folder,
        &["inspect", "P.tpb", "--json", "I.json"],
    ));
    assert_eq!((status, talk.as_str()), (0, ""));
    for line in [
        "six: 6 joints; ",
        "from tracker.csv by truepose 0.1.0, 2020-02-02: 70 rows fitted, 30 held back",
        "rms position error of the rows held back: 1.210 mm before, 0.050 mm after",
        "base yaw                 30.0000       30.0000     +0.0000 deg",
        "joint 1 theta             0.0000       -0.0063     -0.0063 deg",
        "joint 1 d               290.0000      290.1210     +0.1210 mm",
        "gear-eccentricity of joint 2, order 1: cos -1.000e-4 rad sin 3.100e-4 rad",
        "joint-compliance of joint 3: compliance 2.000e-5 rad/(N m)",
        "joint 4: revolute, -160.0 to 160.0 deg, steps of 0.00100 deg",
        "joint 6: revolute, no limits",
        "compensation: inverse-jacobian, at most 8 iterations",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
    let json = fs::read_to_string(folder.join("I.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["joints"].as_array().unwrap().len(), 6);
    assert_eq!(json["effects"][0]["joint"], 2);
    assert_eq!(json["effects"][0]["parameters"]["sin"], 3.1e-4);
    assert_eq!(json["rows"]["verify"], 30);
    let d = &json["parameters"][7];
    assert_eq!(d["name"], "joint 1 d");
    assert!((d["value"].as_f64().unwrap() - 0.290_121).abs() < 1e-12);
}

#[test]
fn predict_writes_a_pose_for_each_row_with_the_model_of_the_controller() {
    let folder = folder("predict");
    let blob = write_blob(&folder);
    let table = "# nothing measured here
q1,q2,q3,q4,q5,q6,payload
0,0,0,0,0,0,0
0.1,-0.2,0.3,-0.4,0.5,-0.6,2.5
-1.5,1.0,-1.2,2.0,-1.0,3.0,0
";
    fs::write(folder.join("D.csv"), table).unwrap();
    let arguments = [
        "predict", "--params", "P.tpb", "--data", "D.csv", "--out", "PRED.csv",
    ];
    let (status, text, talk) = said(&truepose(&folder, &arguments));
    assert_eq!((status, talk.as_str()), (0, ""));
    assert_eq!(
        text,
        "six: 3 poses predicted from D.csv, written to PRED.csv\n"
    );
    let csv = fs::read_to_string(folder.join("PRED.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("x,y,z,qw,qx,qy,qz"));
    let model = blob.model::<f64, 6>().unwrap();
    for (q, payload) in [
        ([0.0; 6], 0.0),
        ([0.1, -0.2, 0.3, -0.4, 0.5, -0.6], 2.5),
        ([-1.5, 1.0, -1.2, 2.0, -1.0, 3.0], 0.0),
    ] {
        let conditions = Conditions {
            direction: [0.0; 6],
            ambient: Ambient {
                payload,
                ..Ambient::default()
            },
        };
        let wanted = model.predict(&q, &conditions);
        let numbers = lines.next().unwrap().split(',').map(|n| n.parse().unwrap());
        let numbers: Vec<f64> = numbers.collect();
        let [x, y, z, qw, qx, qy, qz] = numbers[..] else {
            panic!("{numbers:?}")
        };
        let found = Pose::from_quaternion([qw, qx, qy, qz], [x, y, z].into()).unwrap();
        // Printed in full, so only the quaternion rounds.
        let off = found.twist_to(&wanted);
        assert!(
            off.linear.norm() < 1e-15 && off.angular.norm() < 1e-14,
            "{off:?}"
        );
    }
    assert_eq!(lines.next(), None);
}

/// Joints within the limits of the arm, well away from its singular poses, and the poses that
/// they nominally reach, as a table of targets.
fn targets(blob: &Blob<'_>) -> (Vec<Pose<f64>>, String) {
    let model = blob.model::<f64, 6>().unwrap();
    let mut table = String::from("q1,q2,q3,q4,q5,q6,x_mm,y_mm,z_mm,qw,qx,qy,qz,payload\n");
    let mut poses = Vec::new();
    for k in 0..20 {
        let at = |speed: f64, middle: f64, half: f64| middle + half * (speed * f64::from(k)).sin();
        let q = [
            at(1.0, 0.0, 2.0),
            at(1.7, 0.3, 0.5),
            at(2.3, -0.3, 0.4),
            at(3.1, 0.0, 2.0),
            at(0.7, 1.2, 0.4),
            at(1.3, 0.0, 2.5),
        ];
        let pose = model.nominal_pose(&q);
        let p = pose.translation * 1e3;
        let [w, x, y, z] = pose.quaternion();
        for q in q {
            table += &format!("{q},");
        }
        table += &format!("{},{},{},{w},{x},{y},{z},1.5\n", p.x, p.y, p.z);
        poses.push(pose);
    }
    (poses, table)
}

#[test]
fn compensated_commands_take_the_calibrated_arm_to_the_targets() {
    let folder = folder("compensate");
    let blob = write_blob(&folder);
    let (poses, table) = targets(&blob);
    fs::write(folder.join("T.csv"), table).unwrap();
    let model = blob.model::<f64, 6>().unwrap();
    let mut conditions = Conditions::default();
    conditions.ambient.payload = 1.5;
    // Converged means 1 um and 1 urad by the model's own prediction; in f32 that prediction
    // itself rounds by as much.
    for (precision, position, orientation) in [("f64", 1e-6, 1e-6), ("f32", 2e-6, 5e-6)] {
        let (status, text, talk) = said(&truepose(
            &folder,
            &[
                "compensate",
                "--params",
                "P.tpb",
                "--targets",
                "T.csv",
                "--out",
                "C.csv",
                "--method",
                "inverse-jacobian",
                "--precision",
                precision,
                "--json",
                "C.json",
            ],
        ));
        assert_eq!((status, talk.as_str()), (0, ""));
        let first = format!("six: 20 targets by inverse-jacobian in {precision}, written to C.csv");
        assert_eq!(text.lines().next(), Some(first.as_str()));
        let csv = fs::read_to_string(folder.join("C.csv")).unwrap();
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some("q1,q2,q3,q4,q5,q6,converged,iterations"));
        for (pose, line) in poses.iter().zip(lines.by_ref()) {
            let numbers: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
            let [q1, q2, q3, q4, q5, q6, converged, iterations] = numbers[..] else {
                panic!("{line}")
            };
            let off = model
                .predict(&[q1, q2, q3, q4, q5, q6], &conditions)
                .twist_to(pose);
            assert!(off.linear.norm() < position, "{line}: {off:?}");
            assert!(off.angular.norm() < orientation, "{line}: {off:?}");
            assert!(converged > 0.5 || precision == "f32", "{line}");
            assert!((1.0..=3.0).contains(&iterations), "{line}");
        }
        assert_eq!(lines.next(), None);
        let json = fs::read_to_string(folder.join("C.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["targets"], 20);
        // The parameters are off by some tenths of a mm each.
        assert!(json["largest_before"]["mm"].as_f64().unwrap() > 0.3);
    }
}

#[test]
fn single_precision_commands_are_the_bits_of_the_controller() {
    let folder = folder("bits");
    let blob = write_blob(&folder);
    let (_, table) = targets(&blob);
    fs::write(folder.join("T.csv"), table).unwrap();
    let arguments = [
        "compensate",
        "--params",
        "P.tpb",
        "--targets",
        "T.csv",
        "--out",
        "C.csv",
    ];
    let (status, ..) = said(&truepose(
        &folder,
        &[&arguments[..], &["--precision", "f32"]].concat(),
    ));
    assert_eq!(status, 0);
    let csv = fs::read_to_string(folder.join("C.csv")).unwrap();
    let model = blob.model::<f32, 6>().unwrap();
    let file = folder.join("T.csv");
    let read = read(&file, &Expected::of_blob(&blob), Purpose::Targets).unwrap();
    let mut conditions = Conditions::default();
    conditions.ambient.payload = 1.5;
    for (line, row) in csv.lines().skip(1).zip(&read.rows) {
        let q: [f64; 6] = row.q[..].try_into().unwrap();
        let pose = row.pose().unwrap().cast();
        let request = Request::pose(pose, q.map(|q| q as f32)).conditions(conditions);
        let outcome = Compensator::new(&model).correct(&request, &mut Budget::unlimited());
        let numbers = line.split(',').take(6).map(|n| n.parse::<f32>().unwrap());
        let found: Vec<u32> = numbers.map(f32::to_bits).collect();
        assert_eq!(found, outcome.q.map(f32::to_bits));
    }
    assert_eq!(read.rows.len(), 20);
}

#[test]
fn an_unknown_method_is_refused_with_those_that_there_are() {
    let folder = folder("method");
    let arguments = [
        "compensate",
        "--params",
        "P.tpb",
        "--targets",
        "T.csv",
        "--out",
        "C.csv",
        "--method",
        "magic",
    ];
    let (status, _, talk) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 2);
    assert!(
        talk.contains("'magic'") && talk.contains("inverse-jacobian"),
        "{talk}"
    );
}

#[test]
fn a_blob_that_is_none_is_refused_and_nothing_written() {
    let folder = folder("no_blob");
    write_blob(&folder);
    let mut bytes = fs::read(folder.join("P.tpb")).unwrap();
    fs::write(folder.join("empty.tpb"), "").unwrap();
    fs::write(folder.join("text.tpb"), "this is a text, not a blob at all").unwrap();
    bytes[100] ^= 1;
    fs::write(folder.join("flipped.tpb"), &bytes).unwrap();
    fs::write(folder.join("D.csv"), "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n").unwrap();
    let before = names(&folder);
    for (file, expected) in [
        (
            "empty.tpb",
            "error: empty.tpb: 0 bytes are too few for a blob\n",
        ),
        ("text.tpb", "error: text.tpb: not a truepose blob\n"),
        (
            "flipped.tpb",
            "error: flipped.tpb: the checksum is wrong: the blob has been altered\n",
        ),
        (
            "none.tpb",
            "error: none.tpb: cannot be read: No such file or directory (os error 2)\n",
        ),
        (
            ".",
            "error: .: found a directory, expected a .tpb file; name the file in it\n",
        ),
    ] {
        let inspect = truepose(&folder, &["inspect", file, "--json", "I.json"]);
        assert_eq!(said(&inspect), (2, String::new(), expected.to_owned()));
        let arguments = [
            "predict", "--params", file, "--data", "D.csv", "--out", "PRED.csv",
        ];
        let predict = truepose(&folder, &arguments);
        assert_eq!(said(&predict), (2, String::new(), expected.to_owned()));
    }
    assert_eq!(names(&folder), before);
}
