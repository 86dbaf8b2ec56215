//! Is what is left more than noise?

use super::schema::Verdict;
use crate::identify::Calibration;
use crate::identify::noise::{Component, fitted, neighbour_likeness, of_fitted, of_unseen, unseen};
use crate::identify::problem::Problem;
use crate::measurement::Dataset;

/// A declared standard deviation is taken as right to this.
const SLACK: f64 = 0.1;

/// Standard deviations by which chance may exceed an expectation: 1 in 30 000.
const CHANCE: f64 = 4.0;

/// Ratio of two declared noises that is taken as wrong from here on.
const IMBALANCE: f64 = 2.0;

/// A verdict and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// The answer.
    pub verdict: Verdict,
    /// A sentence each.
    pub reasons: Vec<String>,
    /// What deserves a look besides.
    pub noticed: Vec<String>,
}

/// Kind of measurement, its declared noise in `unit`, residual of the unseen and of the
/// fitted rows.
struct Kind {
    name: &'static str,
    key: &'static str,
    declared: Option<f64>,
    unseen: Component,
    fitted: Component,
}

/// Judges what the complete model leaves of the verify rows: against the declared noise, or,
/// where none is declared, by whether neighbouring rows have like residuals.
pub(super) fn judge(problem: &Problem, calibration: &Calibration, data: &Dataset) -> Judgement {
    let stage = &calibration.complete;
    let kept = fitted(problem, calibration);
    let unseen = of_unseen(&stage.arm, &unseen(problem, calibration), problem.sigmas);
    let seen = of_fitted(stage, &kept, problem.sigmas);
    let kinds: Vec<Kind> = [
        (
            "positions",
            "position_sigma_mm",
            data.noise.position,
            unseen.position,
            seen.position,
        ),
        (
            "orientations",
            "orientation_sigma_deg",
            data.noise.orientation,
            unseen.orientation,
            seen.orientation,
        ),
        (
            "lengths",
            "length_sigma_mm",
            data.noise.length,
            unseen.length,
            seen.length,
        ),
        (
            "distances",
            "distance_sigma_mm",
            data.noise.distance,
            unseen.distance,
            seen.distance,
        ),
        (
            "touches",
            "contact_sigma_mm",
            data.noise.contact,
            unseen.contact,
            seen.contact,
        ),
        (
            "bearings",
            "bearing_sigma_deg",
            data.noise.bearing,
            unseen.bearing,
            seen.bearing,
        ),
    ]
    .into_iter()
    .map(|(name, key, declared, unseen, fitted)| Kind {
        name,
        key,
        declared,
        unseen,
        fitted,
    })
    .filter(|kind| kind.unseen.equations > 0)
    .collect();

    let mut reasons = Vec::new();
    let mut structure = false;
    // A prediction of an unseen row carries the parameters' own uncertainty too.
    let used = stage.fit.unknowns.len() as f64 / stage.fit.equations.max(1) as f64;
    for kind in kinds.iter().filter(|k| k.declared.is_some()) {
        let Some(ratio) = kind.unseen.ratio() else {
            continue;
        };
        let expected = (1.0 + used).sqrt();
        let chance = CHANCE / (2.0 * kind.unseen.freedom).sqrt();
        let limit = expected * (1.0 + SLACK + chance);
        let relation = if ratio > limit {
            structure = true;
            "more than noise"
        } else {
            "no more than noise"
        };
        reasons.push(format!(
            "{}: what is left of the held-back rows is {:.2} times the declared noise, {relation} \
             (limit here {limit:.2})",
            kind.name, ratio
        ));
    }
    if reasons.is_empty() {
        let z = neighbour_likeness(&stage.arm, &kept, problem.sigmas);
        structure = z > CHANCE;
        reasons.push(format!(
            "the noise is not declared, so the size of the residual says nothing: neighbouring \
             poses have {} residuals ({z:.1} standard deviations from chance; {CHANCE} would \
             count as structure)",
            if structure { "like" } else { "unrelated" }
        ));
        if !structure {
            reasons.push(
                "structure that changes from one pose to the next, or is as small as the noise, \
                 would not show so; declare the noise to be surer"
                    .to_owned(),
            );
        }
    }
    Judgement {
        verdict: match (structure, calibration.complete.arm.effects.is_empty()) {
            (true, _) => Verdict::StructureRemains,
            (false, true) => Verdict::NothingMissing,
            (false, false) => Verdict::Explained,
        },
        reasons,
        noticed: imbalance(&kinds),
    }
}

/// Declared noises that do not agree with the residual or with one another.
fn imbalance(kinds: &[Kind]) -> Vec<String> {
    let mut noticed = Vec::new();
    for kind in kinds.iter().filter(|k| k.declared.is_some()) {
        if let Some(ratio) = kind.fitted.ratio()
            && ratio * IMBALANCE < 1.0
        {
            noticed.push(format!(
                "{}: the residual is {ratio:.2} of the declared noise: {} is too large, and \
                 hides what may be missing",
                kind.name, kind.key
            ));
        }
    }
    let ratios: Vec<(&Kind, f64)> = kinds
        .iter()
        .filter_map(|k| Some((k, k.fitted.ratio()?)))
        .collect();
    if let [(a, ra), (b, rb)] = ratios.as_slice()
        && (ra / rb > IMBALANCE || rb / ra > IMBALANCE)
    {
        noticed.push(format!(
            "the residual is {ra:.2} times the assumed noise of {} and {rb:.2} times that of {}: \
             their weights do not match, which costs accuracy; correct {} or {} unless \
             structure is what remains",
            a.name, b.name, a.key, b.key
        ));
    }
    noticed
}
