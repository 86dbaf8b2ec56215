//! Poses that cannot show every parameter end in a report that says so, without NaN.

use crate::synthetic::{SIGMAS, Seen, anywhere, arm, built, measured, problem};
use nalgebra::Vector3;
use truepose::Convention;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::method::{ESTIMATORS, Method};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::{Calibration, Failure, Status, identify};
use truepose_host::random::Random;

fn arms(parallel: &[usize]) -> (ArmModel, ArmModel) {
    let drawing = arm(Convention::Dh, "RRRRRR", parallel, 4);
    let mut truth = built(&drawing, 1e-3, 4);
    truth.bases[0] = anywhere(&mut Random::new(4, 1));
    truth.bake();
    (drawing, truth)
}

/// Full poses whose joints `hold` has changed, measured again.
fn held(truth: &ArmModel, rows: usize, hold: impl Fn(usize, &mut Vec<f64>)) -> Vec<Observation> {
    let mut random = Random::new(2, 8);
    let mut data = measured(truth, Seen::Pose, rows, 0.0, 5);
    let mut evaluator = Evaluator::new(truth, SIGMAS);
    for (k, o) in data.iter_mut().enumerate() {
        hold(k, &mut o.q);
        let pose = evaluator.observe(o);
        let mut blur = || Vector3::new(random.normal(), random.normal(), random.normal());
        let turn = truepose::Pose::from_rotation_vector(&(blur() * SIGMAS.orientation));
        o.position = Some(pose.translation + blur() * SIGMAS.position);
        o.rotation = Some(turn.rotation * pose.rotation);
    }
    data
}

fn finite(calibration: &Calibration) {
    let stage = &calibration.complete;
    let mut identified = 0;
    for (unknown, status) in &calibration.statuses {
        let name = unknown.name(&stage.arm);
        assert!(unknown.value(&stage.arm).is_finite(), "{name}");
        match status {
            Status::Identified => {
                identified += 1;
                let sigma = stage.fit.sigma(*unknown);
                assert!(
                    sigma.is_some_and(|s| s.is_finite() && s > 0.0),
                    "{name}: {sigma:?}"
                );
            }
            Status::Fixed(why) | Status::Merged(why) => assert!(!why.is_empty(), "{name}"),
        }
    }
    assert!(identified > 0);
    assert!(stage.fit.covariance.iter().all(|x| x.is_finite()));
}

fn notes(calibration: &Calibration) -> String {
    let all = calibration.statuses.iter().filter_map(|(_, s)| match s {
        Status::Fixed(note) | Status::Merged(note) => Some(note.as_str()),
        Status::Identified => None,
    });
    all.collect::<Vec<&str>>().join("\n")
}

#[test]
fn one_joint_never_moved() {
    let (drawing, truth) = arms(&[]);
    for joint in [0, 2, 5] {
        let data = held(&truth, 60, |_, q| q[joint] = 0.3);
        for (name, estimator) in &ESTIMATORS[..5] {
            let mut problem = problem(&drawing, data.clone());
            problem.method = Method {
                estimator: *estimator,
                ..Method::default()
            };
            let found = identify(&problem).unwrap_or_else(|f| unreachable!("{name}: {f:?}"));
            finite(&found);
            let said = notes(&found);
            let still = format!("joint {} does not move", joint + 1);
            assert!(said.contains(&still), "{name} {joint}: {said}");
        }
    }
}

#[test]
fn only_one_joint_moves() {
    let (drawing, truth) = arms(&[]);
    let data = held(&truth, 60, |k, q| {
        q.fill(0.2);
        q[3] = 0.1 * k as f64 - 3.0;
    });
    let found = identify(&problem(&drawing, data));
    finite(found.as_ref().unwrap_or_else(|f| unreachable!("{f:?}")));
}

#[test]
fn no_joint_moves() {
    let (drawing, truth) = arms(&[]);
    let data = held(&truth, 60, |_, q| q.fill(0.2));
    assert_eq!(
        identify(&problem(&drawing, data)).err(),
        Some(Failure::OnePose)
    );
}

#[test]
fn two_poses_again_and_again() {
    let (drawing, truth) = arms(&[]);
    let data = held(&truth, 60, |k, q| {
        q.fill(0.2 + 0.5 * (k % 2) as f64);
    });
    let found = identify(&problem(&drawing, data));
    finite(found.as_ref().unwrap_or_else(|f| unreachable!("{f:?}")));
}

#[test]
fn as_many_equations_as_parameters() {
    let (drawing, truth) = arms(&[]);
    for rows in [5, 6, 7, 8] {
        let data = held(&truth, rows, |_, _| {});
        match identify(&problem(&drawing, data)) {
            Ok(found) => finite(&found),
            Err(failure) => assert!(
                matches!(failure, Failure::TooFewEquations(..)) && rows <= 5,
                "{rows}: {failure:?}"
            ),
        }
    }
}

#[test]
fn axes_exactly_parallel() {
    let mut drawing = arm(Convention::Dh, "RRRRRR", &[1, 2], 4);
    drawing.joints[1].alpha = 0.0;
    drawing.joints[2].alpha = 0.0;
    drawing.bake();
    let mut truth = drawing.clone();
    truth.joints[1].a += 1e-3;
    truth.bases[0] = anywhere(&mut Random::new(4, 1));
    truth.bake();
    let data = held(&truth, 60, |_, _| {});
    let found = identify(&problem(&drawing, data));
    let found = found.unwrap_or_else(|f| unreachable!("{f:?}"));
    finite(&found);
    assert!(notes(&found).contains("Hayati"));
}
