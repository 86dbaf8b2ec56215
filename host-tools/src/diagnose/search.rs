//! Which effects: add the best, refit all, exchange, remove; until nothing passes.

use truepose::JointKind;

use super::curve;
use super::hypothesis::{Hypothesis, Members, hypotheses};
use super::model::Extended;
use super::noise::estimated;
use super::periodogram::peaks;
use super::refine::refined;
use super::space::{Score, Space, columns};
use super::validate::{Blocks, Comparison, compare, folds};
use crate::identify::Failure;
use crate::identify::arm::ArmModel;
use crate::identify::gross::levers;
use crate::identify::linearize::Linear;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::unknown::Unknown;

/// Probability of naming anything at all where there is nothing.
const ALPHA: f64 = 0.01;

/// Candidates that are cross-validated at each step before the search gives up.
const TRIES: usize = 12;

/// Exchanges and removals after one series of additions.
const EXCHANGES: usize = 4;

/// One candidate at the step that added it, or that looked for more.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranked {
    /// As a person says it.
    pub label: String,
    /// Logarithm of the probability by chance, all candidates considered.
    pub ln_p: f64,
    /// Share of the squared residual that it takes.
    pub share: f64,
}

/// A step of the search.
#[derive(Clone, Debug)]
pub struct Step {
    /// What was added.
    pub hypothesis: Hypothesis,
    /// Logarithm of the probability by chance, all candidates considered.
    pub ln_p: f64,
    /// Held-back rms error with over without, on random folds, blocks in time, in space.
    /// `None` for what came in by exchange.
    pub held_back: Option<[f64; 3]>,
    /// The best candidates then.
    pub ranking: Vec<Ranked>,
}

/// What the search works on.
pub struct Search<'a> {
    /// Rows in the fit.
    pub observations: Vec<&'a Observation>,
    /// Noise that residuals are weighted by.
    pub sigmas: Sigmas,
    /// Unknowns of geometry and placement.
    pub geometry: Vec<Unknown>,
    /// Candidates.
    pub hypotheses: Vec<Hypothesis>,
    /// Candidates that fit only with sizes that no machine has.
    refused: Vec<Hypothesis>,
    folds: [Vec<usize>; 3],
}

/// Where the search ended.
pub struct Found {
    /// The model.
    pub model: Extended,
    /// How each addition came about.
    pub steps: Vec<Step>,
}

impl<'a> Search<'a> {
    /// Over everything that the rows allow.
    pub fn new(
        arm: &ArmModel,
        observations: Vec<&'a Observation>,
        sigmas: Sigmas,
        geometry: Vec<Unknown>,
    ) -> Self {
        let levers = levers(arm, &observations, sigmas);
        let folds = [Blocks::Random, Blocks::Time, Blocks::Space]
            .map(|blocks| folds(&observations, &levers, blocks));
        Self {
            hypotheses: hypotheses(arm, &observations),
            refused: Vec::new(),
            folds,
            observations,
            sigmas,
            geometry,
        }
    }

    /// Refit with these hypotheses.
    pub fn fit(&self, arm: &ArmModel, accepted: Vec<Hypothesis>) -> Result<Extended, Failure> {
        Extended::fitted(
            arm,
            &self.geometry,
            accepted,
            &self.observations,
            self.sigmas,
        )
    }

    /// From the geometric fit on; `progress` is told every addition.
    ///
    /// The residual's own size is the yardstick at every step: where much is missing, a
    /// direction that the instrument could see is still drowned by what is missing.
    pub fn run(&mut self, arm: &ArmModel, progress: &dyn Fn(&str)) -> Result<Found, Failure> {
        let mut model = self.fit(arm, Vec::new())?;
        self.weigh(&model);
        let mut steps: Vec<Step> = Vec::new();
        loop {
            while let Some(step) = self.best_addition(&model)? {
                let mut accepted = model.accepted.clone();
                accepted.push(step.hypothesis.clone());
                model = self.fit(&model.arm, accepted)?;
                model = refined(self, self.pruned(model));
                self.weigh(&model);
                progress(&step.hypothesis.label());
                let hypothesis = model.accepted.last().cloned();
                steps.push(Step {
                    hypothesis: hypothesis.unwrap_or(step.hypothesis),
                    ..step
                });
            }
            let before = model.accepted.clone();
            model = self.exchanged(model);
            let same = before.len() == model.accepted.len()
                && before
                    .iter()
                    .zip(&model.accepted)
                    .all(|(a, b)| a.is_same(b));
            if same || steps.len() > 4 * self.observations.len() {
                break;
            }
            self.weigh(&model);
        }
        steps.retain(|s| model.accepted.iter().any(|h| h.is_same(&s.hypothesis)));
        Ok(Found { model, steps })
    }

