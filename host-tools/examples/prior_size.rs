//! How far the held-out error falls with a prior whose size is found by cross-validation, on
//! simulated six-joint arms: few noisy rows to many good ones (docs/ESTIMATORS.md).
//!
//!     cargo run --release -p truepose-host-tools --example prior_size [SEEDS]
//!
//! Of each: rms of the tool's true error on 500 other poses over that of the plain fit, mean of
//! the squares over all seeds; how many seeds are better, and the worst one.

use nalgebra::Vector3;
use truepose::Convention;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::identify;
use truepose_host::identify::method::{Estimator, Method};
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::random::Random;

#[path = "../tests/synthetic/mod.rs"]
#[expect(dead_code, reason = "the tests use the rest")]
mod synthetic;
use synthetic::{SIGMAS, Seen, anywhere, arm, built, measured, problem};

/// Rows, noise over [`SIGMAS`], the largest deviation of the arm, m and rad.
const STUDIES: [(usize, f64, f64); 6] = [
    (20, 16.7, 1e-3),
    (20, 16.7, 5e-3),
    (20, 1.0, 1e-3),
    (40, 16.7, 1e-3),
    (100, 16.7, 1e-3),
    (100, 1.0, 1e-3),
];

fn with(tolerance: [f64; 2], cross_validated: bool) -> Method {
    Method {
        estimator: Estimator::MinimumVariance,
        tolerance,
        cross_validated,
        ..Method::default()
    }
}

/// Mean squared error of the tool point at other poses, m^2; NaN where nothing settles.
fn error(
    drawing: &ArmModel,
    truth: &ArmModel,
    data: &[Observation],
    noise: f64,
    by: Method,
) -> f64 {
    let mut problem = problem(drawing, data.to_vec());
    problem.sigmas = Sigmas {
        position: noise * SIGMAS.position,
        ..SIGMAS
    };
    problem.method = by;
    let Ok(found) = identify(&problem) else {
        return f64::NAN;
    };
    let unseen = measured(truth, Seen::Position, 500, 0.0, 7);
    let mut evaluator = Evaluator::new(&found.complete.arm, SIGMAS);
    let off = |o: &Observation| {
        let p: Vector3<f64> = o.position.unwrap_or_default();
        (evaluator.observe(o).translation - p).norm_squared()
    };
    unseen.iter().map(off).sum::<f64>() / unseen.len() as f64
}

fn main() {
    let seeds = std::env::args().nth(1).and_then(|n| n.parse().ok());
    let seeds: u64 = seeds.unwrap_or(100);
    let default = Method::default().tolerance;
    let tight = [1e-3, 0.1_f64.to_radians()];
    println!(
        "| rows | noise, um | arm off by, mm, mrad | plain, um | prior | over plain | better | worst |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (rows, noise, size) in STUDIES {
        let ways = [
            ("5 mm, 0.5 deg", with(default, false)),
            ("1 mm, 0.1 deg", with(tight, false)),
            ("cross-validated", with(default, true)),
        ];
        let mut plain = Vec::new();
        let mut each = vec![Vec::new(); ways.len()];
        for seed in 0..seeds {
            let drawing = arm(Convention::Dh, "RRRRRR", &[], seed);
            let mut truth = built(&drawing, size, seed);
            truth.bases[0] = anywhere(&mut Random::new(seed, 1));
            truth.bake();
            let data = measured(&truth, Seen::Position, rows, noise, 100 + seed);
            plain.push(error(&drawing, &truth, &data, noise, Method::default()));
            for ((_, way), errors) in ways.iter().zip(&mut each) {
                errors.push(error(&drawing, &truth, &data, noise, *way));
            }
        }
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        for ((name, _), errors) in ways.iter().zip(&each) {
            let ratios = || errors.iter().zip(&plain).map(|(e, p)| (e / p).sqrt());
            println!(
                "| {rows} | {:.0} | {:.0} | {:.1} | {name} | {:.3} | {} of {seeds} | {:.2} |",
                noise * 30.0,
                size * 1e3,
                mean(&plain).sqrt() * 1e6,
                (mean(errors) / mean(&plain)).sqrt(),
                ratios().filter(|r| *r < 1.0).count(),
                ratios().fold(0.0, f64::max),
            );
        }
    }
}
