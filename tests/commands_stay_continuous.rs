//! Along a straight path, points 0.1 mm apart, corrected commands move on in small steps:
//! through the wrist singularity, along and into a joint limit, with and without a memory.

use crate::path::{in_plane, path};
use crate::puma::{blob, off};
use crate::random::Random;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::taught::Taught;
use truepose::{Method, Model, Settings};

/// The largest step of any corrected joint beyond the nominal step, rad. A correction is at
/// most `e / γ` times as steep as the singular value along the path, with a pose error e of
/// 0.01 and γ = 0.001 right at the singularity; the wrist turns by 0.3 mrad between
/// neighbours.
const BOUND: f64 = 0.01 / 0.001 * 3e-4;

/// The methods that need no tables; those that do have the same paths to go in
/// `host-tools/tests/taught_commands_are_continuous.rs`.
fn model_based() -> impl Iterator<Item = Method> {
    Method::ALL
        .into_iter()
        .filter(|&method| Taught::<f64>::default().has(method))
}

/// Largest joint step beyond the nominal one; checks the other promises on the way.
fn roughness(model: &Model<'_, f64, 6>, path: &[[f64; 6]], method: Method, memory: bool) -> f64 {
    let settings = Settings {
        method,
        ..Settings::default()
    };
    let mut compensator = Compensator::new(model).with_settings(settings);
    let mut last: Option<[f64; 6]> = None;
    let mut largest = 0.0_f64;
    for (k, q) in path.iter().enumerate() {
        if !memory {
            compensator.reset();
        }
        let outcome = compensator.correct(&Request::joints(*q), &mut Budget::unlimited());
        let (before, after) = (outcome.initial.unwrap(), outcome.remaining.unwrap());
        assert!(
            after.position.hypot(after.orientation) <= before.position.hypot(before.orientation)
        );
        let correction = std::array::from_fn(|j| outcome.q[j] - q[j]);
        if let Some(last) = last {
            for j in 0..6 {
                let step: f64 = correction[j] - last[j];
                largest = largest.max(step.abs());
            }
        }
        last = Some(correction);
        assert!(k < path.len());
    }
    largest
}

#[test]
fn through_the_wrist_singularity() {
    let mut random = Random(31);
    let mut worst = [0.0_f64; 2];
    for _ in 0..20 {
        let blob = blob(off(&mut random), &[]);
        let model = blob.model::<f64, 6>().unwrap();
        let path = path(&model, random.within(2.0), &in_plane(0.3));
        for method in model_based() {
            for (worst, memory) in worst.iter_mut().zip([false, true]) {
                *worst = worst.max(roughness(&model, &path, method, memory));
            }
        }
    }
    println!("largest step beyond nominal {worst:?} rad");
    assert!(
        worst.iter().all(|&w| w < BOUND),
        "{worst:?} against {BOUND}"
    );
}

#[test]
fn along_and_into_a_joint_limit() {
    let mut random = Random(32);
    let mut worst = [0.0_f64; 2];
    for k in 0..20 {
        let mut blob = blob(off(&mut random), &[]);
        let free = blob.model::<f64, 6>().unwrap();
        let path = path(&free, 0.5, &in_plane(0.3));
        // The path runs into the limit of one joint and out again, or along it.
        let j = [1, 2, 3, 4, 5][k % 5];
        let highest = path.iter().map(|q| q[j]).fold(f64::MIN, f64::max);
        let lowest = path.iter().map(|q| q[j]).fold(f64::MAX, f64::min);
        blob.limits[j][1] = lowest + (highest - lowest) * 0.7;
        let model = blob.model::<f64, 6>().unwrap();
        for method in model_based() {
            for (worst, memory) in worst.iter_mut().zip([false, true]) {
                *worst = worst.max(roughness(&model, &path, method, memory));
            }
        }
    }
    println!("largest step beyond nominal {worst:?} rad");
    assert!(
        worst.iter().all(|&w| w < BOUND),
        "{worst:?} against {BOUND}"
    );
}
