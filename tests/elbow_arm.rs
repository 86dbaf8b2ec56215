//! The elbow arm of MRD example 1 (tables 5.1 and 5.2): joint commands updated by the inverse of
//! the nominal Jacobian, in closed form.

#![expect(clippy::unwrap_used, reason = "a test may stop at what cannot happen")]
#[path = "support/puma.rs"]
mod puma;
#[expect(dead_code, reason = "random arms are for other tests")]
mod support;

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix6, Vector6};
use puma::{away_from_singularities, blob, off};
use support::Random;
use truepose::budget::Budget;
use truepose::compensate::spherical_wrist::SphericalWrist;
use truepose::compensate::wrist_jacobian::step;
use truepose::compensate::{Compensator, Request, Status};
use truepose::effects::Conditions;
use truepose::jacobian::joint_column;
use truepose::params::Description;
use truepose::{Frame, Joint, JointKind, Model, Twist, forward};

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

/// Nominal frames and tool point at `q`.
fn frames(model: &Model<'_, f64, 6>, q: &[f64; 6]) -> ([Frame<f64>; 6], nalgebra::Vector3<f64>) {
    let chain = &model.nominal;
    let mut frames = [Frame::identity(); 6];
    let tool = forward(&chain.base, &chain.joints, q, &mut frames).then(&chain.tool);
    (frames, tool.translation)
}

#[test]
fn the_closed_form_is_the_general_inverse_to_rounding() {
    let mut random = Random(101);
    let elbow = {
        let mut blob = blob(elbow(&mut |_| 0.0), &[]);
        blob.nominal = blob.calibrated.clone();
        blob
    };
    for blob in [elbow, blob(off(&mut random), &[])] {
        let model = blob.model::<f64, 6>().unwrap();
        assert!(SphericalWrist::of(&model.nominal).is_some());
        for _ in 0..2000 {
            let q = away_from_singularities(&mut random, &model);
            let (frames, tool) = frames(&model, &q);
            let twist = Twist::new(random.vector(0.01), random.vector(0.01));
            let fast = step(&frames, &tool, &twist).unwrap();
            let mut jacobian = Matrix6::zeros();
            for (j, frame) in frames.iter().enumerate() {
                let column = joint_column(JointKind::Revolute, frame, &tool).rows();
                jacobian.set_column(j, &Vector6::from(column));
            }
            let slow = jacobian.lu().solve(&Vector6::from(twist.rows())).unwrap();
            for (fast, slow) in fast.iter().zip(slow.iter()) {
                assert!((fast - slow).abs() < 1e-12, "{fast} {slow}");
            }
        }
    }
}

#[test]
fn at_a_singular_configuration_there_is_none() {
    let blob = blob(elbow(&mut |_| 0.0), &[]);
    let model = {
        let mut blob = blob;
        blob.nominal = blob.calibrated.clone();
        blob.model::<f64, 6>().unwrap()
    };
    let twist = Twist::new([1e-3, 2e-3, 3e-3].into(), [1e-3; 3].into());
    // The arm stretched: links 2 and 3 in line.
    let (frames, tool) = frames(&model, &[0.0, 0.0, 0.0, 0.4, 0.9, 0.2]);
    let found = step(&frames, &tool, &twist);
    assert!(
        found.is_none_or(|p| p.iter().any(|p| p.abs() > 1e3)),
        "{found:?}"
    );
}

/// MRD 5.46 to 5.48 as printed, in the frame of link 3.
#[test]
fn the_first_three_are_those_of_the_printed_equations() {
    let mut random = Random(102);
    let mut blob = blob(elbow(&mut |_| 0.0), &[]);
    blob.nominal = blob.calibrated.clone();
    let model = blob.model::<f64, 6>().unwrap();
    for _ in 0..200 {
        let q = away_from_singularities(&mut random, &model);
        let (frames, tool) = frames(&model, &q);
        let twist = Twist::new(random.vector(0.01), random.vector(0.01));
        let found = step(&frames, &tool, &twist).unwrap();
        // x of link 3 along the link, z along its joint.
        let z = frames[2].axis();
        let x = (frames[4].origin - frames[2].origin).normalize();
        let y = z.cross(&x);
        let centre = frames[4].origin;
        let mu = twist.linear + twist.angular.cross(&(centre - tool));
        let (mx, my, mz) = (mu.dot(&x), mu.dot(&y), mu.dot(&z));
        let (s3, c3) = q[2].sin_cos();
        let (s23, c23) = (q[1] + q[2]).sin_cos();
        let d1 = -mz / (M * q[1].cos() + N * c23);
        let d2 = (mx - d1 * L * c23) / (M * s3);
        let d3 = (d1 * L * s23 - d2 * (N + M * c3) + my) / N;
        for (found, printed) in found.iter().zip([d1, d2, d3]) {
            assert!((found - printed).abs() < 1e-10, "{found:?} {printed}");
        }
    }
}

/// Table 5.2: errors of 5.5 to 6.8 mm fall by about 40 to 1, in four to six iterations, each with
/// the nominal Jacobian, ended when a joint's step is below its resolution. (The printed
/// deviations are not given; these are random and as large.)
#[test]
fn errors_fall_forty_times_in_a_few_iterations() {
    const RESOLUTION: f64 = 1e-4;
    let mut random = Random(103);
    let (mut most, mut worst, mut sizes) = (0, 0.0_f64, Vec::new());
    for _ in 0..200 {
        let mut blob = blob(elbow(&mut |range| random.within(range)), &[]);
        blob.nominal = elbow(&mut |_| 0.0);
        let model = blob.model::<f64, 6>().unwrap();
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
            let (frames, tool) = frames(&model, &q);
            let p = step(&frames, &tool, &error(&q)).unwrap();
            for (q, p) in q.iter_mut().zip(p) {
                *q += p;
            }
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
