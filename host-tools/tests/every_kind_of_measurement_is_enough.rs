//! Distances between poses, touches of points and planes, bearings: derivatives follow
//! differences, and without noise the true arm comes back.

use crate::bound::{Bound, bound, posture, problem_of, surrounded};
use crate::synthetic::{self, CONVENTIONS, SIGMAS, anywhere, apart, arm, built, problem};
use nalgebra::Vector3;
use truepose::{Convention, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::linearize::{linearize, residuals};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::problem::Problem;
use truepose_host::identify::relation::Relation;
use truepose_host::identify::unknown::{Unknown, apply};
use truepose_host::identify::{Calibration, Status, identify};
use truepose_host::random::Random;

const TRUTH: f64 = 1e-9;

/// Gives `truth` the length that measurements without scale take from the drawing.
fn same_size(truth: &mut ArmModel, drawing: &ArmModel, calibration: &Calibration) -> Unknown {
    let held = calibration
        .statuses
        .iter()
        .find_map(|(u, status)| match status {
            Status::Fixed(why) if why.contains("proportions") => Some(*u),
            _ => None,
        });
    let held = held.unwrap_or_else(|| panic!("nothing gives the scale"));
    let step = held.value(drawing) - held.value(truth);
    apply(truth, &[held], &[step]);
    held
}

#[test]
fn derivatives_follow_differences() {
    for by in Bound::ALL {
        let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
        let truth = surrounded(&drawing, by, 8);
        let rows = bound(&truth, by, 6, 0.0, 3);
        // somewhere else, so that no residual is zero
        let mut here = built(&truth, 2e-3, 9);
        let mut unknowns: Vec<Unknown> = Vec::new();
        unknowns.extend((0..6).map(|axis| Unknown::Base { session: 0, axis }));
        unknowns.extend((0..3).map(|axis| Unknown::Tool { axis }));
        unknowns.extend((0..3).map(|axis| Unknown::Point { point: 1, axis }));
        unknowns.extend((0..3).map(|value| Unknown::Plane { plane: 1, value }));
        unknowns.extend((0..6).map(|axis| Unknown::Station { station: 1, axis }));
        for (j, joint) in drawing.joints.iter().enumerate() {
            unknowns.extend(joint.parameters().iter().map(|p| Unknown::Joint(j, *p)));
        }
        let moved: Vec<f64> = unknowns.iter().map(|_| 1e-3).collect();
        apply(&mut here, &unknowns, &moved);
        let rows: Vec<&Observation> = rows.iter().collect();
        let ones = vec![1.0; unknowns.len()];
        let analytic = linearize(&here, &unknowns, &ones, &rows, SIGMAS).jacobian;
        for (k, unknown) in unknowns.iter().enumerate() {
            let at = |h: f64| {
                let mut there = here.clone();
                apply(&mut there, &[*unknown], &[h]);
                residuals(&there, &rows, SIGMAS)
            };
            let h = 1e-6;
            // residual = measured - predicted
            let differences = (at(-h) - at(h)) / (2.0 * h);
            let column = analytic.column(k);
            let off = (&differences - column).norm();
            // central differences: rounding of 1e-16 / 1e-6 and a curvature of 1e-12, over sigma
            let scale = 1e-8 / 1e-5 + 1e-8 * column.norm();
            assert!(off < scale * 10.0, "{by:?} {}: {off}", unknown.name(&here));
        }
    }
}

#[test]
fn the_true_arm_comes_back() {
    for convention in CONVENTIONS {
        for (by, rows) in [
            (Bound::Distance, 150),
            (Bound::Points, 90),
            (Bound::Planes, 200),
            (Bound::Bearings, 80),
        ] {
            let drawing = arm(convention, "RRRRRR", &[], 8);
            let mut truth = surrounded(&drawing, by, 8);
            let run = |truth: &ArmModel| {
                identify(&problem_of(&drawing, by, bound(truth, by, rows, 0.0, 3)))
                    .unwrap_or_else(|failure| panic!("{convention:?} {by:?}: {failure:?}"))
            };
            let mut calibration = run(&truth);
            if matches!(by, Bound::Points | Bound::Planes | Bound::Bearings) {
                same_size(&mut truth, &drawing, &calibration);
                calibration = run(&truth);
            }
            let found = &calibration.complete.arm;
            for (unknown, status) in &calibration.statuses {
                let (is, should) = (unknown.value(found), unknown.value(&truth));
                assert!(is.is_finite());
                if let (Unknown::Joint(..), Status::Identified) = (unknown, status) {
                    let name = unknown.name(found);
                    let off = (is - should).abs();
                    assert!(off < 10.0 * TRUTH, "{convention:?} {by:?} {name}: {off}");
                }
            }
            let (far, _) = apart(&truth, found, synthetic::Seen::Position);
            assert!(far < TRUTH, "{convention:?} {by:?}: {far} m");
        }
    }
}

#[test]
fn what_they_cannot_show_is_said() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    for (by, rows, why) in [
        (Bound::Distance, 150, "where the arm stands"),
        (Bound::Points, 90, "where the arm stands"),
        (Bound::Bearings, 80, "proportions"),
    ] {
        let truth = surrounded(&drawing, by, 8);
        let problem = problem_of(&drawing, by, bound(&truth, by, rows, 0.0, 3));
        let calibration = identify(&problem).unwrap();
        let notes = calibration.statuses.iter().filter_map(|(_, s)| match s {
            Status::Fixed(note) | Status::Merged(note) => Some(note.as_str()),
            Status::Identified => None,
        });
        let notes: Vec<&str> = notes.collect();
        assert!(notes.iter().any(|n| n.contains(why)), "{by:?}: {notes:?}");
        assert!(notes.iter().any(|n| n.contains("no orientation")), "{by:?}");
        let moved = calibration.complete.arm.bases[0].twist_to(&drawing.bases[0]);
        let placed = by == Bound::Bearings;
        assert_eq!(moved.linear.norm() > 0.0, placed, "{by:?}");
    }
}

