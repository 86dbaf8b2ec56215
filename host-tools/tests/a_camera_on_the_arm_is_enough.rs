//! A camera on the tool sees a board that stands still, or points of which nobody knows where
//! they are: files of it go through every command.

use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use truepose::Pose;
use truepose_host::diagnose::input::{Finding, Kind, check};
use truepose_host::identify::align::best_fit;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::identify;
use truepose_host::identify::observation::Sigmas;
use truepose_host::identify::problem::{Joints, Problem};
use truepose_host::measurement::{Expected, Purpose, read};
use truepose_host::random::Random;

use crate::support::{ROBOT, folder, names, robot, said, truepose};

const LIMITS: [f64; 6] = [165.0, 110.0, 70.0, 160.0, 120.0, 180.0];
/// Noise of a board's pose, m and rad an axis.
const BOARD: [f64; 2] = [1e-4, 3e-4];
/// A tenth of a pixel at a focal length of 2000.
const PIXEL: f64 = 5e-5;
/// Points on and beside the board, in its own frame, m.
const POINTS: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [0.12, 0.0, 0.01],
    [0.0, 0.09, -0.02],
    [-0.1, -0.07, 0.05],
];

/// The arm of `support` as it was really built, in the frame of a board before it that faces
/// up; the tool is the camera, its z axis looking ahead, mounted as no drawing says.
fn built(folder: &Path, seed: u64) -> ArmModel {
    let mut arm = ArmModel::drawn(&robot(folder));
    let mut random = Random::new(seed, 7);
    for joint in &mut arm.joints {
        for &parameter in joint.parameters() {
            let off = random.between(-1e-3, 1e-3);
            // beta is no parameter of this arm; the longest length gives the scale of bearings
            let kept = parameter == truepose::Parameter::Beta || joint.d > 0.3;
            *joint.parameter_mut(parameter) += if kept { 0.0 } else { off };
        }
    }
    let board = Pose::from_xyz_rpy(Vector3::new(0.35, 0.1, 0.05), Vector3::new(0.05, 0.1, 0.4));
    arm.bases[0] = board.inverse();
    arm.tool = Pose::from_xyz_rpy(Vector3::new(0.05, 0.02, 0.09), Vector3::new(0.1, -0.2, 2.1));
    arm.bake();
    arm
}

/// Rows of `q1` to `q6` from which the middle of the board is in view, at most 20 deg off the
/// axis and from 0.2 to 0.9 m away; with the camera's pose in the board's frame.
fn views(arm: &ArmModel, count: usize, seed: u64) -> Vec<(Vec<f64>, Pose<f64>)> {
    let mut random = Random::new(seed, 8);
    let mut evaluator = Evaluator::new(arm, Sigmas::UNIT);
    let mut found = Vec::new();
    while found.len() < count {
        let q = LIMITS.map(|l| random.between(-l, l).to_radians());
        let none = vec![0.0; 6];
        let pose = evaluator.go(0, &q, &none, &truepose::effects::Ambient::default());
        let seen = pose.inverse().translation;
        let off_axis = seen.xy().norm().atan2(seen.z).to_degrees();
        let above = pose.translation.z > 0.1;
        if above && off_axis < 20.0 && (0.2..0.9).contains(&seen.norm()) {
            found.push((q.to_vec(), pose));
        }
    }
    found
}

fn joined(values: &[f64]) -> String {
    let cells: Vec<String> = values.iter().map(f64::to_string).collect();
    cells.join(",")
}

/// The table of the board's poses that the camera sees, in mm.
fn boards(views: &[(Vec<f64>, Pose<f64>)], noise: f64, seed: u64) -> String {
    let mut random = Random::new(seed, 9);
    let mut csv = String::from(
        "q1,q2,q3,q4,q5,q6,seen_x_mm,seen_y_mm,seen_z_mm,seen_qw,seen_qx,seen_qy,seen_qz\n",
    );
    for (q, camera) in views {
        let mut off = |sigma: f64| Vector3::from([0.0; 3].map(|_| noise * sigma * random.normal()));
        let board = camera.inverse();
        let at = (board.translation + off(BOARD[0])) * 1e3;
        let turn = Pose::from_rotation_vector(&off(BOARD[1])).rotation * board.rotation;
        let turn = Pose::new(turn, Vector3::zeros()).quaternion();
        csv += &format!(
            "{},{},{}\n",
            joined(q),
            joined(at.as_slice()),
            joined(&turn)
        );
    }
    csv
}

