//! One effect that stands for two.
//!
//! Where two effects are missing, the one that explains most may be neither of them: a warm-up
//! for a step beside another warm-up, a link that bends for a joint that tilts beside a gain. The
//! two together then explain more than it does, but neither comes in while it is there.

use nalgebra::DMatrix;
use truepose::effects::{Effect, Variable};

use super::addition::drifts;
use super::exchange::EVIDENT;
use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::refine::refined;
use super::search::{ALPHA, Search, is_same_name};
use super::sensible::sensible;
use super::space::{Columns, SHOWS, Score, Space, columns};
use super::unnamed::variables;

/// First members of pairs that are tried.
const FIRSTS: usize = 12;

impl Search<'_> {
    /// The model with one effect, or one slow term without a name, exchanged for the two that explain
    /// evidently more and predict held-back rows better; `None` where there is no such pair. Beside curves, which give way
    /// to whatever comes, scores of pairs say nothing.
    pub(super) fn pair_instead(&self, model: &Extended) -> Option<Extended> {
        if !model.arm.curves.is_empty() {
            return None;
        }
        (0..model.accepted.len()).find_map(|index| {
            let own = &model.accepted[index];
            let slow = is_slow(own);
            if own.kind == "unnamed" && !slow {
                return None;
            }
            let mut others = model.accepted.clone();
            others.remove(index);
            let without = self.fit(&model.arm, others).ok()?;
            let pair = self.best_pair(&without, own)?;
            if slow && !pair.iter().all(drifts) {
                return None;
            }
            if !self.predicts_more(&without, &[&pair[0], &pair[1]], &[own]) {
                return None;
            }
            let mut accepted = without.accepted.clone();
            accepted.splice(index..index, pair);
            let trial = refined(self, self.fit(&without.arm, accepted).ok()?);
            let fits = sensible(&trial, index) && sensible(&trial, index + 1);
            fits.then(|| self.pruned(self.pruned(trial, index + 1), index))
        })
    }

    /// Two that are worth evidently more than `own`, each of them significant beside the other.
    fn best_pair(&self, without: &Extended, own: &Hypothesis) -> Option<[Hypothesis; 2]> {
        let (_, space) = without.space(&self.observations, self.sigmas);
        let mut candidates = self.catalogue(without);
        candidates.retain(|c| !c.is_same(own));
        candidates.push(own.clone());
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&without.arm, &references, &self.observations, self.sigmas);
        let beyond = Columns {
            matrix: &columns.matrix - &space.basis * space.basis.tr_mul(&columns.matrix),
            groups: columns.groups,
        };
        let worth = |score: &Score, i: usize| score.gain + 2.0 * candidates[i].ln_weight;
        let passes = |score: &Score, i: usize| score.ln_p - candidates[i].ln_weight < ALPHA.ln();
        let alone = space.scores(&beyond);
        let least = worth(&alone[candidates.len() - 1], candidates.len() - 1) + EVIDENT;
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        order.sort_by(|&a, &b| {
            worth(&alone[b], b)
                .total_cmp(&worth(&alone[a], a))
                .then(a.cmp(&b))
        });
        // several constants of one effect are one first member
        let mut firsts: Vec<usize> = Vec::new();
        for &i in &order {
            let known = |f: &&usize| candidates[**f].label() == candidates[i].label();
            if firsts.iter().filter(known).count() < 2 {
                firsts.push(i);
            }
            if firsts.len() == FIRSTS {
                break;
            }
        }
        let mut best: Option<(f64, [usize; 2])> = None;
        for &first in &firsts {
            let beside = space.beside(&beyond.select(&[first]).matrix);
            let scores = beside.scores(&beyond);
            for (i, score) in scores.iter().enumerate() {
                let both = worth(&alone[first], first) + worth(score, i);
                let better = both > best.map_or(least, |b| b.0);
                if better && passes(score, i) && !is_same_name(&candidates[first], &candidates[i]) {
                    best = Some((both, [first, i]));
                }
            }
        }
        let [first, second] = best?.1;
        let beside = space.beside(&beyond.select(&[second]).matrix);
        let score = beside.scores(&beyond.select(&[first]))[0];
        passes(&score, first).then(|| [candidates[first].clone(), candidates[second].clone()])
    }
}

/// A term without a name that goes by the time and temperatures alone: two drifts look like that.
fn is_slow(hypothesis: &Hypothesis) -> bool {
    let clock = |v: &Variable| matches!(v, Variable::Time | Variable::Temperature(_));
    let slow = |e: &Effect<'static, f64>| match e {
        Effect::Unnamed(term) => variables(term).iter().all(clock),
        _ => false,
    };
    matches!(&hypothesis.members, Members::Effects(effects) if effects.iter().all(slow))
}

impl Space {
    /// What is left once these columns, orthogonal to the basis, have taken their part. Its own
    /// basis is theirs alone.
    fn beside(&self, columns: &DMatrix<f64>) -> Self {
        let svd = columns.clone().svd(true, false);
        let shows = |i: &usize| svd.singular_values[*i] > SHOWS;
        let kept: Vec<usize> = (0..svd.singular_values.len()).filter(shows).collect();
        let basis = match &svd.u {
            Some(u) => u.select_columns(&kept),
            None => DMatrix::zeros(columns.nrows(), 0),
        };
        let residual = &self.residual - &basis * basis.tr_mul(&self.residual);
        Self {
            rss: residual.norm_squared(),
            freedom: (self.freedom - basis.ncols() as f64).max(1.0),
            effective: self.effective,
            residual,
            basis,
        }
    }
}
