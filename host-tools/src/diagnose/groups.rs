//! Groups that count as one hypothesis, and which of their members stay.

use truepose::effects::Effect;

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::search::Search;
use super::sensible::within;
use crate::identify::unknown::Unknown;

impl Search<'_> {
    /// Members of group `index` that do not earn their place leave it. To be asked when the
    /// group comes in: what comes in later is judged beside it and does not take it apart.
    pub(super) fn pruned(&self, mut model: Extended, index: usize) -> Extended {
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
        model
    }

    /// Members of one group that were found one by one are one hypothesis: gravity acts on all
    /// joints at once.
    pub(super) fn gathered(&self, model: Extended) -> Extended {
        let mut gathered: Vec<Hypothesis> = Vec::new();
        for hypothesis in &model.accepted {
            let first = gathered
                .iter_mut()
                .find(|g| g.kind == hypothesis.kind && of_a_group(g) && of_a_group(hypothesis));
            match (first, &hypothesis.members) {
                (Some(first), Members::Effects(further)) => {
                    first.joint = None;
                    if let Members::Effects(effects) = &mut first.members {
                        effects.extend(further);
                    }
                }
                _ => gathered.push(hypothesis.clone()),
            }
        }
        if gathered.len() == model.accepted.len() {
            return model;
        }
        self.fit(&model.arm, gathered).unwrap_or(model)
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
}

/// True for a joint, or several, of those that one cause acts on.
fn of_a_group(hypothesis: &Hypothesis) -> bool {
    let Members::Effects(effects) = &hypothesis.members else {
        return false;
    };
    let acts =
        |e: &Effect<'static, f64>| matches!(e, Effect::JointCompliance(_) | Effect::ToolLoad(_));
    effects.iter().all(acts)
}
