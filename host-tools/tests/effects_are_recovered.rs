//! Every effect, put into synthetic poses without noise, is identified with its own values
//! together with the geometry, and predicts poses that no fit has seen.

use std::f64::consts::FRAC_PI_2;

use crate::synthetic;
use nalgebra::Vector3;
use truepose::effects::{AXES, Ambient, Effect, Factor, Place, Selector, Shape, Unnamed, Variable};
use truepose::{Joint, JointKind, LinkMass, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::identify::problem::Problem;
use truepose_host::identify::structure::structure;
use truepose_host::identify::unknown::Unknown;
use truepose_host::identify::{Status, identify};

/// A 64-bit linear congruential generator (Knuth's MMIX constants).
struct Random(u64);

impl Random {
    /// Uniform in [-range, range).
    fn within(&mut self, range: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0) * range
    }

    fn vector(&mut self, range: f64) -> Vector3<f64> {
        Vector3::new(self.within(range), self.within(range), self.within(range))
    }
}

const SIGMAS: Sigmas = Sigmas {
    position: 2e-5,
    orientation: 7e-5,
    length: 2e-5,
    ..Sigmas::UNIT
};

/// An elbow arm with a wrist whose axes do not meet; with a slide as its third joint instead
/// of the elbow if asked for.
fn drawing(slide: bool) -> ArmModel {
    use JointKind::{Prismatic, Revolute};
    let rows = if slide {
        [
            (Revolute, 0.0, 0.4, 0.0, -FRAC_PI_2),
            (Revolute, 0.0, 0.15, 0.02, FRAC_PI_2),
            (Prismatic, 0.0, 0.3, 0.03, 0.4),
            (Revolute, 0.0, 0.1, 0.02, -FRAC_PI_2),
            (Revolute, 0.0, 0.0, 0.03, FRAC_PI_2),
            (Revolute, 0.0, 0.1, 0.0, 0.0),
        ]
    } else {
        [
            (Revolute, 0.0, 0.4, 0.05, -FRAC_PI_2),
            (Revolute, 0.0, 0.1, 0.45, 0.1),
            (Revolute, 0.0, 0.0, 0.06, FRAC_PI_2),
            (Revolute, 0.0, 0.42, 0.02, -FRAC_PI_2),
            (Revolute, 0.0, 0.05, 0.03, FRAC_PI_2),
            (Revolute, 0.0, 0.1, 0.0, 0.0),
        ]
    };
    let mass = |mass: f64, x: f64| LinkMass {
        mass,
        com: Vector3::new(x, 0.02, -0.01),
    };
    ArmModel::new(
        Pose::from_xyz_rpy(Vector3::new(0.5, 0.2, 0.1), Vector3::new(0.02, -0.01, 0.4)),
        rows.iter()
            .map(|&(kind, theta, d, a, alpha)| Joint::dh(kind, theta, d, a, alpha))
            .collect(),
        vec![
            mass(12.0, -0.02),
            mass(9.0, -0.2),
            mass(6.0, -0.05),
            mass(4.0, -0.1),
            mass(2.0, 0.0),
            mass(1.0, 0.0),
        ],
        Pose::from_xyz_rpy(Vector3::new(0.03, 0.02, 0.15), Vector3::zeros()),
        Vector3::new(0.0, 0.0, -9.81),
    )
}

/// The arm itself: the drawing with errors of half a millimetre and half a milliradian. Only
/// of what shows in poses: elsewhere the fit keeps to the drawing, and the masses with it.
fn real(drawing: &ArmModel, random: &mut Random) -> ArmModel {
    let mut arm = drawing.clone();
    let shown = structure(drawing, SIGMAS);
    for unknown in &shown.unknowns {
        if let Unknown::Joint(j, parameter) = *unknown {
            *arm.joints[j].parameter_mut(parameter) += random.within(5e-4);
        }
    }
    arm.tool = arm.tool.then(&Pose::from_xyz_rpy(
        random.vector(1e-3),
        random.vector(1e-3),
    ));
    arm.bases[0] = arm.bases[0].then(&Pose::from_xyz_rpy(
        random.vector(2e-3),
        random.vector(2e-3),
    ));
    arm.bake();
    arm
}

