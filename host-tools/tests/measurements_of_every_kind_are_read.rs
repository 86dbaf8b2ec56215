//! `identify` on files of distances, touches and bearings, by every estimator; what cannot be
//! meant is named.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::support::{folder, names, robot, said, truepose};
use nalgebra::Vector3;
use serde_json::Value;
use truepose::Pose;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::identify::relation::bearing;
use truepose_host::random::Random;

const UNIT: Sigmas = Sigmas::UNIT;

/// The arm of `support` as it was really built, seen from the instrument.
fn built(folder: &Path) -> ArmModel {
    let robot = robot(folder);
    let mut arm = ArmModel::drawn(&robot);
    let mut random = Random::new(1, 2);
    for joint in &mut arm.joints {
        joint.theta += random.between(-1e-3, 1e-3);
        joint.alpha += random.between(-1e-3, 1e-3);
        joint.a += random.between(-1e-3, 1e-3);
    }
    arm.bake();
    arm
}

fn postures(count: usize) -> Vec<Vec<f64>> {
    let mut random = Random::new(5, 6);
    let limits = [2.8, 1.9, 1.2, 2.7, 2.0, 3.0];
    let mut one = || limits.map(|l| random.between(-l, l)).to_vec();
    (0..count).map(|_| one()).collect()
}

/// Rows of `q1,...,q6` with whatever `more` says of the tool point.
fn table(
    arm: &ArmModel,
    rows: usize,
    columns: &str,
    mut more: impl FnMut(usize, Vector3<f64>, &mut Random) -> String,
) -> String {
    let mut text = format!("q1,q2,q3,q4,q5,q6,{columns}\n");
    let mut random = Random::new(9, 9);
    let mut evaluator = Evaluator::new(arm, UNIT);
    for (k, q) in postures(rows).into_iter().enumerate() {
        let o = Observation {
            direction: vec![0.0; 6],
            travel: vec![0.0; 6],
            q,
            ..Observation::default()
        };
        let p = evaluator.observe(&o).translation;
        for q in &o.q {
            let _ = write!(text, "{q},");
        }
        let _ = writeln!(text, "{}", more(k, p, &mut random));
    }
    text
}

fn distances(arm: &ArmModel, rows: usize) -> String {
    let mut before = Vector3::zeros();
    table(arm, rows, "pair,distance_mm", |k, p, random| {
        let first = k % 2 == 0;
        let apart = ((p - before).norm() + 2e-5 * random.normal()) * 1e3;
        before = p;
        match first {
            true => format!("{},", k / 2),
            false => format!("{},{apart}", k / 2),
        }
    })
}

fn bearings(arm: &ArmModel, rows: usize) -> String {
    let from = [
        Pose::from_xyz_rpy(Vector3::new(4.0, 1.0, 0.5), Vector3::new(0.0, 0.0, 3.0)),
        Pose::from_xyz_rpy(Vector3::new(2.0, 4.0, 0.3), Vector3::new(0.01, 0.0, -1.7)),
    ];
    table(
        arm,
        rows,
        "azimuth_deg,elevation_deg,azimuth2_deg,elevation2_deg",
        |_, p, random| {
            let see = |station: &Pose<f64>, random: &mut Random| {
                let [a, e] = bearing(station, &p);
                let noise = 5e-6;
                let a = (a + noise * random.normal()).to_degrees();
                let e = (e + noise * random.normal()).to_degrees();
                format!("{a},{e}")
            };
            format!("{},{}", see(&from[0], random), see(&from[1], random))
        },
    )
}

fn positions(arm: &ArmModel, rows: usize) -> String {
    table(arm, rows, "x_mm,y_mm,z_mm", |_, p, random| {
        let p = (p + Vector3::new(random.normal(), random.normal(), random.normal()) * 2e-5) * 1e3;
        format!("{},{},{}", p.x, p.y, p.z)
    })
}

fn identified(folder: &Path, more: &[&str]) -> (Value, String) {
    let mut arguments = vec![
        "identify",
        "--robot",
        "robot.toml",
        "--data",
        "d.csv",
        "--out",
        "p.tpb",
        "--json",
        "r.json",
    ];
    arguments.extend(more);
    let (status, out, err) = said(&truepose(folder, &arguments));
    assert_eq!(status, 0, "{out}{err}");
    let text = fs::read_to_string(folder.join("r.json")).unwrap();
    (serde_json::from_str(&text).unwrap(), out)
}

fn rms(report: &Value) -> f64 {
    report["error_mm"]["final"]["rms"].as_f64().unwrap()
}