const SIDECAR: &str = "position_sigma_mm = 0.1\norientation_sigma_deg = 0.0171887\n";

fn run(folder: &Path, arguments: &[&str], status: i32) -> String {
    let (is, out, err) = said(&truepose(folder, arguments));
    assert_eq!(is, status, "{out}{err}");
    out + &err
}

/// Runs `command` on the table; its report and what it said.
fn reported(folder: &Path, command: &str) -> (Value, String) {
    let inputs = [command, "--robot", "robot.toml", "--data", "d.csv"];
    let outputs = ["--out", "p.tpb", "--json", "r.json"];
    let said = run(folder, &[&inputs[..], &outputs].concat(), 0);
    let text = fs::read_to_string(folder.join("r.json")).unwrap();
    (serde_json::from_str(&text).unwrap(), said)
}

/// What `predict` says of the table: tool points, and the tool's turns.
fn predicted(folder: &Path) -> Vec<Pose<f64>> {
    let inputs = ["predict", "--params", "p.tpb", "--data", "d.csv"];
    run(folder, &[&inputs[..], &["--out", "pred.csv"]].concat(), 0);
    let text = fs::read_to_string(folder.join("pred.csv")).unwrap();
    let pose = |line: &str| {
        let v: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let wxyz = [v[3], v[4], v[5], v[6]];
        Pose::from_quaternion(wxyz, Vector3::new(v[0], v[1], v[2])).unwrap()
    };
    text.lines().skip(1).map(pose).collect()
}

fn number(report: &Value, path: &str) -> f64 {
    let found = report.pointer(path).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no {path}"))
}

fn identified(report: &Value) -> usize {
    let parameters = report["parameters"].as_array().unwrap();
    let is = |p: &&Value| p["status"] == "identified";
    parameters.iter().filter(is).count()
}

#[test]
fn a_board_without_noise_gives_the_arm() {
    let folder = folder("camera-exact");
    let truth = built(&folder, 1);
    let views = views(&truth, 60, 1);
    fs::write(folder.join("d.csv"), boards(&views, 0.0, 1)).unwrap();
    fs::write(folder.join("d.toml"), SIDECAR).unwrap();
    let (report, out) = reported(&folder, "identify");
    assert_eq!(report["measured"], "board");
    // 4 R + 2 P + 6: a board shows all of it, and there is nothing else to find
    assert_eq!(identified(&report), 30, "{out}");
    for (found, (_, camera)) in predicted(&folder).iter().zip(&views) {
        let off = found.twist_to(camera);
        assert!(off.linear.norm() < 1e-9, "{} m", off.linear.norm());
        assert!(off.angular.norm() < 1e-9, "{} rad", off.angular.norm());
    }
}

#[test]
fn the_camera_may_sit_anywhere_and_see_more_than_the_board() {
    let folder = folder("camera-anywhere");
    let truth = built(&folder, 1);
    let views = views(&truth, 60, 1);
    fs::write(folder.join("d.toml"), SIDECAR).unwrap();
    let board = boards(&views, 0.0, 1);
    let pixels = pixels(&views, 0.0, 1);
    let place = "xyz_mm = [0.0, 10.0, 120.0]";
    for elsewhere in ["[250.0, -200.0, 0.0]", "[-300.0, 300.0, 300.0]"] {
        let file = folder.join("robot.toml");
        let drawn = ROBOT.replace(place, &format!("xyz_mm = {elsewhere}"));
        assert_ne!(drawn, ROBOT);
        fs::write(&file, drawn).unwrap();
        fs::write(folder.join("d.csv"), &board).unwrap();
        reported(&folder, "identify");
        for (found, (_, camera)) in predicted(&folder).iter().zip(&views) {
            assert!(found.twist_to(camera).linear.norm() < 1e-9, "{elsewhere}");
        }
        fs::write(folder.join("d.csv"), &pixels).unwrap();
        reported(&folder, "identify");
        let [far, _, turned] = off(&predicted(&folder), &views);
        assert!(far < 1e-8 && turned < 1e-8, "{far} m, {turned} rad");
    }
    // The board, and the bearing of a second point in its frame. Both are in the tool's axes,
    // and a bearing's look ahead along x.
    let turned: Vec<(Vec<f64>, Pose<f64>)> = views
        .iter()
        .map(|(q, camera)| (q.clone(), camera.then(&ahead())))
        .collect();
    let board = boards(&turned, 0.0, 1);
    let second = |line: &str| {
        line.split(',')
            .skip(8)
            .take(2)
            .collect::<Vec<_>>()
            .join(",")
    };
    let both = board.lines().zip(pixels.lines());
    let both: String = both.map(|(b, p)| format!("{b},{}\n", second(p))).collect();
    fs::write(folder.join("d.csv"), both).unwrap();
    let (report, out) = reported(&folder, "identify");
    assert_eq!(identified(&report), 33, "{out}");
    assert!(out.contains("point 1 here is point 2 of the file"), "{out}");
    for (axis, should) in ["x", "y", "z"].iter().zip(POINTS[1]) {
        let name = format!("point 1 {axis}");
        let parameters = report["parameters"].as_array().unwrap();
        let found = parameters
            .iter()
            .find(|p| p["name"] == name.as_str())
            .unwrap();
        assert!(
            (found["value"].as_f64().unwrap() - should).abs() < 1e-9,
            "{found}"
        );
    }
}

