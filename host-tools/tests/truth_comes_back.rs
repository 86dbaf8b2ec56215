//! Without noise the true arm comes back, whatever the convention, the joints, what was
//! measured, and wherever the instrument stood.

use crate::synthetic::{CONVENTIONS, SIGMAS, Seen, anywhere, apart, arm, built, measured, problem};
use nalgebra::Vector3;
use truepose::{Convention, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::structure::{complete_count, structure};
use truepose_host::identify::unknown::Unknown;
use truepose_host::identify::{Calibration, Status, identify};
use truepose_host::random::Random;

/// Rounding of 1e-16 over a metre, times the conditioning of such arms (1e3 to 1e5).
const TRUTH: f64 = 1e-9;

fn found(drawing: &ArmModel, truth: &ArmModel, seen: Seen, rows: usize) -> Calibration {
    let data = measured(truth, seen, rows, 0.0, 5);
    identify(&problem(drawing, data)).unwrap_or_else(|failure| panic!("{failure:?}"))
}

/// Every identified joint parameter is the truth's: base and tool are the same gauge in both.
fn same_parameters(truth: &ArmModel, calibration: &Calibration) {
    let arm = &calibration.complete.arm;
    for (unknown, status) in &calibration.statuses {
        if let (Unknown::Joint(..), Status::Identified) = (unknown, status) {
            let (is, should) = (unknown.value(arm), unknown.value(truth));
            let name = unknown.name(arm);
            assert!((is - should).abs() < 10.0 * TRUTH, "{name}: {is} {should}");
        }
    }
}

#[test]
fn full_poses_of_one_to_seven_joints_in_every_convention() {
    for convention in CONVENTIONS {
        for (seed, kinds) in (0..).zip(["R", "RR", "RRP", "PRRR", "RRRRR", "RRRRRR", "RRRPRRR"]) {
            let drawing = arm(convention, kinds, &[], seed);
            let mut truth = built(&drawing, 2e-3, seed);
            truth.bases[0] = anywhere(&mut Random::new(seed, 1));
            truth.bake();
            let calibration = found(&drawing, &truth, Seen::Pose, 40);
            let (far, turned) = apart(&truth, &calibration.complete.arm, Seen::Pose);
            assert!(
                far < TRUTH && turned < TRUTH,
                "{convention:?} {kinds}: {far} m, {turned} rad"
            );
            same_parameters(&truth, &calibration);
        }
    }
}

#[test]
fn positions_targets_and_lengths() {
    for convention in CONVENTIONS {
        for seen in [Seen::Position, Seen::Targets, Seen::Length] {
            for (seed, kinds) in (20..).zip(["RRR", "RRPR", "RRRRRR"]) {
                let drawing = arm(convention, kinds, &[], seed);
                let mut truth = built(&drawing, 2e-3, seed);
                let mut random = Random::new(seed, 1);
                if seen == Seen::Length {
                    truth.anchor = Vector3::new(1.5, -0.8, 0.4);
                } else {
                    truth.bases[0] = anywhere(&mut random);
                }
                truth.bake();
                let rows = if seen == Seen::Length { 160 } else { 60 };
                let calibration = found(&drawing, &truth, seen, rows);
                let (far, _) = apart(&truth, &calibration.complete.arm, seen);
                assert!(far < TRUTH, "{convention:?} {kinds} {seen:?}: {far} m");
            }
        }
    }
}

#[test]
fn a_model_has_four_two_and_six_parameters_beside_parallel_axes_too() {
    for convention in CONVENTIONS {
        for seed in 0..8 {
            let kinds = ["RRRRRR", "RRPRRR", "PRRRR", "RRRRRRR"][seed as usize % 4];
            // Nearly parallel turns; a slide beside them would hide what d does.
            let pairs: &[usize] = match seed % 4 {
                0 => &[1, 2],
                1 => &[3],
                2 => &[2],
                _ => &[1, 4],
            };
            for parallel in [&[][..], pairs] {
                let drawing = arm(convention, kinds, parallel, seed);
                let kept = structure(&drawing, SIGMAS).unknowns.len();
                let complete = complete_count(&drawing);
                assert_eq!(kept, complete, "{convention:?} {kinds} {parallel:?}");
            }
        }
    }
}

#[test]
fn nearly_parallel_axes_come_back_as_well() {
    for convention in CONVENTIONS {
        let drawing = arm(convention, "RRRRRR", &[1, 2], 3);
        let mut truth = built(&drawing, 1e-3, 3);
        truth.bases[0] = anywhere(&mut Random::new(3, 1));
        truth.bake();
        let calibration = found(&drawing, &truth, Seen::Pose, 60);
        let (far, turned) = apart(&truth, &calibration.complete.arm, Seen::Pose);
        assert!(
            far < TRUTH && turned < TRUTH,
            "{convention:?}: {far} m, {turned} rad"
        );
        same_parameters(&truth, &calibration);
    }
}

#[test]
fn an_instrument_anywhere_and_a_tool_that_is_not_described() {
    for seed in 0..12 {
        let mut drawing = arm(Convention::Dh, "RRRRRR", &[], seed);
        let mut truth = built(&drawing, 2e-3, seed);
        truth.bases[0] = anywhere(&mut Random::new(seed, 1));
        truth.bake();
        drawing.tool = Pose::identity();
        drawing.bake();
        for seen in [Seen::Pose, Seen::Position] {
            let calibration = found(&drawing, &truth, seen, 60);
            let (far, turned) = apart(&truth, &calibration.complete.arm, seen);
            assert!(
                far < TRUTH && turned < TRUTH,
                "{seed} {seen:?}: {far} m, {turned} rad"
            );
        }
    }
}

#[test]
fn what_these_poses_cannot_show_is_said_and_stays_as_drawn() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 4);
    let mut truth = built(&drawing, 2e-3, 4);
    truth.bases[0] = anywhere(&mut Random::new(4, 1));
    truth.bake();
    let mut data = measured(&truth, Seen::Pose, 50, 0.0, 5);
    // Joint 3 never moves: its offset and the next link are one rigid piece.
    let still: Vec<_> = data
        .iter()
        .map(|o| {
            let mut q = o.q.clone();
            q[2] = 0.3;
            q
        })
        .collect();
    let mut evaluator = truepose_host::identify::evaluator::Evaluator::new(&truth, SIGMAS);
    for (o, q) in data.iter_mut().zip(still) {
        o.q = q;
        let pose = evaluator.observe(o);
        o.position = Some(pose.translation);
        o.rotation = Some(pose.rotation);
    }
    let calibration = identify(&problem(&drawing, data)).unwrap();
    let arm = &calibration.complete.arm;
    let mut merged = 0;
    for (unknown, status) in &calibration.statuses {
        let value = unknown.value(arm);
        assert!(value.is_finite());
        match status {
            Status::Identified => {
                let sigma = calibration.complete.sigma(*unknown).unwrap();
                assert!(sigma.is_finite() && sigma > 0.0, "{}", unknown.name(arm));
            }
            Status::Merged(with) => {
                merged += 1;
                assert!(with.contains("combination"), "{with}");
                if let Unknown::Joint(..) = unknown {
                    assert_eq!(value.to_bits(), unknown.value(&drawing).to_bits());
                }
            }
            Status::Fixed(_) => {}
        }
    }
    // Four of the still joint's beyond the six that no data can show.
    assert!(merged >= 4, "{merged}");
}
