//! Sizes that a machine can have.

use super::hypothesis::Members;
use super::model::Extended;
use crate::identify::unknown::{Unknown, largest};

/// Bounds are round figures: a value that is known to `sigma` may be above by three times that, and
/// by this share at most.
const ROUND: f64 = 0.2;

/// Whether a value is one that a machine can have; `unit` in SI.
pub(super) fn within(kind: &str, unit: &str, value: f64, sigma: f64) -> bool {
    let bound = match kind {
        // of high order; lower ones are eccentricity
        "gear-ripple" => 2e-3,
        "base-flex" => 2e-4,
        // a joint's zero may jump or settle by more than a gear is out of true
        // anywhere
        "instrument-moved" => f64::INFINITY,
        "step-change" | "warm-up" => 2.0 * largest(unit),
        _ => largest(unit),
    };
    let slack = (3.0 * sigma).min(ROUND * bound);
    value.abs() - slack < bound
}

/// Whether the fitted sizes are ones that a machine can have.
pub(super) fn sensible(model: &Extended, index: usize) -> bool {
    let Some(hypothesis) = model.accepted.get(index) else {
        return false;
    };
    let effects = model.effects_of(index);
    if matches!(hypothesis.members, Members::Curve(_)) {
        return true;
    }
    if effects.is_empty() {
        return within("early-reading", "rad", model.arm.early_reading, 0.0);
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
                let unit = effect.model().parameters().get(value).map_or("", |p| p.1);
                // a lever may point either way
                let stiff = matches!(
                    hypothesis.kind,
                    "joint-compliance" | "cross-axis-compliance" | "thermal-growth"
                ) && unit != "rad s^2/m";
                let sigma = model
                    .fit
                    .sigma(Unknown::Effect {
                        effect: offset + m,
                        value,
                    })
                    .unwrap_or(0.0);
                within(hypothesis.kind, unit, *v, sigma) && !(stiff && *v < -3.0 * sigma)
            })
    });
    if effects.len() > 1 {
        fine.into_iter().any(|f| f)
    } else {
        fine.into_iter().all(|f| f)
    }
}
