//! A person says which parameters are identified: the others stay as drawn to the last bit,
//! whatever the estimator, and what is free comes back as well as the bound allows.

use crate::synthetic::{CONVENTIONS, SIGMAS, Seen, anywhere, apart, arm, built, measured, problem};
use nalgebra::Vector3;
use truepose::{Convention, JointKind, Parameter, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::bootstrap::bootstrap;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::held::Wish;
use truepose_host::identify::method::{ESTIMATORS, Loss, Method};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::predicted::Uncertainty;
use truepose_host::identify::problem::Problem;
use truepose_host::identify::structure::complete_count;
use truepose_host::identify::unknown::Unknown;
use truepose_host::identify::{Calibration, Failure, Status, geometry, identify};
use truepose_host::random::Random;

const TRUTH: f64 = 1e-9;

fn wish(only: &[&str], hold: &[&str], free: &[&str]) -> Wish {
    let of = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
    Wish {
        only: of(only),
        hold: of(hold),
        free: of(free),
    }
}

fn asked(drawing: &ArmModel, data: &[Observation], wish: &Wish) -> Result<Problem, Failure> {
    let mut problem = problem(drawing, data.to_vec());
    problem.hold(wish)?;
    Ok(problem)
}

fn found(drawing: &ArmModel, data: &[Observation], wish: &Wish) -> Calibration {
    identify(&asked(drawing, data, wish).unwrap()).unwrap()
}

/// Offsets of all joints are off, and the instrument stands anywhere.
pub(crate) fn offset(drawing: &ArmModel, seed: u64) -> ArmModel {
    let mut random = Random::new(seed, 1);
    let mut truth = drawing.clone();
    for joint in &mut truth.joints {
        match joint.kind {
            JointKind::Revolute => joint.theta += random.between(-0.02, 0.02),
            JointKind::Prismatic => joint.d += random.between(-0.02, 0.02),
        }
    }
    truth.bases[0] = anywhere(&mut random);
    truth.bake();
    truth
}

/// All that is not identified has the drawing's value, bit by bit; joints' parameters at least
/// are told of.
fn as_drawn(drawing: &ArmModel, found: &Calibration) -> usize {
    let stage = &found.complete;
    let mut held = 0;
    for (j, joint) in drawing.joints.iter().enumerate() {
        for &parameter in joint.parameters() {
            let unknown = Unknown::Joint(j, parameter);
            if !stage.fit.unknowns.contains(&unknown) {
                let (is, should) = (unknown.value(&stage.arm), unknown.value(drawing));
                assert_eq!(is.to_bits(), should.to_bits(), "{}", unknown.name(drawing));
                held += 1;
            }
        }
    }
    held
}

fn status<'a>(found: &'a Calibration, name: &str) -> &'a Status {
    let named = |(unknown, _): &&(Unknown, Status)| unknown.name(&found.complete.arm) == name;
    let mut all = found.statuses.iter().filter(named);
    let (_, status) = all.next().unwrap_or_else(|| panic!("{name} has no status"));
    assert!(all.next().is_none(), "{name} has two");
    status
}

fn is_held(found: &Calibration, name: &str, by: &str) -> bool {
    matches!(status(found, name), Status::Fixed(why) if why.contains(by))
}

#[test]
fn offsets_alone_come_back_in_every_convention() {
    for convention in CONVENTIONS {
        for (seed, kinds) in (0..).zip(["RRR", "RRPR", "RRRRRR"]) {
            for seen in [Seen::Position, Seen::Pose] {
                let drawing = arm(convention, kinds, &[], seed);
                let truth = offset(&drawing, seed);
                let data = measured(&truth, seen, 40, 0.0, 5);
                let only = found(&drawing, &data, &wish(&["offsets"], &[], &[]));
                let (far, turned) = apart(&truth, &only.complete.arm, seen);
                assert!(
                    far < TRUTH && turned < TRUTH,
                    "{convention:?} {kinds}: {far} {turned}"
                );
                let fitted = only.complete.fit.unknowns.iter();
                let joints = fitted.filter(|u| matches!(u, Unknown::Joint(..))).count();
                // the first turn is the base's, the last the tool's, as far as either shows
                assert!(joints + 2 >= kinds.len() && joints <= kinds.len());
                assert!(as_drawn(&drawing, &only) >= 3 * kinds.len());
                let other = match convention {
                    Convention::ZeroReference => "joint 2 axis x",
                    _ => "joint 2 alpha",
                };
                assert!(is_held(&only, other, "--only \"offsets\""));
                assert_eq!(*status(&only, "joint 2 theta"), Status::Identified);
            }
        }
    }
}

