//! What could stand in the place of what is in the model.

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::rivals::squares;
use super::search::{ALPHA, Search};
use super::sensible::sensible;
use super::space::{Score, columns};
use super::unnamed::{offered, terms};
use super::validate::{Blocks, Comparison, HeldBack};
use crate::identify::Failure;

/// Rivals that explain the rows this much worse (difference in BIC) cannot be ruled out.
pub(super) const RIVAL: f64 = 10.0;

/// Rivals that are listed whatever they lack.
const LISTED: usize = 3;

/// A name is exchanged for another one that is worth this much more.
pub(super) const EVIDENT: f64 = 6.0;

/// Cosine from which two hypotheses share a direction.
const SAME: f64 = 0.999;

/// Exchanges and removals after one series of additions.
const EXCHANGES: usize = 4;

/// What could replace an accepted hypothesis.
pub struct Substitute {
    /// What it is.
    pub hypothesis: Hypothesis,
    /// With all others in the model.
    pub score: Score,
    /// Largest cosine between it and what it replaces, beyond what the model has.
    pub similarity: f64,
    /// Smallest cosine: from here on every direction of the one is one of the other.
    pub sameness: f64,
    /// Logarithm of how much likelier it is with any constants than with its own: others may
    /// explain the rows as well.
    pub ln_constants: f64,
}

/// Rivals of an accepted hypothesis.
pub struct Substitutes {
    /// Its own score with all others in the model.
    pub own: Score,
    /// As [`Substitute::ln_constants`].
    pub own_ln_constants: f64,
    /// Largest gain first: those that cannot be ruled out, the best few in any case.
    pub others: Vec<Substitute>,
    /// The model without it.
    pub without: Extended,
}

