//! Which parameters make a complete model of this arm, and no more: 4R + 2P + 6.
//!
//! A complete model has four parameters a revolute joint, two a prismatic one, and six for
//! base and tool together (MRD 2.95). Every convention is brought there the same way: all
//! parameters that the description knows are candidates, and columns of the identification
//! Jacobian that are combinations of others at *every* pose are left out, base and tool
//! first in priority. Nearly parallel neighbours get Hayati's beta in place of d, which
//! moves without bound as the axes come parallel.

use nalgebra::{DMatrix, Vector3};
use truepose::{Convention, JointKind, Parameter, Pose};

use super::arm::ArmModel;
use super::factor::{Dropped, Selection, select_in_turns};
use super::held::Held;
use super::linearize::linearize;
use super::observation::{Observation, Sigmas};
use super::unknown::Unknown;

/// Axes closer than this are nearly parallel, rad.
pub const NEARLY_PARALLEL: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Share of a column that is clearly not a combination of others.
const CLEAR: f64 = 0.02;

/// A pair of neighbouring joints that were given beta in place of d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearlyParallel {
    /// Joint whose d is kept at the drawing's value (from 0).
    pub joint: usize,
    /// First of the two axes (from 0).
    pub first: usize,
    /// Angle between the axes, rad.
    pub angle: f64,
}

/// Candidates of the geometric model in order of priority, base and tool first.
#[derive(Clone, Debug)]
pub struct Structure {
    /// Parameters that are told apart by some set of poses.
    pub unknowns: Vec<Unknown>,
    /// Parameters that no set of poses can tell from those: index in `candidates`, reason.
    pub dropped: Vec<(Unknown, Dropped)>,
    /// All candidates; `Dropped::Dependent` counts in these.
    pub candidates: Vec<Unknown>,
    /// Neighbours treated after Hayati.
    pub parallel: Vec<NearlyParallel>,
    /// Joint parameters that would be candidates, were they not held.
    pub held: Vec<Unknown>,
}

impl Structure {
    /// True for what a model without anything held would speak of.
    pub(super) fn offers(&self, unknown: &Unknown) -> bool {
        !matches!(unknown, Unknown::Joint(..)) || self.held.contains(unknown)
    }
}

fn nearly_parallel(arm: &ArmModel) -> Vec<NearlyParallel> {
    let mut found = Vec::new();
    for (i, baked) in arm.baked().iter().enumerate() {
        let Some(next) = arm.joints.get(i + 1) else {
            continue;
        };
        let angle = baked.sin_alpha.abs().asin();
        let revolute =
            arm.joints[i].kind == JointKind::Revolute && next.kind == JointKind::Revolute;
        // d of the joint after the pair in Craig's form, of the joint before it otherwise
        let joint = match (arm.joints[i].convention, next.convention) {
            (Convention::ZeroReference, _) | (_, Convention::ZeroReference) => continue,
            (_, Convention::Mdh) => i + 1,
            _ => i,
        };
        if revolute && angle < NEARLY_PARALLEL {
            found.push(NearlyParallel {
                joint,
                first: i,
                angle,
            });
        }
    }
    found
}

/// Finds the complete, minimal set of parameters.
pub fn structure(arm: &ArmModel, sigmas: Sigmas) -> Structure {
    structure_holding(arm, sigmas, &Held::default())
}

