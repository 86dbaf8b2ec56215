//! What identification costs: every estimator on the same hundred poses, and how time grows
//! with rows and falls with threads. Least of several runs each.
//!
//! `cargo run --release -p truepose-host-tools --example identification_cost`

#![expect(
    clippy::expect_used,
    clippy::unwrap_used,
    reason = "an example ends where its data cannot be made"
)]

#[path = "../tests/synthetic/mod.rs"]
#[expect(dead_code, reason = "shared with the tests")]
mod synthetic;

use std::time::{Duration, Instant};

use synthetic::{Seen, anywhere, arm, built, measured, problem};
use truepose::Convention;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::identify;
use truepose_host::identify::method::{ESTIMATORS, Estimator, Loss, Method};
use truepose_host::identify::problem::Problem;
use truepose_host::random::Random;

/// Least time of `runs`, and the passes over the rows that the last fit took.
fn least(problem: &Problem, runs: usize) -> (Duration, usize) {
    let one = |_| {
        let start = Instant::now();
        let found = identify(problem).expect("a fit");
        (start.elapsed(), found.complete.fit.iterations)
    };
    (0..runs).map(one).min().unwrap()
}

fn arms() -> (ArmModel, ArmModel) {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    truth.bake();
    (drawing, truth)
}

fn main() {
    let (drawing, truth) = arms();
    let of = |seen, rows| problem(&drawing, measured(&truth, seen, rows, 1.0, 1));
    println!("| estimator, 6R | 100 positions, ms | 100 full poses, ms | passes |");
    println!("| --- | --- | --- | --- |");
    let mut methods: Vec<(String, Method)> = Vec::new();
    for (name, estimator) in ESTIMATORS {
        let method = Method {
            estimator,
            ..Method::default()
        };
        methods.push((name.to_owned(), method));
    }
    for loss in [Loss::Huber, Loss::Tukey] {
        let method = Method {
            loss,
            ..Method::default()
        };
        methods.push((format!("levenberg-marquardt, {}", loss.name()), method));
    }
    for (name, method) in methods {
        let slow = method.estimator == Estimator::GoldenSection;
        let runs = if slow { 1 } else { 50 };
        let each = [Seen::Position, Seen::Pose].map(|seen| {
            let mut problem = of(seen, 100);
            problem.method = method;
            least(&problem, runs)
        });
        let ms = |d: Duration| d.as_secs_f64() * 1e3;
        println!(
            "| {name} | {:.2} | {:.2} | {} |",
            ms(each[0].0),
            ms(each[1].0),
            each[0].1
        );
    }

    println!();
    println!("| rows of positions | 1 thread, ms | 2 threads, ms | ratio | us a row, 1 thread |");
    println!("| --- | --- | --- | --- | --- |");
    for rows in [200, 300, 500, 1000, 2000, 5000, 10_000, 20_000] {
        let problem = of(Seen::Position, rows);
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().expect("threads");
            pool.install(|| least(&problem, 10)).0.as_secs_f64()
        });
        println!(
            "| {rows} | {:.2} | {:.2} | {:.2} | {:.2} |",
            one * 1e3,
            two * 1e3,
            one / two,
            one * 1e6 / rows as f64
        );
    }
}
