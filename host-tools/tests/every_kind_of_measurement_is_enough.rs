//! Distances between poses, touches of points and planes, bearings, what a camera on the tool
//! sees: derivatives follow differences, and without noise the true arm comes back.

use crate::bound::{Bound, board, bound, posture, problem_of, surrounded};
use crate::support::{folder, robot, said, truepose};
use crate::synthetic::{self, CONVENTIONS, SIGMAS, anywhere, apart, arm, built, problem};
use nalgebra::Vector3;
use truepose::{Convention, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::linearize::{linearize, residuals};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::problem::Problem;
use truepose_host::identify::relation::Relation;
use truepose_host::identify::unknown::{Unknown, apply};
use truepose_host::identify::{Calibration, Status, identify};
use truepose_host::random::Random;

const TRUTH: f64 = 1e-9;

/// Gives `truth` the length that measurements without scale take from the drawing.
fn same_size(truth: &mut ArmModel, drawing: &ArmModel, calibration: &Calibration) -> Unknown {
    let held = calibration
        .statuses
        .iter()
        .find_map(|(u, status)| match status {
            Status::Fixed(why) if why.contains("proportions") => Some(*u),
            _ => None,
        });
    let held = held.unwrap_or_else(|| panic!("nothing gives the scale"));
    let step = held.value(drawing) - held.value(truth);
    apply(truth, &[held], &[step]);
    held
}

#[test]
fn derivatives_follow_differences() {
    for by in Bound::ALL {
        let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
        let truth = surrounded(&drawing, by, 8);
        let mut rows = bound(&truth, by, 6, 0.0, 3);
        // somewhere else, so that no residual is zero
        let mut here = built(&truth, 2e-3, 9);
        let mut unknowns: Vec<Unknown> = Vec::new();
        unknowns.extend((0..6).map(|axis| Unknown::Base { session: 0, axis }));
        unknowns.extend((0..6).map(|axis| Unknown::Tool { axis }));
        unknowns.extend((0..3).map(|axis| Unknown::Point { point: 1, axis }));
        unknowns.extend((0..3).map(|value| Unknown::Plane { plane: 1, value }));
        for station in 0..2 {
            unknowns.extend((0..6).map(|axis| Unknown::Station { station, axis }));
        }
        for (j, joint) in drawing.joints.iter().enumerate() {
            unknowns.extend(joint.parameters().iter().map(|p| Unknown::Joint(j, *p)));
        }
        let moved: Vec<f64> = unknowns.iter().map(|_| 1e-3).collect();
        apply(&mut here, &unknowns, &moved);
        if by == Bound::Board {
            // turns have their derivative at a residual of zero
            let from_board = here.stations[0].inverse();
            let mut evaluator = Evaluator::new(&here, SIGMAS);
            for o in &mut rows {
                let tool = from_board.then(&evaluator.observe(o));
                o.relations[1] = board(&tool, 0.0, &mut Random::new(0, 0))[1].clone();
            }
        }
        let rows: Vec<&Observation> = rows.iter().collect();
        let ones = vec![1.0; unknowns.len()];
        let analytic = linearize(&here, &unknowns, &ones, &rows, SIGMAS).jacobian;
        for (k, unknown) in unknowns.iter().enumerate() {
            let at = |h: f64| {
                let mut there = here.clone();
                apply(&mut there, &[*unknown], &[h]);
                residuals(&there, &rows, SIGMAS)
            };
            let h = 1e-6;
            // residual = measured - predicted
            let differences = (at(-h) - at(h)) / (2.0 * h);
            let column = analytic.column(k);
            let off = (&differences - column).norm();
            // central differences: rounding of 1e-16 / 1e-6 and a curvature of 1e-12, over sigma
            let scale = 1e-8 / 1e-5 + 1e-8 * column.norm();
            assert!(off < scale * 10.0, "{by:?} {}: {off}", unknown.name(&here));
        }
    }
}

#[test]
fn the_true_arm_comes_back() {
    for convention in CONVENTIONS {
        for (by, rows) in [
            (Bound::Distance, 150),
            (Bound::Points, 90),
            (Bound::Planes, 200),
            (Bound::Bearings, 80),
            (Bound::Board, 40),
            (Bound::Marks, 40),
            (Bound::Sights, 60),
        ] {
            let drawing = arm(convention, "RRRRRR", &[], 8);
            let mut truth = surrounded(&drawing, by, 8);
            let run = |truth: &ArmModel| {
                identify(&problem_of(&drawing, by, bound(truth, by, rows, 0.0, 3)))
                    .unwrap_or_else(|failure| panic!("{convention:?} {by:?}: {failure:?}"))
            };
            let mut calibration = run(&truth);
            let proportions = [Bound::Points, Bound::Planes, Bound::Bearings, Bound::Sights];
            if proportions.contains(&by) {
                same_size(&mut truth, &drawing, &calibration);
                calibration = run(&truth);
            }
            let found = &calibration.complete.arm;
            for (unknown, status) in &calibration.statuses {
                let (is, should) = (unknown.value(found), unknown.value(&truth));
                assert!(is.is_finite());
                if let (Unknown::Joint(..), Status::Identified) = (unknown, status) {
                    let name = unknown.name(found);
                    let off = (is - should).abs();
                    assert!(off < 10.0 * TRUTH, "{convention:?} {by:?} {name}: {off}");
                }
            }
            let (far, turned) = apart(&truth, found, synthetic::Seen::Pose);
            assert!(far < TRUTH, "{convention:?} {by:?}: {far} m");
            // from the tool its own turn shows
            assert!(
                !by.is_view() || turned < TRUTH,
                "{convention:?} {by:?}: {turned} rad"
            );
        }
    }
}

#[test]
fn what_they_cannot_show_is_said() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    for (by, rows, why) in [
        (Bound::Distance, 150, "where the arm stands"),
        (Bound::Points, 90, "where the arm stands"),
        (Bound::Bearings, 80, "proportions"),
    ] {
        let truth = surrounded(&drawing, by, 8);
        let problem = problem_of(&drawing, by, bound(&truth, by, rows, 0.0, 3));
        let calibration = identify(&problem).unwrap();
        let notes = calibration.statuses.iter().filter_map(|(_, s)| match s {
            Status::Fixed(note) | Status::Merged(note) => Some(note.as_str()),
            Status::Identified => None,
        });
        let notes: Vec<&str> = notes.collect();
        assert!(notes.iter().any(|n| n.contains(why)), "{by:?}: {notes:?}");
        assert!(notes.iter().any(|n| n.contains("no orientation")), "{by:?}");
        let moved = calibration.complete.arm.bases[0].twist_to(&drawing.bases[0]);
        let placed = by == Bound::Bearings;
        assert_eq!(moved.linear.norm() > 0.0, placed, "{by:?}");
    }
}

