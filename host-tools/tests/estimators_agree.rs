//! All estimators find the same arm on the same well-posed data, robust losses name the rows
//! that are wrong, and a Kalman filter notices a model that does not hold.

use crate::synthetic::{SIGMAS, Seen, anywhere, apart, arm, built, measured, problem};
use nalgebra::Vector3;
use truepose::{Convention, Parameter};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::bootstrap::bootstrap;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::method::{ESTIMATORS, Estimator, Loss, Method};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::prior::Prior;
use truepose_host::identify::solve::solve;
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

/// Mean squared error, m^2, of the plain fit, with the prior of [`Method::default`], and with
/// one whose size is found, over seeds.
fn found_sizes(rows: usize, noise: f64, seeds: u64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for seed in 0..seeds {
        let drawing = arm(Convention::Dh, "RRRR", &[], seed);
        let mut truth = built(&drawing, 1e-3, seed);
        truth.bases[0] = anywhere(&mut Random::new(seed, 1));
        truth.bake();
        let data = measured(&truth, Seen::Position, rows, noise, seed);
        let unseen = measured(&truth, Seen::Position, 100, 0.0, 7);
        let sized = Method {
            cross_validated: true,
            ..with(Estimator::MinimumVariance)
        };
        let ways = [Method::default(), with(Estimator::MinimumVariance), sized];
        for (method, sum) in ways.into_iter().zip(&mut sums) {
            let mut problem = problem(&drawing, data.clone());
            problem.sigmas.position *= noise;
            problem.method = method;
            let found = identify(&problem).unwrap();
            let mut evaluator = Evaluator::new(&found.complete.arm, SIGMAS);
            for o in &unseen {
                let p = evaluator.observe(o).translation;
                *sum += (p - o.position.unwrap()).norm_squared();
            }
        }
    }
    sums
}

#[test]
fn the_size_of_a_prior_is_found_where_it_pays_and_costs_nothing_elsewhere() {
    // Twelve rows of half a millimetre, an arm that is right to one.
    let [plain, given, found] = found_sizes(12, 16.7, 12);
    println!("few: {} {}", (given / plain).sqrt(), (found / plain).sqrt());
    assert!(
        found < 0.9 * plain && found < 0.95 * given,
        "{plain} {given} {found}"
    );
    let [plain, given, found] = found_sizes(100, 1.0, 4);
    println!(
        "many: {} {}",
        (given / plain).sqrt(),
        (found / plain).sqrt()
    );
    assert!((found / plain).sqrt() < 1.01, "{plain} {given} {found}");
}

#[test]
fn a_found_size_is_the_best_that_was_tried_and_serves_every_use_of_it() {
    let (drawing, truth) = arms("RRRR");
    let mut data = measured(&truth, Seen::Position, 30, 10.0, 3);
    data[4].position = data[4].position.map(|p| p + Vector3::new(0.0, 0.05, 0.0));
    let sized = |estimator| Method {
        cross_validated: true,
        ..with(estimator)
    };
    let solved = |method: Method| {
        let mut problem = problem(&drawing, data.clone());
        problem.sigmas.position *= 10.0;
        problem.method = method;
        (identify(&problem).unwrap(), problem)
    };
    let (found, problem) = solved(sized(Estimator::MinimumVariance));
    let sizes = found.sizes.as_ref().unwrap();
    assert_eq!(found.rejected, [5]);
    assert_eq!(sizes.rows, 29);
    assert_eq!(sizes.tried.len(), 12);
    let best = sizes.tried[sizes.chosen];
    assert!(sizes.tried.iter().all(|t| t.whitened >= best.whitened));
    let bits = |tolerance: [f64; 2]| tolerance.map(f64::to_bits);
    assert_eq!(bits(found.method.tolerance), bits(best.tolerance));
    assert!(sizes.tried[0].tolerance[0].is_infinite());
    // as if it had been given
    let given = Method {
        tolerance: best.tolerance,
        ..with(Estimator::MinimumVariance)
    };
    let (given, _) = solved(given);
    let (far, _) = apart(&given.complete.arm, &found.complete.arm, Seen::Position);
    assert!(far < 1e-8, "{far}");
    let scatter = |c: &Calibration| bootstrap(&problem, c, 10);
    assert_eq!(scatter(&given).draws, 10);
    for (a, b) in scatter(&given).each.iter().zip(&scatter(&found).each) {
        assert!(
            (a.1.sigma - b.1.sigma).abs() < 1e-3 * a.1.sigma,
            "{a:?} {b:?}"
        );
    }
    // the filter chooses the same, and a robust loss by the rows that it trusts
    let (filtered, _) = solved(sized(Estimator::Kalman));
    assert_eq!(bits(filtered.method.tolerance), bits(best.tolerance));
    let (robust, _) = solved(Method {
        loss: Loss::Tukey,
        ..sized(Estimator::MinimumVariance)
    });
    assert!(robust.sizes.unwrap().rows < 30 && robust.rejected.contains(&5));
    // what has no prior has no size
    assert!(
        solved(sized(Estimator::LevenbergMarquardt))
            .0
            .sizes
            .is_none()
    );
}

#[test]
fn robust_losses_name_the_rows_that_are_wrong() {
    let (drawing, truth) = arms("RRRRRR");
    let mut data = measured(&truth, Seen::Position, 100, 1.0, 4);
    let clean = by(Method::default(), &drawing, &data);
    // 0.4 to 0.7 mm, 13 to 23 sigmas.
    let wrong = [7, 20, 33, 48, 59, 71, 80, 94];
    for (k, &row) in wrong.iter().enumerate() {
        let off = Vector3::ith(k % 3, 4e-4 + 4e-5 * k as f64);
        let p = data[row - 1].position.unwrap();
        data[row - 1].position = Some(p + off);
    }
    let far_arm = |arm: &ArmModel| apart(&truth, arm, Seen::Position).0;
    let far = |c: &Calibration| far_arm(&c.complete.arm);
    // least squares of all rows, the wrong ones with them
    let mut plain = clean.complete.arm.clone();
    let all: Vec<&Observation> = data.iter().collect();
    let unknowns = &clean.complete.fit.unknowns;
    assert!(solve(&mut plain, unknowns, &all, SIGMAS, Prior::None).converged);
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
        assert!(far(&found) < 0.5 * far_arm(&plain), "{loss:?}");
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