#[test]
fn an_instrument_that_was_moved() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    let places: Vec<Pose<f64>> = (0..3).map(|k| anywhere(&mut Random::new(k, 1))).collect();
    truth.bases = places.clone();
    truth.bake();
    let mut random = Random::new(3, 6);
    let mut evaluator = Evaluator::new(&truth, SIGMAS);
    let rows = (0..90).map(|k| {
        let mut o = posture(&truth, &mut random);
        o.row = k + 1;
        o.session = k % 3;
        o.position = Some(evaluator.observe(&o).translation);
        // one distance in ten, to a pose of the same session
        if k % 10 == 0 {
            let mut to = posture(&truth, &mut random);
            to.session = o.session;
            let far = evaluator.observe(&to).translation;
            let distance = (evaluator.observe(&o).translation - far).norm();
            o.relations.push(Relation::Distance {
                to: Box::new(to),
                distance,
            });
        }
        o
    });
    let problem = Problem {
        sessions: vec![4, 7, 9],
        ..problem(&drawing, rows.collect())
    };
    let found = identify(&problem).unwrap().complete.arm;
    for (is, should) in found.bases.iter().zip(&places) {
        let off = is.twist_to(should);
        assert!(off.linear.norm() < TRUTH && off.angular.norm() < TRUTH);
    }
}

#[test]
fn known_targets_show_the_tool_whole() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    // A tool that is not as drawn at all: only the poses built from three targets tell.
    let turn = Pose::from_rotation_vector(&Vector3::new(1.2, -0.8, 1.9));
    truth.tool.rotation = turn.rotation * truth.tool.rotation;
    truth.targets = synthetic::TARGETS.map(Vector3::from).to_vec();
    truth.bake();
    let data = synthetic::measured(&truth, synthetic::Seen::Targets, 60, 0.0, 5);
    let problem = Problem {
        targets_known: true,
        ..problem(&drawing, data)
    };
    let calibration = identify(&problem).unwrap();
    let found = &calibration.complete.arm;
    let (far, turned) = apart(&truth, found, synthetic::Seen::Pose);
    assert!(far < TRUTH && turned < TRUTH, "{far} m, {turned} rad");
    let of_tool =
        |(u, s): &&(Unknown, Status)| matches!(u, Unknown::Tool { .. }) && *s == Status::Identified;
    assert_eq!(calibration.statuses.iter().filter(of_tool).count(), 6);
}