impl Search<'_> {
    /// Removes members that no longer pass, and exchanges a member for a substitute where
    /// that leaves less and predicts more.
    pub(super) fn exchanged(&mut self, mut model: Extended) -> Extended {
        for _ in 0..EXCHANGES {
            match self.exchange_once(&model) {
                Some(better) => model = better,
                None => match self
                    .curve_for_several(&model)
                    .or_else(|| self.pair_instead(&model))
                {
                    Some(better) => model = better,
                    None => break,
                },
            }
        }
        model
    }

    fn exchange_once(&mut self, model: &Extended) -> Option<Extended> {
        let nameless = !terms(&model.accepted).is_empty();
        for (index, accepted) in model.accepted.iter().enumerate() {
            if matches!(accepted.members, Members::Curve(_)) {
                continue;
            }
            let Ok(rivals) = self.substitutes(model, index, nameless) else {
                continue;
            };
            let own = rivals.own;
            if model.accepted.len() > 1 && !sensible(model, index) {
                // others have made it larger than a machine can have
                self.refused.push(accepted.clone());
                return Some(rivals.without);
            }
            if own.ln_p - accepted.ln_weight > ALPHA.ln() {
                return Some(rivals.without);
            }
            // by how much more a substitute is worth than what is in
            let gain = |s: &Substitute| {
                let weights = s.hypothesis.ln_weight - accepted.ln_weight;
                s.score.gain - own.gain + 2.0 * weights - EVIDENT
            };
            let best = rivals
                .others
                .iter()
                // the same thing in another frame
                .filter(|s| s.similarity < SAME || !accepted.is_in_joint_frame_of(&s.hypothesis))
                .max_by(|a, b| gain(a).total_cmp(&gain(b)));
            if let Some(best) = best.filter(|s| gain(s) > 0.0) {
                let mut exchanged = model.accepted.clone();
                exchanged[index] = best.hypothesis.clone();
                if self.predicts_more(&rivals.without, &[&best.hypothesis], &[accepted])
                    && let Ok(trial) = self.fit(&model.arm, exchanged)
                    && sensible(&trial, index)
                    && trial.fit.cost < model.fit.cost
                {
                    return Some(self.pruned(trial, index));
                }
            }
        }
        None
    }

    /// Whether rows held back at random and in blocks of joint space are predicted better with
    /// `these` than with `those` in addition to the model. Rows that a fit has seen cannot tell:
    /// what has more parameters imitates what nobody has named.
    pub(super) fn predicts_more(
        &self,
        model: &Extended,
        these: &[&Hypothesis],
        those: &[&Hypothesis],
    ) -> bool {
        let (linear, space) = model.space(&self.observations, self.sigmas);
        let error = |hypotheses: &[&Hypothesis]| {
            let extra = columns(&model.arm, hypotheses, &self.observations, self.sigmas).matrix;
            [Blocks::Random, Blocks::Space].map(|blocks| {
                let fold = &self.folds[0][blocks as usize];
                let rows = &self.observations;
                let held_back =
                    HeldBack::new(rows, fold, &linear.jacobian, &extra, &space.residual);
                held_back.compare(0..extra.ncols(), None).with
            })
        };
        let ([at_random, in_space], [other_at_random, other_in_space]) =
            (error(these), error(those));
        let more = |with: &[f64], without: &[f64]| with.iter().sum::<f64>() < without.iter().sum();
        let more = more(&at_random, &other_at_random) && more(&in_space, &other_in_space);
        // gravity on several joints, which engineers expect, gives way as it comes in: where rows
        // tell; as many joints as the other has values are not what they expect
        let values = these.iter().map(|h| h.len()).sum();
        let expected = |h: &&Hypothesis| is_gravity_on_joints(h) && h.len() > values;
        let against = Comparison {
            without: other_at_random,
            with: at_random,
        };
        more && (against.t() > 2.0 || !those.iter().any(expected))
    }

    /// What else could stand in the place of an accepted hypothesis. `nameless`: terms without
    /// a name as well.
    pub fn substitutes(
        &self,
        model: &Extended,
        index: usize,
        nameless: bool,
    ) -> Result<Substitutes, Failure> {
        let mut others = model.accepted.clone();
        let own = others.remove(index);
        let without = self.fit(&model.arm, others)?;
        let (_, space) = without.space(&self.observations, self.sigmas);
        let mut candidates = self.catalogue(&without);
        if nameless {
            candidates.extend(offered(&without, &space, &self.observations, self.sigmas));
        }
        let is_other: Vec<bool> = candidates.iter().map(|c| !c.is_same(&own)).collect();
        candidates.push(own);
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&without.arm, &references, &self.observations, self.sigmas);
        let scores = space.scores(&columns);
        let last = candidates.len() - 1;
        let own = match model.arm.curves.is_empty() {
            true => scores[last],
            // curves give way to what comes in: only a fit tells what it is worth beside them
            false => {
                let rss = squares(self, &without);
                let unknowns = |model: &Extended| model.fit.unknowns.len();
                let more = unknowns(model).saturating_sub(unknowns(&without));
                space.judge_from(rss, rss - squares(self, model), more as f64)
            }
        };
        let own_columns = columns.select(&[last]).matrix;
        let ln_constants = |i: usize, gain: f64| {
            let of_name = (0..last).filter(|&c| candidates[c].is_same(&candidates[i]));
            let weight = |c: usize| candidates[c].ln_weight - candidates[i].ln_weight;
            let terms = of_name.map(|c| (weight(c) + 0.5 * (scores[c].gain - gain)).exp());
            terms.sum::<f64>().max(1.0).ln()
        };
        let mut order: Vec<usize> = (0..last).filter(|&i| is_other[i]).collect();
        order.sort_by(|&a, &b| scores[b].gain.total_cmp(&scores[a].gain).then(a.cmp(&b)));
        let close =
            |&(place, &i): &(usize, &usize)| place < LISTED || own.gain - scores[i].gain < RIVAL;
        let others = order
            .iter()
            .enumerate()
            .filter(close)
            .map(|(_, &i)| {
                let cosines = space.cosines(&own_columns, &columns.select(&[i]).matrix);
                Substitute {
                    hypothesis: candidates[i].clone(),
                    score: scores[i],
                    similarity: cosines.first().copied().unwrap_or(0.0),
                    sameness: cosines.last().copied().unwrap_or(0.0),
                    ln_constants: ln_constants(i, scores[i].gain),
                }
            })
            .collect();
        Ok(Substitutes {
            own,
            own_ln_constants: ln_constants(last, own.gain),
            others,
            without,
        })
    }
}

/// Keeps the first of each name: of one with several constants the best, if that is their order.
pub(super) fn once_each(substitutes: &mut Vec<Substitute>) {
    let mut seen: Vec<String> = Vec::new();
    substitutes.retain(|substitute| {
        let label = substitute.hypothesis.label();
        let new = !seen.contains(&label);
        seen.push(label);
        new
    });
}

/// Joints that yield under gravity, one or all.
fn is_gravity_on_joints(hypothesis: &Hypothesis) -> bool {
    hypothesis.kind == "joint-compliance"
}