#[test]
fn base_and_tool_alone_are_the_nominal_stage() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = built(&drawing, 1e-3, 8);
    truth.bases[0] = anywhere(&mut Random::new(8, 1));
    truth.bake();
    for seen in [Seen::Position, Seen::Pose, Seen::Targets] {
        let data = measured(&truth, seen, 60, 1.0, 3);
        for wish in [
            wish(&[], &["joint"], &[]),
            wish(&["base", "tool"], &[], &[]),
        ] {
            let aligned = found(&drawing, &data, &wish);
            let (far, turned) = apart(
                &aligned.nominal.arm,
                &aligned.geometric.arm,
                match seen {
                    Seen::Targets => Seen::Position,
                    other => other,
                },
            );
            assert!(far < 1e-8 && turned < 1e-8, "{seen:?}: {far} {turned}");
            assert!(aligned.rejected.is_empty());
            assert_eq!(as_drawn(&drawing, &aligned), 30);
            let free = found(&drawing, &data, &Wish::default());
            let (far, _) = apart(&free.nominal.arm, &aligned.nominal.arm, Seen::Position);
            assert!(far < TRUTH, "{far}");
        }
    }
}

#[test]
fn every_estimator_and_loss_keeps_to_it() {
    for (kinds, estimators) in [("RRR", &ESTIMATORS[..]), ("RRRRRR", &ESTIMATORS[..5])] {
        let drawing = arm(Convention::Dh, kinds, &[], 8);
        let mut truth = built(&drawing, 1e-3, 8);
        for (is, should) in truth.joints.iter_mut().zip(&drawing.joints) {
            is.alpha = should.alpha;
        }
        truth.bases[0] = anywhere(&mut Random::new(8, 1));
        truth.bake();
        let data = measured(&truth, Seen::Position, 60, 1.0, 1);
        let hold = wish(&[], &["joint * alpha"], &[]);
        let reference = found(&drawing, &data, &hold);
        let mut methods: Vec<(&str, Method)> = Vec::new();
        for &(name, estimator) in estimators {
            methods.push((
                name,
                Method {
                    estimator,
                    ..Method::default()
                },
            ));
        }
        for loss in [Loss::Huber, Loss::Tukey] {
            methods.push((
                loss.name(),
                Method {
                    loss,
                    ..Method::default()
                },
            ));
        }
        for (name, method) in methods {
            let mut problem = asked(&drawing, &data, &hold).unwrap();
            problem.method = method;
            let is = identify(&problem).unwrap();
            assert!(is_held(&is, "joint 1 alpha", "--hold \"joint * alpha\""));
            assert!(as_drawn(&drawing, &is) >= kinds.len());
            for (unknown, status) in &is.statuses {
                let alpha = matches!(unknown, Unknown::Joint(_, Parameter::Alpha));
                assert!(!(alpha && *status == Status::Identified), "{name}");
            }
            assert_eq!(is.complete.fit.unknowns, reference.complete.fit.unknowns);
            // the same parameters: a tenth of a standard error, robust losses half of one
            let within = if method.loss == Loss::Square {
                0.1
            } else {
                0.8
            };
            for unknown in &reference.complete.fit.unknowns {
                let sigma = reference.complete.sigma(*unknown).unwrap();
                let off = unknown.value(&is.complete.arm) - unknown.value(&reference.complete.arm);
                assert!(
                    off.abs() < within * sigma,
                    "{name} {unknown:?}: {off} {sigma}"
                );
            }
        }
        let problem = asked(&drawing, &data, &hold).unwrap();
        for (unknown, _) in &bootstrap(&problem, &reference, 5).each {
            assert!(!problem.held.contains(unknown));
        }
        assert!(
            geometry(&problem, &reference)
                .iter()
                .all(|u| !problem.held.contains(u))
        );
    }
}

