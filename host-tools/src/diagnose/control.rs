//! An effect against its shuffled self: does it follow its covariate, or would any numbers
//! of that size do?

use nalgebra::DMatrix;
use truepose::Twist;
use truepose::effects::{Kind, Needs};

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::search::Search;
use super::space::{Columns, columns};
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::Observation;
use crate::random::Random;

/// Shuffles.
const SHUFFLES: usize = 19;

/// Seed of the shuffles.
const SEED: u64 = 0;

/// Shares of the squared residual that an effect takes, everything else in the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// What was dealt to other rows: direction, torque, temperature, time, last move.
    pub covariate: &'static str,
    /// As it is.
    pub own: f64,
    /// What it does to its place in one row dealt to another row: mean of all shuffles.
    pub shuffled: f64,
    /// The largest of all shuffles.
    pub largest: f64,
}

/// What an effect's size depends on besides a joint's own reading.
fn covariate(hypothesis: &Hypothesis) -> Option<&'static str> {
    if matches!(hypothesis.members, Members::EarlyReading) {
        return Some("last move");
    }
    if hypothesis.kind == "instrument-moved" {
        return Some("time");
    }
    match Kind::of(hypothesis.kind)?.needs {
        Needs::Joints => None,
        Needs::Gravity | Needs::Masses => Some("torque"),
        Needs::Direction => Some("direction"),
        Needs::Temperature => Some("temperature"),
        Needs::Time => Some("time"),
    }
}

/// The control of accepted hypothesis `index`; `None` for one that depends on readings alone.
pub fn control(search: &Search<'_>, model: &Extended, index: usize) -> Option<Control> {
    let own = model.accepted.get(index)?;
    let covariate = covariate(own)?;
    let mut others = model.accepted.clone();
    others.remove(index);
    let without = search.fit(&model.arm, others).ok()?;
    let observations = &search.observations;
    let (_, space) = without.space(observations, search.sigmas);
    let share = |columns: &Columns| {
        let score = space.scores(columns).into_iter().next();
        score.map_or(0.0, |s| s.reduction / space.rss)
    };
    let kept = columns(&without.arm, &[own], observations, search.sigmas);
    let mut random = Random::new(SEED, index as u64);
    let mut sum = 0.0;
    let mut largest = 0.0_f64;
    for _ in 0..SHUFFLES {
        let mut cards: Vec<usize> = (0..observations.len()).collect();
        for last in (1..cards.len()).rev() {
            cards.swap(last, random.below(last + 1));
        }
        let dealt = share(&shuffled(search, &without, own, &cards));
        sum += dealt;
        largest = largest.max(dealt);
    }
    Some(Control {
        covariate,
        own: share(&kept),
        shuffled: sum / SHUFFLES as f64,
        largest,
    })
}

/// Columns of a hypothesis, each row with the size that row `cards[row]` has.
fn shuffled(search: &Search<'_>, model: &Extended, own: &Hypothesis, cards: &[usize]) -> Columns {
    let observations = &search.observations;
    let mut evaluator = Evaluator::new(&model.arm, search.sigmas);
    // where each value acts, and what it does there at each posture of each row
    let mut places: Vec<Option<usize>> = Vec::new();
    let mut local: Vec<Vec<Vec<Twist<f64>>>> = Vec::new();
    if let Members::Effects(effects) = &own.members {
        for o in observations {
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
    let early = matches!(own.members, Members::EarlyReading);
    let width = if early { 1 } else { places.len() };
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut matrix = DMatrix::zeros(rows, width);
    let mut start = 0;
    for (o, &card) in observations.iter().zip(cards) {
        let end = start + o.equations();
        let dealt: Vec<&Observation> = observations[card].postures().collect();
        let mut number = 0;
        evaluator.each_posture(o, |evaluator, posture| {
            // a row of fewer postures deals its own to the further ones
            let from = if number < dealt.len() { number } else { 0 };
            for k in 0..width {
                let twist = if early {
                    let travel = dealt[from].travel.iter().enumerate();
                    travel.fold(Twist::zero(), |sum, (j, &d)| {
                        sum.plus(&evaluator.joint_twist(j).scaled(d))
                    })
                } else {
                    evaluator.from_place(posture.at, places[k], &local[card][from][k])
                };
                let cells = &mut matrix.as_mut_slice()[k * rows + start..k * rows + end];
                posture.spread(evaluator, &twist, cells);
            }
            number += 1;
        });
        start = end;
    }
    // a value of any size: the scale of what shows is the columns' own
    for mut column in matrix.column_iter_mut() {
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