    fn weigh(&mut self, model: &Extended) {
        let fitted = model.fit.unknowns.len();
        self.sigmas = estimated(&model.arm, &self.observations, self.sigmas, fitted);
    }

    /// Candidates that are not yet in the model, with the periodogram's.
    fn candidates(&self, model: &Extended, lines: bool) -> Vec<Hypothesis> {
        let mut candidates: Vec<Hypothesis> = self
            .hypotheses
            .iter()
            .filter(|h| !model.accepted.iter().any(|a| overlaps(a, h)))
            .filter(|h| !self.refused.iter().any(|r| r.is_same(h)))
            .cloned()
            .collect();
        if !lines {
            return candidates;
        }
        candidates.extend(
            peaks(model, &self.observations, self.sigmas)
                .into_iter()
                .filter(|h| {
                    !model
                        .accepted
                        .iter()
                        .chain(&candidates)
                        .any(|a| a.is_same(h))
                })
                .collect::<Vec<_>>(),
        );
        candidates
    }

    /// The best candidate that is significant among all, lowers the held-back error, and has
    /// a sensible size; `None` where nothing passes.
    fn best_addition(&mut self, model: &Extended) -> Result<Option<Step>, Failure> {
        let (linear, space) = model.space(&self.observations, self.sigmas);
        let candidates = self.candidates(model, true);
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&model.arm, &references, &self.observations, self.sigmas);
        let scores = space.scores(&columns);
        let mut order: Vec<usize> = (0..scores.len())
            .filter(|&i| scores[i].ln_p - candidates[i].ln_weight < ALPHA.ln())
            .collect();
        let worth = |i: usize| scores[i].gain + 2.0 * candidates[i].ln_weight;
        order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)).then(a.cmp(&b)));
        let ranking: Vec<Ranked> = order
            .iter()
            .take(12)
            .map(|&i| Ranked {
                label: candidates[i].label(),
                ln_p: scores[i].ln_p - candidates[i].ln_weight,
                share: scores[i].reduction / space.rss,
            })
            .collect();
        for i in order.into_iter().take(TRIES) {
            let candidate = &candidates[i];
            let (start, len) = columns.groups[i];
            let extra = columns.matrix.columns(start, len).into_owned();
            let held_back = [0, 1, 2].map(|b| {
                compare(
                    &self.observations,
                    &self.folds[b],
                    &linear.jacobian,
                    &extra,
                    &space.residual,
                    None,
                )
            });
            let ratios = [0, 1, 2].map(|b| held_back[b].ratio());
            let in_time = depends_on_time(candidate.kind);
            let holds = held_back[0].t() > 2.0 && ratios[2] < 1.0 && (in_time || ratios[1] < 1.0);
            if !holds {
                continue;
            }
            let mut accepted = model.accepted.clone();
            accepted.push(candidate.clone());
            let fits = self
                .fit(&model.arm, accepted)
                .is_ok_and(|trial| sensible(&trial, trial.accepted.len() - 1));
            if !fits {
                self.refused.push(candidate.clone());
                continue;
            }
            if let Some(step) =
                self.curve_instead(model, candidate, &linear, &space, &held_back[0], &ranking)
            {
                return Ok(Some(step));
            }
            return Ok(Some(Step {
                hypothesis: candidate.clone(),
                ln_p: scores[i].ln_p - candidate.ln_weight,
                held_back: Some(ratios),
                ranking,
            }));
        }
        Ok(None)
    }

    /// A joint's curve in place of a function of the same joint's reading, where it predicts
    /// held-back rows better.
    fn curve_instead(
        &self,
        model: &Extended,
        candidate: &Hypothesis,
        linear: &Linear,
        space: &Space,
        rival: &Comparison,
        ranking: &[Ranked],
    ) -> Option<Step> {
        let joint = candidate.joint?;
        let of_reading = matches!(
            candidate.kind,
            "gear-eccentricity" | "joint-gain" | "gear-ripple"
        );
        let has = model
            .accepted
            .iter()
            .any(|h| h.kind == "joint-curve" && h.joint == Some(joint));
        if !of_reading || has || model.arm.joints[joint].kind != JointKind::Revolute {
            return None;
        }
        let extra = curve::columns(&model.arm, joint, &self.observations, self.sigmas);
        let mut best: Option<(f64, Comparison)> = None;
        for smooth in curve::SMOOTHNESS {
            let prior = curve::precision(smooth);
            let comparison = compare(
                &self.observations,
                &self.folds[0],
                &linear.jacobian,
                &extra,
                &space.residual,
                Some(&prior),
            );
            if best
                .as_ref()
                .is_none_or(|b| comparison.ratio() < b.1.ratio())
            {
                best = Some((smooth, comparison));
            }
        }
        let (smooth, comparison) = best?;
        let against = Comparison {
            without: rival.with.clone(),
            with: comparison.with.clone(),
        };
        if against.t() < 2.0 {
            return None;
        }
        let prior = curve::precision(smooth);
        let blocks = [1, 2].map(|b| {
            compare(
                &self.observations,
                &self.folds[b],
                &linear.jacobian,
                &extra,
                &space.residual,
                Some(&prior),
            )
            .ratio()
        });
        (blocks[0] < 1.0 && blocks[1] < 1.0).then(|| Step {
            hypothesis: Hypothesis {
                kind: "joint-curve",
                joint: Some(joint),
                order: None,
                from: None,
                members: Members::Curve(smooth),
                ln_weight: candidate.ln_weight,
            },
            ln_p: ranking.first().map_or(0.0, |r| r.ln_p),
            held_back: Some([comparison.ratio(), blocks[0], blocks[1]]),
            ranking: ranking.to_vec(),
        })
    }

    /// Members of groups that do not earn their place leave it.
    fn pruned(&self, mut model: Extended) -> Extended {
        for index in 0..model.accepted.len() {
            while model.effects_of(index).len() > 1 {
                let Some(weakest) = self.weakest_member(&model, index) else {
                    break;
                };
                let mut accepted = model.accepted.clone();
                let group = &mut accepted[index];
                if let Members::Effects(effects) = &mut group.members {
                    effects.remove(weakest);
                    if let [only] = effects.as_slice() {
                        group.joint = only.model().joint();
                    }
                }
                match self.fit(&model.arm, accepted) {
                    Ok(smaller) => model = smaller,
                    Err(_) => break,
                }
            }
        }
        model
    }

    /// The member of a group that could go: it is not significant, or not sensible.
    fn weakest_member(&self, model: &Extended, index: usize) -> Option<usize> {
        let hypothesis = model.accepted.get(index)?;
        if !matches!(hypothesis.kind, "joint-compliance" | "tool-load") {
            return None;
        }
        let offset: usize = (0..index).map(|i| model.effects_of(i).len()).sum();
        let mut weakest: Option<(usize, f64)> = None;
        for (m, effect) in model.effects_of(index).iter().enumerate() {
            let unknown = Unknown::Effect {
                effect: offset + m,
                value: 0,
            };
            let value = effect.model().values().first().copied().unwrap_or(0.0);
            let t = match model.fit.sigma(unknown) {
                Some(sigma) => value.abs() / sigma.max(1e-300),
                None => 0.0,
            };
            let unit = effect.model().parameters().first().map_or("", |p| p.1);
            let t = if within(hypothesis.kind, unit, value) {
                t
            } else {
                t.min(0.1)
            };
            if t < 3.0 && weakest.is_none_or(|(_, w)| t < w) {
                weakest = Some((m, t));
            }
        }
        weakest.map(|(m, _)| m)
    }

    /// Removes members that no longer pass, and exchanges a member for a substitute where
    /// that leaves less.
    fn exchanged(&self, mut model: Extended) -> Extended {
        for _ in 0..EXCHANGES {
            match self.exchange_once(&model) {
                Some(better) => model = self.pruned(better),
                None => break,
            }
        }
        model
    }

    fn exchange_once(&self, model: &Extended) -> Option<Extended> {
        if model.accepted.len() < 2 {
            return None;
        }
        for index in 0..model.accepted.len() {
            if matches!(model.accepted[index].members, Members::Curve(_)) {
                continue;
            }
            let Ok(rivals) = self.substitutes(model, index) else {
                continue;
            };
            let own = rivals.own;
            if own.ln_p - model.accepted[index].ln_weight > ALPHA.ln() {
                return Some(rivals.without);
            }
            if let Some((better, score)) = rivals.others.first() {
                let gain = score.gain + 2.0 * better.ln_weight
                    - (own.gain + 2.0 * model.accepted[index].ln_weight);
                if gain > 6.0 {
                    let mut accepted = model.accepted.clone();
                    accepted[index] = better.clone();
                    if let Ok(trial) = self.fit(&model.arm, accepted)
                        && sensible(&trial, index)
                        && trial.fit.cost < model.fit.cost
                    {
                        return Some(trial);
                    }
                }
            }
        }
        None
    }

    /// What else could stand in the place of an accepted hypothesis, best first.
    pub fn substitutes(&self, model: &Extended, index: usize) -> Result<Substitutes, Failure> {
        let mut others = model.accepted.clone();
        let own = others.remove(index);
        let without = self.fit(&model.arm, others)?;
        let (_, space) = without.space(&self.observations, self.sigmas);
        let mut candidates = self.candidates(&without, false);
        candidates.retain(|c| !c.is_same(&own));
        candidates.push(own);
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&without.arm, &references, &self.observations, self.sigmas);
        let scores = space.scores(&columns);
        let last = candidates.len() - 1;
        let group = |i: usize| {
            let (start, len) = columns.groups[i];
            columns.matrix.columns(start, len).into_owned()
        };
        let own_columns = group(last);
        let mut order: Vec<usize> = (0..last).collect();
        let worth = |i: usize| scores[i].gain + 2.0 * candidates[i].ln_weight;
        order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)).then(a.cmp(&b)));
        order.truncate(12);
        let similarities: Vec<f64> = order
            .iter()
            .map(|&i| space.similarity(&own_columns, &group(i)))
            .collect();
        Ok(Substitutes {
            own: scores[last],
            others: order
                .iter()
                .map(|&i| (candidates[i].clone(), scores[i]))
                .collect(),
            similarities,
            without,
        })
    }
}

