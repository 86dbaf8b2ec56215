//! Which poses would tell two explanations apart.
//!
//! An effect was found, and a rival explains the measured rows about as well. Of a further
//! pose counts how far the effect moves the tool there *beyond* what the rival can imitate
//! once it, the geometry and all other effects are fitted to everything measured. That is
//! the T-criterion: the squared distance, in standard deviations of the instrument, that the
//! better of the two will have over the other. Poses are added one at a time, each for the
//! pair that is least apart so far.

use nalgebra::{DMatrix, DVector};
use truepose::effects::Effect;

use super::{Choice, Seen};
use crate::diagnose::hypothesis::Members;
use crate::diagnose::{Diagnosis, Named, Rival, UNDECIDED};
use crate::identify::arm::ArmModel;
use crate::identify::linearize::linearize;
use crate::identify::noise::fitted;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::relation::Relation;
use crate::identify::unknown::Unknown;
use crate::random::Random;

/// Poses that the choice is made from.
const POOL: usize = 1500;

/// Random numbers of the pool.
const STREAM: u64 = 7;

/// Less alike than this (cosine of what they do to the rows), two effects explain different
/// parts of the residual and are no rivals.
const ALIKE: f64 = 0.7;

/// Two explanations and how far apart they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispute {
    /// The explanation in the model.
    pub found: String,
    /// The other one.
    pub rival: String,
    /// Expected difference of the two in squared standard deviations, by the rows measured.
    pub measured: f64,
    /// The same with the chosen poses.
    pub planned: f64,
}

/// The chosen poses, the most telling first.
#[derive(Clone, Debug)]
pub struct Decision {
    /// As [`Choice`] has them.
    pub poses: Vec<Vec<f64>>,
    /// How the measurements are chosen: those of the data.
    pub choice: Choice,
    /// Every pair that is open.
    pub disputes: Vec<Dispute>,
}

