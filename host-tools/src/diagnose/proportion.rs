//! Does what was named follow its cause in proportion?
//!
//! A name that fits by and large takes most of what another cause does: a joint with friction
//! passes for one that gives way in proportion to torque, an error that saturates for two
//! harmonics. So everything that was fitted is tried once more, stronger or weaker with its own
//! size, beyond a threshold, with the joint's torque, the payload, the time, the temperature,
//! and with what else was found. Powers of what was fitted as a test of its form are Ramsey's
//! (1969); thresholds take their place here, since friction and saturation have corners.

use nalgebra::DVector;
use truepose::Twist;
use truepose::effects::{Effect, JointCompliance};

use super::confirmed::Confirmation;
use super::hypothesis::Members;
use super::model::Extended;
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::{Observation, Sigmas};

/// Chance below which an effect is called out of proportion, all trials considered.
const LEVEL: f64 = 0.003;

/// Thresholds that are tried, in the effect's largest size over the rows.
const THRESHOLDS: [f64; 3] = [0.15, 0.3, 0.5];

/// An effect that is not in proportion to its cause.
#[derive(Clone, Debug, PartialEq)]
pub struct Disproportion {
    /// Which of the accepted hypotheses.
    pub index: usize,
    /// What it changes with.
    pub with: &'static str,
    /// Logarithm of the chance, all trials considered.
    pub ln_p: f64,
    /// True where chance does not explain it.
    pub bent: bool,
}

/// A fitted displacement.
#[derive(Clone)]
pub(super) struct Part {
    /// Which of the accepted hypotheses.
    pub(super) index: usize,
    pub(super) joint: Option<usize>,
    /// One entry a posture: a row has one, a distance between two poses has two.
    pieces: Vec<Piece>,
}

/// What it is at one posture.
#[derive(Clone)]
struct Piece {
    /// First equation of the row.
    start: usize,
    /// What it does to the row's equations, whitened.
    column: DVector<f64>,
    /// How large it is where it acts.
    size: f64,
    /// The joint's torque.
    load: f64,
}

impl Part {
    /// Its column with a factor at every posture.
    pub(super) fn times(&self, equations: usize, factors: &[f64]) -> DVector<f64> {
        let mut column = DVector::zeros(equations);
        for (piece, factor) in self.pieces.iter().zip(factors) {
            let mut rows = column.rows_mut(piece.start, piece.column.len());
            rows.axpy(*factor, &piece.column, 1.0);
        }
        column
    }

    pub(super) fn sizes(&self) -> Vec<f64> {
        self.pieces.iter().map(|p| p.size).collect()
    }
}

