//! Circle point analysis: fits, extraction, and from sweeps alone to a calibrated arm.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::fs;

use nalgebra::{Vector2, Vector3};
use truepose::{Convention, JointKind, Pose};
use truepose_host::cell::{Arm, Cell};
use truepose_host::circle_points::fits::{circle, line, plane};
use truepose_host::circle_points::sklar::{common_normal, mutual_moment};
use truepose_host::circle_points::{Failure, Method, analyse, describe};
use truepose_host::convert::{Axis, Form, ZeroPosition, convert};
use truepose_host::description::Robot;
use truepose_host::measurement::{self, Expected, Purpose};
use truepose_host::random::Random;

use crate::support::{folder, said, truepose};
use crate::synthetic::{self, anywhere, arm};

fn vector(random: &mut Random, size: f64) -> Vector3<f64> {
    Vector3::new(random.normal(), random.normal(), random.normal()) * size
}

/// Mean over seeds of (error / standard error) squared, which is 1 if the latter is right.
fn calibration(errors: impl Iterator<Item = (f64, f64)>) -> f64 {
    let ratios: Vec<f64> = errors
        .map(|(error, sigma)| (error / sigma).powi(2))
        .collect();
    ratios.iter().sum::<f64>() / ratios.len() as f64
}

/// 400 draws, a chi-square of as many: within 4 of its standard deviations.
const RIGHT: std::ops::Range<f64> = 0.72..1.28;