#[test]
fn a_tool_known_from_elsewhere_gives_the_last_joint_back() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 4);
    let mut truth = built(&drawing, 1e-3, 4);
    let mut random = Random::new(4, 2);
    // what a free tool would take over
    truth.joints[5].d += 2e-3;
    truth.joints[5].theta += 3e-3;
    truth.bases[0] = anywhere(&mut random);
    truth.bake();
    let data = measured(&truth, Seen::Pose, 40, 0.0, 5);
    let free = found(&drawing, &data, &Wish::default());
    assert!(matches!(status(&free, "joint 6 d"), Status::Merged(_)));
    let known = found(&drawing, &data, &wish(&[], &["tool"], &[]));
    for name in ["joint 6 d", "joint 6 theta"] {
        assert_eq!(*status(&known, name), Status::Identified, "{name}");
    }
    assert!(is_held(&known, "tool yaw", "--hold \"tool\""));
    let (far, turned) = apart(&truth, &known.complete.arm, Seen::Pose);
    assert!(far < TRUTH && turned < TRUTH, "{far} {turned}");
    let d = known.complete.arm.joints[5].d - truth.joints[5].d;
    assert!(d.abs() < 1e-8, "{d}");
    let tool = &known.complete.arm.tool;
    assert_eq!(tool.translation, drawing.tool.translation);
    assert_eq!(tool.rotation, drawing.tool.rotation);
    // four of the six are the last joint's in a complete model without a tool
    let count = known.complete.fit.unknowns.len();
    assert_eq!(count, complete_count(&drawing) - 2);
}

#[test]
fn one_joint_alone_and_all_others_alone() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 6);
    let mut truth = drawing.clone();
    truth.joints[2].alpha += 2e-3;
    truth.joints[2].a -= 1e-3;
    truth.joints[2].theta += 4e-3;
    truth.bases[0] = anywhere(&mut Random::new(6, 1));
    truth.bake();
    let data = measured(&truth, Seen::Position, 30, 0.0, 5);
    for wish in [
        wish(&["joint 3"], &[], &[]),
        wish(&[], &["joint"], &["Joint 3"]),
        wish(
            &[],
            &["joint"],
            &["joint 3 alpha", "joint 3 a", "joint 3 theta"],
        ),
    ] {
        let one = found(&drawing, &data, &wish);
        for (unknown, status) in &one.statuses {
            if let (Unknown::Joint(j, p), Status::Identified) = (unknown, status) {
                assert_eq!(*j, 2, "{p:?}");
                let off = unknown.value(&one.complete.arm) - unknown.value(&truth);
                assert!(off.abs() < 1e-8, "{p:?} {off}");
            }
        }
        let (far, _) = apart(&truth, &one.complete.arm, Seen::Position);
        assert!(far < TRUTH, "{far}");
    }
    // held, it cannot be made up for: beta, which no complete model of this arm has, stays out
    let others = found(&drawing, &data, &wish(&[], &["joint 3"], &[]));
    let (far, _) = apart(&truth, &others.complete.arm, Seen::Position);
    assert!(far > 1e-4, "{far}");
    let beta = |u: &Unknown| matches!(u, Unknown::Joint(_, Parameter::Beta));
    assert!(!others.complete.fit.unknowns.iter().any(beta));
    // but named in full it is identified
    let mut tilted = drawing.clone();
    tilted.joints[2].beta = 3e-3;
    tilted.bake();
    let data = measured(&tilted, Seen::Position, 30, 0.0, 5);
    let beta = found(&drawing, &data, &wish(&["joint 3 beta"], &[], &[]));
    assert!((beta.complete.arm.joints[2].beta - 3e-3).abs() < 1e-8);
}

