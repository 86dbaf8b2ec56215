//! An effect against its shuffled self: does it follow what it depends on, or would any
//! numbers of that size do?

use std::collections::HashMap;

use nalgebra::DMatrix;
use truepose::Twist;
use truepose::effects::{Effect, Kind, Needs, ONE, Variable};

use super::curve;
use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::search::Search;
use super::space::{Columns, Space};
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::Observation;
use crate::identify::problem::Problem;
use crate::random::Random;

/// Shuffles.
const SHUFFLES: usize = 19;

/// Seed of the shuffles.
const SEED: u64 = 0;

/// Shares of the squared residual that an effect takes, everything else in the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// What was dealt to other rows: direction, torque, payload, temperature, time, last move,
    /// readings.
    pub covariate: &'static str,
    /// As it is.
    pub own: f64,
    /// What it does to its place in one row dealt to another row: mean of all shuffles.
    pub shuffled: f64,
    /// The largest of all shuffles.
    pub largest: f64,
    /// Of an early reading, with the move before the last in place of the last.
    pub move_before: Option<f64>,
}

/// What an effect's size depends on.
fn covariate(hypothesis: &Hypothesis) -> &'static str {
    match &hypothesis.members {
        Members::EarlyReading => return "last move",
        Members::Curve(_) => return "readings",
        Members::Effects(effects) => {
            if let Some(Effect::Unnamed(term)) = effects.first() {
                let factors = term.factors.iter().filter(|f| **f != ONE);
                let mut conditions = factors.filter_map(|f| match f.variable {
                    Variable::Joint(_) => None,
                    Variable::Direction(_) => Some("direction"),
                    Variable::Time => Some("time"),
                    Variable::Temperature(_) => Some("temperature"),
                    Variable::Payload => Some("payload"),
                });
                return conditions.next().unwrap_or("readings");
            }
        }
    }
    match Kind::of(hypothesis.kind).map(|kind| kind.needs) {
        Some(Needs::Gravity | Needs::Masses) => "torque",
        Some(Needs::Direction) => "direction",
        Some(Needs::Temperature) => "temperature",
        Some(Needs::Time) => "time",
        Some(Needs::Joints) => "readings",
        // a fault of the recording
        None => "time",
    }
}

/// The control of accepted hypothesis `index`; `None` where the model without it has no fit.
pub fn control(
    search: &Search<'_>,
    model: &Extended,
    index: usize,
    problem: &Problem,
) -> Option<Control> {
    let own = model.accepted.get(index)?;
    let mut others = model.accepted.clone();
    others.remove(index);
    let without = search.fit(&model.arm, others).ok()?;
    let observations = &search.observations;
    let (_, space) = without.space(observations, search.sigmas);
    let share = |from: &[&Observation]| {
        let columns = dealt(search, &without, own, from);
        let reduction = match own.members {
            Members::Curve(smooth) => of_curve(&space, &columns.matrix, smooth),
            _ => {
                let score = space.scores(&columns).into_iter().next();
                score.map_or(0.0, |s| s.reduction)
            }
        };
        reduction / space.rss
    };
    let mut random = Random::new(SEED, index as u64);
    let mut sum = 0.0;
    let mut largest = 0.0_f64;
    for _ in 0..SHUFFLES {
        let mut cards = observations.clone();
        for last in (1..cards.len()).rev() {
            cards.swap(last, random.below(last + 1));
        }
        let dealt = share(&cards);
        sum += dealt;
        largest = largest.max(dealt);
    }
    let early = matches!(own.members, Members::EarlyReading);
    Some(Control {
        covariate: covariate(own),
        own: share(observations),
        shuffled: sum / SHUFFLES as f64,
        largest,
        move_before: early.then(|| {
            let before = rows_before(observations, problem);
            share(&before.iter().collect::<Vec<_>>())
        }),
    })
}

/// Reduction of the squared residual by the cells of a curve, what its prior costs paid.
fn of_curve(space: &Space, cells: &DMatrix<f64>, smooth: curve::Smoothness) -> f64 {
    let along = space.basis.tr_mul(cells);
    let gram = cells.tr_mul(cells) - along.tr_mul(&along) + curve::precision(smooth);
    let z = cells.tr_mul(&space.residual);
    let factor = gram.cholesky();
    factor.map_or(0.0, |factor| z.dot(&factor.solve(&z)))
}

