//! Errors on poses that no fit has seen are what the Cramer-Rao bound predicts, the covariance
//! of the predicted tool is the scatter of the predictions, and the bootstrap agrees.

use crate::synthetic::{SIGMAS, Seen, anywhere, arm, built, measured, problem};
use nalgebra::{Matrix6, Vector3, Vector6};
use truepose::Convention;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::bootstrap::bootstrap;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::linearize::{linearize, residuals};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::predicted::Uncertainty;
use truepose_host::identify::unknown::Unknown;
use truepose_host::identify::{Stage, identify};
use truepose_host::random::Random;

const SEEDS: u64 = 100;

fn arms(seen: Seen) -> (ArmModel, ArmModel) {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    match seen {
        Seen::Length => truth.anchor = Vector3::new(1.5, -0.8, 0.4),
        _ => truth.bases[0] = anywhere(&mut Random::new(8, 1)),
    }
    truth.bake();
    (drawing, truth)
}

/// Mean square of the whitened verify error over what the bound says: noise, and parameters
/// found with the covariance (JᵀJ)⁻¹ of the true arm.
fn over_bound(seen: Seen, rows: usize) -> f64 {
    let (drawing, truth) = arms(seen);
    let unseen = measured(&truth, seen, 500, 0.0, 7);
    let unseen: Vec<&Observation> = unseen.iter().collect();
    let (mut sum, mut predicted) = (0.0, 0.0);
    for seed in 0..SEEDS {
        let data = measured(&truth, seen, rows, 1.0, 1000 + seed);
        let found = identify(&problem(&drawing, data.clone())).unwrap().complete;
        let unknowns = &found.fit.unknowns;
        let ones = vec![1.0; unknowns.len()];
        let fitted: Vec<&Observation> = data.iter().collect();
        let j = linearize(&truth, unknowns, &ones, &fitted, SIGMAS).jacobian;
        let v = linearize(&truth, unknowns, &ones, &unseen, SIGMAS).jacobian;
        // Columns to unit length first: metres and radians.
        let lengths: Vec<f64> = j.column_iter().map(|c| c.norm()).collect();
        let mut scaled = [j, v];
        for m in &mut scaled {
            for (mut column, length) in m.column_iter_mut().zip(&lengths) {
                column /= *length;
            }
        }
        let [j, v] = scaled;
        let r = j.qr().unpack_r();
        let spread = r
            .transpose()
            .solve_lower_triangular(&v.transpose())
            .unwrap();
        predicted += spread.norm_squared();
        sum += residuals(&found.arm, &unseen, SIGMAS).norm_squared();
    }
    // The same unit noise on both sides stands for that of the verify measurements.
    let equations: usize = unseen.iter().map(|o| o.equations()).sum();
    let noise = equations as f64 * SEEDS as f64;
    ((sum + noise) / (predicted + noise)).sqrt()
}

#[test]
fn verify_errors_are_those_of_the_bound() {
    for (seen, rows) in [(Seen::Position, 50), (Seen::Pose, 50), (Seen::Length, 120)] {
        let ratio = over_bound(seen, rows);
        println!("{seen:?}: {ratio:.4} of the bound");
        assert!((ratio - 1.0).abs() < 0.03, "{seen:?}: {ratio}");
    }
}

#[test]
fn predicted_tools_scatter_as_their_covariance_says() {
    let (drawing, truth) = arms(Seen::Pose);
    let places = measured(&truth, Seen::Pose, 5, 0.0, 9);
    let at: Vec<&Observation> = places.iter().collect();
    let mut squares = [0.0; 5];
    for seed in 0..SEEDS {
        let data = measured(&truth, Seen::Pose, 40, 1.0, 3000 + seed);
        let found = identify(&problem(&drawing, data)).unwrap().complete;
        let covariance: Vec<Matrix6<f64>> = Uncertainty::of(&found).at(&found.arm, &at);
        let mut evaluator = Evaluator::new(&found.arm, SIGMAS);
        for ((o, c), sum) in places.iter().zip(covariance).zip(&mut squares) {
            let should = truepose::Pose::new(o.rotation.unwrap(), o.position.unwrap());
            let off = evaluator.observe(o).twist_to(&should);
            let off = Vector6::from_iterator(off.linear.iter().chain(off.angular.iter()).copied());
            *sum += off.dot(&c.cholesky().unwrap().solve(&off));
        }
    }
    for sum in squares {
        // Chi-square of six over a hundred seeds, with an estimated variance: 6 to 4 standard
        // errors of sqrt(12 / 100) each.
        let mean = sum / SEEDS as f64;
        assert!((mean - 6.0).abs() < 1.4, "{mean}");
    }
}

fn sigmas(stage: &Stage, unknowns: &[Unknown]) -> Vec<f64> {
    let each = unknowns.iter().map(|u| stage.fit.sigma(*u).unwrap());
    each.collect()
}

#[test]
fn the_bootstrap_says_the_same_for_any_number_of_threads() {
    let (drawing, truth) = arms(Seen::Pose);
    let data = measured(&truth, Seen::Pose, 100, 1.0, 11);
    let problem = problem(&drawing, data);
    let calibration = identify(&problem).unwrap();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| bootstrap(&problem, &calibration, 60))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one, three);
    assert_eq!((one.draws, one.failed), (60, 0));
    let unknowns: Vec<Unknown> = one.each.iter().map(|(u, _)| *u).collect();
    let declared = sigmas(&calibration.complete, &unknowns);
    let ratios = one
        .each
        .iter()
        .zip(&declared)
        .map(|((_, s), d)| s.sigma / d);
    let mean = ratios.map(f64::ln).sum::<f64>() / declared.len() as f64;
    // Rows drawn with replacement: fewer different ones, so a little more scatter.
    assert!((0.85..1.3).contains(&mean.exp()), "{}", mean.exp());
    for (unknown, scatter) in &one.each {
        let value = unknown.value(&calibration.complete.arm);
        let [low, high] = scatter.interval95;
        assert!(low < value + 2.0 * scatter.sigma && high > value - 2.0 * scatter.sigma);
    }
}

#[test]
fn threads_do_not_change_a_fit() {
    let (drawing, truth) = arms(Seen::Pose);
    let data = measured(&truth, Seen::Pose, 900, 1.0, 12);
    let problem = problem(&drawing, data);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let found = pool.install(|| identify(&problem)).unwrap().complete;
        let values = found
            .fit
            .unknowns
            .iter()
            .map(|u| u.value(&found.arm).to_bits());
        values.collect::<Vec<u64>>()
    };
    assert_eq!(with(1), with(2));
}
