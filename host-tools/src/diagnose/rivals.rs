//! What else an effect could have been.

use super::curve::{Smoothness, precision};
use super::exchange::{RIVAL, Substitute, once_each};
use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::search::{Search, is_same_name};
use crate::identify::linearize::residuals;

/// Rivals that are fitted beside curves, the likeliest first.
const FITTED: usize = 5;

/// Rivals that are listed whatever they lack.
const LISTED: usize = 3;

/// Another explanation of what an effect explains.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The other explanation.
    pub hypothesis: Hypothesis,
    /// Cosine between what the two do to the measurements, beyond what the model has.
    pub similarity: f64,
    /// How much worse it explains them.
    pub delta_bic: f64,
}

/// Rivals of accepted hypothesis `index`, likeliest first. A curve has none.
pub(super) fn rivals(search: &Search<'_>, model: &Extended, index: usize) -> Vec<Rival> {
    let Some(known) = model.accepted.get(index) else {
        return Vec::new();
    };
    if matches!(known.members, Members::Curve(_)) {
        return Vec::new();
    }
    let Ok(substitutes) = search.substitutes(model, index, false) else {
        return Vec::new();
    };
    let own = substitutes.own;
    // another time of the same step, the group of the same joint: no other explanation
    let mut others = substitutes.others;
    others.retain(|other| !is_same_name(known, &other.hypothesis));
    // of one rival with several constants the best
    once_each(&mut others);
    if model.arm.curves.is_empty() {
        return others
            .into_iter()
            .map(|other| Rival {
                delta_bic: own.gain - other.score.gain,
                hypothesis: other.hypothesis,
                similarity: other.similarity,
            })
            .collect();
    }
    others.truncate(FITTED);
    let beside = |other: Substitute| beside_curves(search, model, index, other);
    let mut rivals: Vec<Rival> = others.into_iter().filter_map(beside).collect();
    rivals.sort_by(|a, b| a.delta_bic.total_cmp(&b.delta_bic));
    let mut place = 0;
    rivals.retain(|rival| {
        place += 1;
        place <= LISTED || rival.delta_bic < RIVAL
    });
    rivals
}

/// A rival with the whole model fitted anew: curves give way to it as they gave way to what it
/// stands for.
fn beside_curves(
    search: &Search<'_>,
    model: &Extended,
    index: usize,
    other: Substitute,
) -> Option<Rival> {
    let mut accepted = model.accepted.clone();
    accepted[index] = other.hypothesis.clone();
    let trial = search.fit(&model.arm, accepted).ok()?;
    Some(Rival {
        delta_bic: bic(search, &trial) - bic(search, model),
        hypothesis: other.hypothesis,
        similarity: other.similarity,
    })
}

/// N ln RSS + k ln N of a fitted model, the curves' prior included; a constant that is refined is
/// none of its k unknowns.
pub(super) fn bic(search: &Search<'_>, model: &Extended) -> f64 {
    let equations = search.observations.iter().map(|o| o.equations().min(6));
    let n = equations.sum::<usize>() as f64;
    n * squares(search, model).max(f64::MIN_POSITIVE).ln()
        + model.fit.unknowns.len() as f64 * n.ln()
}

/// Squared residual and what the curves' prior adds.
pub(super) fn squares(search: &Search<'_>, model: &Extended) -> f64 {
    let residual = residuals(&model.arm, &search.observations, search.sigmas);
    let smoothness = model.accepted.iter().filter_map(|h| match h.members {
        Members::Curve(smooth) => Some(smooth),
        _ => None,
    });
    let prior = |(curve, smooth): (&crate::identify::arm::Curve, Smoothness)| {
        let known = |v: &f64| if v.is_finite() { *v } else { 0.0 };
        let values = curve.values.iter().map(known);
        let values = nalgebra::DVector::from_iterator(curve.values.len(), values);
        values.dot(&(precision(smooth) * &values))
    };
    let curves = model.arm.curves.iter().zip(smoothness);
    residual.norm_squared() + curves.map(prior).sum::<f64>()
}