/// A pose measured without noise.
fn measured(arm: &ArmModel, row: usize, random: &mut Random) -> Observation {
    let mut ambient = Ambient {
        payload: 2.5 + random.within(2.5),
        payload_com: random.vector(0.05),
        time: 1800.0 + random.within(1800.0),
        ..Ambient::default()
    };
    ambient.temperature[0] = 25.0 + random.within(8.0);
    ambient.temperature[1] = 30.0 + random.within(5.0);
    let reach = |kind| match kind {
        JointKind::Revolute => 3.1,
        JointKind::Prismatic => 0.3,
    };
    let kinds: Vec<JointKind> = arm.joints.iter().map(|j| j.kind).collect();
    let mut o = Observation {
        row,
        q: kinds.iter().map(|&k| random.within(reach(k))).collect(),
        direction: kinds.iter().map(|_| random.within(1.0).signum()).collect(),
        travel: vec![0.0; kinds.len()],
        ambient,
        ..Observation::default()
    };
    let pose = Evaluator::new(arm, SIGMAS).observe(&o);
    o.position = Some(pose.translation);
    o.rotation = Some(pose.rotation);
    o
}

/// Puts `truth` into an arm, identifies it from 150 poses and looks at what came back.
/// `shown`: values that geometry cannot take the place of; they must be recovered.
fn recover(slide: bool, truth: &[Effect<'static, f64>], shown: usize) {
    let mut random = Random(7);
    let kind = truth[0].model().kind();
    let drawing = drawing(slide);
    let mut arm = real(&drawing, &mut random);
    arm.effects = truth.to_vec();
    arm.bake();
    let mut blank = truth.to_vec();
    for effect in &mut blank {
        effect.model_mut().values_mut().fill(0.0);
    }
    let rows = (0..150).map(|i| measured(&arm, i + 1, &mut random));
    let problem = Problem {
        sigmas: SIGMAS,
        effects: blank,
        ..synthetic::problem(&drawing, rows.collect())
    };
    let calibration = identify(&problem).unwrap();
    let found = &calibration.complete.arm;
    let mut without: f64 = 0.0;
    for i in 0..60 {
        let o = measured(&arm, i, &mut random);
        let at = Evaluator::new(found, SIGMAS).observe(&o);
        let p = o.position.unwrap() - at.translation;
        let turn = Pose::new(
            o.rotation.unwrap() * at.rotation.transpose(),
            Vector3::zeros(),
        );
        // Poses of a metre, hundreds of equations: rounding times the conditioning.
        let off = p.norm() + turn.rotation_vector().norm();
        assert!(off < 1e-9, "{kind}: {off} off at a new pose");
        let rigid = Evaluator::new(&calibration.geometric.arm, SIGMAS).observe(&o);
        without = without.max((o.position.unwrap() - rigid.translation).norm());
    }
    // The effect is one that geometry cannot do: at least 10 um without it.
    assert!(
        without > 1e-5,
        "{kind}: geometry alone is good to {without}"
    );
    let mut identified = 0;
    for (unknown, status) in &calibration.statuses {
        let Unknown::Effect { effect, value } = *unknown else {
            continue;
        };
        if *status != Status::Identified {
            continue;
        }
        identified += 1;
        let (true_value, value) = (
            truth[effect].model().values()[value],
            found.effects[effect].model().values()[value],
        );
        let scale = true_value.abs().max(1.0);
        assert!(
            (value - true_value).abs() < 1e-9 * scale,
            "{kind}: {value} instead of {true_value}"
        );
    }
    assert_eq!(identified, shown, "{kind}: {:?}", calibration.statuses);
}

/// One effect by its name with these values.
fn named(kind: &str, selector: Selector, values: &[f64]) -> Effect<'static, f64> {
    let mut effect = Effect::named(kind, &selector).unwrap();
    effect.model_mut().values_mut().copy_from_slice(values);
    effect
}

fn joint(j: usize) -> Selector {
    Selector {
        joint: Some(j),
        ..Selector::default()
    }
}

