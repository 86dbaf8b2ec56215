//! Which of several names, where they are one and the same thing in these poses.

use super::exchange::{Substitute, once_each};
use super::hypothesis::Members;
use super::model::Extended;
use super::refine::refined;
use super::rivals::bic;
use super::search::{Search, is_same_name};
use super::sensible::sensible;

/// Cosine from which two explanations are nearly one direction in these poses.
const ONE: f64 = 0.9;

impl Search<'_> {
    /// Every effect by the likeliest of the names that these poses cannot tell apart; `None`
    /// where it has that already. The fit is the same, so what counts is how many parameters it
    /// takes and how likely the name was before anything was measured: kinds alike, then the
    /// members of a kind. A joint that gives way comes before one of two forms in which a link may
    /// bend, a base that rocks before one of seven joints that may tilt, a gain before one of
    /// twelve orders. An effect counts with all its constants: a drift does not come before a step
    /// at whatever time there is, but before a step at one time of many.
    pub(super) fn likeliest_names(&self, model: &Extended) -> Option<Extended> {
        let mut renamed: Option<Extended> = None;
        for index in 0..model.accepted.len() {
            let better = self.likelier_name(renamed.as_ref().unwrap_or(model), index);
            renamed = better.or(renamed);
        }
        renamed
    }

    fn likelier_name(&self, model: &Extended, index: usize) -> Option<Extended> {
        let own = &model.accepted[index];
        if matches!(own.members, Members::Curve(_)) || own.kind == "unnamed" {
            return None;
        }
        let found = self.substitutes(model, index, false).ok()?;
        let same = |s: &Substitute| {
            s.sameness > ONE
                && !is_same_name(own, &s.hypothesis)
                // one wobble has a name in either frame: its joint's is the one that is used
                && own.kind != "axis-wobble"
        };
        let worth = |model: &Extended, ln_constants: f64| {
            2.0 * (model.accepted[index].ln_weight + ln_constants) - bic(self, model)
        };
        // of one name the form and the constants that are worth most
        let mut others: Vec<Substitute> = found.others.into_iter().filter(same).collect();
        let alone = |s: &Substitute| s.score.gain + 2.0 * s.hypothesis.ln_weight;
        others.sort_by(|a, b| alone(b).total_cmp(&alone(a)));
        once_each(&mut others);
        let mut best: Option<(f64, Extended)> = None;
        for other in others {
            let mut accepted = model.accepted.clone();
            accepted[index] = other.hypothesis;
            let Ok(trial) = self.fit(&model.arm, accepted) else {
                continue;
            };
            let trial = refined(self, self.pruned(trial, index));
            let own = worth(model, found.own_ln_constants);
            let least = best.as_ref().map_or(own, |b| b.0);
            let worth = worth(&trial, other.ln_constants);
            if worth > least && sensible(&trial, index) {
                best = Some((worth, trial));
            }
        }
        best.map(|b| b.1)
    }
}