/// Rivals of an accepted hypothesis.
pub struct Substitutes {
    /// Its own score with all others in the model.
    pub own: Score,
    /// Candidates that could replace it, best first.
    pub others: Vec<(Hypothesis, Score)>,
    /// Largest cosine between each and it, beyond what the model has.
    pub similarities: Vec<f64>,
    /// The model without it.
    pub without: Extended,
}

/// Same kind on the same joint, so that both at once make no sense: other constants of one
/// kind, or one joint of a group that is in.
fn overlaps(accepted: &Hypothesis, candidate: &Hypothesis) -> bool {
    if accepted.is_same(candidate) {
        return true;
    }
    if accepted.kind != candidate.kind {
        return false;
    }
    let joints = |h: &Hypothesis| -> Vec<Option<usize>> {
        match &h.members {
            Members::Effects(effects) => effects.iter().map(|e| e.model().joint()).collect(),
            Members::EarlyReading | Members::Curve(_) => vec![accepted.joint],
        }
    };
    if candidate.order.is_some() || candidate.from.is_some() {
        return false;
    }
    let in_model = joints(accepted);
    joints(candidate).iter().any(|j| in_model.contains(j))
}

/// Held back in blocks of time, these have nothing to be predicted from.
fn depends_on_time(kind: &str) -> bool {
    matches!(
        kind,
        "time-drift" | "warm-up" | "step-change" | "thermal-drift" | "thermal-growth"
    )
}