#[test]
fn a_board_gives_the_arm_as_exactly_as_its_noise_allows() {
    let folder = folder("camera-noise");
    let (mut square, mut seeds) = (0.0, 0.0);
    for seed in 1..=8 {
        let truth = built(&folder, seed);
        let views = views(&truth, 100, seed);
        fs::write(folder.join("d.csv"), boards(&views, 1.0, seed)).unwrap();
        fs::write(folder.join("d.toml"), SIDECAR).unwrap();
        let (report, out) = reported(&folder, "identify");
        assert_eq!(report["verdict"], "nothing-missing", "{out}");
        for (noise, sigma) in [("/noise_mm", 0.1), ("/noise_deg", 0.0171887)] {
            let estimated = number(&report, &format!("{noise}/estimated"));
            assert!((estimated / sigma - 1.0).abs() < 0.2, "{estimated} {sigma}");
        }
        // of the unseen rows three axes of noise, and the parameters' own
        let rms = number(&report, "/error_mm/final/rms");
        assert!(rms > 0.14 && rms < 0.25, "{rms}");
        let sigma = number(&report, "/model_sigma_mm/rms") * 1e-3;
        let off = predicted(&folder)
            .iter()
            .zip(&views)
            .map(|(found, (_, camera))| (found.translation - camera.translation).norm_squared())
            .sum::<f64>();
        square += off / views.len() as f64 / (sigma * sigma);
        seeds += 1.0;
    }
    // The error of the predicted tool over what the covariance says of it, which is the
    // Cramer-Rao bound: the squares of 30 parameters weigh unlike, as by a dozen or so alike.
    let ratio = (square / seeds).sqrt();
    assert!(ratio > 0.75 && ratio < 1.3, "{ratio}");
}

