//! What was named against another explanation, where it is known: can the rows tell at all?

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::refine::refined;
use super::rivals::bic;
use super::run::Diagnosis;
use super::search::Search;
use super::sensible::sensible;
use super::space::columns;
use crate::identify::geometry;
use crate::identify::noise::fitted;

/// By how much the explanation `wanted`, of each of its effects the candidates that it may be, is
/// likelier than what was named: difference in BIC, twice
/// the logarithm of the candidates' shares included, both fitted to the rows of the final fit with
/// the same noise. Above zero, the search lost it; below, the rows speak for what was named.
///
/// `None` where a curve is on either side, whose many amplitudes BIC does not count, where
/// something wanted is no candidate of a sensible size, or where a fit fails.
pub fn likelier(diagnosis: &Diagnosis, wanted: &[&dyn Fn(&Hypothesis) -> bool]) -> Option<f64> {
    let identified = &diagnosis.identified;
    let (problem, calibration) = (&identified.problem, &identified.calibration);
    let named: Vec<Hypothesis> = diagnosis
        .named
        .iter()
        .map(|n| n.step.hypothesis.clone())
        .collect();
    let is_curve = |h: &Hypothesis| matches!(h.members, Members::Curve(_));
    if named.iter().any(is_curve) {
        return None;
    }
    let arm = &calibration.geometric.arm;
    let rows = fitted(problem, calibration);
    let unknowns = geometry(problem, calibration);
    let search = Search::new(arm, rows, calibration.complete.sigmas, unknowns);
    let mut model = search.fit(arm, Vec::new()).ok()?;
    for is in wanted {
        let (_, space) = model.space(&search.observations, search.sigmas);
        let mut candidates = search.candidates(&model, &space);
        candidates.retain(|h| is(h));
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&model.arm, &references, &search.observations, search.sigmas);
        let scores = space.scores(&columns);
        let worth = |i: usize| scores[i].gain + 2.0 * candidates[i].ln_weight;
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)).then(a.cmp(&b)));
        let last = model.accepted.len();
        model = order.into_iter().find_map(|i| {
            let mut accepted = model.accepted.clone();
            accepted.push(candidates[i].clone());
            let trial = search.pruned(search.fit(&model.arm, accepted).ok()?, last);
            sensible(&trial, last).then(|| refined(&search, trial))
        })?;
    }
    let named = refined(&search, search.fit(arm, named).ok()?);
    let worth = |model: &Extended| {
        let shares = model.accepted.iter().map(|h| 2.0 * h.ln_weight);
        shares.sum::<f64>() - bic(&search, model)
    };
    Some(worth(&model) - worth(&named))
}
