//! What has no name: products of two simple functions of joints and conditions, on any
//! joint's reading or on the base (MRD 5.4.1).
//!
//! A term's column is what its joint (or the base) does to the tool times a function of the
//! row. So thousands of terms cost one matrix product a joint: functions times what is known
//! of each row.

use nalgebra::DMatrix;
use truepose::effects::{Effect, Factor, ONE, Place, Reading, Shape, Unnamed, Variable};

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::space::{Moving, Space, postures};
use crate::identify::observation::{Observation, Sigmas};

/// Share of the error probability that terms without a name have, of all kinds together.
const SHARE: f64 = 0.1;

/// Terms that become candidates at a step.
const OFFERED: usize = 24;

/// Highest degree and order of functions of one joint, and of either factor of a product.
const ALONE: (u8, u8) = (3, 2);
const PRODUCT: (u8, u8) = (2, 2);

/// The same of further functions of joints that a term in the model depends on already.
const FURTHER: (u8, u8) = (5, 4);

/// Thresholds of a sign that are tried, evenly among the readings; the best is refined.
const THRESHOLDS: usize = 7;

/// A function of a row, and over which ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Function {
    factors: [Factor; 2],
    limits: [[f64; 3]; 2],
}

/// A function of one variable with its parameter and range.
type Single = (Factor, [f64; 3]);

const NONE: Single = (ONE, [0.0; 3]);

impl Function {
    fn of(first: Single, second: Single) -> Self {
        Self {
            factors: [first.0, second.0],
            limits: [first.1, second.1],
        }
    }

    fn on(&self, place: Place<f64>) -> Unnamed<f64> {
        Unnamed::new(place, self.factors, self.limits)
    }

    fn variables(&self) -> impl Iterator<Item = Variable> {
        let factors = self.factors.into_iter();
        factors
            .filter(|f| f.shape != Shape::One)
            .map(|f| f.variable)
    }
}

/// Lowest and highest value of a variable; `None` where it does not change.
fn range(variable: Variable, observations: &[&Observation]) -> Option<[f64; 2]> {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for o in observations {
        let x = match variable {
            Variable::Joint(j) => o.q.get(usize::from(j)).copied()?,
            Variable::Direction(j) => o.direction.get(usize::from(j)).copied()?,
            Variable::Time => o.ambient.time,
            Variable::Temperature(k) => o.ambient.temperature.get(usize::from(k)).copied()?,
            Variable::Payload => o.ambient.payload,
        };
        if x.is_finite() {
            range = [range[0].min(x), range[1].max(x)];
        }
    }
    (range[1] - range[0] > 1e-3).then_some(range)
}

/// Polynomials from degree `from` to `to`.
fn polynomials(variable: Variable, [low, high]: [f64; 2], from: u8, to: u8) -> Vec<Single> {
    (from..=to)
        .map(|degree| {
            let shape = Shape::Polynomial(degree);
            (Factor { variable, shape }, [0.0, low, high])
        })
        .collect()
}

fn harmonics(variable: Variable, [low, high]: [f64; 2], to: u8) -> Vec<Single> {
    (1..=to)
        .flat_map(|order| {
            [Shape::Sine, Shape::Cosine]
                .map(|shape| (Factor { variable, shape }, [f64::from(order), low, high]))
        })
        .collect()
}

fn signs(j: u8, [low, high]: [f64; 2], observations: &[&Observation]) -> Vec<Single> {
    let mut readings: Vec<f64> = observations.iter().map(|o| o.q[usize::from(j)]).collect();
    readings.sort_by(f64::total_cmp);
    let at = |i: usize| readings[i * readings.len() / (THRESHOLDS + 1)];
    let mut thresholds: Vec<f64> = (1..=THRESHOLDS).map(at).collect();
    if low < 0.0 && high > 0.0 {
        thresholds.push(0.0);
    }
    let factor = Factor {
        variable: Variable::Joint(j),
        shape: Shape::Sign,
    };
    let sign = |threshold: f64| (factor, [threshold, low, high]);
    thresholds.into_iter().map(sign).collect()
}

fn of_joint(j: u8, observations: &[&Observation], (degree, order): (u8, u8)) -> Vec<Single> {
    let variable = Variable::Joint(j);
    let Some(range) = range(variable, observations) else {
        return Vec::new();
    };
    let mut functions = polynomials(variable, range, 1, degree);
    functions.extend(harmonics(variable, range, order));
    functions
}

fn products(first: &[Single], second: &[Single]) -> Vec<Function> {
    let pair = |a: &Single| second.iter().map(|b| Function::of(*a, *b)).collect();
    first
        .iter()
        .flat_map(|a: &Single| -> Vec<Function> { pair(a) })
        .collect()
}

