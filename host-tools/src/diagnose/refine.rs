//! Constants that the model is not linear in: a step's time, a warm-up's time constant, the
//! threshold of a sign, how smooth a curve is.

use nalgebra::DVector;
use truepose::effects::{Effect, Factor, Shape, Variable};

use super::curve;
use super::hypothesis::Members;
use super::model::Extended;
use super::search::Search;
use super::smoothness::Evidence;
use super::space::Space;

/// Steps in time that are tried at most around the best of the grid.
const TIMES: usize = 40;

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
                model = best(search, model, index, 0, &times(search))
            }
            "warm-up" => {
                for factors in FACTORS {
                    let Some(tau) = constant(&model, index, 0) else {
                        break;
                    };
                    let tried: Vec<f64> = factors.iter().map(|f| f * tau).collect();
                    model = best(search, model, index, 0, &tried);
                }
            }
            _ => {
                for (place, joint) in thresholds(&model, index) {
                    model = best(search, model, index, place, &readings(search, joint));
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

fn times(search: &Search<'_>) -> Vec<f64> {
    let times = search.observations.iter().map(|o| o.ambient.time);
    midpoints(times.filter(|t| t.is_finite()).collect())
}

fn readings(search: &Search<'_>, joint: usize) -> Vec<f64> {
    midpoints(search.observations.iter().map(|o| o.q[joint]).collect())
}

/// Midpoints between successive values.
fn midpoints(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    values.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
}

/// The model with the constant of an accepted hypothesis where the fit is best. For a long
/// list only the values nearest to the present one are tried.
fn best(
    search: &Search<'_>,
    model: Extended,
    index: usize,
    place: usize,
    values: &[f64],
) -> Extended {
    let Some(present) = constant(&model, index, place) else {
        return model;
    };
    let mut near = values.to_vec();
    near.sort_by(|a, b| (a - present).abs().total_cmp(&(b - present).abs()));
    near.truncate(TIMES);
    let mut best = model.clone();
    for value in near {
        let mut accepted = model.accepted.clone();
        if let Members::Effects(effects) = &mut accepted[index].members {
            for effect in effects {
                if let Some(constant) = effect.model_mut().constants_mut().get_mut(place) {
                    *constant = value;
                }
            }
        }
        if let Ok(trial) = search.fit(&model.arm, accepted)
            && trial.fit.cost < best.fit.cost
        {
            best = trial;
        }
    }
    best
}
