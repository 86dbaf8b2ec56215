//! What measuring a described arm shows of its parameters.

use nalgebra::{Matrix3, Vector3};
use truepose::JointKind;

use super::Sensitivity;
use crate::description::Robot;
use crate::identify::arm::ArmModel;
use crate::identify::linearize::linearize;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::solve::distinguishable;
use crate::identify::structure::structure;
use crate::identify::unknown::Unknown;
use crate::random::Random;

/// What is going to be measured at each pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The tool point.
    Position,
    /// The tool's full pose.
    Pose,
    /// The length of a wire to the tool point.
    Length,
}

/// An arm under an instrument.
pub struct MeasuredArm {
    arm: ArmModel,
    /// Parameters that poses within the limits can tell apart.
    unknowns: Vec<Unknown>,
    scales: Vec<f64>,
    sigmas: Sigmas,
    limits: Vec<[f64; 2]>,
    template: Observation,
}

/// Random poses that decide which parameters can be told apart at all.
const PROBES: usize = 300;
/// Random numbers of the probes.
const PROBE: u64 = 5;

/// Limits of every joint, a full turn where a revolute joint has none; the number of the
/// first slide without limits, from 1, otherwise.
pub fn limits(robot: &Robot) -> Result<Vec<[f64; 2]>, usize> {
    let turn = std::f64::consts::PI;
    (1..)
        .zip(&robot.joints)
        .map(|(number, j)| match (j.limits, j.joint.kind) {
            (Some(limits), _) => Ok(limits),
            (None, JointKind::Revolute) => Ok([-turn, turn]),
            (None, JointKind::Prismatic) => Err(number),
        })
        .collect()
}

impl MeasuredArm {
    /// `arm` as it is known so far, measured with noise of `sigmas`, moved within `limits`.
    /// Every geometric parameter, base, tool and targets count, and the values of the effects
    /// that the arm has.
    pub fn new(arm: ArmModel, seen: Seen, sigmas: Sigmas, limits: Vec<[f64; 2]>) -> Self {
        let zero = Vector3::zeros();
        let template = Observation {
            row: 0,
            q: vec![0.0; arm.joint_count()],
            direction: vec![0.0; arm.joint_count()],
            travel: vec![0.0; arm.joint_count()],
            position: (seen != Seen::Length).then_some(zero),
            rotation: (seen == Seen::Pose).then(Matrix3::identity),
            targets: match seen {
                Seen::Position => vec![Some(zero); arm.targets.len()],
                Seen::Pose | Seen::Length => Vec::new(),
            },
            length: (seen == Seen::Length).then_some(0.0),
            ..Observation::default()
        };
        let mut candidates: Vec<Unknown> = (0..6)
            .map(|axis| Unknown::Base { session: 0, axis })
            .collect();
        if seen == Seen::Length {
            candidates.extend((0..3).map(|axis| Unknown::Anchor { axis }));
        }
        candidates.extend((0..3).map(|axis| Unknown::Tool { axis }));
        for target in 0..template.targets.len() {
            candidates.extend((0..3).map(|axis| Unknown::Target { target, axis }));
        }
        candidates.extend((3..6).map(|axis| Unknown::Tool { axis }));
        for unknown in structure(&arm, sigmas).unknowns {
            if !candidates.contains(&unknown) {
                candidates.push(unknown);
            }
        }
        for (effect, e) in arm.effects.iter().enumerate() {
            let count = e.model().values().len();
            candidates.extend((0..count).map(|value| Unknown::Effect { effect, value }));
        }
        let mut random = Random::new(0, PROBE);
        let probes: Vec<Observation> = super::random_poses(&limits, PROBES, &mut random)
            .into_iter()
            .map(|q| Observation {
                q,
                ..template.clone()
            })
            .collect();
        let probes: Vec<&Observation> = probes.iter().collect();
        let selection = distinguishable(&arm, &candidates, &probes, sigmas);
        let unknowns: Vec<Unknown> = selection
            .kept
            .iter()
            .filter_map(|&k| candidates.get(k).copied())
            .collect();
        let scales = unknowns.iter().map(|u| u.expected(&arm)).collect();
        Self {
            arm,
            unknowns,
            scales,
            sigmas,
            limits,
            template,
        }
    }

    /// Names of the parameters that count, in the order of the columns.
    pub fn names(&self) -> Vec<String> {
        self.unknowns.iter().map(|u| u.name(&self.arm)).collect()
    }

    fn fill(&self, observation: &Observation, sigmas: Sigmas, rows: &mut [f64]) {
        let jacobian = linearize(
            &self.arm,
            &self.unknowns,
            &self.scales,
            &[observation],
            sigmas,
        )
        .jacobian;
        for (row, out) in jacobian
            .row_iter()
            .zip(rows.chunks_mut(self.unknowns.len().max(1)))
        {
            row.iter().zip(out).for_each(|(x, out)| *out = *x);
        }
    }
}

impl Sensitivity for MeasuredArm {
    fn parameters(&self) -> usize {
        self.unknowns.len()
    }

    fn height(&self) -> usize {
        self.template.equations()
    }

    fn limits(&self) -> &[[f64; 2]] {
        &self.limits
    }

    fn rows(&mut self, q: &[f64], rows: &mut [f64]) {
        let observation = Observation {
            q: q.to_vec(),
            ..self.template.clone()
        };
        self.fill(&observation, self.sigmas, rows);
    }

    fn tool(&mut self, q: &[f64], rows: &mut [f64]) {
        let observation = Observation {
            q: q.to_vec(),
            position: Some(Vector3::zeros()),
            rotation: None,
            targets: Vec::new(),
            length: None,
            ..self.template.clone()
        };
        let metre = Sigmas {
            position: 1.0,
            ..self.sigmas
        };
        self.fill(&observation, metre, rows);
    }
}
