//! The task point that the nominal inverse kinematics have to be asked for, so that the arm
//! goes where it should; and the analytic inverse of arms with a spherical wrist.

use crate::puma::{away_from_singularities, blob, nominal, off, smallest_singular_value};
use crate::random::Random;
use truepose::budget::Budget;
use truepose::compensate::spherical_wrist::SphericalWrist;
use truepose::compensate::task_point::first;
use truepose::compensate::{Compensator, Request, Status};
use truepose::effects::Conditions;
use truepose::jacobian::parameter_twists;
use truepose::{Frame, Method, Pose, Settings, Twist, forward};

fn settings(method: Method) -> Settings<f64> {
    Settings {
        method,
        ..Settings::default()
    }
}

fn size(twist: &Twist<f64>) -> f64 {
    twist.linear.norm().hypot(twist.angular.norm())
}

#[test]
fn the_analytic_inverse_is_the_inverse_of_the_nominal_arm() {
    let mut random = Random(71);
    let blob = blob(off(&mut random), &[]);
    let model = blob.model::<f64, 6>().unwrap();
    let wrist = SphericalWrist::of(&model.nominal).unwrap();
    for _ in 0..2000 {
        let q = away_from_singularities(&mut random, &model);
        // From near by it finds the same branch.
        let near = q.map(|q| q + random.within(0.05));
        let found = wrist.inverse(&model.nominal_pose(&q), &near).unwrap();
        for (found, q) in found.iter().zip(q) {
            assert!((found - q).abs() < 1e-9, "{found} {q}");
        }
    }
}

#[test]
fn the_analytic_inverse_stands_where_the_wrist_is_aligned_and_fails_out_of_reach() {
    let mut random = Random(72);
    let blob = blob(off(&mut random), &[]);
    let model = blob.model::<f64, 6>().unwrap();
    let wrist = SphericalWrist::of(&model.nominal).unwrap();
    for _ in 0..300 {
        let mut q: [f64; 6] = std::array::from_fn(|_| random.within(1.5));
        q[4] = 0.0;
        assert!(smallest_singular_value(&model, &q) < 1e-6);
        let pose = model.nominal_pose(&q);
        let found = wrist.inverse(&pose, &q).unwrap();
        assert!(size(&model.nominal_pose(&found).twist_to(&pose)) < 1e-7);
        let mut far = pose;
        far.translation *= 5.0 / far.translation.norm();
        assert_eq!(wrist.inverse(&far, &q), None);
    }
    // The calibrated arm's axes do not meet.
    assert!(SphericalWrist::of(&model.calibrated).is_none());
}

/// MRD 5.57 and 5.58: the task point moves by the kinematic sensitivities times the parameter
/// errors, with the opposite sign, to first order.
#[test]
fn the_first_move_is_that_of_the_kinematic_sensitivities() {
    let mut random = Random(73);
    let mut calibrated = nominal();
    let mut changes = Vec::new();
    for (j, joint) in calibrated.joints.iter_mut().enumerate() {
        for &parameter in joint.parameters() {
            let change = random.within(1e-5);
            *joint.parameter_mut(parameter) += change;
            changes.push((j, parameter, change));
        }
    }
    let blob = blob(calibrated, &[]);
    let model = blob.model::<f64, 6>().unwrap();
    let q = away_from_singularities(&mut random, &model);
    let moved = model
        .nominal_pose(&q)
        .twist_to(&first(&model, &Request::joints(q)));

    let chain = &model.nominal;
    let mut gauges = [Pose::identity(); 6];
    blob.nominal.chain::<6>(blob.gravity, &mut gauges).unwrap();
    let mut frames = [Frame::identity(); 6];
    let tool = forward(&chain.base, &chain.joints, &q, &mut frames).then(&chain.tool);
    let base = chain.base.inverse().then(&Pose::from(&blob.nominal.base));
    let mut expected = Twist::zero();
    for (j, parameter, change) in changes {
        for twist in parameter_twists(&base, &blob.nominal.joints, &gauges, j, parameter)
            .iter()
            .flatten()
        {
            let column = twist.column(&chain.base, &frames, &tool.translation);
            expected = expected.plus(&column.scaled(-change));
        }
    }
    let off = moved.plus(&expected.scaled(-1.0));
    // Second order: thirty changes of 1e-5 each.
    assert!(size(&off) < 1e-8, "{moved:?} {expected:?}");
    assert!(size(&moved) > 1e-6);
}

#[test]
fn both_ways_and_the_regulator_agree_away_from_singularities() {
    let mut random = Random(74);
    for _ in 0..20 {
        let blob = blob(off(&mut random), &[]);
        let model = blob.model::<f64, 6>().unwrap();
        let wrist = SphericalWrist::of(&model.nominal).unwrap();
        let inverse = |pose: &Pose<f64>, near: &[f64; 6]| wrist.inverse(pose, near);
        for _ in 0..20 {
            let q = away_from_singularities(&mut random, &model);
            let desired = model.nominal_pose(&q);
            for (method, through) in [
                (Method::InverseJacobian, false),
                (Method::Lqr, false),
                (Method::TaskPoint, false),
                (Method::TaskPoint, true),
            ] {
                let mut compensator = Compensator::new(&model).with_settings(settings(method));
                let outcome = compensator.correct_through(
                    &Request::joints(q),
                    through.then_some(&inverse),
                    &mut Budget::unlimited(),
                );
                let left = model
                    .predict(&outcome.q, &Conditions::default())
                    .twist_to(&desired);
                let (position, orientation) = (left.linear.norm(), left.angular.norm());
                assert!(
                    position < 2e-6 && orientation < 5e-6,
                    "{method:?} {through} {outcome:?}"
                );
                if method == Method::TaskPoint {
                    assert_eq!(outcome.status, Status::Converged);
                    // What the controller's own kinematics make of the task point.
                    let asked = outcome.task_point.unwrap();
                    let own = wrist.inverse(&asked, &q).unwrap();
                    let left = model
                        .predict(&own, &Conditions::default())
                        .twist_to(&desired);
                    assert!(size(&left) < 5e-6, "{left:?}");
                }
            }
        }
    }
}

/// No inverse is needed for the first move: it is there in the middle of a singularity.
#[test]
fn the_task_point_is_continuous_through_the_wrist_singularity() {
    let mut random = Random(75);
    let blob = blob(off(&mut random), &[]);
    let model = blob.model::<f64, 6>().unwrap();
    let mut last: Option<Twist<f64>> = None;
    for k in -500..=500 {
        let q = [0.3, -0.6, 0.2, 0.4, f64::from(k) * 2e-4, 0.1];
        let moved = model
            .nominal_pose(&q)
            .twist_to(&first(&model, &Request::joints(q)));
        if let Some(last) = last {
            // A pose error of 0.01 that turns by 0.2 mrad.
            assert!(size(&moved.plus(&last.scaled(-1.0))) < 1e-5);
        }
        last = Some(moved);
    }
}
