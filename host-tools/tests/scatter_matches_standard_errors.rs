//! Over 200 seeds of noise, estimates scatter as the reported standard errors say.

use crate::synthetic::{Seen, anywhere, arm, built, measured, problem};
use truepose::Convention;
use truepose_host::identify::unknown::Unknown;
use truepose_host::identify::{Status, identify};
use truepose_host::random::Random;

const SEEDS: u64 = 200;

fn scatter(seen: Seen) {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    truth.bake();
    // Sums over the seeds of the error over its standard error, squared, one an unknown.
    let mut unknowns: Vec<Unknown> = Vec::new();
    let mut squares: Vec<f64> = Vec::new();
    for seed in 0..SEEDS {
        let data = measured(&truth, seen, 50, 1.0, 1000 + seed);
        let calibration = identify(&problem(&drawing, data)).unwrap();
        let stage = &calibration.complete;
        let identified = calibration
            .statuses
            .iter()
            .filter(|(_, status)| *status == Status::Identified);
        for (k, (unknown, _)) in identified.enumerate() {
            if seed == 0 {
                unknowns.push(*unknown);
                squares.push(0.0);
            }
            assert_eq!(unknowns[k], *unknown);
            let mut error = unknown.value(&stage.arm) - unknown.value(&truth);
            if unknown.unit(&stage.arm) == "rad" {
                error = error.sin(); // a roll of pi is one of -pi
            }
            squares[k] += (error / stage.sigma(*unknown).unwrap()).powi(2);
        }
    }
    assert!(unknowns.len() >= 27, "{}", unknowns.len());
    let each: Vec<f64> = squares.iter().map(|s| (s / SEEDS as f64).sqrt()).collect();
    let all = (squares.iter().sum::<f64>() / (SEEDS as f64 * squares.len() as f64)).sqrt();
    // All together within 10 %. A single one's root mean square has itself a standard error
    // of 1 / sqrt(2 * 200) = 5 %: four of them for the worst of thirty.
    assert!((all - 1.0).abs() < 0.1, "{all}");
    for (unknown, ratio) in unknowns.iter().zip(&each) {
        assert!((ratio - 1.0).abs() < 0.2, "{unknown:?}: {ratio}");
    }
}

#[test]
fn of_full_poses() {
    scatter(Seen::Pose);
}

#[test]
fn of_positions() {
    scatter(Seen::Position);
}
