//! Which effects: add the best, refit all, exchange, remove; until nothing passes.

use std::mem::discriminant;

use truepose::effects::Effect;

use super::hypothesis::{Hypothesis, Members, hypotheses};
use super::model::Extended;
use super::noise::estimated;
use super::periodogram::peaks;
use super::refine::refined;
use super::space::Space;
use super::unnamed::offered;
use super::validate::{Blocks, dealt_out, folds};
use crate::identify::Failure;
use crate::identify::arm::ArmModel;
use crate::identify::gross::levers;
use crate::identify::observation::{Kind, Observation, Sigmas};
use crate::identify::unknown::Unknown;

/// Probability of naming anything at all where there is nothing.
pub(super) const ALPHA: f64 = 0.01;

/// Times that the noise is estimated anew while it falls.
const WEIGHED: usize = 12;

/// Noise has settled where a fit leaves no less than this share of it.
const SETTLED: f64 = 0.95;

/// With the noise that was declared, a fit leaves no less than this share of it.
const AFRESH: f64 = 0.8;

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
    /// Noise as it was before any fit.
    declared: Sigmas,
    /// Unknowns of geometry and placement.
    pub geometry: Vec<Unknown>,
    /// Candidates.
    pub hypotheses: Vec<Hypothesis>,
    /// Candidates that fit only with sizes that no machine has.
    pub(super) refused: Vec<Hypothesis>,
    /// Fold of every row, one list each of [`Blocks`]; where rows lie apart, once more with
    /// these dealt out.
    pub(super) folds: Vec<[Vec<usize>; 3]>,
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
        let dealt = [0, 1, 2].map(|b| dealt_out(&observations, &folds[b]));
        let any = dealt.iter().any(Option::is_some);
        let dealt = [0, 1, 2].map(|b| dealt[b].clone().unwrap_or_else(|| folds[b].clone()));
        let folds = std::iter::once(folds).chain(any.then_some(dealt)).collect();
        Self {
            hypotheses: hypotheses(arm, &observations),
            refused: Vec::new(),
            folds,
            observations,
            sigmas,
            declared: sigmas,
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
        let model = self.fit(arm, Vec::new())?;
        let mut model = self.weighed(model)?;
        let mut steps: Vec<Step> = Vec::new();
        // sets of effects that the search has been at: it ends where it has been before
        let mut been: Vec<Vec<String>> = Vec::new();
        loop {
            while let Some(step) = self.best_addition(&model)? {
                let (accepted, place) = self.with_room(&model, &step.hypothesis);
                model = self.fit(&model.arm, accepted)?;
                model = self.pruned(model, place);
                model = self.weighed(model)?;
                model = refined(self, model);
                model = self.weighed(model)?;
                progress(&step.hypothesis.label());
                let hypothesis = model.accepted.get(place).cloned();
                steps.push(Step {
                    hypothesis: hypothesis.unwrap_or(step.hypothesis),
                    ..step
                });
            }
            model = self.gathered(model);
            let before = labels(&model);
            been.push(before.clone());
            model = self.exchanged(model);
            let after = labels(&model);
            if after == before || been.contains(&after) {
                break;
            }
            been.push(after);
            model = self.weighed(model)?;
        }
        if let Some(renamed) = self.likeliest_names(&model) {
            // what stood beside the other name may have made up for it
            model = self.weighed(renamed)?;
            model = self.exchanged(model);
        }
        model = self.ordered(arm, model)?;
        steps.retain(|s| model.accepted.iter().any(|h| h.is_same(&s.hypothesis)));
        Ok(Found { model, steps })
    }

    /// The model fitted anew with the noise that it leaves: costs compare only where the noise
    /// is the same. With less noise more of the geometry can be told apart, which may leave less
    /// again: until it stays.
    ///
    /// With what was declared the fit starts once more: too much noise hides directions of the
    /// geometry, and what they leave is taken for noise.
    fn weighed(&mut self, mut model: Extended) -> Result<Extended, Failure> {
        let leaves = |model: &Extended, sigmas| {
            let fitted = model.fit.unknowns.len();
            estimated(&model.arm, &self.observations, sigmas, fitted)
        };
        let falls = |from: Sigmas, to: Sigmas, share: f64| {
            Kind::ALL
                .into_iter()
                .any(|kind| to.of(kind) < share * from.of(kind))
        };
        let mut sigmas = leaves(&model, self.sigmas);
        if falls(sigmas, self.declared, SETTLED) {
            let (rows, accepted) = (&self.observations, model.accepted.clone());
            let afresh =
                Extended::fitted(&model.arm, &self.geometry, accepted, rows, self.declared);
            if let Ok(afresh) = afresh {
                let left = leaves(&afresh, self.declared);
                if falls(sigmas, left, AFRESH) {
                    (model, sigmas) = (afresh, left);
                }
            }
        }
        for _ in 0..WEIGHED {
            self.sigmas = sigmas;
            model = self.fit(&model.arm, model.accepted)?;
            let left = estimated(
                &model.arm,
                &self.observations,
                sigmas,
                model.fit.unknowns.len(),
            );
            if !falls(sigmas, left, SETTLED) {
                break;
            }
            sigmas = left;
        }
        Ok(model)
    }

    /// Candidates of the catalogue that are not yet in the model.
    pub(super) fn catalogue(&self, model: &Extended) -> Vec<Hypothesis> {
        self.hypotheses
            .iter()
            .filter(|h| !model.accepted.iter().any(|a| overlaps(a, h)))
            .filter(|h| !h.has_levers() || self.may_pull(model, h))
            .filter(|h| !self.is_refused(h))
            .cloned()
            .collect()
    }

    /// Whether to ask for the weight at free levers. Where masses are described, once their joint
    /// is known to give way to them: they may be wrong.
    fn may_pull(&self, model: &Extended, levers: &Hypothesis) -> bool {
        let described = model.arm.masses.iter().any(|m| m.mass > 0.0);
        let yields = |h: &Hypothesis| match &h.members {
            Members::Effects(effects) => effects.iter().any(|e| {
                let on = levers.joint.is_none() || e.model().joint() == levers.joint;
                on && matches!(e, Effect::JointCompliance(_))
            }),
            Members::EarlyReading | Members::Curve(_) => false,
        };
        !described || model.accepted.iter().any(|h| yields(h) || h.has_levers())
    }

    /// The same with the strongest lines of the periodogram and the best terms without a name.
    pub(super) fn candidates(&self, model: &Extended, space: &Space) -> Vec<Hypothesis> {
        let mut candidates = self.catalogue(model);
        for found in peaks(model, space, &self.observations, self.sigmas) {
            let mut known = model.accepted.iter().chain(&candidates);
            if !known.any(|h| h.is_same(&found)) {
                candidates.push(found);
            }
        }
        let unnamed = offered(model, space, &self.observations, self.sigmas);
        candidates.extend(unnamed.into_iter().filter(|h| !self.is_refused(h)));
        candidates
    }

    fn is_refused(&self, hypothesis: &Hypothesis) -> bool {
        self.refused.iter().any(|r| r.is_same(hypothesis))
    }
}