#[test]
fn every_command_takes_a_board() {
    let folder = folder("camera-commands");
    let mut truth = built(&folder, 2);
    let sight = views(&truth, 120, 2);
    fs::write(folder.join("d.csv"), boards(&sight, 1.0, 2)).unwrap();
    fs::write(folder.join("d.toml"), SIDECAR).unwrap();
    let (report, out) = reported(&folder, "diagnose");
    assert_eq!(report["measured"], "board");
    assert_eq!(report["verdict"], "nothing-missing", "{out}");
    assert!(out.contains("the board stood still"), "{out}");

    // new rows of the same board
    fs::write(folder.join("new.toml"), SIDECAR).unwrap();
    fs::write(
        folder.join("new.csv"),
        boards(&views(&truth, 40, 3), 1.0, 3),
    )
    .unwrap();
    let verify = [
        "verify", "--params", "p.tpb", "--data", "new.csv", "--json", "r.json",
    ];
    let verified = |more: &[&str]| -> Value {
        run(&folder, &[&verify[..], more].concat(), 0);
        serde_json::from_str(&fs::read_to_string(folder.join("r.json")).unwrap()).unwrap()
    };
    let still = verified(&["--accept-deg", "0.2"]);
    assert_eq!(still["measured"], "board");
    assert_eq!(still["accepted"], true);
    let after = number(&still, "/error_mm/after/rms");
    assert!(after > 0.13 && after < 0.27, "{after}");
    assert!(number(&still, "/error_mm/before/rms") > 5.0 * after);
    let turned = number(&still, "/error_deg/after/rms");
    assert!(turned > 0.024 && turned < 0.045, "{turned}");
    assert!(still.get("tool_point_mm").is_none());

    // the board was put elsewhere: that is to be said, and then costs nothing
    let moved = Pose::from_xyz_rpy(
        Vector3::new(0.05, -0.08, 0.02),
        Vector3::new(0.1, 0.2, -1.0),
    );
    truth.bases[0] = moved.then(&truth.bases[0]);
    truth.bake();
    fs::write(
        folder.join("new.csv"),
        boards(&views(&truth, 40, 3), 1.0, 3),
    )
    .unwrap();
    assert!(number(&verified(&[]), "/error_mm/after/rms") > 50.0);
    let found = verified(&["--realign"]);
    assert_eq!(found["realigned"], true);
    let after = number(&found, "/error_mm/after/rms");
    assert!(after > 0.12 && after < 0.27, "{after}");

    // two placements of the board are two sessions
    let session = |text: &str, number: usize| -> String {
        let rows = text.lines().skip(1);
        rows.map(|line| format!("{line},{number}\n")).collect()
    };
    let first = fs::read_to_string(folder.join("d.csv")).unwrap();
    let second = boards(&views(&truth, 60, 4), 1.0, 4);
    let header = format!("{},session\n", first.lines().next().unwrap());
    let both = header + &session(&first, 1) + &session(&second, 2);
    fs::write(folder.join("d.csv"), both).unwrap();
    let (report, out) = reported(&folder, "identify");
    assert_eq!(report["verdict"], "nothing-missing", "{out}");
    assert!(out.contains("2 placements of the board"), "{out}");
    assert_eq!(identified(&report), 36, "{out}");

    // which poses see the board is not known to `plan`
    let plan = [
        "plan",
        "--robot",
        "robot.toml",
        "--data",
        "d.csv",
        "--poses",
        "10",
    ];
    for more in [
        &["--out", "more.csv"][..],
        &["--out", "more.csv", "--discriminate"],
    ] {
        let said = run(&folder, &[&plan[..], more].concat(), 2);
        assert!(said.contains("d.csv") && said.contains("in view"), "{said}");
        assert!(!names(&folder).contains(&"more.csv".to_owned()));
    }
}

/// Writes the table of a board's poses with `change` done to their cells.
fn changed(folder: &Path, seed: u64, rows: usize, change: &dyn Fn(usize, &mut Vec<f64>)) {
    let truth = built(folder, seed);
    let table = boards(&views(&truth, rows, seed), 1.0, seed);
    let mut lines = table.lines();
    let mut csv = format!("{}\n", lines.next().unwrap());
    let rows = lines.map(|line| line.split(',').map(|x| x.parse().unwrap()).collect());
    let mut rows: Vec<Vec<f64>> = rows.collect();
    rows.iter_mut()
        .enumerate()
        .for_each(|(i, row)| change(i, row));
    rows.iter().for_each(|row| csv += &(joined(row) + "\n"));
    fs::write(folder.join("d.csv"), csv).unwrap();
    fs::write(folder.join("d.toml"), SIDECAR).unwrap();
}

/// What the check of the input says of such a table.
fn suspected(folder: &Path, change: &dyn Fn(usize, &mut Vec<f64>)) -> Vec<Finding> {
    changed(folder, 4, 60, change);
    let robot = robot(folder);
    let data = read(&folder.join("d.csv"), &Expected::of(&robot), Purpose::Fit).unwrap();
    let problem = Problem::new(&robot, &data, Joints::Readings, Vec::new());
    let fitted = identify(&problem).ok();
    check(
        &problem,
        &data,
        &robot,
        fitted.as_ref().map(|f| &f.geometric),
    )
}

fn seen(row: &[f64]) -> Pose<f64> {
    let at = Vector3::new(row[6], row[7], row[8]) * 1e-3;
    Pose::from_quaternion([row[9], row[10], row[11], row[12]], at).unwrap()
}

fn write(row: &mut [f64], pose: &Pose<f64>) {
    row[6..9].copy_from_slice((pose.translation * 1e3).as_slice());
    row[9..].copy_from_slice(&pose.quaternion());
}