#[test]
fn d_of_parallel_axes_stands_in_where_beta_is_held() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[1], 3);
    let mut truth = drawing.clone();
    truth.joints[1].d += 2e-3;
    truth.bases[0] = anywhere(&mut Random::new(3, 1));
    truth.bake();
    let data = measured(&truth, Seen::Pose, 40, 0.0, 5);
    let d = found(&drawing, &data, &wish(&["joint 2 d"], &[], &[]));
    assert_eq!(*status(&d, "joint 2 d"), Status::Identified);
    assert!((d.complete.arm.joints[1].d - truth.joints[1].d).abs() < 1e-8);
    assert!(is_held(&d, "joint 2 beta", "--only"));
    // held itself, beta stays
    let held = found(&drawing, &data, &wish(&[], &["joint 2 d"], &[]));
    assert!(is_held(&held, "joint 2 d", "--hold"));
    assert_eq!(*status(&held, "joint 2 beta"), Status::Identified);
}

#[test]
fn a_levelled_instrument_keeps_its_level() {
    let mut drawing = arm(Convention::Dh, "RRRRRR", &[], 7);
    let turns = |yaw| Vector3::new(0.02, -0.03, yaw);
    drawing.bases[0] = Pose::from_xyz_rpy(Vector3::new(1.0, 0.2, -0.3), turns(0.4));
    drawing.bake();
    let mut truth = built(&drawing, 1e-3, 7);
    truth.bases[0] = Pose::from_xyz_rpy(Vector3::new(1.4, -0.6, 0.1), turns(-2.1));
    truth.bake();
    let data = measured(&truth, Seen::Position, 50, 0.0, 5);
    let level = found(
        &drawing,
        &data,
        &wish(&[], &["base roll", "base pitch"], &[]),
    );
    let rpy = level.complete.arm.bases[0].rpy();
    assert!(
        (rpy.x - 0.02).abs() < 1e-12 && (rpy.y + 0.03).abs() < 1e-12,
        "{rpy}"
    );
    let (far, _) = apart(&truth, &level.complete.arm, Seen::Position);
    assert!(far < TRUTH, "{far}");
    assert!((rpy.z + 2.1).abs() < 1e-8, "{rpy}");
}

#[test]
fn a_known_base_holds_of_the_first_placement_alone() {
    let mut drawing = arm(Convention::Dh, "RRRR", &[], 9);
    drawing.bases[0] = anywhere(&mut Random::new(9, 7));
    drawing.bake();
    let mut truth = built(&drawing, 1e-3, 9);
    // a base that may move takes these over
    truth.joints[0].d += 3e-3;
    truth.joints[0].theta += 2e-3;
    let mut moved = truth.clone();
    moved.bases[0] = anywhere(&mut Random::new(9, 8));
    truth.bake();
    moved.bake();
    let mut data = measured(&truth, Seen::Pose, 25, 0.0, 5);
    for (k, mut o) in measured(&moved, Seen::Pose, 25, 0.0, 6)
        .into_iter()
        .enumerate()
    {
        (o.row, o.session) = (26 + k, 1);
        data.push(o);
    }
    let mut problem = problem(&drawing, data);
    problem.sessions = vec![4, 5];
    problem.hold(&wish(&[], &["base"], &[])).unwrap();
    let known = identify(&problem).unwrap();
    assert_eq!(
        known.complete.arm.bases[0].translation,
        drawing.bases[0].translation
    );
    assert_eq!(
        known.complete.arm.bases[0].rotation,
        drawing.bases[0].rotation
    );
    assert_eq!(*status(&known, "base x of placement 2"), Status::Identified);
    assert!((known.complete.arm.joints[0].d - truth.joints[0].d).abs() < 1e-8);
    let off = known.complete.arm.bases[1].translation - moved.bases[0].translation;
    assert!(off.norm() < TRUTH, "{off}");
}

