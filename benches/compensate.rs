//! One compensated pose on the host in `f64`, from nominal joints to 1e-6 m and 1e-6 rad:
//! `cargo bench --bench compensate`.

#![expect(missing_docs, reason = "criterion's macros write undocumented items")]
#![expect(clippy::unwrap_used, reason = "a bench may stop at what cannot happen")]
#[path = "../tests/support/puma.rs"]
mod puma;
#[path = "../tests/support/random.rs"]
#[expect(dead_code, reason = "shared with the tests")]
mod random;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request, Status};

fn one_pose(criterion: &mut Criterion) {
    let mut random = random::Random(41);
    let blob = puma::blob(puma::off(&mut random), &[]);
    let model = blob.model::<f64, 6>().unwrap();
    let requests: Vec<_> = (0..256)
        .map(|_| Request::joints(puma::away_from_singularities(&mut random, &model)))
        .collect();
    let mut next = 0;
    criterion.bench_function("one pose, from nominal joints", |b| {
        let mut compensator = Compensator::new(&model);
        b.iter(|| {
            next = (next + 1) % requests.len();
            compensator.reset();
            let outcome = compensator.correct(black_box(&requests[next]), &mut Budget::unlimited());
            assert_eq!(outcome.status, Status::Converged);
            outcome
        });
    });
    criterion.bench_function("forward kinematics", |b| {
        b.iter(|| {
            next = (next + 1) % requests.len();
            model.nominal_pose(black_box(&requests[next].q))
        });
    });
}

criterion_group!(benches, one_pose);
criterion_main!(benches);
