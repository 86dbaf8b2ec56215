//! The elbow arm of MRD example 1 (tables 5.1 and 5.2): joint commands updated by the inverse of
//! the nominal Jacobian, which the compensator of a nominal model has in closed form.

use std::f64::consts::FRAC_PI_2;

use crate::puma::{self, away_from_singularities, blob};
use crate::random::Random;
use truepose::budget::Budget;
use truepose::compensate::spherical_wrist::SphericalWrist;
use truepose::compensate::{Compensator, Request, Status};
use truepose::effects::Conditions;
use truepose::params::Description;
use truepose::{Joint, JointKind, Model, Settings};

/// Lengths of table 5.1, m.
const L: f64 = 0.149_09;
const M: f64 = 0.431_8;
const N: f64 = 0.433_07;
const P: f64 = 0.056_25;

/// Table 5.1: d, a, alpha.
const ELBOW: [[f64; 3]; 6] = [
    [0.0, 0.0, FRAC_PI_2],
    [L, M, 0.0],
    [0.0, N, 0.0],
    [0.0, 0.0, FRAC_PI_2],
    [0.0, 0.0, FRAC_PI_2],
    [P, 0.0, 0.0],
];

fn elbow(off: &mut dyn FnMut(f64) -> f64) -> Description {
    let mut description = puma::nominal();
    let joint = |&[d, a, alpha]: &[f64; 3]| Joint::dh(JointKind::Revolute, 0.0, d, a, alpha);
    description.joints = ELBOW.iter().map(joint).collect();
    for joint in &mut description.joints {
        joint.theta += off(4e-3);
        joint.alpha += off(4e-3);
        joint.d += off(2e-3);
        joint.a += off(2e-3);
    }
    description
}

/// Table 5.2: errors of 5.5 to 6.8 mm fall by about 40 to 1, in four to six iterations, each a
/// step of the nominal arm's compensator from the error that the true arm has, ended when every
/// joint's step is below its resolution. (The printed deviations are not given; these are random
/// and as large.)
#[test]
fn errors_fall_forty_times_in_a_few_iterations() {
    const RESOLUTION: f64 = 1e-4;
    let mut random = Random(103);
    let (mut most, mut worst, mut sizes) = (0, 0.0_f64, Vec::new());
    for _ in 0..200 {
        let mut blob = blob(elbow(&mut |range| random.within(range)), &[]);
        blob.nominal = elbow(&mut |_| 0.0);
        let model = blob.model::<f64, 6>().unwrap();
        let nominal = Model {
            calibrated: model.nominal.clone(),
            ..model.clone()
        };
        assert!(SphericalWrist::of(&nominal.calibrated).is_some());
        let mut by_nominal = Compensator::new(&nominal).with_settings(Settings {
            max_iterations: 1,
            ..nominal.settings
        });
        let start = away_from_singularities(&mut random, &model);
        let desired = model.nominal_pose(&start);
        let error = |q: &[f64; 6]| {
            let there = model.predict(q, &Conditions::default());
            there.twist_to(&desired)
        };
        let before = error(&start).linear.norm();
        if !(5.5e-3..6.9e-3).contains(&before) {
            continue;
        }
        sizes.push(before);
        let (mut q, mut iterations) = (start, 0);
        loop {
            let none = Conditions::default();
            let measured = model.predict(&q, &none);
            let request = Request::sensed(&nominal, q, &measured, &desired, none);
            let outcome = by_nominal.correct(&request, &mut Budget::unlimited());
            assert!(outcome.status.compensated() && outcome.iterations <= 1);
            let p: [f64; 6] = std::array::from_fn(|k| outcome.q[k] - q[k]);
            q = outcome.q;
            iterations += 1;
            // 5.44, step 6, with every element where the book has one.
            if p.iter().all(|p| p.abs() < RESOLUTION) {
                break;
            }
        }
        most = most.max(iterations);
        worst = worst.max(error(&q).linear.norm() / before);
        // The compensator on the same request.
        let outcome =
            Compensator::new(&model).correct(&Request::joints(start), &mut Budget::unlimited());
        assert_eq!(outcome.status, Status::Converged);
        assert!(outcome.iterations <= 4, "{outcome:?}");
    }
    println!(
        "{} arms, at most {most} iterations, at worst 1 to {:.0}",
        sizes.len(),
        1.0 / worst
    );
    assert!(sizes.len() >= 5, "{sizes:?}");
    assert!(most <= 6 && worst < 1.0 / 40.0, "{most} {worst}");
}