#[test]
fn poses_of_a_board_that_are_written_wrongly_are_found() {
    let folder = folder("camera-input");
    assert_eq!(suspected(&folder, &|_, _| {}), []);
    type Change<'a> = &'a dyn Fn(usize, &mut Vec<f64>);
    let faults: [(Change<'_>, Kind, &str); 6] = [
        // the camera in the board's frame
        (
            &|_, row| {
                let camera = seen(row).inverse();
                write(row, &camera);
            },
            Kind::RotationConvention,
            "of the camera in the board's frame",
        ),
        (
            &|_, row| row[10..].iter_mut().for_each(|x| *x = -*x),
            Kind::RotationConvention,
            "of the inverse rotation",
        ),
        (
            &|_, row| row[9..].rotate_left(1),
            Kind::RotationConvention,
            "in the order x y z w",
        ),
        (
            &|_, row| row[6..9].iter_mut().for_each(|x| *x *= 10.0),
            Kind::WrongUnit,
            "seen_x, seen_y, seen_z in another unit",
        ),
        (&|_, row| row[2] = -row[2], Kind::WrongSign, "q3 counts"),
        (&|_, row| row.swap(1, 2), Kind::ExchangedJoints, "q2 and q3"),
    ];
    for (change, kind, says) in faults {
        let found = suspected(&folder, change);
        let kinds: Vec<Kind> = found.iter().map(|f| f.kind).collect();
        assert_eq!(kinds, [kind], "{says}: {found:#?}");
        assert!(found[0].saw.contains(says), "{says}: {found:#?}");
    }
    // where no fit settles the command says why
    changed(&folder, 8, 100, faults[0].0);
    for command in ["identify", "diagnose"] {
        let inputs = [command, "--robot", "robot.toml", "--data", "d.csv"];
        let out = run(&folder, &[&inputs[..], &["--out", "p.tpb"]].concat(), 2);
        for says in ["d.csv: seen_x, seen_y", "write their inverses"] {
            assert!(out.contains(says), "{says}: {out}");
        }
    }
}

/// The table of the bearings of [`POINTS`] in a camera's image, blank where one is out of view,
/// by the formula of docs/MEASUREMENTS.md.
fn pixels(views: &[(Vec<f64>, Pose<f64>)], noise: f64, seed: u64) -> String {
    let mut random = Random::new(seed, 10);
    let names = ["", "2", "3", "4"].map(|n| format!("seen_azimuth{n}_deg,seen_elevation{n}_deg"));
    let mut csv = format!("q1,q2,q3,q4,q5,q6,{}\n", names.join(","));
    for (q, camera) in views {
        let cells = POINTS.map(|point| {
            let p = camera.inverse().point(&Vector3::from(point));
            let [r, s] = [p.x / p.z, p.y / p.z].map(|x| x + noise * PIXEL * random.normal());
            let inside = p.z > 0.0 && r.abs() < 0.45 && s.abs() < 0.35;
            let angles = [(-r).atan2(1.0), (-s).atan2(r.hypot(1.0))].map(f64::to_degrees);
            if inside {
                joined(&angles)
            } else {
                ",".to_owned()
            }
        });
        csv += &format!("{},{}\n", joined(q), cells.join(","));
    }
    csv
}

/// The camera's frame as bearings have it: x ahead, y to the left, z up.
fn ahead() -> Pose<f64> {
    let turn = Matrix3::from_columns(&[Vector3::z(), -Vector3::x(), -Vector3::y()]);
    Pose::new(turn, Vector3::zeros())
}

/// Largest and root mean square distance of predicted cameras from the true ones, m, and the
/// largest angle, rad, once the arms are laid upon one another: where it stands does not show.
fn off(found: &[Pose<f64>], views: &[(Vec<f64>, Pose<f64>)]) -> [f64; 3] {
    let points = |poses: &mut dyn Iterator<Item = &Pose<f64>>| -> Vec<Vector3<f64>> {
        poses.map(|pose| pose.translation).collect()
    };
    let from = points(&mut found.iter());
    let to = points(&mut views.iter().map(|(_, camera)| camera));
    let place = best_fit(&from, &to).unwrap();
    let mut worst = [0.0_f64; 2];
    let mut square = 0.0;
    for (found, (_, camera)) in found.iter().zip(views) {
        let off = place.then(found).twist_to(&camera.then(&ahead()));
        let (far, turned) = (off.linear.norm(), off.angular.norm());
        worst = [worst[0].max(far), worst[1].max(turned)];
        square += far * far;
    }
    [worst[0], (square / views.len() as f64).sqrt(), worst[1]]
}

#[test]
fn pixels_of_unknown_points_give_the_arm() {
    let folder = folder("camera-pixels");
    let truth = built(&folder, 5);
    let views = views(&truth, 120, 5);
    fs::write(folder.join("d.toml"), "bearing_sigma_deg = 0.0028648\n").unwrap();

    fs::write(folder.join("d.csv"), pixels(&views, 0.0, 5)).unwrap();
    let (report, out) = reported(&folder, "identify");
    assert_eq!(report["measured"], "sight");
    for why in ["proportions", "where the arm stands", "point 4 x"] {
        assert!(out.contains(why), "{why}: {out}");
    }
    let [far, _, turned] = off(&predicted(&folder), &views);
    assert!(far < 1e-8 && turned < 1e-8, "{far} m, {turned} rad");

    let csv = pixels(&views, 1.0, 5);
    assert!(csv.contains(",,"), "every point is in view everywhere");
    fs::write(folder.join("d.csv"), csv).unwrap();
    let (report, out) = reported(&folder, "diagnose");
    assert_eq!(report["verdict"], "nothing-missing", "{out}");
    let estimated = number(&report, "/noise_deg/estimated");
    // an angle of the field of view is a little less than its pixels over the focal length
    assert!(estimated > 0.0022 && estimated < 0.0031, "{estimated}");
    let sigma = number(&report, "/model_sigma_mm/rms") * 1e-3;
    let [_, rms, turned] = off(&predicted(&folder), &views);
    assert!(rms < 1.5 * sigma && sigma < 1e-3, "{rms} m, {sigma} m");
    assert!(turned < 2e-3, "{turned}");

    // verify finds the points first
    let verify = [
        "verify", "--params", "p.tpb", "--data", "d.csv", "--json", "v.json",
    ];
    run(&folder, &verify, 0);
    let text = fs::read_to_string(folder.join("v.json")).unwrap();
    let verified: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        (&verified["measured"], &verified["realigned"]),
        (&"sight".into(), &true.into())
    );
    let [before, after] =
        ["/error_deg/before/rms", "/error_deg/after/rms"].map(|path| number(&verified, path));
    assert!(after < 0.0045 && before > 5.0 * after, "{before} {after}");
}