#[test]
fn distances_between_poses() {
    let folder = folder("kinds-distance");
    let arm = built(&folder);
    fs::write(folder.join("d.csv"), distances(&arm, 400)).unwrap();
    fs::write(folder.join("d.toml"), "distance_sigma_um = 20\n").unwrap();
    let (report, out) = identified(&folder, &[]);
    assert_eq!(report["measured"], "distance");
    assert!(out.contains("where the arm stands"), "{out}");
    // 20 um of noise, and the parameters' own.
    assert!(
        rms(&report) > 0.015 && rms(&report) < 0.04,
        "{}",
        rms(&report)
    );
    assert!(report["error_mm"]["nominal"]["rms"].as_f64().unwrap() > 0.3);
    assert_eq!(report["verdict"], "nothing-missing");

    // what diagnoses reads them as well
    let _ = fs::remove_file(folder.join("p.tpb"));
    let files = ["--robot", "robot.toml", "--data", "d.csv", "--out", "p.tpb"];
    let json = ["--json", "r.json"];
    let (status, out, err) = said(&truepose(
        &folder,
        &[&["diagnose"][..], &files, &json].concat(),
    ));
    assert_eq!(status, 0, "{out}{err}");
    let report = fs::read_to_string(folder.join("r.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["measured"], "distance");
    assert_eq!(report["verdict"], "nothing-missing", "{out}");
    assert!(names(&folder).contains(&"p.tpb".to_owned()));

    // and plan goes on with the kind that was measured
    let more = ["--poses", "20", "--robot", "robot.toml", "--data", "d.csv"];
    let out = ["--out", "more.csv", "--json", "r.json"];
    let (status, said, err) = said(&truepose(&folder, &[&["plan"][..], &more, &out].concat()));
    assert_eq!(status, 0, "{said}{err}");
    let report = fs::read_to_string(folder.join("r.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(
        (&report["poses"], &report["measured_before"]),
        (&20.into(), &400.into())
    );
    let more = fs::read_to_string(folder.join("more.csv")).unwrap();
    assert!(more.starts_with("q1,q2,q3,q4,q5,q6,pair\n"), "{more}");
}

#[test]
fn bearings_of_two_theodolites() {
    let folder = folder("kinds-bearing");
    let arm = built(&folder);
    fs::write(folder.join("d.csv"), bearings(&arm, 120)).unwrap();
    fs::write(folder.join("d.toml"), "bearing_sigma_deg = 0.000286\n").unwrap();
    let (report, out) = identified(&folder, &[]);
    assert_eq!(report["measured"], "bearing");
    assert!(out.contains("proportions"), "{out}");
    // 5 urad at four metres, twice two of them.
    assert!(
        rms(&report) > 0.01 && rms(&report) < 0.06,
        "{}",
        rms(&report)
    );
    let parameters = report["parameters"].as_array().unwrap();
    let station = |p: &&Value| p["name"].as_str().unwrap().starts_with("station 2");
    assert_eq!(parameters.iter().filter(station).count(), 6);
}

#[test]
fn every_estimator_says_which_it_is_and_they_agree() {
    let folder = folder("kinds-estimators");
    let arm = built(&folder);
    fs::write(folder.join("d.csv"), positions(&arm, 100)).unwrap();
    fs::write(folder.join("d.toml"), "position_sigma_um = 20\n").unwrap();
    let mut first: Option<Vec<String>> = None;
    for name in [
        "levenberg-marquardt",
        "least-squares",
        "weighted-least-squares",
        "minimum-variance",
        "kalman",
    ] {
        // A prior so wide that it says nothing.
        let wide = [
            "--estimator",
            name,
            "--prior-mm",
            "100",
            "--prior-deg",
            "10",
        ];
        let takes_prior = ["minimum-variance", "kalman"].contains(&name);
        let (report, out) = identified(&folder, &wide[..if takes_prior { 6 } else { 2 }]);
        assert!(out.contains(&format!("estimator {name}")), "{out}");
        assert_eq!(report["estimator"]["name"], *name);
        let table = out.split("parameters identified").nth(1).unwrap();
        let lines = table.lines().take_while(|l| !l.contains("(base and tool"));
        // name, unit, value: the last printed digit
        let value = |line: &str| line.get(..58).map(str::to_owned);
        let values: Vec<String> = lines.skip(1).filter_map(value).collect();
        assert!(values.len() > 25, "{values:?}");
        match &first {
            None => first = Some(values),
            Some(first) => assert_eq!(&values, first, "{name}"),
        }
    }
    let (report, out) = identified(&folder, &["--loss", "tukey", "--bootstrap", "20"]);
    assert_eq!(report["estimator"]["loss"], "tukey");
    assert!(out.contains("20 fits of rows drawn anew"), "{out}");
    let parameters = report["parameters"].as_array().unwrap();
    assert!(
        parameters
            .iter()
            .any(|p| p["bootstrap"]["sigma"].as_f64().is_some())
    );

    // the covariance goes with the poses
    let arguments = [
        "predict", "--params", "p.tpb", "--data", "d.csv", "--out", "pred.csv", "--sigma", "r.json",
    ];
    let (status, out, err) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 0, "{out}{err}");
    let text = fs::read_to_string(folder.join("pred.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("x,y,z,qw,qx,qy,qz,sx,sy,sz,srx,sry,srz"));
    assert_eq!(lines.clone().count(), 100);
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        // microns, less than the noise of one measurement
        let sigma = cells[7];
        assert!(sigma > 1e-6 && sigma < 2e-5, "{line}");
    }
    let (status, _, err) = said(&truepose(
        &folder,
        &[
            "predict", "--params", "p.tpb", "--data", "d.csv", "--out", "x.csv", "--sigma", "d.csv",
        ],
    ));
    assert_eq!(status, 2);
    assert!(err.contains("d.csv:1") && err.contains("--json"), "{err}");

    for (wrong, says) in [
        (["--estimator", "newton"], "levenberg-marquardt"),
        (["--loss", "cauchy"], "huber"),
        (["--prior-mm", "3"], "minimum-variance"),
        (["--bootstrap", "1"], "at least 2"),
    ] {
        let mut arguments = vec![
            "identify",
            "--robot",
            "robot.toml",
            "--data",
            "d.csv",
            "--out",
            "n.tpb",
        ];
        arguments.extend(wrong);
        let (status, _, err) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2);
        assert!(err.contains(wrong[0]) && err.contains(says), "{err}");
        assert!(!names(&folder).contains(&"n.tpb".to_owned()));
    }
}

#[test]
fn a_running_number_called_point_stays_out_of_a_fit_of_positions() {
    let folder = folder("kinds-running");
    let arm = built(&folder);
    let text = positions(&arm, 60);
    let numbered: String = text
        .lines()
        .enumerate()
        .map(|(k, line)| match k {
            0 => format!("{line},point\n"),
            _ => format!("{line},{k}\n"),
        })
        .collect();
    fs::write(folder.join("d.csv"), numbered).unwrap();
    let arguments = [
        "identify",
        "--robot",
        "robot.toml",
        "--data",
        "d.csv",
        "--out",
        "p.tpb",
    ];
    let (status, out, err) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 0, "{err}");
    assert!(
        err.contains("point beside positions") && err.contains("contact_sigma_mm"),
        "{err}"
    );
    assert!(!out.contains("point 1 x"), "{out}");
}

#[test]
fn what_cannot_be_meant_is_named() {
    let folder = folder("kinds-bad");
    let arm = built(&folder);
    let good = distances(&arm, 100);
    let line = |k: usize, text: &str, cell: usize, to: &str| {
        let edit = |(i, l): (usize, &str)| {
            let mut cells: Vec<&str> = l.split(',').collect();
            if i == k {
                cells[cell] = to;
            }
            cells.join(",") + "\n"
        };
        text.lines().enumerate().map(edit).collect::<String>()
    };
    let sights = bearings(&arm, 60);
    let with_set = |text: &str| -> String {
        let add = |(i, l): (usize, &str)| match i {
            0 => format!("{l},set\n"),
            1 => format!("{l},verify\n"),
            _ => format!("{l},identify\n"),
        };
        text.lines().enumerate().map(add).collect()
    };
    for (table, says) in [
        (
            line(1, &good, 6, "70"),
            "row 2, column pair: found pair 0 on 1 rows (2)",
        ),
        (
            line(2, &good, 7, ""),
            "row 2, column distance: found no distance on either row of pair 0",
        ),
        (line(1, &good, 7, "1.0"), "one distance a pair"),
        (
            line(1, &good, 6, "0.5"),
            "row 1, column pair: found \"0.5\", expected an integer",
        ),
        (line(1, &good, 6, ""), "pair"),
        (line(2, &good, 7, "-3"), "row 2, column distance_mm"),
        (with_set(&good), "both rows of a pair in one set"),
        (good.replace("distance_mm", "apart"), "distance beside pair"),
        (good.replace("pair", "of"), "pair beside distance"),
        (line(3, &sights, 7, "89.5"), "row 3, column elevation_deg"),
        (
            sights.replace("elevation2_deg", "e2"),
            "elevation2: found no such column",
        ),
        (sights.replace("azimuth_deg", "azimuth"), "azimuth"),
    ] {
        fs::write(folder.join("d.csv"), &table).unwrap();
        let arguments = [
            "identify",
            "--robot",
            "robot.toml",
            "--data",
            "d.csv",
            "--out",
            "p.tpb",
        ];
        let (status, _, err) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2, "{says}: {err}");
        assert!(err.contains(says), "{says}: {err}");
        assert!(err.contains("d.csv"), "{err}");
        assert!(!names(&folder).contains(&"p.tpb".to_owned()));
    }
    for (sidecar, says) in [
        ("contact_sigma_mm = 0\n", "a standard deviation above zero"),
        ("bearing_sigma_mm = 1\n", "unknown key bearing_sigma_mm"),
        ("targets_known = 1\n", "true or false"),
    ] {
        fs::write(folder.join("d.csv"), &good).unwrap();
        fs::write(folder.join("d.toml"), sidecar).unwrap();
        let arguments = [
            "identify",
            "--robot",
            "robot.toml",
            "--data",
            "d.csv",
            "--out",
            "p.tpb",
        ];
        let (status, _, err) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2, "{sidecar}");
        assert!(err.contains("d.toml:1") && err.contains(says), "{err}");
    }
}