/// Every row with the move to the row before it in the file as its last move.
fn rows_before(observations: &[&Observation], problem: &Problem) -> Vec<Observation> {
    let all = problem.identify.iter().chain(&problem.verify);
    let by_row: HashMap<usize, &Observation> = all.map(|o| (o.row, o)).collect();
    let before = |o: &&Observation| {
        let found = o.row.checked_sub(1).and_then(|row| by_row.get(&row));
        Observation {
            travel: found.map_or_else(|| vec![0.0; o.q.len()], |before| before.travel.clone()),
            ..(*o).clone()
        }
    };
    observations.iter().map(before).collect()
}

/// Columns of a hypothesis, each row with the size that the row of the same place in `from`
/// has.
fn dealt(
    search: &Search<'_>,
    model: &Extended,
    own: &Hypothesis,
    from: &[&Observation],
) -> Columns {
    let observations = &search.observations;
    let mut evaluator = Evaluator::new(&model.arm, search.sigmas);
    // where each value acts, and what it does there at each posture of each row
    let mut places: Vec<Option<usize>> = Vec::new();
    let mut local: Vec<Vec<Vec<Twist<f64>>>> = Vec::new();
    if let Members::Effects(effects) = &own.members {
        for o in from {
            let mut every = Vec::new();
            evaluator.each_posture(o, |evaluator, posture| {
                let mut twists = Vec::new();
                places.clear();
                for effect in effects {
                    let place = effect.model().joint();
                    evaluator.effect_twists(posture.at, effect, |_, twist| {
                        twists.push(twist);
                        places.push(place);
                    });
                }
                for (twist, &place) in twists.iter_mut().zip(&places) {
                    *twist = evaluator.to_place(posture.at, place, twist);
                }
                every.push(twists);
            });
            local.push(every);
        }
    }
    let joint = own.joint.unwrap_or(0);
    let width = match own.members {
        Members::EarlyReading => 1,
        Members::Curve(_) => curve::CELLS,
        Members::Effects(_) => places.len(),
    };
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut matrix = DMatrix::zeros(rows, width);
    let mut start = 0;
    for (row, (o, card)) in observations.iter().zip(from).enumerate() {
        let end = start + o.equations();
        let dealt: Vec<&Observation> = card.postures().collect();
        let mut number = 0;
        evaluator.each_posture(o, |evaluator, posture| {
            // a row of fewer postures deals its own to the further ones
            let place = if number < dealt.len() { number } else { 0 };
            number += 1;
            let mut put = |k: usize, twist: &Twist<f64>| {
                let cells = &mut matrix.as_mut_slice()[k * rows + start..k * rows + end];
                posture.spread(evaluator, twist, cells);
            };
            match own.members {
                Members::EarlyReading => {
                    let travel = dealt[place].travel.iter().enumerate();
                    let twist = travel.fold(Twist::zero(), |sum, (j, &d)| {
                        sum.plus(&evaluator.joint_twist(j).scaled(d))
                    });
                    put(0, &twist);
                }
                Members::Curve(_) => {
                    let twist = evaluator.joint_twist(joint);
                    for (cell, weight) in curve::flat(joint).cells(dealt[place].q[joint]) {
                        put(cell, &twist.scaled(weight));
                    }
                }
                Members::Effects(_) => {
                    for k in 0..width {
                        let there = &local[row][place][k];
                        put(k, &evaluator.from_place(posture.at, places[k], there));
                    }
                }
            }
        });
        start = end;
    }
    // a value of any size: the scale of what shows is the columns' own; a cell's has a prior
    let free = !matches!(own.members, Members::Curve(_));
    for mut column in matrix.column_iter_mut().filter(|_| free) {
        let norm = column.norm();
        if norm > 0.0 {
            column *= 1e3 / norm;
        }
    }
    Columns {
        matrix,
        groups: vec![(0, width)],
    }
}