#[test]
fn an_instrument_that_was_moved() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    let places: Vec<Pose<f64>> = (0..3).map(|k| anywhere(&mut Random::new(k, 1))).collect();
    truth.bases = places.clone();
    truth.bake();
    let mut random = Random::new(3, 6);
    let mut evaluator = Evaluator::new(&truth, SIGMAS);
    let rows = (0..90).map(|k| {
        let mut o = posture(&truth, &mut random);
        o.row = k + 1;
        o.session = k % 3;
        o.position = Some(evaluator.observe(&o).translation);
        // one distance in ten, to a pose of the same session
        if k % 10 == 0 {
            let mut to = posture(&truth, &mut random);
            to.session = o.session;
            let far = evaluator.observe(&to).translation;
            let distance = (evaluator.observe(&o).translation - far).norm();
            o.relations.push(Relation::Distance {
                to: Box::new(to),
                distance,
            });
        }
        o
    });
    let problem = Problem {
        sessions: vec![4, 7, 9],
        ..problem(&drawing, rows.collect())
    };
    let found = identify(&problem).unwrap().complete.arm;
    for (is, should) in found.bases.iter().zip(&places) {
        let off = is.twist_to(should);
        assert!(off.linear.norm() < TRUTH && off.angular.norm() < TRUTH);
    }
}

#[test]
fn known_targets_show_the_tool_whole() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    // A tool that is not as drawn at all: only the poses built from three targets tell.
    let turn = Pose::from_rotation_vector(&Vector3::new(1.2, -0.8, 1.9));
    truth.tool.rotation = turn.rotation * truth.tool.rotation;
    truth.targets = synthetic::TARGETS.map(Vector3::from).to_vec();
    truth.bake();
    let data = synthetic::measured(&truth, synthetic::Seen::Targets, 60, 0.0, 5);
    let problem = Problem {
        targets_known: true,
        ..problem(&drawing, data)
    };
    let calibration = identify(&problem).unwrap();
    let found = &calibration.complete.arm;
    let (far, turned) = apart(&truth, found, synthetic::Seen::Pose);
    assert!(far < TRUTH && turned < TRUTH, "{far} m, {turned} rad");
    let of_tool =
        |(u, s): &&(Unknown, Status)| matches!(u, Unknown::Tool { .. }) && *s == Status::Identified;
    assert_eq!(calibration.statuses.iter().filter(of_tool).count(), 6);
}

/// A pinhole camera without distortion: focal length and centre, pixels. Its z axis looks ahead,
/// x to the right of the image, y down.
struct Camera {
    focal: [f64; 2],
    centre: [f64; 2],
    pose: Pose<f64>,
}

