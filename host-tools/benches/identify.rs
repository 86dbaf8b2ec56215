//! Identification from arrays to parameters with rank and covariance, one thread: up to 256
//! rows are one block of work.

#[path = "../tests/synthetic/mod.rs"]
#[expect(dead_code, reason = "shared with the tests")]
mod synthetic;

use std::hint::black_box;

use criterion::Criterion;
use synthetic::{Seen, anywhere, arm, built, measured, problem};
use truepose::Convention;
use truepose_host::identify::identify;
use truepose_host::random::Random;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    truth.bake();
    for (name, seen) in [
        ("6R, 100 full poses", Seen::Pose),
        ("6R, 100 positions", Seen::Position),
    ] {
        let problem = problem(&drawing, measured(&truth, seen, 100, 1.0, 1));
        criterion.bench_function(&format!("identify {name}"), |bench| {
            bench.iter(|| identify(black_box(&problem)));
        });
    }
    criterion.final_summary();
}