/// Chooses `poses` poses within `limits` (rad or m, one pair a joint); `None` if the diagnosis
/// leaves nothing open. The further poses are taken under the conditions (payload,
/// temperature, time) of the middle row.
pub fn discriminate(
    diagnosis: &Diagnosis,
    limits: &[[f64; 2]],
    poses: usize,
    seed: u64,
) -> Option<Decision> {
    let identified = &diagnosis.identified;
    let calibration = &identified.calibration;
    let measured = fitted(&identified.problem, calibration);
    let template = *measured.get(measured.len() / 2)?;
    let arm = &calibration.complete.arm;
    let seen = match template.relations.first() {
        Some(Relation::Distance { .. }) => Some(Seen::Distance),
        Some(Relation::Point { .. } | Relation::Plane { .. }) => Some(Seen::Touch),
        _ => None,
    };
    // all else is measured at any pose, of the same kind as the template
    let choice = Choice::new(arm, seen.unwrap_or(Seen::Position), limits);
    let count = if seen == Some(Seen::Distance) {
        poses / 2
    } else {
        poses
    };
    let random = &mut Random::new(seed, STREAM);
    let q = choice.draw(arm, POOL.max(2 * count), random);
    let pool: Vec<Observation> = q
        .iter()
        .map(|q| match seen {
            Some(_) => choice.observation(arm, template, q),
            None => Observation {
                row: 0,
                q: q.clone(),
                direction: vec![0.0; q.len()],
                travel: vec![0.0; q.len()],
                ..template.clone()
            },
        })
        .collect();
    let pool: Vec<&Observation> = pool.iter().collect();

    let mut open = Vec::new();
    for named in &diagnosis.named {
        for rival in named.rivals.iter().filter(|r| is_open(r)) {
            open.extend(Pair::new(diagnosis, named, rival, &measured, &pool));
        }
    }
    if open.is_empty() {
        return None;
    }
    let before: Vec<f64> = open.iter().map(|pair| pair.apart).collect();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count {
        let closest = open.iter().min_by(|a, b| a.apart.total_cmp(&b.apart))?;
        let best = (0..pool.len())
            .filter(|k| !chosen.contains(k))
            .map(|k| (k, closest.gain(k)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?
            .0;
        chosen.push(best);
        for pair in &mut open {
            pair.add(best);
        }
    }
    Some(Decision {
        poses: chosen.iter().map(|&k| q[k].clone()).collect(),
        choice,
        disputes: open
            .into_iter()
            .zip(before)
            .map(|(pair, measured)| Dispute {
                found: pair.found,
                rival: pair.rival,
                measured,
                planned: pair.apart,
            })
            .collect(),
    })
}

fn is_open(rival: &Rival) -> bool {
    rival.delta_bic < UNDECIDED && rival.similarity > ALIKE
}

/// An effect and its rival in a linear problem: what the effect does to the rows, and the
/// columns with which the rest of the model and the rival imitate it.
struct Pair {
    found: String,
    rival: String,
    /// Whitened rows of the pool: what the effect does, what imitates it.
    pool: Vec<(DVector<f64>, DMatrix<f64>)>,
    /// Of the rows taken so far: information of the imitation, its product with the effect,
    /// the effect's squared length.
    information: DMatrix<f64>,
    product: DVector<f64>,
    length: f64,
    /// Inverse information, and the imitation fitted so far.
    inverse: DMatrix<f64>,
    imitation: DVector<f64>,
    /// Squared distance that no imitation closes.
    apart: f64,
}

impl Pair {
    fn new(
        diagnosis: &Diagnosis,
        named: &Named,
        rival: &Rival,
        measured: &[&Observation],
        pool: &[&Observation],
    ) -> Option<Self> {
        let problem = &diagnosis.identified.problem;
        let stage = &diagnosis.identified.calibration.complete;
        // what is left may be more than the declared noise: that decides how far apart two are
        let scale = stage.fit.variance().sqrt().max(1.0);
        let sigmas = Sigmas::per_kind(|kind| problem.sigmas.of(kind) * scale);
        let own = |unknown: &Unknown| match unknown {
            Unknown::Effect { effect, .. } => stage
                .arm
                .effects
                .get(*effect)
                .is_some_and(|e| named.effects.contains(e)),
            Unknown::EarlyReading => {
                matches!(named.step.hypothesis.members, Members::EarlyReading)
            }
            _ => false,
        };
        let (values, rest): (Vec<Unknown>, Vec<Unknown>) =
            stage.fit.unknowns.iter().partition(|u| own(u));
        let amplitudes =
            DVector::from_iterator(values.len(), values.iter().map(|u| u.value(&stage.arm)));
        let (arm, added) = with_rival(&stage.arm, rival)?;
        let mut columns = rest;
        columns.extend(added);
        let units = vec![1.0; values.len()];
        let scales: Vec<f64> = columns.iter().map(|u| u.expected(&arm)).collect();
        let of = |rows: &[&Observation]| {
            let effect = linearize(&arm, &values, &units, rows, sigmas).jacobian * &amplitudes;
            let imitation = linearize(&arm, &columns, &scales, rows, sigmas).jacobian;
            (effect, imitation)
        };
        let (effect, jacobian) = of(measured);
        let mut pair = Self {
            found: named.step.hypothesis.label(),
            rival: rival.hypothesis.label(),
            pool: pool.iter().map(|o| of(&[o])).collect(),
            // columns are in units of what may be expected: one is what is known beforehand
            information: jacobian.tr_mul(&jacobian)
                + DMatrix::identity(columns.len(), columns.len()),
            product: jacobian.tr_mul(&effect),
            length: effect.norm_squared(),
            inverse: DMatrix::zeros(0, 0),
            imitation: DVector::zeros(0),
            apart: 0.0,
        };
        pair.settle();
        Some(pair)
    }

    /// Refits the imitation.
    fn settle(&mut self) {
        if let Some(factor) = self.information.clone().cholesky() {
            self.inverse = factor.inverse();
            self.imitation = factor.solve(&self.product);
            self.apart = (self.length - self.product.dot(&self.imitation)).max(0.0);
        }
    }

    /// By how much pose `k` of the pool would set the two further apart.
    fn gain(&self, k: usize) -> f64 {
        let (effect, jacobian) = &self.pool[k];
        let distance = effect - jacobian * &self.imitation;
        let height = distance.len();
        let spread =
            DMatrix::identity(height, height) + jacobian * &self.inverse * jacobian.transpose();
        spread
            .cholesky()
            .map_or(0.0, |factor| distance.dot(&factor.solve(&distance)))
    }

    fn add(&mut self, k: usize) {
        let (effect, jacobian) = &self.pool[k];
        self.information += jacobian.tr_mul(jacobian);
        self.product += jacobian.tr_mul(effect);
        self.length += effect.norm_squared();
        self.settle();
    }
}

/// The arm with the rival's effects behind its own, without a share in anything yet, and
/// their unknowns.
fn with_rival(arm: &ArmModel, rival: &Rival) -> Option<(ArmModel, Vec<Unknown>)> {
    let mut arm = arm.clone();
    let mut added = Vec::new();
    match &rival.hypothesis.members {
        Members::Effects(effects) => {
            for effect in effects {
                let mut effect: Effect<'static, f64> = *effect;
                effect.model_mut().values_mut().fill(0.0);
                let index = arm.effects.len();
                let count = effect.model().values().len();
                added.extend((0..count).map(|value| Unknown::Effect {
                    effect: index,
                    value,
                }));
                arm.effects.push(effect);
            }
            arm.bake();
        }
        Members::EarlyReading => added.push(Unknown::EarlyReading),
        Members::Curve(_) => return None,
    }
    Some((arm, added))
}