/// Everything that is offered before anything unnamed is in the model.
fn dictionary(joints: u8, observations: &[&Observation]) -> Vec<Function> {
    let mut functions: Vec<Function> = Vec::new();
    let alone = |single: Single| Function::of(single, NONE);
    let factors: Vec<Vec<Single>> = (0..joints)
        .map(|j| of_joint(j, observations, PRODUCT))
        .collect();
    let direction = |j: u8| -> Vec<Single> {
        let variable = Variable::Direction(j);
        match range(variable, observations) {
            Some(_) => polynomials(variable, [-1.0, 1.0], 1, 1),
            None => Vec::new(),
        }
    };
    let varying = |variable: Variable, from: u8, to: u8| -> Vec<Single> {
        let range = range(variable, observations);
        range.map_or_else(Vec::new, |range| polynomials(variable, range, from, to))
    };
    let payload = varying(Variable::Payload, 1, 2);
    for j in 0..joints {
        functions.extend(of_joint(j, observations, ALONE).into_iter().map(alone));
        if let Some(range) = range(Variable::Joint(j), observations) {
            functions.extend(signs(j, range, observations).into_iter().map(alone));
        }
        functions.extend(direction(j).into_iter().map(alone));
        for i in 0..joints {
            let other = &factors[usize::from(i)];
            if i > j {
                functions.extend(products(&factors[usize::from(j)], other));
            }
            functions.extend(products(&direction(j), other));
        }
        functions.extend(products(&payload, &direction(j)));
        functions.extend(products(&payload, &factors[usize::from(j)]));
    }
    functions.extend(payload.into_iter().map(alone));
    functions.extend(varying(Variable::Time, 2, 3).into_iter().map(alone));
    functions.extend(
        varying(Variable::Temperature(0), 2, 2)
            .into_iter()
            .map(alone),
    );
    functions
}

/// More functions of the joints that an unnamed term in the model depends on.
fn further(term: &Unnamed<f64>, observations: &[&Observation]) -> Vec<Function> {
    let function = Function {
        factors: term.factors,
        limits: [[0.0; 3]; 2],
    };
    let singles: Vec<Vec<Single>> = function
        .variables()
        .map(|variable| match variable {
            Variable::Joint(j) => of_joint(j, observations, FURTHER),
            _ => range(variable, observations)
                .map_or_else(Vec::new, |range| polynomials(variable, range, 1, 3)),
        })
        .collect();
    let mut functions: Vec<Function> = singles
        .iter()
        .flatten()
        .map(|&single| Function::of(single, NONE))
        .collect();
    if let [first, second] = singles.as_slice() {
        functions.extend(products(first, second));
    }
    functions
}

/// True where the catalogue has the term: a joint by its own reading alone or in proportion
/// to another's, or by its own direction.
fn has_a_name(place: Place<f64>, function: &Function) -> bool {
    let Place::Joint(own) = place else {
        return false;
    };
    let alone = function.factors[1].shape == Shape::One;
    let own = [Variable::Joint(own), Variable::Direction(own)];
    let only_own = function.variables().all(|v| own.contains(&v));
    let coupling = alone
        && matches!(function.factors[0].variable, Variable::Joint(_))
        && function.factors[0].shape == Shape::Polynomial(1);
    only_own || coupling
}

/// The unnamed terms among accepted hypotheses.
pub fn terms(accepted: &[Hypothesis]) -> Vec<&Unnamed<f64>> {
    let effects = accepted.iter().filter_map(|h| match &h.members {
        Members::Effects(effects) => Some(effects),
        _ => None,
    });
    effects
        .flatten()
        .filter_map(|e| match e {
            Effect::Unnamed(term) => Some(term),
            _ => None,
        })
        .collect()
}

/// One joint or direction of the base, with what each row needs.
struct Mover {
    place: Place<f64>,
    moving: Moving,
}

/// Logarithm of the share that is in every weight, so that terms can be judged by themselves.
pub(super) fn trials() -> f64 {
    SHARE.ln()
}