#[test]
fn fits_find_what_was_drawn_with_the_errors_that_they_say() {
    let noise = 1e-4;
    let (mut tilts, mut lines, mut centers) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..400 {
        let mut random = Random::new(seed, 0);
        let place = anywhere(&mut random);
        let z = place.rotation.column(2).into_owned();
        // Two thirds of a circle of half a metre.
        let drawn: Vec<Vector3<f64>> = (0..25)
            .map(|k| {
                let angle = 4.0 * f64::from(k) / 24.0;
                place.point(&Vector3::new(0.5 * angle.cos(), 0.5 * angle.sin(), 0.0))
            })
            .collect();
        let measured: Vec<_> = drawn
            .iter()
            .map(|p| p + vector(&mut random, noise))
            .collect();
        let exact = plane(&drawn).unwrap();
        assert!(exact.normal.cross(&z).norm() < 1e-12);
        let fit = plane(&measured).unwrap();
        let sign = fit.normal.dot(&z).signum();
        // A turn towards an axis of the plane shows as that component of the true normal.
        let scale = noise / fit.sigma;
        for (axis, error) in fit.axes.iter().zip(fit.normal_errors) {
            tilts.push((sign * z.dot(axis), error * scale));
        }
        let straight: Vec<_> = (0..25)
            .map(|k| place.translation + z * (0.04 * f64::from(k)) + vector(&mut random, noise))
            .collect();
        let fit = line(&straight).unwrap();
        let across = place.rotation.column(0).dot(&fit.direction) * fit.direction.dot(&z).signum();
        lines.push((across, fit.direction_error * noise / fit.sigma));

        let flat: Vec<Vector2<f64>> = (0..25)
            .map(|k| {
                let angle = 4.0 * f64::from(k) / 24.0;
                let r = Vector2::new(0.5 * angle.cos() + 0.7, 0.5 * angle.sin() - 3.0);
                r + Vector2::new(random.normal(), random.normal()) * noise
            })
            .collect();
        let fit = circle(&flat).unwrap();
        assert!((fit.radius - 0.5).abs() < 1e-3);
        let off = fit.center - Vector2::new(0.7, -3.0);
        for k in 0..2 {
            centers.push((off[k], noise * fit.cofactor[(k, k)].sqrt()));
        }
    }
    for (name, errors) in [("plane", tilts), ("line", lines), ("circle", centers)] {
        let ratio = calibration(errors.into_iter());
        assert!(RIGHT.contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn circles_are_fitted_by_distance_and_not_by_squared_distance() {
    // The linear fit 4.263 is drawn towards the points of a short arc; the radial one is not.
    let (mut ours, mut linear) = (0.0, 0.0);
    let mut random = Random::new(1, 1);
    for _ in 0..300 {
        let points: Vec<Vector2<f64>> = (0..20)
            .map(|k| {
                let angle = 0.9 * f64::from(k) / 19.0;
                Vector2::new(angle.cos(), angle.sin())
                    + Vector2::new(random.normal(), random.normal()) * 4e-3
            })
            .collect();
        ours += circle(&points).unwrap().radius - 1.0;
        let a = nalgebra::DMatrix::from_fn(20, 3, |i, k| if k < 2 { points[i][k] } else { 1.0 });
        let w = nalgebra::DVector::from_fn(20, |i, _| points[i].norm_squared());
        let s = a.svd(true, true).solve(&w, 1e-12).unwrap();
        linear += (s[2] + (s[0] * s[0] + s[1] * s[1]) / 4.0).sqrt() - 1.0;
    }
    let (ours, linear) = (ours / 300.0, linear / 300.0);
    assert!(
        linear < -0.01 && ours.abs() < 0.3 * linear.abs(),
        "{ours} {linear}"
    );
}

#[test]
fn shapes_that_are_none_are_refused() {
    let points: Vec<Vector3<f64>> = (0..6).map(|k| Vector3::x() * f64::from(k)).collect();
    assert_eq!(plane(&points), None);
    assert_eq!(plane(&points[..3]), None);
    assert_eq!(line(&points[..2]), None);
    assert_eq!(line(&[Vector3::y(); 5]), None);
    let flat: Vec<Vector2<f64>> = (0..6).map(|k| Vector2::x() * f64::from(k)).collect();
    assert_eq!(circle(&flat[..3]), None);
    assert_eq!(circle(&[Vector2::y(); 5]), None);
}

fn axis(direction: [f64; 3], point: [f64; 3]) -> Axis {
    Axis {
        kind: JointKind::Revolute,
        direction: Vector3::from(direction).normalize(),
        point: point.into(),
    }
}

#[test]
fn mutual_moment_tells_skew_meeting_and_parallel_axes() {
    let z = axis([0., 0., 1.], [0.2, 0.0, 5.0]);
    // Skew: 0.3 along x, turned by a right angle about it.
    let skew = axis([0., -1., 0.], [0.5, 7.0, 1.0]);
    let normal = common_normal(&z, &skew);
    assert!((mutual_moment(&z, &skew) + normal.length * normal.twist.sin()).abs() < 1e-12);
    assert!((normal.length - 0.3).abs() < 1e-12 && (normal.twist - FRAC_PI_2).abs() < 1e-12);
    assert!((normal.direction - Vector3::x()).norm() < 1e-12);
    assert!((normal.on_first - Vector3::new(0.2, 0.0, 1.0)).norm() < 1e-12);
    assert!((normal.on_second - Vector3::new(0.5, 0.0, 1.0)).norm() < 1e-12);
    // The same pair, twist beyond half a turn: the normal still goes from first to second.
    let other = common_normal(&z, &axis([0., 1., 0.], [0.5, 7.0, 1.0]));
    assert!((other.direction - Vector3::x()).norm() < 1e-12);
    assert!((other.twist + FRAC_PI_2).abs() < 1e-12 && (other.length - 0.3).abs() < 1e-12);
    let meets = axis([0., -1., 0.], [0.2, 7.0, 1.0]);
    assert!(mutual_moment(&z, &meets).abs() < 1e-12);
    let normal = common_normal(&z, &meets);
    assert!(normal.length < 1e-12 && (normal.on_first - normal.on_second).norm() < 1e-12);
    for sign in [1.0, -1.0] {
        let parallel = axis([0., 0., sign], [0.2, 0.4, 2.0]);
        assert!(mutual_moment(&z, &parallel).abs() < 1e-12);
        let normal = common_normal(&z, &parallel);
        assert!((normal.length - 0.4).abs() < 1e-12);
        assert!((normal.direction - Vector3::y()).norm() < 1e-12);
        assert!((normal.twist.cos() - sign).abs() < 1e-12);
    }
}

#[test]
fn stone_and_sklar_and_conversion_agree() {
    for kinds in ["RRRRRR", "RRPRRR", "PRPR", "RRRRRRR"] {
        for parallel in [&[][..], &[1], &[0, 2]] {
            for seed in 0..5 {
                let model = arm(Convention::ZeroReference, kinds, parallel, seed);
                let base = anywhere(&mut Random::new(seed, 7));
                let target = Vector3::new(0.3, 0.8, -0.4);
                let robot = Robot {
                    name: String::new(),
                    base: Pose::identity(),
                    joints: (model.joints.iter())
                        .map(|joint| truepose_host::description::RobotJoint {
                            joint: *joint,
                            limits: None,
                            ratio: None,
                            resolution: None,
                            link: None,
                        })
                        .collect(),
                    tool: Pose::translate(target.x, target.y, target.z),
                    gravity: Vector3::zeros(),
                    source: "synthetic".into(),
                };
                let zero = ZeroPosition::of(&robot);
                let seen: Vec<Axis> = zero.axes.iter().map(|a| a.moved(&base)).collect();
                let analysis = truepose_host::circle_points::Analysis {
                    traced: Vec::new(),
                    axes: seen,
                    target: base.point(&target),
                    rms: 0.0,
                    unused: Vec::new(),
                };
                let file = std::path::Path::new("x");
                let stone = describe("a", file, &analysis, Method::Stone);
                let sklar = describe("a", file, &analysis, Method::Sklar);
                let converted = convert(&stone, Form::Hayati).unwrap().robot;
                let mut random = Random::new(seed, 8);
                for _ in 0..5 {
                    let q = synthetic::readings(&model, &mut random);
                    let truth = base.then(&robot.forward(&q)).translation;
                    for found in [&stone, &sklar, &converted] {
                        let far = (found.forward(&q).translation - truth).norm();
                        assert!(far < 1e-11, "{kinds} {parallel:?} {seed}: {far:e}");
                    }
                }
                for (a, b) in stone.joints.iter().zip(&sklar.joints) {
                    let (a, b) = (a.joint, b.joint);
                    assert_eq!(a.convention, b.convention);
                    for p in a.parameters() {
                        let (x, y) = (a.parameter(*p), b.parameter(*p));
                        let off = (x - y + 1.0).rem_euclid(2.0 * PI) - 1.0;
                        assert!(
                            off.abs() < 1e-10,
                            "{kinds} {parallel:?} {seed} {p:?} {x} {y}"
                        );
                    }
                }
            }
        }
    }
}

/// Sweeps of every joint of `robot`, the other joints in another posture each time, the
/// readings jittering and the points with noise, as a file.
fn swept(robot: &Robot, noise: f64, seed: u64) -> String {
    let mut random = Random::new(seed, 50);
    let n = robot.joints.len();
    let mut text = (1..=n).map(|j| format!("q{j},")).collect::<String>() + "x,y,z\n";
    for joint in 0..n {
        let limits = |j: usize| match robot.joints[j].joint.kind {
            JointKind::Revolute => [-1.4, 1.4],
            JointKind::Prismatic => robot.joints[j].limits.unwrap(),
        };
        let rest: Vec<f64> = (0..n)
            .map(|j| {
                let [low, high] = limits(j);
                random.between(low, high)
            })
            .collect();
        for step in 0..30 {
            let [low, high] = limits(joint);
            let mut q = rest.clone();
            q[joint] = low + (high - low) * f64::from(step) / 29.0;
            let p = robot.forward(&q).translation + vector(&mut random, noise);
            for q in &q {
                write!(text, "{},", q + 1e-6 * random.normal()).unwrap();
            }
            writeln!(text, "{},{},{}", p.x, p.y, p.z).unwrap();
        }
    }
    text
}

/// Poses anywhere, half of them held back.
fn measured(robot: &Robot, noise: f64, seed: u64) -> String {
    let mut random = Random::new(seed, 51);
    let n = robot.joints.len();
    let mut text = (1..=n).map(|j| format!("q{j},")).collect::<String>() + "x,y,z,set\n";
    for row in 0..160 {
        let q: Vec<f64> = (robot.joints.iter())
            .map(|j| match j.joint.kind {
                JointKind::Revolute => random.between(-2.0, 2.0),
                JointKind::Prismatic => random.between(j.limits.unwrap()[0], j.limits.unwrap()[1]),
            })
            .collect();
        let p = robot.forward(&q).translation + vector(&mut random, noise);
        for q in &q {
            write!(text, "{q},").unwrap();
        }
        let set = if row % 2 == 0 { "identify" } else { "verify" };
        writeln!(text, "{},{},{},{set}", p.x, p.y, p.z).unwrap();
    }
    text
}

#[test]
fn sweeps_alone_start_an_identification_that_ends_at_the_noise() {
    let noise = 3e-5;
    for (which, name) in [
        (Arm::Puma560, "puma"),
        (Arm::Stanford, "stanford"),
        (Arm::Scara, "scara"),
    ] {
        // Not as drawn: every axis a few milliradians and millimetres off, placed anywhere.
        let mut robot = Cell::as_drawn(which).robot();
        let mut random = Random::new(11, 0);
        for described in &mut robot.joints {
            for p in described.joint.parameters() {
                *described.joint.parameter_mut(*p) += random.between(-4e-3, 4e-3);
            }
        }
        robot.base = anywhere(&mut random);
        robot.tool = Pose::translate(0.05, -0.08, 0.15);
        let folder = folder(&format!("sweeps_{name}"));
        fs::write(folder.join("sweeps.csv"), swept(&robot, noise, 1)).unwrap();
        fs::write(folder.join("poses.csv"), measured(&robot, noise, 2)).unwrap();
        fs::write(folder.join("poses.toml"), "position_sigma_mm = 0.03\n").unwrap();
        for method in ["stone", "sklar"] {
            let arguments = ["circle-points", "--data", "sweeps.csv", "--out", "R.toml"];
            let arguments = [&arguments[..], &["--method", method, "--json", "c.json"]].concat();
            let (code, out, err) = said(&truepose(&folder, &arguments));
            assert_eq!(code, 0, "{out}{err}");
            // The description as it is: wrong by the axes' errors at the arm's length.
            let found = Robot::read(&folder.join("R.toml")).unwrap();
            let mut worst = 0.0_f64;
            for _ in 0..100 {
                let q: Vec<f64> = (robot.joints.iter())
                    .map(|j| match j.joint.kind {
                        JointKind::Revolute => random.between(-2.0, 2.0),
                        JointKind::Prismatic => random.between(0.1, 0.4),
                    })
                    .collect();
                let far = (found.forward(&q).translation - robot.forward(&q).translation).norm();
                worst = worst.max(far);
            }
            assert!(worst < 2e-3, "{name} {method}: {worst}");
        }
        let arguments = [
            "identify",
            "--robot",
            "R.toml",
            "--data",
            "poses.csv",
            "--out",
            "P.tpb",
            "--json",
            "i.json",
        ];
        let (code, out, err) = said(&truepose(&folder, &arguments));
        assert_eq!(code, 0, "{out}{err}");
        let said: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(folder.join("i.json")).unwrap()).unwrap();
        let rms = said["error_mm"]["final"]["rms"].as_f64().unwrap();
        // Three axes of noise, and what 80 poses leave open of 27 or fewer parameters.
        let expected = 0.03 * (3.0 + 27.0 / 80.0_f64).sqrt();
        assert!(
            (rms / expected - 1.0).abs() < 0.2,
            "{name}: {rms} {expected}"
        );
    }
}

#[test]
fn sweeps_say_what_is_wrong_with_them() {
    let folder = folder("sweeps_say");
    let robot = Cell::as_drawn(Arm::Scara).robot();
    let good = swept(&robot, 1e-5, 3);
    let run = |text: &str| {
        fs::write(folder.join("s.csv"), text).unwrap();
        let out = truepose(
            &folder,
            &["circle-points", "--data", "s.csv", "--out", "R.toml"],
        );
        let (code, _, err) = said(&out);
        assert!(code == 0 || !folder.join("R.toml").exists());
        (code, err)
    };
    // The rows of joint 2 are missing.
    let lines: Vec<&str> = good.lines().collect();
    let without: Vec<&str> = [&lines[..31], &lines[61..]].concat();
    let (code, err) = run(&without.join("\n"));
    assert_eq!(code, 2);
    assert!(
        err.contains("s.csv: q2: found no run of rows in which this joint alone"),
        "{err}"
    );
    // Readings in degrees that say nothing of it.
    let degrees: String = (lines.iter().enumerate())
        .map(|(k, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if k > 0 {
                let q: f64 = cells[0].parse().unwrap();
                cells[0] = (q.to_degrees() * 0.2).to_string();
            }
            cells.join(",") + "\n"
        })
        .collect();
    let (code, err) = run(&degrees);
    assert_eq!(code, 2);
    assert!(
        err.contains("whose target moves 0.087 times what is read"),
        "{err}"
    );
    // A slide whose column says that it turns.
    let (code, err) = run(&good.replacen("q3,", "q3_deg,", 1));
    assert_eq!(code, 2);
    assert!(
        err.contains("row 61: q3") || err.contains("row 61, column q3"),
        "{err}"
    );
    // The instrument was moved.
    let moved: String = (lines.iter().enumerate())
        .map(|(k, line)| match k {
            0 => format!("{line},session\n"),
            k => format!("{line},{}\n", k / 40),
        })
        .collect();
    let (code, err) = run(&moved);
    assert_eq!(code, 2);
    assert!(
        err.contains("several placements of the instrument"),
        "{err}"
    );
    let (code, err) = run("a,b\n1,2\n");
    assert_eq!(code, 2);
    assert!(err.contains("no column q1"), "{err}");
    let (code, _) = run(&good);
    assert_eq!(code, 0);
}

#[test]
fn failures_are_those_of_the_joint_that_fails() {
    let folder = folder("sweep_failures");
    let robot = Cell::as_drawn(Arm::Puma560).robot();
    let text = swept(&robot, 0.0, 4);
    fs::write(folder.join("s.csv"), &text).unwrap();
    let read = |name: &str| {
        let file = folder.join(name);
        let (expected, kinds) = Expected::of_table(&file).unwrap();
        (
            measurement::read(&file, &expected, Purpose::Check).unwrap(),
            kinds,
        )
    };
    let (data, kinds) = read("s.csv");
    let analysis = analyse(&data, &kinds).unwrap();
    assert!(
        analysis.rms < 1e-5,
        "jitter of the readings alone: {}",
        analysis.rms
    );
    assert_eq!(analysis.unused, Vec::<usize>::new());
    // Joint 4 was hardly moved: neither circle nor line of its reading's size.
    let still: String = (text.lines().enumerate())
        .filter(|(k, _)| *k < 92 || *k > 120)
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    fs::write(folder.join("t.csv"), still).unwrap();
    let (data, kinds) = read("t.csv");
    assert_eq!(analyse(&data, &kinds).unwrap_err(), Failure::NeverAlone(3));
}
