//! Arms drawn at random, built a little wrong, and measured.

use std::f64::consts::PI;

use nalgebra::Vector3;
use truepose::effects::Ambient;
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::held::Held;
use truepose_host::identify::method::Method;
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::identify::problem::Problem;
use truepose_host::identify::structure::structure;
use truepose_host::identify::unknown::{Unknown, apply};
use truepose_host::random::Random;

pub(crate) const CONVENTIONS: [Convention; 4] = [
    Convention::Dh,
    Convention::Hayati,
    Convention::Mdh,
    Convention::ZeroReference,
];

pub(crate) const SIGMAS: Sigmas = Sigmas {
    position: 3e-5,
    orientation: 1e-4,
    length: 3e-5,
    distance: 3e-5,
    contact: 3e-5,
    bearing: 1e-5,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seen {
    Position,
    Pose,
    Targets,
    Length,
}

/// Offsets of the further targets in the tool frame, m.
pub(crate) const TARGETS: [[f64; 3]; 2] = [[0.05, 0.08, -0.03], [-0.06, 0.04, 0.07]];

/// An arm with one joint a letter of `kinds` (R or P). Neighbouring axes are at 40 to 140 deg
/// and up to 0.4 m apart; those after the joints in `parallel` (from 0) at 1 mrad.
pub(crate) fn arm(convention: Convention, kinds: &str, parallel: &[usize], seed: u64) -> ArmModel {
    let mut random = Random::new(seed, 90);
    let mut joints = Vec::new();
    for (j, letter) in kinds.chars().enumerate() {
        let kind = match letter {
            'P' => JointKind::Prismatic,
            _ => JointKind::Revolute,
        };
        // Craig's alpha and a stand before the joint.
        let before = convention == Convention::Mdh;
        let near = match before {
            true => j > 0 && parallel.contains(&(j - 1)),
            false => parallel.contains(&j),
        };
        let alpha = match near {
            true => 1e-3,
            false => random.sign() * random.between(0.7, PI - 0.7),
        };
        let mut joint = Joint {
            theta: random.between(-3.0, 3.0),
            d: random.between(0.1, 0.4),
            a: random.between(0.1, 0.4),
            alpha,
            ..Joint::new(kind, convention)
        };
        if convention == Convention::ZeroReference {
            let previous: Option<&Joint<f64>> = joints.last();
            let (axis, point) = match previous {
                None => (Vector3::z(), Vector3::zeros()),
                Some(p) => {
                    let angle = match parallel.contains(&(j - 1)) {
                        true => 1e-3,
                        false => random.between(0.7, PI - 0.7),
                    };
                    let across = p.axis.cross(&Vector3::new(0.3, 0.5, -0.8)).normalize();
                    let turn = Pose::from_rotation_vector(&(across * angle)).rotation;
                    let point = |r: &mut Random| r.between(0.1, 0.4);
                    let (x, y, z) = (point(&mut random), point(&mut random), point(&mut random));
                    (turn * p.axis, p.point + Vector3::new(x, y, z))
                }
            };
            joint = Joint {
                axis,
                point,
                ..Joint::new(kind, convention)
            };
        }
        joints.push(joint);
    }
    let masses = vec![LinkMass::none(); joints.len()];
    let tool = Pose::from_xyz_rpy(
        Vector3::new(0.06, -0.04, 0.15),
        Vector3::new(0.3, -0.2, 0.9),
    );
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    ArmModel::new(Pose::identity(), joints, masses, tool, gravity)
}

/// Changes everything that a complete model of the drawing has: geometry by up to `size` (m
/// and rad), base and tool by hundreds of times that.
pub(crate) fn built(drawing: &ArmModel, size: f64, seed: u64) -> ArmModel {
    let mut random = Random::new(seed, 91);
    let mut arm = drawing.clone();
    let unknowns = structure(drawing, SIGMAS).unknowns;
    let steps: Vec<f64> = unknowns
        .iter()
        .map(|u| match u {
            Unknown::Joint(..) => random.between(-size, size),
            _ => 0.0,
        })
        .collect();
    apply(&mut arm, &unknowns, &steps);
    arm
}

/// Anywhere: metres away and turned any way.
pub(crate) fn anywhere(random: &mut Random) -> Pose<f64> {
    let mut vector = |r: f64| {
        Vector3::new(
            random.between(-r, r),
            random.between(-r, r),
            random.between(-r, r),
        )
    };
    let position = vector(4.0);
    Pose::new(Pose::from_rotation_vector(&vector(1.8)).rotation, position)
}

/// Readings at random, a turn or a metre each.
pub(crate) fn readings(arm: &ArmModel, random: &mut Random) -> Vec<f64> {
    arm.joints
        .iter()
        .map(|joint| match joint.kind {
            JointKind::Revolute => random.between(-PI, PI),
            JointKind::Prismatic => random.between(-0.5, 0.5),
        })
        .collect()
}

/// Measures `arm` at random readings. `noise`: times [`SIGMAS`].
pub(crate) fn measured(
    arm: &ArmModel,
    seen: Seen,
    rows: usize,
    noise: f64,
    seed: u64,
) -> Vec<Observation> {
    let mut random = Random::new(seed, 92);
    let mut evaluator = Evaluator::new(arm, SIGMAS);
    let n = arm.joint_count();
    (0..rows)
        .map(|row| {
            let mut o = Observation {
                row: row + 1,
                q: readings(arm, &mut random),
                direction: vec![0.0; n],
                travel: vec![0.0; n],
                ..Observation::default()
            };
            let pose = evaluator.observe(&o);
            let mut blur = |sigma: f64| {
                let s = noise * sigma;
                Vector3::new(random.normal(), random.normal(), random.normal()) * s
            };
            if seen == Seen::Length {
                let blur = blur(SIGMAS.length).x;
                o.length = Some((pose.translation - arm.anchor).norm() + blur);
                return o;
            }
            o.position = Some(pose.translation + blur(SIGMAS.position));
            if seen == Seen::Pose {
                let turn = Pose::from_rotation_vector(&blur(SIGMAS.orientation));
                o.rotation = Some(turn.rotation * pose.rotation);
            }
            if seen == Seen::Targets {
                let targets = TARGETS.map(Vector3::from);
                o.targets = targets
                    .iter()
                    .map(|t| Some(pose.point(t) + blur(SIGMAS.position)))
                    .collect();
            }
            o
        })
        .collect()
}

/// What identification is given: the drawing and the measurements.
pub(crate) fn problem(drawing: &ArmModel, identify: Vec<Observation>) -> Problem {
    let targets = identify.first().map_or(0, |o| o.targets.len());
    Problem {
        drawing: drawing.clone(),
        identify,
        verify: Vec::new(),
        sigmas: SIGMAS,
        sessions: vec![0],
        points: Vec::new(),
        planes: Vec::new(),
        stations: 0,
        targets_known: false,
        method: Method::default(),
        target_offsets: TARGETS
            .iter()
            .take(targets)
            .map(|t| Vector3::from(*t))
            .collect(),
        held: Held::default(),
        effects: Vec::new(),
    }
}

/// Largest distances between what two arms measure at fresh random readings, m and rad.
pub(crate) fn apart(a: &ArmModel, b: &ArmModel, seen: Seen) -> (f64, f64) {
    let mut random = Random::new(77, 93);
    let (mut x, mut y) = (Evaluator::new(a, SIGMAS), Evaluator::new(b, SIGMAS));
    let none = vec![0.0; a.joint_count()];
    let (mut far, mut turned) = (0.0_f64, 0.0_f64);
    for _ in 0..50 {
        let q = readings(a, &mut random);
        let p = x.go(0, &q, &none, &Ambient::default());
        let r = y.go(0, &q, &none, &Ambient::default());
        match seen {
            Seen::Length => {
                let of = |p: &Pose<f64>, arm: &ArmModel| (p.translation - arm.anchor).norm();
                far = far.max((of(&p, a) - of(&r, b)).abs());
            }
            _ => far = far.max((p.translation - r.translation).norm()),
        }
        if seen == Seen::Pose {
            turned = turned.max(p.twist_to(&r).angular.norm());
        }
        if seen == Seen::Targets {
            for (t, u) in TARGETS.iter().zip(&b.targets) {
                far = far.max((p.point(&Vector3::from(*t)) - r.point(u)).norm());
            }
        }
    }
    (far, turned)
}
