//! All estimators find the same arm on the same well-posed data, robust losses name the rows
//! that are wrong, and a Kalman filter notices a model that does not hold.

use crate::synthetic::{SIGMAS, Seen, anywhere, apart, arm, built, measured, problem};
use nalgebra::Vector3;
use truepose::{Convention, Parameter};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::method::{ESTIMATORS, Estimator, Loss, Method};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::unknown::Unknown;
use truepose_host::identify::{Calibration, Status, identify};
use truepose_host::random::Random;

fn arms(kinds: &str) -> (ArmModel, ArmModel) {
    let drawing = arm(Convention::Dh, kinds, &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    truth.bake();
    (drawing, truth)
}

fn by(method: Method, drawing: &ArmModel, data: &[Observation]) -> Calibration {
    let mut problem = problem(drawing, data.to_vec());
    problem.method = method;
    identify(&problem).unwrap()
}

fn with(estimator: Estimator) -> Method {
    Method {
        estimator,
        ..Method::default()
    }
}

/// Every identified parameter to the second digit of its standard error, as reports print it.
fn printed(calibration: &Calibration, reference: &Calibration) -> Vec<String> {
    let stage = &calibration.complete;
    let of = |(unknown, _): &(_, _)| {
        let sigma = reference.complete.sigma(*unknown).unwrap();
        let decimals = (1.0 - sigma.log10().floor()) as usize;
        format!(
            "{} {:.decimals$}",
            unknown.name(&stage.arm),
            unknown.value(&stage.arm)
        )
    };
    let identified = calibration.statuses.iter();
    identified
        .filter(|(_, s)| *s == Status::Identified)
        .map(of)
        .collect()
}

#[test]
fn to_the_last_printed_digit() {
    // The search without a Jacobian has a thousand times the work: a smaller arm for it.
    // Of six hundred rows, which are taken in blocks, those without a prior.
    for (kinds, rows, estimators) in [
        ("RRR", 60, &ESTIMATORS[..]),
        ("RRRRRR", 60, &ESTIMATORS[..5]),
        ("RRRRRR", 600, &ESTIMATORS[..3]),
    ] {
        let (drawing, truth) = arms(kinds);
        let data = measured(&truth, Seen::Position, rows, 1.0, 1);
        let reference = by(Method::default(), &drawing, &data);
        let expected = printed(&reference, &reference);
        assert!(expected.len() >= 15, "{kinds}");
        for (name, estimator) in estimators {
            let found = by(with(*estimator), &drawing, &data);
            let found = printed(&found, &reference);
            assert_eq!(found, expected, "{kinds} {name}");
        }
    }
}

#[test]
fn and_without_noise_they_find_the_truth_from_full_poses() {
    let (drawing, truth) = arms("RRRRRR");
    let data = measured(&truth, Seen::Pose, 40, 0.0, 5);
    for (name, estimator) in &ESTIMATORS[..5] {
        let found = by(with(*estimator), &drawing, &data);
        let (far, turned) = apart(&truth, &found.complete.arm, Seen::Pose);
        // A prior of 5 mm pulls by the square of noise over prior: 4e-5 of a millimetre.
        let limit = match estimator {
            Estimator::MinimumVariance | Estimator::Kalman => 1e-7,
            _ => 1e-9,
        };
        assert!(
            far < limit && turned < limit,
            "{name}: {far} m, {turned} rad"
        );
    }
}

#[test]
fn a_prior_keeps_what_the_data_hardly_show_near_the_drawing() {
    let (drawing, truth) = arms("RRRRRR");
    // Thirty millimetres of noise, and an arm that is right to a millimetre.
    let data = measured(&truth, Seen::Position, 20, 1000.0, 3);
    let free = by(Method::default(), &drawing, &data);
    let held = by(
        Method {
            tolerance: [1e-3, 1e-3],
            // the declared noise is what the prior is weighed against
            ..with(Estimator::MinimumVariance)
        },
        &drawing,
        &data,
    );
    let mut problem = problem(&drawing, data);
    problem.sigmas.position = 3e-2;
    problem.method = Method {
        tolerance: [1e-3, 1e-3],
        ..with(Estimator::MinimumVariance)
    };
    let weighed = identify(&problem).unwrap();
    let far = |c: &Calibration| apart(&truth, &c.complete.arm, Seen::Position).0;
    assert!(
        far(&weighed) < 0.5 * far(&free),
        "{} {}",
        far(&weighed),
        far(&free)
    );
    assert!(far(&weighed) < far(&held));
}

#[test]
fn robust_losses_name_the_rows_that_are_wrong() {
    let (drawing, truth) = arms("RRRRRR");
    let mut data = measured(&truth, Seen::Position, 100, 1.0, 4);
    let clean = by(Method::default(), &drawing, &data);
    // Too small for gross errors, too large for noise: 0.4 to 0.7 mm, 13 to 23 sigmas.
    let wrong = [7, 20, 33, 48, 59, 71, 80, 94];
    for (k, &row) in wrong.iter().enumerate() {
        let off = Vector3::ith(k % 3, 4e-4 + 4e-5 * k as f64);
        let p = data[row - 1].position.unwrap();
        data[row - 1].position = Some(p + off);
    }
    let plain = by(Method::default(), &drawing, &data);
    let far = |c: &Calibration| apart(&truth, &c.complete.arm, Seen::Position).0;
    for (loss, within) in [(Loss::Huber, 2.0), (Loss::Tukey, 1.5)] {
        let method = Method {
            loss,
            ..Method::default()
        };
        let found = by(method, &drawing, &data);
        let named: Vec<usize> = found.outliers.iter().map(|o| o.row).collect();
        for row in wrong {
            assert!(named.contains(&row), "{loss:?}: row {row} not in {named:?}");
        }
        assert!(named.len() <= wrong.len() + 2, "{loss:?}: {named:?}");
        assert!(far(&found) < within * far(&clean), "{loss:?}");
        assert!(far(&found) < far(&plain), "{loss:?}");
        if loss == Loss::Tukey {
            assert!(wrong.iter().all(|row| found.rejected.contains(row)));
        }
    }
    // and nothing where nothing is wrong
    let data = measured(&truth, Seen::Position, 100, 1.0, 4);
    let method = Method {
        loss: Loss::Tukey,
        ..Method::default()
    };
    assert!(by(method, &drawing, &data).rejected.is_empty());
}

#[test]
fn innovations_are_white_where_the_model_holds_and_only_there() {
    let (drawing, truth) = arms("RRRRRR");
    let good = measured(&truth, Seen::Position, 200, 1.0, 6);
    let found = by(with(Estimator::Kalman), &drawing, &good);
    let seen = found.innovations.unwrap();
    assert_eq!(seen.white(), Some(true), "{seen:?}");
    // Rms of some 500 numbers of variance one: 1 within 4 / sqrt(2 * 500).
    assert!((seen.size - 1.0).abs() < 0.13, "{seen:?}");

    // The second joint's offset drifts by half a milliradian over the session.
    let mut drifting = good.clone();
    for (k, o) in drifting.iter_mut().enumerate() {
        let mut arm = truth.clone();
        arm.joints[1].theta += 5e-4 * k as f64 / 200.0;
        arm.bake();
        let mut evaluator = Evaluator::new(&arm, SIGMAS);
        let noise = o.position.unwrap() - Evaluator::new(&truth, SIGMAS).observe(o).translation;
        o.position = Some(evaluator.observe(o).translation + noise);
    }
    let found = by(with(Estimator::Kalman), &drawing, &drifting);
    let seen = found.innovations.unwrap();
    assert_eq!(seen.white(), Some(false), "{seen:?}");
    assert_eq!(seen.drifts, Some(Unknown::Joint(1, Parameter::Theta)));
    let rigid = seen.size;
    // Parameters that may wander by 3 um and urad a row follow it.
    let method = Method {
        process_noise: 3e-6,
        ..with(Estimator::Kalman)
    };
    let seen = by(method, &drawing, &drifting).innovations.unwrap();
    assert!(seen.size < 0.7 * rigid, "{seen:?} {rigid}");
}