/// The named effect that is most out of proportion; `None` where nothing can be asked.
pub fn disproportion(
    model: &Extended,
    fitted: &[&Observation],
    unseen: &[&Observation],
    sigmas: Sigmas,
) -> Option<Disproportion> {
    let confirmation = Confirmation::new(model, fitted, unseen, sigmas)?;
    let all: Vec<&Observation> = fitted.iter().chain(unseen).copied().collect();
    let equations = all.iter().map(|o| o.equations()).sum();
    let parts = parts(model, &all, sigmas);
    let mut trials: Vec<(usize, &'static str, DVector<f64>)> = Vec::new();
    let mut add = |part: &Part, with, factors: &[f64]| {
        trials.push((part.index, with, part.times(equations, factors)));
    };
    for part in &parts {
        for (with, factors) in own(part) {
            add(part, with, &factors);
        }
        for (with, factors) in conditions(part, &all) {
            add(part, with, &factors);
        }
        for other in parts.iter().filter(|other| other.index != part.index) {
            add(part, "the size of another effect", &other.sizes());
        }
    }
    for whole in together(&parts) {
        for (with, factors) in own(&whole) {
            add(&whole, with, &factors);
        }
    }
    let asked = trials
        .iter()
        .filter_map(|trial| Some((confirmation.ln_p(&trial.2)?, trial)));
    let asked: Vec<_> = asked.collect();
    let (own, (index, with, column)) = asked.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let ln_p = confirmation.together(column, own + (asked.len() as f64).ln());
    Some(Disproportion {
        index: *index,
        with,
        ln_p,
        bent: ln_p < LEVEL.ln(),
    })
}

/// What a displacement is tried to change with by its own size.
fn own(part: &Part) -> Vec<(&'static str, Vec<f64>)> {
    let sizes = part.sizes();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let of = |factor: &dyn Fn(f64) -> f64| sizes.iter().map(|&s| factor(s)).collect();
    let inverse = |s: f64| if s > 0.0 { s.recip() } else { 0.0 };
    let mut all = vec![("its sign alone", of(&inverse))];
    all.extend(THRESHOLDS.map(|share| {
        let beyond = |s: f64| match s > share * largest {
            true => 1.0 - share * largest / s,
            false => 0.0,
        };
        ("a threshold of its size", of(&beyond))
    }));
    all
}

/// What an effect is tried to change with besides.
fn conditions(part: &Part, observations: &[&Observation]) -> Vec<(&'static str, Vec<f64>)> {
    let postures: Vec<&Observation> = observations.iter().flat_map(|o| o.postures()).collect();
    let of = |factor: &dyn Fn(&Observation) -> f64| -> Vec<f64> {
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        postures.iter().map(|o| finite(factor(o))).collect()
    };
    let loads = || part.pieces.iter().map(|p| p.load);
    vec![
        ("the joint's torque", loads().collect()),
        (
            "the root of the joint's torque",
            loads().map(f64::sqrt).collect(),
        ),
        ("the payload", of(&|o| o.ambient.payload)),
        ("the time", of(&|o| o.ambient.time)),
        ("the temperature", of(&|o| o.ambient.temperature[0])),
    ]
}

/// Whatever acts on one joint as one displacement, and all that was named as one.
fn together(parts: &[Part]) -> Vec<Part> {
    let mut places: Vec<Option<Option<usize>>> = parts.iter().map(|p| Some(p.joint)).collect();
    places.sort_unstable();
    places.dedup();
    let several = places.len() > 1;
    places.extend(several.then_some(None));
    let whole = |place: Option<Option<usize>>| {
        let mut members = parts
            .iter()
            .filter(|p| place.is_none_or(|joint| joint == p.joint));
        let mut whole = members.next()?.clone();
        let mut more = false;
        for member in members {
            more = true;
            for (sum, piece) in whole.pieces.iter_mut().zip(&member.pieces) {
                sum.column += &piece.column;
                sum.size = sum.column.norm();
            }
        }
        more.then_some(whole)
    };
    places.into_iter().filter_map(whole).collect()
}

/// What was named, as fitted: what one name does to one joint is one part.
pub(super) fn parts(model: &Extended, observations: &[&Observation], sigmas: Sigmas) -> Vec<Part> {
    let mut parts = Vec::new();
    for (index, hypothesis) in model.accepted.iter().enumerate() {
        if let Members::Effects(effects) = &hypothesis.members
            && hypothesis.kind != "unnamed"
        {
            let mut joints: Vec<Option<usize>> = Vec::new();
            for joint in effects.iter().map(|e| e.model().joint()) {
                if !joints.contains(&joint) {
                    joints.push(joint);
                }
            }
            for joint in joints {
                let on = effects.iter().filter(|e| e.model().joint() == joint);
                let on: Vec<&Effect<'static, f64>> = on.collect();
                parts.push(part(model, index, joint, &on, observations, sigmas));
            }
        }
    }
    parts
}

fn part(
    model: &Extended,
    index: usize,
    joint: Option<usize>,
    effects: &[&Effect<'static, f64>],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Part {
    let torque = joint
        .and_then(|j| u8::try_from(j).ok())
        .map(|j| Effect::JointCompliance(JointCompliance::new(j)));
    let mut pieces = Vec::with_capacity(observations.len());
    let mut evaluator = Evaluator::new(&model.arm, sigmas);
    let size = |twist: &Twist<f64>| twist.angular.norm() + twist.linear.norm();
    let mut start = 0;
    for o in observations {
        evaluator.each_posture(o, |evaluator, posture| {
            let at = posture.at;
            let mut whole = Twist::zero();
            for effect in effects {
                let values = effect.model().values();
                evaluator.effect_twists(at, effect, |k, twist| {
                    whole = whole.plus(&twist.scaled(values[k]));
                });
            }
            let mut load = 0.0;
            if let Some(torque) = &torque {
                evaluator.effect_twists(at, torque, |_, twist| load = size(&twist));
                let unit = joint.map_or(0.0, |j| size(&evaluator.joint_twist(j)));
                load = if unit > 0.0 { load / unit } else { 0.0 };
            }
            let mut column = DVector::zeros(o.equations());
            posture.spread(evaluator, &whole, column.as_mut_slice());
            pieces.push(Piece {
                start,
                column,
                size: size(&evaluator.to_place(at, joint, &whole)),
                load,
            });
        });
        start += o.equations();
    }
    Part {
        index,
        joint,
        pieces,
    }
}
