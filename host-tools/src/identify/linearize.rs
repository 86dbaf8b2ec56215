//! Residuals and identification Jacobian of all rows, whitened by the instrument's noise.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::arm::ArmModel;
use super::attached::Attached;
use super::evaluator::{Evaluator, Path, paths};
use super::observation::{Observation, Sigmas};
use super::solve::{BLOCK, block};
use super::unknown::Unknown;

/// The unknowns whose twists are constant in some frame, one set a placement of the
/// instrument, and the places of the others. Of an arm that is not `rigid` the tool is one of
/// those: it turns with whatever bends before it.
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
            Path::Base { session, unit } => {
                if let Some(set) = sets.get_mut(*session) {
                    set.push_base(k, unit, scale);
                }
            }
            Path::Attached(twists) => sets.iter_mut().for_each(|s| s.push(k, twists, scale)),
            Path::Tool(twist) if rigid => {
                let twists = [Some(*twist), None];
                sets.iter_mut().for_each(|s| s.push(k, &twists, scale));
            }
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
    let rigid = arm.effects.is_empty();
    let (attached, rest) = attached(arm, &paths, scales, rigid);
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        evaluator.observe(o);
        evaluator.residual(o, &mut residual.as_mut_slice()[start..end]);
        if any_effect {
            evaluator.all_effect_twists(o, &mut effects);
        }
        let columns = jacobian.as_mut_slice();
        let place = |k: usize| k * rows + start..k * rows + end;
        if let Some(attached) = attached.get(o.session.min(arm.bases.len() - 1)) {
            evaluator.attached(o, attached, columns, place);
        }
        for &k in &rest {
            let (path, scale, column) = (&paths[k], scales[k], &mut columns[place(k)]);
            match evaluator.twist(o, path, &effects) {
                Some(twist) => evaluator.spread(o, &twist.scaled(scale), column),
                None => {
                    evaluator.column(o, path, column);
                    for x in column {
                        *x *= scale;
                    }
                }
            }
        }
        evaluator.elsewhere(o, |evaluator, posture| {
            evaluator.all_effect_twists(posture.at, &mut effects);
            for (k, (path, &scale)) in paths.iter().zip(scales).enumerate() {
                if let Some(twist) = evaluator.twist(posture.at, path, &effects) {
                    posture.spread(evaluator, &twist.scaled(scale), &mut columns[place(k)]);
                }
            }
        });
        start = end;
    }
    Linear { jacobian, residual }
}

/// Whitened residual alone; of many rows, by several threads.
pub fn residuals(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> DVector<f64> {
    if observations.len() <= BLOCK {
        return residuals_of_block(arm, observations, sigmas);
    }
    let blocks: Vec<DVector<f64>> = observations
        .par_chunks(block(observations.len()))
        .map(|rows| residuals_of_block(arm, rows, sigmas))
        .collect();
    let all = blocks.iter().flat_map(|block| block.iter().copied());
    DVector::from_vec(all.collect())
}

/// The same by one thread.
pub(super) fn residuals_of_block(
    arm: &ArmModel,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> DVector<f64> {
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
    DVector::from_vec(residual)
}
