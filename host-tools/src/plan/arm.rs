//! What measuring a described arm shows of its parameters.

use nalgebra::Vector3;
use truepose::JointKind;

use super::{Choice, Seen, Sensitivity, draw};
use crate::description::Robot;
use crate::identify::arm::ArmModel;
use crate::identify::held::{Held, Wish};
use crate::identify::linearize::linearize;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::solve::distinguishable;
use crate::identify::structure::structure_holding;
use crate::identify::unknown::Unknown;
use crate::random::Random;

/// An arm under an instrument.
pub struct MeasuredArm {
    arm: ArmModel,
    /// Parameters that poses within the limits can tell apart.
    unknowns: Vec<Unknown>,
    scales: Vec<f64>,
    sigmas: Sigmas,
    choice: Choice,
    height: usize,
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
        let around = placement(&arm, seen);
        Self::with(arm, seen, sigmas, limits, around, &Held::default())
    }

    /// The same without the parameters that `wish` holds; a sentence where it cannot be
    /// fulfilled.
    pub fn holding(
        arm: ArmModel,
        seen: Seen,
        sigmas: Sigmas,
        limits: Vec<[f64; 2]>,
        wish: &Wish,
    ) -> Result<Self, String> {
        let around = placement(&arm, seen);
        let held = wish.among(&arm, &around)?;
        let measured = Self::with(arm, seen, sigmas, limits, around, &held);
        match measured.unknowns.is_empty() {
            true => Err("--only and --hold leave nothing to identify".to_owned()),
            false => Ok(measured),
        }
    }

    fn with(
        arm: ArmModel,
        seen: Seen,
        sigmas: Sigmas,
        limits: Vec<[f64; 2]>,
        mut candidates: Vec<Unknown>,
        held: &Held,
    ) -> Self {
        let choice = Choice::new(&arm, seen, &limits);
        let placed = is_placed(seen);
        for unknown in structure_holding(&arm, sigmas, held).unknowns {
            let base = matches!(unknown, Unknown::Base { .. });
            if !candidates.contains(&unknown) && (placed || !base) {
                candidates.push(unknown);
            }
        }
        candidates.retain(|unknown| !held.contains(unknown));
        for (effect, e) in arm.effects.iter().enumerate() {
            let count = e.model().values().len();
            candidates.extend((0..count).map(|value| Unknown::Effect { effect, value }));
        }
        let mut random = Random::new(0, PROBE);
        let mut measured = Self {
            height: choice.height(&arm),
            arm,
            unknowns: Vec::new(),
            scales: Vec::new(),
            sigmas,
            choice,
        };
        let probes: Vec<Observation> = draw(&mut measured, PROBES, &mut random)
            .iter()
            .map(|probe| measured.observation(probe))
            .collect();
        let probes: Vec<&Observation> = probes.iter().collect();
        let selection = distinguishable(&measured.arm, &candidates, &probes, sigmas);
        measured.unknowns = selection
            .kept
            .iter()
            .filter_map(|&k| candidates.get(k).copied())
            .collect();
        let expected = |u: &Unknown| u.expected(&measured.arm);
        measured.scales = measured.unknowns.iter().map(expected).collect();
        measured
    }

    /// The arm.
    pub fn arm(&self) -> &ArmModel {
        &self.arm
    }

    /// How its measurements are chosen.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// Names of the parameters that count, in the order of the columns.
    pub fn names(&self) -> Vec<String> {
        self.unknowns.iter().map(|u| u.name(&self.arm)).collect()
    }

    fn observation(&self, choice: &[f64]) -> Observation {
        let here = Observation::default();
        self.choice.observation(&self.arm, &here, choice)
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
        // a plane has fewer rows than a point: the others say nothing
        rows.fill(0.0);
        for (row, out) in jacobian
            .row_iter()
            .zip(rows.chunks_mut(self.unknowns.len().max(1)))
        {
            row.iter().zip(out).for_each(|(x, out)| *out = *x);
        }
    }
}

/// Where nothing is placed in the world, the base is the world.
fn is_placed(seen: Seen) -> bool {
    !matches!(seen, Seen::Distance | Seen::Touch)
}

/// Unknowns of base and tool and of what stands around the arm.
fn placement(arm: &ArmModel, seen: Seen) -> Vec<Unknown> {
    let mut candidates: Vec<Unknown> = (0..6)
        .filter(|_| is_placed(seen))
        .map(|axis| Unknown::Base { session: 0, axis })
        .collect();
    if seen == Seen::Length {
        candidates.extend((0..3).map(|axis| Unknown::Anchor { axis }));
    }
    if seen == Seen::Touch {
        for point in 0..arm.points.len() {
            candidates.extend((0..3).map(|axis| Unknown::Point { point, axis }));
        }
        for plane in 0..arm.planes.len() {
            candidates.extend((0..3).map(|value| Unknown::Plane { plane, value }));
        }
    }
    if seen == Seen::Bearing {
        for station in 1..arm.stations.len() {
            candidates.extend((0..6).map(|axis| Unknown::Station { station, axis }));
        }
    }
    let targets = match seen {
        Seen::Position => arm.targets.len(),
        _ => 0,
    };
    candidates.extend((0..3).map(|axis| Unknown::Tool { axis }));
    for target in 0..targets {
        candidates.extend((0..3).map(|axis| Unknown::Target { target, axis }));
    }
    candidates.extend((3..6).map(|axis| Unknown::Tool { axis }));
    candidates
}

impl Sensitivity for MeasuredArm {
    fn parameters(&self) -> usize {
        self.unknowns.len()
    }

    fn height(&self) -> usize {
        self.height
    }

    fn limits(&self) -> &[[f64; 2]] {
        self.choice.limits()
    }

    fn bring(&mut self, choice: &mut [f64]) -> bool {
        self.choice.bring(&self.arm, choice)
    }

    fn rows(&mut self, choice: &[f64], rows: &mut [f64]) {
        self.fill(&self.observation(choice), self.sigmas, rows);
    }

    fn tool(&mut self, choice: &[f64], rows: &mut [f64]) {
        let joints = self.arm.joint_count();
        let observation = Observation {
            q: choice.get(..joints).unwrap_or(&[]).to_vec(),
            direction: vec![0.0; joints],
            travel: vec![0.0; joints],
            position: Some(Vector3::zeros()),
            ..Observation::default()
        };
        self.fill(&observation, Sigmas::UNIT, rows);
    }
}
