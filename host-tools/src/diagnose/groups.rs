//! Groups that count as one hypothesis, and which of their members stay.

use nalgebra::DMatrix;
use truepose::effects::Effect;

use super::hypothesis::{Hypothesis, Members, YIELDS};
use super::model::Extended;
use super::search::Search;
use super::sensible::within;
use crate::identify::unknown::Unknown;

impl Search<'_> {
    /// Members of group `index` that do not earn their place leave it. To be asked when the
    /// group comes in: what comes in later is judged beside it and does not take it apart.
    pub(super) fn pruned(&self, mut model: Extended, index: usize) -> Extended {
        loop {
            let stays = standing(&model, index);
            if stays.iter().all(|s| *s) {
                return model;
            }
            let mut accepted = model.accepted.clone();
            let group = &mut accepted[index];
            if let Members::Effects(effects) = &mut group.members {
                let mut stays = stays.iter();
                effects.retain(|_| stays.next().is_none_or(|s| *s));
                if let [only] = effects.as_slice() {
                    group.joint = only.model().joint();
                }
            }
            match self.fit(&model.arm, accepted) {
                Ok(smaller) => model = smaller,
                Err(_) => return model,
            }
        }
    }

    /// The model's hypotheses with `addition`, and its place among them. Free levers of all links
    /// beyond a joint stand for all weight there, so that described masses and a weight at the
    /// tool leave it to them; where the payload varies it tells masses from levers.
    pub(super) fn with_room(
        &self,
        model: &Extended,
        addition: &Hypothesis,
    ) -> (Vec<Hypothesis>, usize) {
        let payloads = || self.observations.iter().map(|o| o.ambient.payload);
        let low = payloads().fold(f64::INFINITY, f64::min);
        let varies = payloads().any(|p| p > low);
        let on = |joint| {
            let levers = match &addition.members {
                Members::Effects(effects) if addition.has_levers() => effects.as_slice(),
                _ => &[],
            };
            let on = levers.iter().filter(|e| e.model().joint() == Some(joint));
            on.count()
        };
        let joints = 0..model.arm.joint_count();
        let all = |&j: &usize| on(j) == model.arm.joint_count() - j;
        let levers: Vec<Option<usize>> = joints.filter(all).map(Some).collect();
        let mut accepted = Vec::with_capacity(model.accepted.len() + 1);
        let mut place = None;
        for hypothesis in &model.accepted {
            let mut left = hypothesis.clone();
            if let Members::Effects(effects) = &mut left.members {
                effects.retain(|e| {
                    let stands_for = match e {
                        Effect::JointCompliance(_) => !varies,
                        Effect::ToolLoad(_) => true,
                        _ => false,
                    };
                    !(stands_for && levers.contains(&e.model().joint()))
                });
                if effects.is_empty() {
                    place.get_or_insert(accepted.len());
                    continue;
                }
            }
            accepted.push(left);
        }
        let place = place.unwrap_or(accepted.len());
        accepted.insert(place, addition.clone());
        (accepted, place)
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
                    if first.joint != hypothesis.joint {
                        first.joint = None;
                    }
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
}

/// A member of a group earns its place where one of its values is this many standard errors.
const EARNS: f64 = 3.0;

/// Which members of a group stay: the one that is worth least goes, and the next, as long as one
/// is not significant or not sensible. What the others become is a linear matter: their values
/// and covariance on condition that those that went are zero.
fn standing(model: &Extended, index: usize) -> Vec<bool> {
    let effects = model.effects_of(index);
    let mut stays = vec![true; effects.len()];
    let is_group = |h: &Hypothesis| matches!(h.kind, YIELDS | "tool-load");
    if !model.accepted.get(index).is_some_and(is_group) {
        return stays;
    }
    let kind = model.accepted[index].kind;
    let offset: usize = (0..index).map(|i| model.effects_of(i).len()).sum();
    // member, largest that its unit allows, place among the unknowns
    let mut values: Vec<(usize, &str, Option<usize>)> = Vec::new();
    let mut x: Vec<f64> = Vec::new();
    for (m, effect) in effects.iter().enumerate() {
        for (value, size) in effect.model().values().iter().enumerate() {
            let effect_index = offset + m;
            let unknown = Unknown::Effect {
                effect: effect_index,
                value,
            };
            let place = model.fit.unknowns.iter().position(|u| *u == unknown);
            let unit = effect.model().parameters().get(value).map_or("", |p| p.1);
            values.push((m, unit, place));
            x.push(*size);
        }
    }
    let variance = model.fit.variance();
    let between = |a: Option<usize>, b: Option<usize>| match (a, b) {
        (Some(a), Some(b)) => model.fit.covariance[(a, b)] * variance,
        _ => 0.0,
    };
    let n = values.len();
    let mut c = DMatrix::from_fn(n, n, |a, b| between(values[a].2, values[b].2));
    let rounding = c.diagonal() * 1e-9;
    while stays.iter().filter(|s| **s).count() > 1 {
        let worth = |m: usize| {
            let own = (0..n).filter(|&k| values[k].0 == m);
            let t = own.map(|k| {
                let known = c[(k, k)] > rounding[k];
                let sigma = if known { c[(k, k)].sqrt() } else { 0.0 };
                let t = if known { x[k].abs() / sigma } else { 0.0 };
                let fits = within(kind, values[k].1, x[k], sigma);
                if fits { t } else { t.min(0.1) }
            });
            t.fold(0.0, f64::max)
        };
        let left = (0..stays.len())
            .filter(|&m| stays[m])
            .map(|m| (worth(m), m));
        let weakest = left.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, weakest)) = weakest.filter(|(t, _)| *t < EARNS) else {
            break;
        };
        stays[weakest] = false;
        for k in (0..n).filter(|&k| values[k].0 == weakest) {
            let own = c[(k, k)];
            if own > rounding[k] {
                let column = c.column(k) / own;
                let gone = x[k];
                for (value, share) in x.iter_mut().zip(&column) {
                    *value -= share * gone;
                }
                let row = c.row(k).clone_owned();
                c -= column * row;
            }
        }
    }
    stays
}

/// True for a joint, or several, of those that one cause acts on.
fn of_a_group(hypothesis: &Hypothesis) -> bool {
    let Members::Effects(effects) = &hypothesis.members else {
        return false;
    };
    let acts = |e: &Effect<'static, f64>| {
        use Effect::{GravityLever, JointCompliance, ToolLoad};
        matches!(e, JointCompliance(_) | GravityLever(_) | ToolLoad(_))
    };
    effects.iter().all(acts)
}