/// Whether a value is one that a machine can have; `unit` in SI.
fn within(kind: &str, unit: &str, value: f64) -> bool {
    let bound = match (kind, unit) {
        ("gear-ripple", _) => 2e-3,
        ("thermal-growth", _) => 3e-4,
        ("base-flex", _) => 2e-4,
        (_, "rad" | "m") => 1e-2,
        (_, "rad/(N m)") => 1e-3,
        _ => 2e-2,
    };
    value.abs() < bound
}

/// Whether the fitted sizes are ones that a machine can have.
fn sensible(model: &Extended, index: usize) -> bool {
    let Some(hypothesis) = model.accepted.get(index) else {
        return false;
    };
    let effects = model.effects_of(index);
    if matches!(hypothesis.members, Members::Curve(_)) {
        return true;
    }
    if effects.is_empty() {
        return within("early-reading", "rad", model.arm.early_reading);
    }
    let zero = |v: &f64| v.abs() < f64::MIN_POSITIVE;
    if effects.iter().all(|e| e.model().values().iter().all(zero)) {
        return false;
    }
    // groups are pruned one by one
    let offset: usize = (0..index).map(|i| model.effects_of(i).len()).sum();
    let fine = effects.iter().enumerate().map(|(m, effect)| {
        effect
            .model()
            .values()
            .iter()
            .enumerate()
            .all(|(value, v)| {
                let stiff = matches!(
                    hypothesis.kind,
                    "joint-compliance" | "cross-axis-compliance" | "thermal-growth"
                );
                let sigma = model
                    .fit
                    .sigma(Unknown::Effect {
                        effect: offset + m,
                        value,
                    })
                    .unwrap_or(0.0);
                let unit = effect.model().parameters().get(value).map_or("", |p| p.1);
                within(hypothesis.kind, unit, *v) && !(stiff && *v < -3.0 * sigma)
            })
    });
    if effects.len() > 1 {
        fine.into_iter().any(|f| f)
    } else {
        fine.into_iter().all(|f| f)
    }
}