/// What is in the model, in an order of its own.
fn labels(model: &Extended) -> Vec<String> {
    let mut labels: Vec<String> = model.accepted.iter().map(Hypothesis::label).collect();
    labels.sort();
    labels
}

/// Same kind on the same joint: other constants of one kind, or one joint of a group that is in.
pub(super) fn is_same_name(accepted: &Hypothesis, candidate: &Hypothesis) -> bool {
    overlap(accepted, candidate, &|_, _| true)
}

/// The same form of it as well, so that both at once make no sense. A joint may give way to
/// described masses and to weight that they lack.
fn overlaps(accepted: &Hypothesis, candidate: &Hypothesis) -> bool {
    overlap(accepted, candidate, &|a, b| {
        discriminant(a) == discriminant(b)
    })
}

fn overlap(
    accepted: &Hypothesis,
    candidate: &Hypothesis,
    alike: &dyn Fn(&Effect<'static, f64>, &Effect<'static, f64>) -> bool,
) -> bool {
    if accepted.is_same(candidate) {
        return true;
    }
    let of_another_kind = accepted.kind != candidate.kind || candidate.kind == "unnamed";
    if of_another_kind || candidate.order.is_some() || candidate.from.is_some() {
        return false;
    }
    match (&accepted.members, &candidate.members) {
        (Members::Effects(ours), Members::Effects(theirs)) => theirs.iter().any(|b| {
            let joint = b.model().joint();
            ours.iter()
                .any(|a| a.model().joint() == joint && alike(a, b))
        }),
        _ => accepted.joint == candidate.joint,
    }
}
