//! Constants that the model is not linear in: a step's time, a warm-up's time constant, the
//! threshold of a sign, how smooth a curve is.

use nalgebra::DVector;
use truepose::effects::{Effect, Factor, Shape, Variable};

use super::curve;
use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::search::Search;
use super::smoothness::Evidence;
use super::space::{Space, columns};

/// Steps in time that are tried at most around the best of the grid.
const TIMES: usize = 40;

/// Of these, values that are fitted.
const FITTED: usize = 2;

/// Factors on a time constant that are tried, each round finer than the last.
const FACTORS: [&[f64]; 4] = [
    &[0.45, 0.6, 0.8, 1.25, 1.6, 2.2],
    &[0.85, 0.92, 1.09, 1.18],
    &[0.94, 0.97, 1.03, 1.06],
    &[0.98, 0.99, 1.01, 1.02],
];

/// Moves every such constant of the model to where the fit is best.
pub(super) fn refined(search: &Search<'_>, mut model: Extended) -> Extended {
    for index in 0..model.accepted.len() {
        match model.accepted[index].kind {
            "joint-curve" => model = smoothed(search, model, index),
            "step-change" | "instrument-moved" => {
                let times = times(search);
                let ln_length = |t: f64| {
                    let after = times.partition_point(|&x| x < t).clamp(1, times.len() - 1);
                    (times[after] - times[after - 1]).ln()
                };
                model = best(search, model, index, 0, &midpoints(&times), &ln_length)
            }
            "warm-up" => {
                for factors in FACTORS {
                    let Some(tau) = constant(&model, index, 0) else {
                        break;
                    };
                    let tried: Vec<f64> = factors.iter().map(|f| f * tau).collect();
                    model = best(search, model, index, 0, &tried, &|_| 0.0);
                }
            }
            _ => {
                for (place, joint) in thresholds(&model, index) {
                    let tried = midpoints(&readings(search, joint));
                    model = best(search, model, index, place, &tried, &|_| 0.0);
                }
            }
        }
    }
    model
}

/// The model with the smoothness of an accepted curve chosen anew: once the curve is in, the
/// noise is known better than when it was found.
fn smoothed(search: &Search<'_>, model: Extended, index: usize) -> Extended {
    let hypothesis = &model.accepted[index];
    let (Members::Curve(present), Some(joint)) = (&hypothesis.members, hypothesis.joint) else {
        return model;
    };
    let Some(curve) = model.arm.curves.iter().find(|c| c.joint == joint) else {
        return model;
    };
    let finite = curve
        .values
        .iter()
        .map(|&v| if v.is_finite() { v } else { 0.0 });
    let values = DVector::from_iterator(curve.values.len(), finite);
    let linear = model.linear(&search.observations, search.sigmas);
    let cells = curve::columns(&model.arm, joint, &search.observations, search.sigmas);
    let residual = &linear.residual + &cells * values;
    let extra = cells * curve::waves();
    let freedom = Space::new(&linear, &search.observations).freedom;
    let Some(evidence) = Evidence::new(&linear.jacobian, &extra, &residual, freedom) else {
        return model;
    };
    let (smooth, _) = evidence.likeliest(*present);
    if smooth == *present {
        return model;
    }
    let mut accepted = model.accepted.clone();
    accepted[index].members = Members::Curve(smooth);
    search.fit(&model.arm, accepted).unwrap_or(model)
}

fn constant(model: &Extended, index: usize, place: usize) -> Option<f64> {
    let effect = model.effects_of(index).first()?;
    effect.model().constants().get(place).copied()
}

/// Places of thresholds among the constants of an unnamed term, and of which joint.
fn thresholds(model: &Extended, index: usize) -> Vec<(usize, usize)> {
    let Some(Effect::Unnamed(term)) = model.effects_of(index).first() else {
        return Vec::new();
    };
    let of = |(k, factor): (usize, &Factor)| match (factor.shape, factor.variable) {
        (Shape::Sign, Variable::Joint(j)) => Some((3 * k, usize::from(j))),
        _ => None,
    };
    term.factors.iter().enumerate().filter_map(of).collect()
}

/// In order, each once.
fn times(search: &Search<'_>) -> Vec<f64> {
    let times = search.observations.iter().map(|o| o.ambient.time);
    in_order(times.filter(|t| t.is_finite()).collect())
}

fn readings(search: &Search<'_>, joint: usize) -> Vec<f64> {
    in_order(search.observations.iter().map(|o| o.q[joint]).collect())
}

fn in_order(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// Midpoints between successive values.
fn midpoints(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
}

/// The model with the constant of an accepted hypothesis where it is likeliest, by the fit and by
/// the logarithm of how likely it was before: a step that one row would have a little earlier
/// is rather in the long pause. For a long list only the values nearest to the present one are
/// tried: all of them where everything else is linear, and the best few of these by a fit.
fn best(
    search: &Search<'_>,
    model: Extended,
    index: usize,
    place: usize,
    values: &[f64],
    ln_before: &dyn Fn(f64) -> f64,
) -> Extended {
    let Some(present) = constant(&model, index, place) else {
        return model;
    };
    let mut near = values.to_vec();
    near.sort_by(|a, b| (a - present).abs().total_cmp(&(b - present).abs()));
    near.truncate(TIMES);
    let with = |value: f64| {
        let mut hypothesis = model.accepted[index].clone();
        if let Members::Effects(effects) = &mut hypothesis.members {
            for effect in effects {
                if let Some(constant) = effect.model_mut().constants_mut().get_mut(place) {
                    *constant = value;
                }
            }
        }
        hypothesis
    };
    let tried: Vec<Hypothesis> = near.iter().map(|&value| with(value)).collect();
    let mut others = model.accepted.clone();
    others.remove(index);
    let Ok(without) = search.fit(&model.arm, others) else {
        return model;
    };
    let (_, space) = without.space(&search.observations, search.sigmas);
    let references: Vec<&Hypothesis> = tried.iter().collect();
    let columns = columns(
        &without.arm,
        &references,
        &search.observations,
        search.sigmas,
    );
    let scores = space.scores(&columns);
    let worth = |i: usize| scores[i].reduction + 2.0 * ln_before(near[i]);
    let mut order: Vec<usize> = (0..tried.len()).collect();
    order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)));
    order.truncate(FITTED);
    let mut best = model.clone();
    let mut least = model.fit.cost - 2.0 * ln_before(present);
    for i in order {
        let mut accepted = model.accepted.clone();
        accepted[index] = tried[i].clone();
        let ahead = 2.0 * ln_before(near[i]);
        if let Ok(trial) = search.fit(&model.arm, accepted)
            && trial.fit.cost - ahead < least
        {
            least = trial.fit.cost - ahead;
            best = trial;
        }
    }
    best
}
