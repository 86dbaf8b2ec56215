//! A complete model has 4R + 2P + 6 parameters (MRD 2.95): what is chosen for random arms of
//! every convention counts so, has that rank numerically, and is well conditioned where
//! neighbours are nearly parallel. Left and right differential forms identify the same arm.

use nalgebra::{DMatrix, DVector, Vector3};
use truepose::effects::Ambient;
use truepose::{Convention, Pose};
use truepose_host::convert::{Form, convert};
use truepose_host::description::{Robot, RobotJoint};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::identify;
use truepose_host::identify::linearize::linearize;
use truepose_host::identify::observation::Observation;
use truepose_host::identify::structure::{complete_count, structure};
use truepose_host::identify::unknown::{Unknown, apply};

use crate::synthetic::{CONVENTIONS, SIGMAS, Seen, apart, arm, built, measured, problem};

/// Singular values of the identification Jacobian of full poses, columns of unit length.
fn spectrum(arm: &ArmModel, unknowns: &[Unknown]) -> Vec<f64> {
    let poses = measured(arm, Seen::Pose, 60, 0.0, 17);
    let poses: Vec<&Observation> = poses.iter().collect();
    let scales = vec![1.0; unknowns.len()];
    let unit = truepose_host::identify::observation::Sigmas {
        position: 1.0,
        orientation: 1.0,
        ..SIGMAS
    };
    let mut jacobian = linearize(arm, unknowns, &scales, &poses, unit).jacobian;
    truepose_host::observability::scale_columns(&mut jacobian);
    let mut values: Vec<f64> = jacobian.singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

#[test]
fn random_arms_of_every_convention_have_as_many_parameters_as_their_rank() {
    for kinds in [
        "RRRRRR", "RRPRRR", "RRRRRRR", "PRRPR", "PPPRRR", "RRRP", "RR",
    ] {
        for convention in CONVENTIONS {
            for parallel in [&[][..], &[1]] {
                for seed in 0..4 {
                    let arm = arm(convention, kinds, parallel, seed);
                    let found = structure(&arm, SIGMAS);
                    let count = complete_count(&arm);
                    let of = |letter| kinds.chars().filter(|c| *c == letter).count();
                    assert_eq!(count, 4 * of('R') + 2 * of('P') + 6);
                    let what = format!("{convention:?} {kinds} {parallel:?} {seed}");
                    assert_eq!(found.unknowns.len(), count, "{what}");
                    // All of them are seen, and with everything else that the convention knows
                    // nothing more is.
                    let chosen = spectrum(&arm, &found.unknowns);
                    let all = spectrum(&arm, &found.candidates);
                    let rank = all.iter().filter(|s| **s > 1e-9 * all[0]).count();
                    assert_eq!(rank, count, "{what}");
                    let condition = chosen[0] / chosen[count - 1];
                    assert!(condition < 2000.0, "{what}: {condition}");
                }
            }
        }
    }
}

/// All neighbours nearly parallel, as a SCARA's: each at an angle of a few milliradians.
#[test]
fn arms_of_nearly_parallel_axes_are_as_well_conditioned_as_others() {
    for kinds in ["RRPR", "RRRP", "PRRR"] {
        let tilted = arm(Convention::ZeroReference, kinds, &[0, 1, 2], 3);
        let robot = Robot {
            name: String::new(),
            base: Pose::identity(),
            joints: (tilted.joints.iter())
                .map(|joint| RobotJoint {
                    joint: *joint,
                    limits: None,
                    ratio: None,
                    resolution: None,
                    link: None,
                })
                .collect(),
            tool: tilted.tool,
            gravity: Vector3::zeros(),
            source: "synthetic".into(),
        };
        let hayati = convert(&robot, Form::Hayati).unwrap().robot;
        let hayati = ArmModel::drawn(&hayati);
        for arm in [&tilted, &hayati] {
            let found = structure(arm, SIGMAS);
            assert_eq!(found.unknowns.len(), complete_count(arm), "{kinds}");
            let values = spectrum(arm, &found.unknowns);
            let condition = values[0] / values[values.len() - 1];
            assert!(condition < 500.0, "{kinds}: {condition}");
        }
    }
}

/// Gauss-Newton with residual and Jacobian in world axes (left form, `left`) or in the tool's
/// own (right form): `delta T = T delta T_u`, MRD 4.358, 4.359, 4.363. The columns in the tool's
/// axes are those of 4.376.
fn iterated(drawing: &ArmModel, poses: &[Observation], left: bool) -> ArmModel {
    let mut arm = drawing.clone();
    let unknowns = structure(drawing, SIGMAS).unknowns;
    let one = vec![1.0; unknowns.len()];
    for _ in 0..12 {
        let all: Vec<&Observation> = poses.iter().collect();
        let mut linear = linearize(&arm, &unknowns, &one, &all, SIGMAS);
        if !left {
            let mut evaluator = Evaluator::new(&arm, SIGMAS);
            for (k, o) in poses.iter().enumerate() {
                let predicted = evaluator.observe(o);
                let back = predicted.rotation.transpose();
                // The error that is left, by the right form itself: T_n^-1 T.
                let truth = Pose::new(o.rotation.unwrap(), o.position.unwrap());
                let error = predicted.inverse().then(&truth);
                let turn = error.rotation_vector() / SIGMAS.orientation;
                let shift = error.translation / SIGMAS.position;
                for half in 0..2 {
                    let mut rows = linear.jacobian.rows_mut(6 * k + 3 * half, 3);
                    let carried = back * &rows;
                    rows.copy_from(&carried);
                    let residual = if half == 0 { shift } else { turn };
                    linear
                        .residual
                        .rows_mut(6 * k + 3 * half, 3)
                        .copy_from(&residual);
                }
            }
        }
        let step: DVector<f64> = linear
            .jacobian
            .svd(true, true)
            .solve(&linear.residual, 0.0)
            .unwrap();
        apply(&mut arm, &unknowns, step.as_slice());
    }
    arm
}

#[test]
fn left_and_right_differential_forms_identify_the_same_arm() {
    for (convention, kinds) in [
        (Convention::Dh, "RRRRRR"),
        (Convention::ZeroReference, "RRPRR"),
    ] {
        let drawing = arm(convention, kinds, &[], 5);
        let truth = built(&drawing, 2e-3, 6);
        // Noise as well: both minimise the same sum, whitened alike in every axis.
        let poses = measured(&truth, Seen::Pose, 40, 1.0, 7);
        let (left, right) = (
            iterated(&drawing, &poses, true),
            iterated(&drawing, &poses, false),
        );
        let (far, turned) = apart(&left, &right, Seen::Pose);
        // The residual's own curvature differs by its square: 1e-4 rad of noise, squared.
        assert!(far < 3e-8 && turned < 3e-8, "{far:e} {turned:e}");
        let (noise, _) = apart(&left, &truth, Seen::Pose);
        assert!(noise > 100.0 * far, "{noise:e}");
        // and it is what identification finds
        let found = identify(&problem(&drawing, poses)).unwrap().complete.arm;
        let (far, turned) = apart(&left, &found, Seen::Pose);
        assert!(far < 3e-8 && turned < 3e-8, "{far:e} {turned:e}");
    }
}

#[test]
fn right_form_columns_are_those_of_the_book() {
    // MRD 4.376: L_i = [R' -R' Omega(p); 0 R'], U_i the pose of the tool seen from link i; here
    // for a displacement of link i's distal frame in its own axes.
    let arm = arm(Convention::Dh, "RRPRRR", &[], 9);
    let q: Vec<f64> = (0..6).map(|k| 0.3 * f64::from(k) - 0.4).collect();
    let forward = |arm: &ArmModel| {
        let mut evaluator = Evaluator::new(arm, SIGMAS);
        evaluator.go(0, &q, &[0.0; 6], &Ambient::default())
    };
    let tool = forward(&arm);
    for i in 0..6 {
        let beyond = (arm.joints.iter().zip(&q).skip(i + 1))
            .fold(Pose::identity(), |t, (j, q)| t.then(&j.transform(*q)))
            .then(&arm.tool);
        let (r, p) = (beyond.rotation.transpose(), beyond.translation);
        let mut book = DMatrix::zeros(6, 6);
        book.view_mut((0, 0), (3, 3)).copy_from(&r);
        book.view_mut((0, 3), (3, 3))
            .copy_from(&(-(r * p.cross_matrix())));
        book.view_mut((3, 3), (3, 3)).copy_from(&r);
        let before = (arm.joints.iter().zip(&q).take(i + 1))
            .fold(arm.bases[0], |t, (j, q)| t.then(&j.transform(*q)));
        for axis in 0..6 {
            let h = 1e-6;
            let mut unit = Vector3::zeros();
            unit[axis % 3] = h;
            let moved = match axis {
                0..3 => Pose::translate(unit.x, unit.y, unit.z),
                _ => Pose::from_rotation_vector(&unit),
            };
            let there = before.then(&moved).then(&beyond);
            let error = tool.inverse().then(&there);
            let numeric: Vec<f64> = (error.translation.iter())
                .chain(error.rotation_vector().iter())
                .map(|x| x / h)
                .collect();
            for (row, x) in numeric.iter().enumerate() {
                assert!((x - book[(row, axis)]).abs() < 1e-5, "{i} {axis} {row}");
            }
        }
    }
}