impl Camera {
    /// At `from`, looking at `to` in any roll.
    fn looking(from: Vector3<f64>, to: Vector3<f64>, roll: f64) -> Self {
        let z = (to - from).normalize();
        let x = z.cross(&Vector3::z()).normalize();
        let upright = nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]);
        let turn = Pose::from_rotation_vector(&Vector3::new(0.0, 0.0, roll));
        Self {
            focal: [2700.0, 2690.0],
            centre: [1231.0, 1019.0],
            pose: Pose::new(upright * turn.rotation, from),
        }
    }

    /// Where a point of the world is in the image of 2448 x 2048, if it is.
    fn pixel(&self, p: &Vector3<f64>) -> Option<[f64; 2]> {
        let p = self.pose.inverse().point(p);
        let pixel = [0, 1].map(|k| self.centre[k] + self.focal[k] * p[k] / p.z);
        let inside = (0.0..2448.0).contains(&pixel[0]) && (0.0..2048.0).contains(&pixel[1]);
        (p.z > 0.0 && inside).then_some(pixel)
    }

    /// Azimuth and elevation, as docs/MEASUREMENTS.md turns pixels into them.
    fn bearing(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let right = (u - self.centre[0]) / self.focal[0];
        let down = (v - self.centre[1]) / self.focal[1];
        [(-right).atan2(1.0), (-down).atan2(right.hypot(1.0))]
    }
}

#[test]
fn pixels_of_two_cameras_beside_the_arm() {
    let folder = folder("cameras");
    let drawing = ArmModel::drawn(&robot(&folder));
    let mut truth = drawing.clone();
    let mut random = Random::new(3, 7);
    for joint in &mut truth.joints {
        for &parameter in joint.parameters() {
            let off = random.between(-1e-3, 1e-3);
            // beta is no parameter of this arm; the longest length gives the scale
            let kept = parameter == truepose::Parameter::Beta || joint.d > 0.3;
            *joint.parameter_mut(parameter) += if kept { 0.0 } else { off };
        }
    }
    truth.bake();
    let base = truth.bases[0];
    let at = |x, y, z| base.point(&Vector3::new(x, y, z));
    let middle = at(0.0, 0.0, 0.4);
    let cameras = [
        Camera::looking(at(1.5, 0.5, 0.8), middle, 0.3),
        Camera::looking(at(-0.4, 2.2, 1.2), middle, -0.1),
    ];
    let limits = [165.0, 110.0, 70.0, 160.0, 120.0, 180.0_f64];
    let mut evaluator = Evaluator::new(&truth, SIGMAS);
    let mut csv = String::from("q1,q2,q3,q4,q5,q6,azimuth,elevation,azimuth2,elevation2\n");
    let (mut rows, mut blank) = (0, 0);
    let mut truly = Vec::new();
    // a twentieth of a pixel
    let sigma = 0.05;
    while rows < 200 {
        let q = limits.map(|l| random.between(-l, l).to_radians());
        let none = vec![0.0; 6];
        let p = evaluator.go(0, &q, &none, &truepose::effects::Ambient::default());
        let seen = cameras.each_ref().map(|camera| {
            let pixel = camera.pixel(&p.translation)?;
            Some(camera.bearing(pixel.map(|x| x + sigma * random.normal())))
        });
        let cell = |b: Option<[f64; 2]>| b.map_or(",".to_owned(), |[a, e]| format!("{a},{e}"));
        if seen.iter().all(Option::is_none) {
            continue;
        }
        blank += seen.iter().filter(|b| b.is_none()).count();
        let joints: Vec<String> = q.iter().map(f64::to_string).collect();
        csv += &format!("{},{},{}\n", joints.join(","), cell(seen[0]), cell(seen[1]));
        rows += 1;
        truly.push(p.translation);
    }
    assert!(blank > 0);
    std::fs::write(folder.join("d.csv"), csv).unwrap();
    let declared = (sigma / 2700.0_f64).to_degrees();
    let sidecar = format!("bearing_sigma_deg = {declared}\n");
    std::fs::write(folder.join("d.toml"), sidecar).unwrap();
    let arguments = [
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
    let (status, out, err) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 0, "{out}{err}");
    let text = std::fs::read_to_string(folder.join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["verdict"], "nothing-missing", "{out}");
    // an angle of the field of view is a little less than its pixels over the focal length
    let estimated = report["noise_deg"]["estimated"].as_f64().unwrap();
    assert!(
        estimated / declared > 0.8 && estimated / declared < 1.05,
        "{out}"
    );
    // It puts the tool where it is, seen from the first camera, as nearly as it says itself.
    let sigma = report["model_sigma_mm"]["rms"].as_f64().unwrap() * 1e-3;
    let arguments = [
        "predict", "--params", "p.tpb", "--data", "d.csv", "--out", "pred.csv",
    ];
    let (status, out, err) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 0, "{out}{err}");
    let text = std::fs::read_to_string(folder.join("pred.csv")).unwrap();
    let mut squares = 0.0;
    for (line, should) in text.lines().skip(1).zip(&truly) {
        let values: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let seen = cameras[0].pose.inverse().point(should);
        let should = Vector3::new(seen.z, -seen.x, -seen.y);
        squares += (Vector3::new(values[0], values[1], values[2]) - should).norm_squared();
    }
    assert_eq!(truly.len(), text.lines().count() - 1);
    let rms = (squares / truly.len() as f64).sqrt();
    assert!(sigma < 4e-5 && rms < 2.0 * sigma, "{rms} {sigma}");
}
