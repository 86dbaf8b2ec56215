//! Does what was named follow its cause in proportion?
//!
//! A name that fits by and large takes most of what another cause does: a joint with friction
//! passes for one that gives way in proportion to torque. So the fitted effect is tried once
//! more, stronger or weaker with its own size, the joint's torque, the payload, the time and
//! the temperature.

use nalgebra::DMatrix;
use truepose::Twist;
use truepose::effects::{Effect, JointCompliance};

use super::hypothesis::Members;
use super::model::Extended;
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::{Observation, Sigmas};

/// Chance below which an effect is called out of proportion, all trials considered.
const LEVEL: f64 = 0.003;

/// An effect that is not in proportion to its cause.
#[derive(Clone, Debug, PartialEq)]
pub struct Disproportion {
    /// Which of the accepted hypotheses.
    pub index: usize,
    /// What it changes with.
    pub with: &'static str,
    /// Logarithm of the chance, all trials considered.
    pub ln_p: f64,
}

/// What an effect's strength is tried to change with.
const WITH: [&str; 8] = [
    "its size",
    "the square of its size",
    "its sign alone",
    "the joint's torque",
    "the root of the joint's torque",
    "the payload",
    "the time",
    "the temperature",
];

/// The named effect that is most clearly out of proportion, if any.
pub fn disproportion(
    model: &Extended,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Option<Disproportion> {
    let (_, space) = model.space(observations, sigmas);
    let mut trials = Vec::new();
    for (index, hypothesis) in model.accepted.iter().enumerate() {
        if let Members::Effects(effects) = &hypothesis.members
            && hypothesis.kind != "unnamed"
        {
            for effect in effects {
                trials.push((index, trial(model, effect, observations, sigmas)));
            }
        }
    }
    let count = (trials.len() * WITH.len()).max(1) as f64;
    let mut worst: Option<Disproportion> = None;
    for (index, matrix) in trials {
        for (k, with) in WITH.into_iter().enumerate() {
            let column = matrix.column(k);
            let along = space.basis.tr_mul(&column);
            let left = column.norm_squared() - along.norm_squared();
            // a thousandth of the effect's own is not told from what the model has
            if left < 1e-3 * column.norm_squared() {
                continue;
            }
            let reduction = column.dot(&space.residual).powi(2) / left;
            let ln_p = space.judge(reduction, 1.0).ln_p + count.ln();
            if ln_p < LEVEL.ln() && worst.as_ref().is_none_or(|w| ln_p < w.ln_p) {
                worst = Some(Disproportion { index, with, ln_p });
            }
        }
    }
    worst
}

/// Columns of an effect as fitted times each of [`WITH`].
fn trial(
    model: &Extended,
    effect: &Effect<'static, f64>,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> DMatrix<f64> {
    let values = effect.model().values();
    let joint = effect.model().joint();
    let torque = joint
        .and_then(|j| u8::try_from(j).ok())
        .map(|j| Effect::JointCompliance(JointCompliance::new(j)));
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut matrix = DMatrix::zeros(rows, WITH.len());
    let mut evaluator = Evaluator::new(&model.arm, sigmas);
    let size = |twist: &Twist<f64>| twist.angular.norm() + twist.linear.norm();
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        evaluator.each_posture(o, |evaluator, posture| {
            let at = posture.at;
            let mut whole = Twist::zero();
            evaluator.effect_twists(at, effect, |k, twist| {
                whole = whole.plus(&twist.scaled(values[k]));
            });
            let own = size(&evaluator.to_place(at, joint, &whole));
            let mut load = 0.0;
            if let Some(torque) = &torque {
                evaluator.effect_twists(at, torque, |_, twist| load = size(&twist));
                let unit = joint.map_or(0.0, |j| size(&evaluator.joint_twist(j)));
                load = if unit > 0.0 { load / unit } else { 0.0 };
            }
            let known = |x: f64| if x.is_finite() { x } else { 0.0 };
            let factors = [
                own,
                own * own,
                if own > 0.0 { own.recip() } else { 0.0 },
                load,
                load.sqrt(),
                at.ambient.payload,
                known(at.ambient.time),
                known(at.ambient.temperature[0]),
            ];
            for (k, factor) in factors.into_iter().enumerate() {
                let cells = &mut matrix.as_mut_slice()[k * rows + start..k * rows + end];
                posture.spread(evaluator, &whole.scaled(factor), cells);
            }
        });
        start = end;
    }
    matrix
}