fn order(j: usize, order: f64) -> Selector {
    Selector {
        order: Some(order),
        ..joint(j)
    }
}

fn from(j: usize, from: usize) -> Selector {
    Selector {
        from: Some(from),
        ..joint(j)
    }
}

fn component(selector: Selector, component: u8) -> Selector {
    Selector {
        component: Some(component),
        ..selector
    }
}

fn recover_one(kind: &str, selector: Selector, values: &[f64]) {
    recover(false, &[named(kind, selector, values)], values.len());
}

#[test]
fn errors_of_the_reading_are_recovered() {
    recover_one("joint-gain", joint(1), &[3e-4]);
    recover_one("gear-eccentricity", order(2, 3.0), &[2e-4, -1e-4]);
    recover_one("gear-ripple", order(3, 101.0), &[5e-5, 8e-5]);
    recover_one("backlash", joint(3), &[1e-4]);
    recover_one("joint-coupling", from(4, 3), &[2e-4]);
}

#[test]
fn deflections_under_gravity_are_recovered() {
    recover_one("joint-compliance", joint(1), &[3e-5]);
    recover_one("joint-compliance", from(1, 2), &[3e-5, -2e-5]);
    recover_one("cross-axis-compliance", joint(1), &[4e-5]);
    recover_one("tool-load", joint(2), &[1e-4]);
    recover_one("link-bending", component(joint(1), 0), &[2e-5, 5e-5]);
    recover_one("link-bending", component(joint(1), 1), &[6e-5, 4e-5]);
    recover_one("base-flex", Selector::default(), &[2e-5, 3e-5]);
}

#[test]
fn drifts_are_recovered() {
    let base = component(Selector::default(), 1);
    let other_sensor = Selector {
        sensor: Some(1),
        ..joint(1)
    };
    recover_one("thermal-growth", joint(1), &[2e-5]);
    recover_one("thermal-drift", other_sensor, &[2e-5]);
    recover_one("thermal-drift", base, &[2e-5]);
    recover_one("time-drift", joint(2), &[2e-7]);
    recover_one("time-drift", base, &[1e-7]);
    recover_one("warm-up", joint(1), &[-3e-4]);
    recover_one("warm-up", component(Selector::default(), 4), &[3e-4]);
    let late = |selector| {
        let mut step = named("step-change", selector, &[4e-4]);
        step.model_mut().constants_mut()[0] = 1700.0;
        step
    };
    recover(false, &[late(joint(0))], 1);
    recover(false, &[late(component(Selector::default(), 5))], 1);
}

#[test]
fn joints_of_higher_pairs_are_recovered() {
    let amplitudes = [1e-4, -5e-5, 8e-5, 3e-5];
    for motion in 0..4 {
        recover_one("axis-wobble", component(order(2, 2.0), motion), &amplitudes);
    }
    // Along and across a slide the linear part is the geometry's; about its axes it is not.
    for (axis, name) in AXES.iter().enumerate() {
        let straight = *name == "x" || *name == "y";
        let linear = if straight { 0.0 } else { 3e-4 };
        let selector = component(joint(2), axis as u8);
        let effect = named("prismatic-straightness", selector, &[linear, 1e-3]);
        recover(true, &[effect], if straight { 1 } else { 2 });
    }
    recover(
        true,
        &[named("thermal-growth", component(joint(2), 1), &[2e-5])],
        1,
    );
}

#[test]
fn unnamed_terms_are_recovered() {
    let factor = |j, shape| Factor {
        variable: Variable::Joint(j),
        shape,
    };
    let limits = [[2.0, -3.1, 3.1], [0.1, -3.1, 3.1]];
    let terms = [
        (Place::Joint(2), [Shape::Sine, Shape::Polynomial(2)]),
        (Place::base(3), [Shape::Sign, Shape::Cosine]),
    ];
    for (place, [first, second]) in terms {
        let factors = [factor(1, first), factor(3, second)];
        let mut term = Unnamed::new(place, factors, limits);
        term.amplitude = [2e-4];
        recover(false, &[Effect::Unnamed(term)], 1);
    }
}