/// Rms of the tool's true error over what the covariance of the fits says, and the error in um.
fn over_bound(truth: &ArmModel, drawing: &ArmModel, wish: &Wish, seeds: u64) -> (f64, f64) {
    let places = measured(truth, Seen::Position, 100, 0.0, 7);
    let at: Vec<&Observation> = places.iter().collect();
    let (mut sum, mut predicted) = (0.0, 0.0);
    for seed in 0..seeds {
        let data = measured(truth, Seen::Position, 30, 1.0, 2000 + seed);
        let stage = found(drawing, &data, wish).complete;
        // by the declared noise, not by what this one fit left
        let variance = stage.fit.variance();
        let mut evaluator = Evaluator::new(&stage.arm, SIGMAS);
        for (o, c) in at.iter().zip(Uncertainty::of(&stage).at(&stage.arm, &at)) {
            predicted += (c[(0, 0)] + c[(1, 1)] + c[(2, 2)]) / variance;
            let off = evaluator.observe(o).translation - o.position.unwrap();
            sum += off.norm_squared();
        }
    }
    let rms = (sum / (at.len() as f64 * seeds as f64)).sqrt();
    ((sum / predicted).sqrt(), rms * 1e6)
}

#[test]
fn errors_are_what_the_bound_of_the_smaller_model_says() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let truth = offset(&drawing, 8);
    // Of 40 fits with 12 to 27 parameters each: 1 within 4 / sqrt(2 * 40 * 12) = 0.13.
    let mut errors = Vec::new();
    for wish in [
        Wish::default(),
        wish(&[], &["joint * alpha"], &[]),
        wish(&["offsets"], &[], &[]),
    ] {
        let (ratio, rms) = over_bound(&truth, &drawing, &wish, 40);
        println!("{wish:?}: {rms:.2} um, {ratio:.3} of the bound");
        assert!((ratio - 1.0).abs() < 0.13, "{wish:?}: {ratio}");
        errors.push(rms);
    }
    // fewer parameters, less of the noise in each
    assert!(
        errors[1] < errors[0] && errors[2] < 0.8 * errors[0],
        "{errors:?}"
    );
}

#[test]
fn a_wish_that_cannot_be_is_explained() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 1);
    let truth = offset(&drawing, 1);
    let data = measured(&truth, Seen::Position, 40, 0.0, 5);
    for (wish, says) in [
        (
            wish(&["offests"], &[], &[]),
            "--only \"offests\": no such parameter (is offsets meant?)",
        ),
        (
            wish(&[], &["joint 3 alhpa"], &[]),
            "(is joint 3 alpha meant?)",
        ),
        (
            wish(&[], &["joint 7"], &[]),
            "--hold \"joint 7\": no such parameter; expected offsets",
        ),
        (
            wish(&[], &[""], &[]),
            "joint 1 to 6 theta, d, a, alpha, beta; tool x, y, z, roll",
        ),
        (wish(&[], &["tool x y"], &[]), "no such parameter"),
        (
            wish(&[], &[], &["tool"]),
            "--free \"tool\": nothing of it is held",
        ),
        (
            wish(&[], &["tool yaw"], &[]),
            "roll, pitch and yaw of the tool are one rotation",
        ),
    ] {
        match asked(&drawing, &data, &wish) {
            Err(Failure::Wish(sentence)) => assert!(sentence.contains(says), "{sentence}"),
            other => panic!("{wish:?}: {:?}", other.map(|p| p.held)),
        }
    }
    // --only never holds the base, and the tool where the base is named
    let base = asked(&drawing, &data, &wish(&["base"], &[], &[])).unwrap();
    let tool = asked(&drawing, &data, &wish(&["tool"], &[], &[])).unwrap();
    let x = [
        Unknown::Base {
            session: 0,
            axis: 0,
        },
        Unknown::Tool { axis: 0 },
    ];
    assert_eq!(x.map(|u| base.held.contains(&u)), [false, true]);
    assert_eq!(x.map(|u| tool.held.contains(&u)), [false, false]);
    assert!(tool.held.contains(&Unknown::Joint(2, Parameter::A)));
    let nothing = asked(&drawing, &data, &wish(&[], &["base", "tool", "joint"], &[])).unwrap();
    assert_eq!(identify(&nothing).err(), Some(Failure::NothingFree));
    // what no drawing knows
    let lengths = measured(&truth, Seen::Length, 160, 0.0, 5);
    let anchor = asked(&drawing, &lengths, &wish(&[], &["anchor"], &[]));
    let says = "the drawing has no value";
    assert!(matches!(anchor, Err(Failure::Wish(s)) if s.contains(says)));
}
