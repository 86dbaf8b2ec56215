//! From a robot description and a measurement file to a problem that can be solved.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use truepose::effects::Effect;

use super::arm::ArmModel;
use super::observation::{Observation, Sigmas};
use crate::description::Robot;
use crate::measurement::{Dataset, Row, Set};

/// Noise assumed where the file declares none: a good laser tracker's.
pub const ASSUMED: Sigmas = Sigmas {
    position: 5e-5,
    orientation: 0.02 * std::f64::consts::PI / 180.0,
    length: 5e-5,
};

/// Which columns the joints are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joints {
    /// `q1` .. `qN`.
    Readings,
    /// `qcmd1` .. `qcmdN`.
    Commands,
}

/// Everything that a fit needs, in SI units.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The drawing; base and tool are first guesses.
    pub drawing: ArmModel,
    /// Rows to fit.
    pub identify: Vec<Observation>,
    /// Rows that no fit sees.
    pub verify: Vec<Observation>,
    /// Noise that the residuals are weighted by.
    pub sigmas: Sigmas,
    /// Placements of the instrument: the numbers in the column `session`, in rising order.
    pub sessions: Vec<i64>,
    /// Drawn offsets of further targets in the tool frame, m.
    pub target_offsets: Vec<Vector3<f64>>,
    /// Effects to identify together with the geometry.
    pub effects: Vec<Effect<'static, f64>>,
}

impl Problem {
    /// From what was read, `effects` to be identified with the geometry.
    pub fn new(
        robot: &Robot,
        data: &Dataset,
        joints: Joints,
        effects: Vec<Effect<'static, f64>>,
    ) -> Self {
        let mut numbers = BTreeMap::new();
        for row in &data.rows {
            numbers.insert(row.session.unwrap_or(0), 0);
        }
        for (index, place) in numbers.values_mut().enumerate() {
            *place = index;
        }
        let (mut identify, mut verify) = (Vec::new(), Vec::new());
        let mut before: Option<&[f64]> = None;
        for row in &data.rows {
            let session = numbers.get(&row.session.unwrap_or(0)).copied().unwrap_or(0);
            let observation = observation(row, before, session, joints);
            before = Some(&row.q);
            match row.set {
                Set::Identify => identify.push(observation),
                Set::Verify => verify.push(observation),
            }
        }
        Self {
            drawing: ArmModel::new(
                robot.base,
                robot.geometry(),
                robot.masses(),
                robot.tool,
                robot.gravity,
            ),
            identify,
            verify,
            sigmas: Sigmas {
                position: data.noise.position.unwrap_or(ASSUMED.position),
                orientation: data.noise.orientation.unwrap_or(ASSUMED.orientation),
                length: data.noise.length.unwrap_or(ASSUMED.length),
            },
            sessions: numbers.into_keys().collect(),
            target_offsets: data
                .target_offsets
                .iter()
                .copied()
                .map(Vector3::from)
                .collect(),
            effects,
        }
    }
}

fn observation(row: &Row, before: Option<&[f64]>, session: usize, joints: Joints) -> Observation {
    let q = match (joints, &row.q_command) {
        (Joints::Commands, Some(q)) => q.clone(),
        _ => row.q.clone(),
    };
    Observation {
        row: row.number,
        q,
        direction: row.direction.clone(),
        travel: travel(&row.q, before),
        ambient: row.ambient(),
        session,
        position: row.position.map(Vector3::from),
        rotation: row.pose().map(|p| p.rotation),
        targets: row.targets.iter().map(|t| t.map(Vector3::from)).collect(),
        length: row.length,
    }
}

/// Share of every joint in the move from `before` to `q`.
fn travel(q: &[f64], before: Option<&[f64]>) -> Vec<f64> {
    let moves: Vec<f64> = match before {
        Some(before) => q.iter().zip(before).map(|(a, b)| a - b).collect(),
        None => vec![0.0; q.len()],
    };
    let farthest = moves.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if farthest > 0.0 {
        moves.iter().map(|x| x / farthest).collect()
    } else {
        moves
    }
}