/// The best terms without a name beside what the model has, as hypotheses.
pub fn offered(
    model: &Extended,
    space: &Space,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Vec<Hypothesis> {
    let joints = u8::try_from(model.arm.joint_count()).unwrap_or(u8::MAX);
    let places = (0..joints).map(Place::Joint).chain((0..6).map(Place::base));
    let movers: Vec<Mover> = places
        .map(|place| Mover {
            place,
            moving: Moving::new(&model.arm, place, space, observations, sigmas),
        })
        .collect();
    let postures = postures(observations);
    let observations = postures.as_slice();
    let mut best: Vec<(f64, Hypothesis)> = Vec::new();
    let known = terms(&model.accepted);
    let first = dictionary(joints, observations);
    let share = if known.is_empty() { SHARE } else { 0.5 * SHARE };
    let weight = |count: usize, share: f64| (share / count.max(1) as f64).ln();
    let ln_weight = weight(first.len() * movers.len(), share);
    rank(
        &first,
        &movers.iter().collect::<Vec<_>>(),
        space,
        observations,
        ln_weight,
        &mut best,
    );
    for term in &known {
        let functions = further(term, observations);
        let same: Vec<&Mover> = movers
            .iter()
            .filter(|m| is_same_place(&m.place, &term.place))
            .collect();
        let ln_weight = weight(functions.len() * known.len(), share);
        rank(&functions, &same, space, observations, ln_weight, &mut best);
    }
    best.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut hypotheses: Vec<Hypothesis> = Vec::new();
    for (_, mut hypothesis) in best {
        let new = |h: &Hypothesis| !h.is_same(&hypothesis);
        if hypotheses.iter().all(new) && model.accepted.iter().all(new) {
            if let Members::Effects(effects) = &mut hypothesis.members {
                for effect in effects {
                    model.arm.attach(effect);
                }
            }
            hypotheses.push(hypothesis);
            if hypotheses.len() == OFFERED {
                break;
            }
        }
    }
    hypotheses
}

/// Same joint, or same axis of the base.
pub(super) fn is_same_place(a: &Place<f64>, b: &Place<f64>) -> bool {
    match (a, b) {
        (Place::Joint(a), Place::Joint(b)) => a == b,
        (Place::Base { axis: a, .. }, Place::Base { axis: b, .. }) => a == b,
        _ => false,
    }
}

/// Adds the best of `functions` on each of `movers` to `best`, with what they are worth.
fn rank(
    functions: &[Function],
    movers: &[&Mover],
    space: &Space,
    observations: &[&Observation],
    ln_weight: f64,
    best: &mut Vec<(f64, Hypothesis)>,
) {
    let values = DMatrix::from_fn(observations.len(), functions.len(), |i, k| {
        let o = observations[i];
        let at = Reading {
            q: &o.q,
            direction: &o.direction,
            ambient: &o.ambient,
        };
        let term = functions[k].on(Place::Joint(0));
        truepose::effects::EffectModel::reading_partial(&term, 0, &at)
    });
    for mover in movers {
        let reductions = mover.moving.reductions(&values);
        let mut order: Vec<usize> = (0..functions.len())
            .filter(|&k| reductions[k] > 0.0 && !has_a_name(mover.place, &functions[k]))
            .collect();
        order.sort_by(|&a, &b| reductions[b].total_cmp(&reductions[a]).then(a.cmp(&b)));
        for &k in order.iter().take(OFFERED) {
            let score = space.judge(reductions[k], 1.0);
            let joint = match mover.place {
                Place::Joint(j) => Some(usize::from(j)),
                Place::Base { .. } => None,
            };
            let hypothesis = Hypothesis {
                kind: "unnamed",
                joint,
                order: None,
                from: None,
                members: Members::Effects(vec![Effect::Unnamed(functions[k].on(mover.place))]),
                ln_weight,
            };
            best.push((score.gain + 2.0 * ln_weight, hypothesis));
        }
    }
}

/// As a person says it: what moves, by what.
pub fn label(term: &Unnamed<f64>) -> String {
    let place = match term.place {
        Place::Joint(j) => format!("joint {}", j + 1),
        Place::Base { axis, .. } => {
            let axis = truepose::effects::AXES.get(usize::from(axis)).copied();
            format!("base {}", axis.unwrap_or(""))
        }
    };
    let [first, second] = [0, 1].map(|k| said(term.factors[k], term.limits[3 * k]));
    let by: Vec<String> = [first, second].into_iter().flatten().collect();
    format!("{place} unnamed, by {}", by.join(" times "))
}

/// What a term depends on, each once.
pub fn variables(term: &Unnamed<f64>) -> Vec<Variable> {
    let mut variables: Vec<Variable> = Vec::new();
    for factor in term.factors.iter().filter(|f| f.shape != Shape::One) {
        if !variables.contains(&factor.variable) {
            variables.push(factor.variable);
        }
    }
    variables
}

/// The column of the measurements that holds a variable.
pub fn named_column(variable: Variable) -> String {
    match variable {
        Variable::Joint(j) => format!("q{}", j + 1),
        Variable::Direction(j) => format!("dir{}", j + 1),
        Variable::Time => "t".to_owned(),
        Variable::Temperature(k) => format!("temp{}", k + 1),
        Variable::Payload => "payload".to_owned(),
    }
}

fn said(factor: Factor, parameter: f64) -> Option<String> {
    let of = named_column(factor.variable);
    Some(match factor.shape {
        Shape::One => return None,
        Shape::Sine => format!("sin({parameter} {of})"),
        Shape::Cosine => format!("cos({parameter} {of})"),
        Shape::Sign => format!("the side of {of} from {parameter:.3}"),
        Shape::Polynomial(1) => of,
        Shape::Polynomial(degree) => format!("a polynomial of degree {degree} in {of}"),
    })
}
