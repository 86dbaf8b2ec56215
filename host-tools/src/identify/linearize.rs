//! Residuals and identification Jacobian of all rows, whitened by the instrument's noise.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use truepose::Twist;

use super::arm::ArmModel;
use super::attached::Attached;
use super::evaluator::{Evaluator, Path, paths};
use super::observation::{Observation, Sigmas};
use super::relation::Relation;
use super::solve::BLOCK;
use super::unknown::Unknown;

/// The unknowns whose twists are constant in some frame, one set a placement of the
/// instrument, and the places of the others.
fn attached(
    arm: &ArmModel,
    paths: &[Path],
    scales: &[f64],
    rigid: bool,
) -> (Vec<Attached>, Vec<usize>) {
    let mut sets: Vec<Attached> = arm.bases.iter().map(|_| Attached::default()).collect();
    let mut rest = Vec::new();
    for (k, (path, &scale)) in paths.iter().zip(scales).enumerate() {
        match path {
            Path::Base { session, unit } if rigid => {
                if let Some(set) = sets.get_mut(*session) {
                    set.push_base(k, unit, scale);
                }
            }
            Path::Attached(twists) if rigid => {
                for set in &mut sets {
                    twists.iter().flatten().for_each(|t| set.push(k, t, scale));
                }
            }
            Path::Tool(twist) if rigid => sets.iter_mut().for_each(|s| s.push(k, twist, scale)),
            _ => rest.push(k),
        }
    }
    (sets, rest)
}

/// Whitened residual and identification Jacobian of a set of observations; each column is
/// scaled by what may be expected of its unknown.
pub struct Linear {
    /// Equations x unknowns, over sigma, per expected deviation.
    pub jacobian: DMatrix<f64>,
    /// Measured minus predicted over sigma.
    pub residual: DVector<f64>,
}

/// The other postures of one observation's distances.
struct Other<'a> {
    evaluator: Evaluator<'a>,
    /// One a relation: the twists of all unknowns there.
    each: Vec<Option<Vec<Twist<f64>>>>,
}

impl<'a> Other<'a> {
    fn new(arm: &'a ArmModel, sigmas: Sigmas) -> Self {
        Self {
            evaluator: Evaluator::new(arm, sigmas),
            each: Vec::new(),
        }
    }

    fn observe(&mut self, o: &Observation, paths: &[Path]) {
        self.each.clear();
        let mut effects = Vec::new();
        for relation in &o.relations {
            let Relation::Distance { to, .. } = relation else {
                self.each.push(None);
                continue;
            };
            self.evaluator.observe(to);
            self.evaluator.all_effect_twists(to, &mut effects);
            let twist = |path| self.evaluator.twist(to, path, &effects);
            let twists = paths.iter().map(|p| twist(p).unwrap_or_else(Twist::zero));
            self.each.push(Some(twists.collect()));
        }
    }

    /// Twists of unknown `k`, one a relation.
    fn twists(&self, k: usize, scale: f64) -> Vec<Option<Twist<f64>>> {
        let of = |all: &Vec<Twist<f64>>| all.get(k).map(|t| t.scaled(scale));
        self.each.iter().map(|e| e.as_ref().and_then(of)).collect()
    }
}

/// Linearises the model around the arm as it is. `scales`: unit of each column, in the
/// unknown's own unit.
pub fn linearize(
    arm: &ArmModel,
    unknowns: &[Unknown],
    scales: &[f64],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Linear {
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut jacobian = DMatrix::zeros(rows, unknowns.len());
    let mut residual = DVector::zeros(rows);
    let paths = paths(arm, unknowns);
    let any_effect = paths.iter().any(|p| matches!(p, Path::Effect { .. }));
    let mut effects = Vec::new();
    let mut evaluator = Evaluator::new(arm, sigmas);
    let mut other = Other::new(arm, sigmas);
    let rigid = arm.effects.is_empty();
    let (mut attached, rest) = attached(arm, &paths, scales, rigid);
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        evaluator.observe(o);
        evaluator.residual(o, &mut residual.as_mut_slice()[start..end]);
        if any_effect {
            evaluator.all_effect_twists(o, &mut effects);
        }
        let far = evaluator.looks_elsewhere();
        if far {
            other.observe(o, &paths);
        }
        let columns = jacobian.as_mut_slice();
        let place = |k: usize| k * rows + start..k * rows + end;
        if let Some(attached) = attached.get_mut(o.session.min(arm.bases.len() - 1)) {
            evaluator.attached(o, attached, |k, twist| {
                let column = &mut columns[place(k)];
                evaluator.spread(o, &twist, column);
                if far {
                    evaluator.spread_far(o, &other.twists(k, scales[k]), column);
                }
            });
        }
        for &k in &rest {
            let (path, scale, column) = (&paths[k], scales[k], &mut columns[place(k)]);
            match evaluator.twist(o, path, &effects) {
                Some(twist) => {
                    evaluator.spread(o, &twist.scaled(scale), column);
                    if far {
                        evaluator.spread_far(o, &other.twists(k, scale), column);
                    }
                }
                None => {
                    evaluator.column(o, path, column);
                    for x in column {
                        *x *= scale;
                    }
                }
            }
        }
        start = end;
    }
    Linear { jacobian, residual }
}

/// Whitened residual alone; of many rows, by several threads.
pub fn residuals(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> DVector<f64> {
    let of = |observations: &[&Observation]| {
        let rows: usize = observations.iter().map(|o| o.equations()).sum();
        let mut residual = vec![0.0; rows];
        let mut evaluator = Evaluator::new(arm, sigmas);
        let mut rest = residual.as_mut_slice();
        for o in observations {
            let (these, after) = rest.split_at_mut(o.equations());
            evaluator.observe(o);
            evaluator.residual(o, these);
            rest = after;
        }
        residual
    };
    if observations.len() <= BLOCK {
        return DVector::from_vec(of(observations));
    }
    let blocks: Vec<Vec<f64>> = observations.par_chunks(BLOCK).map(of).collect();
    DVector::from_vec(blocks.concat())
}