/// What is left of the complete set where parameters are `held`, and what those had carried for
/// others.
pub fn structure_holding(arm: &ArmModel, sigmas: Sigmas, held: &Held) -> Structure {
    let beta = |j| Unknown::Joint(j, Parameter::Beta);
    let mut parallel = nearly_parallel(arm);
    // d again where beta may not take its place
    parallel.retain(|pair| !held.contains(&beta(pair.joint)));
    let free = |unknown: &Unknown| !held.contains(unknown);
    let base = (0..6).map(|axis| Unknown::Base { session: 0, axis });
    let tool = (0..6).map(|axis| Unknown::Tool { axis });
    let mut candidates: Vec<Unknown> = base.chain(tool).filter(free).collect();
    let mut left_out = Vec::new();
    for (j, joint) in arm.joints.iter().enumerate() {
        let hayati = parallel.iter().any(|p| p.joint == j);
        let zero_reference = joint.convention == Convention::ZeroReference;
        let mut parameters = joint.parameters().to_vec();
        // What a person would rather see identified comes first. A slide has no place: its
        // `a` moves the next axis as other lengths do, of which `d` is one (MRD 4.5.2).
        let slides = joint.kind == JointKind::Prismatic;
        parameters.sort_by_key(|p| match p {
            Parameter::A if slides => 7,
            Parameter::A => 0,
            Parameter::Alpha => 1,
            Parameter::Beta => 2,
            Parameter::AxisX | Parameter::AxisY => 3,
            Parameter::PointX | Parameter::PointY => 4,
            Parameter::Theta => 5,
            Parameter::D => 6,
        });
        for p in parameters {
            let wanted = match p {
                Parameter::D => !hayati,
                Parameter::Beta => hayati,
                _ => true,
            };
            let unknown = Unknown::Joint(j, p);
            if held.contains(&unknown) {
                if wanted || zero_reference || p == Parameter::D {
                    left_out.push(unknown);
                }
            } else if wanted || zero_reference {
                candidates.push(unknown);
            }
        }
    }
    // Where a slide and a turn are parallel, theta of the first does nothing and its axis needs
    // the second tilt. Last in priority: it is left out wherever theta and d are enough.
    // It must not make up for what is held.
    let complete = (!held.is_empty()).then(|| structure(arm, sigmas));
    for (j, joint) in arm.joints.iter().enumerate() {
        let beta = beta(j);
        let needed = match &complete {
            None => true,
            Some(complete) => complete.unknowns.contains(&beta) || held.asks_for(&beta),
        };
        if !joint.parameters().contains(&Parameter::Beta) || !needed {
            continue;
        }
        if held.contains(&beta) {
            left_out.push(beta);
        } else if !candidates.contains(&beta) {
            candidates.push(beta);
        }
    }
    // six equations a pose, and half a dozen more than there are candidates
    let poses = generic_poses(arm, candidates.len() / 6 + 2);
    let references: Vec<&Observation> = poses.iter().collect();
    let scales = vec![1.0; candidates.len()];
    let unit = Sigmas {
        position: 1.0,
        orientation: 1.0,
        ..sigmas
    };
    let linear = linearize(arm, &candidates, &scales, &references, unit);
    // Columns are of order one per pose; dependent ones leave rounding. What is nearly
    // another's combination, as lengths along nearly parallel axes are, must not take the place
    // of what is not: it is asked last.
    let Selection { kept, dropped } = select_in_turns(&linear.jacobian, 1e-9, &[CLEAR, 1e-7]);
    Structure {
        unknowns: kept.iter().map(|&k| candidates[k]).collect(),
        dropped: dropped
            .into_iter()
            .map(|(k, why)| (candidates[k], why))
            .collect(),
        candidates,
        parallel,
        held: left_out,
    }
}

/// Full poses at readings spread evenly and irregularly over a turn (or half a metre):
/// multiples of the square roots of primes, modulo one (Weyl's sequence).
fn generic_poses(arm: &ArmModel, count: usize) -> Vec<Observation> {
    const PRIMES: [f64; 12] = [2., 3., 5., 7., 11., 13., 17., 19., 23., 29., 31., 37.];
    let reading = |pose: usize, j: usize| {
        let prime = PRIMES[j % PRIMES.len()] + 40.0 * (j / PRIMES.len()) as f64;
        let unit = ((pose + 1) as f64 * prime.sqrt()).fract() - 0.5;
        match arm.joints[j].kind {
            JointKind::Revolute => unit * std::f64::consts::TAU,
            JointKind::Prismatic => unit,
        }
    };
    let n = arm.joint_count();
    (0..count)
        .map(|pose| Observation {
            row: pose,
            q: (0..n).map(|j| reading(pose, j)).collect(),
            direction: vec![0.0; n],
            travel: vec![0.0; n],
            position: Some(Vector3::zeros()),
            rotation: Some(Pose::<f64>::identity().rotation),
            ..Observation::default()
        })
        .collect()
}

/// 4R + 2P + 6.
pub fn complete_count(arm: &ArmModel) -> usize {
    let each = |joint: &truepose::Joint<f64>| match joint.kind {
        JointKind::Revolute => 4,
        JointKind::Prismatic => 2,
    };
    arm.joints.iter().map(each).sum::<usize>() + 6
}

/// Singular values of a factor, largest first, for condition numbers.
pub fn singular_values(r: &DMatrix<f64>) -> Vec<f64> {
    let mut values: Vec<f64> = r.clone().singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}