#[test]
fn what_cannot_be_meant_is_named() {
    let folder = folder("camera-bad");
    let truth = built(&folder, 3);
    let views = views(&truth, 30, 3);
    let good = boards(&views, 1.0, 3);
    let sights = pixels(&views, 0.0, 3);
    let cell = |text: &str, row: usize, cell: usize, to: &str| -> String {
        let edit = |(i, line): (usize, &str)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if i == row {
                cells[cell] = to;
            }
            cells.join(",") + "\n"
        };
        text.lines().enumerate().map(edit).collect()
    };
    let named = |from: &str, to: &str| good.replacen(from, to, 1);
    for (table, says) in [
        (
            named("seen_qw", "w"),
            "d.csv:1: seen_qw: found no such column",
        ),
        (
            named("seen_y_mm", "y_mm"),
            "d.csv:1: y_mm: found y_mm beside seen_x_mm",
        ),
        (
            named("seen_y_mm", "other"),
            "d.csv:1: seen_y: found no such column",
        ),
        (
            named("seen_x_mm", "seen_x_deg"),
            "d.csv:1: seen_x_deg: found the unit suffix _deg",
        ),
        (named("seen_x_mm", "seen_x_mm,seen_x"), "each quantity once"),
        (good.replace("_mm", ""), "name the columns seen_x_mm"),
        (cell(&good, 4, 9, "2.0"), "row 4, column seen_qw, seen_qx"),
        (
            cell(&good, 2, 7, "far"),
            "row 2, column seen_y_mm: found \"far\"",
        ),
        (
            cell(&sights, 3, 7, "89.5"),
            "row 3, column seen_elevation_deg",
        ),
        (cell(&sights, 3, 6, "1e3"), "row 3, column seen_azimuth_deg"),
        (
            sights.replace("seen_azimuth2_deg", "a2"),
            "d.csv:1: seen_azimuth2: found no such",
        ),
        (
            sights.replace("seen_azimuth3_deg", "length"),
            "length beside seen_azimuth",
        ),
        (
            sights.replace("2_deg", "9_deg"),
            "d.csv:1: seen_x2: found no such column",
        ),
    ] {
        fs::write(folder.join("d.csv"), &table).unwrap();
        let inputs = ["identify", "--robot", "robot.toml", "--data", "d.csv"];
        let out = run(&folder, &[&inputs[..], &["--out", "p.tpb"]].concat(), 2);
        assert!(out.contains(says) && out.contains("d.csv"), "{says}: {out}");
        assert!(!names(&folder).contains(&"p.tpb".to_owned()));
    }
}
