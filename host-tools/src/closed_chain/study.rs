//! Which index tells a good set of poses: many sets drawn from measured ones, NH 3.

use super::{Failure, Loop, identify, linearise};
use crate::observability::{Observability, scale_columns};
use crate::random::Random;

/// Of many sets of poses, each identified.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// O1 to O4 of every set, and the rms error of its parameters, each times the length of its
    /// column: `[o1, o2, o3, o4, error]`.
    pub sets: Vec<[f64; 5]>,
    /// Sets that could not be identified.
    pub failed: usize,
}

/// Draws `draws` sets of `size` from `poses`, identifies each from `start` and compares it with
/// the truth. Columns and errors are scaled by the columns' lengths over all poses (NH 3.1.2).
pub fn study(
    chain: &dyn Loop,
    [truth, start]: [&[f64]; 2],
    poses: &[Vec<f64>],
    size: usize,
    draws: usize,
    random: &mut Random,
) -> Result<Study, Failure> {
    let mut all = linearise(chain, truth, poses, None).map_err(Failure::Unbuilt)?;
    let lengths = scale_columns(&mut all.jacobian);
    let scale = (size as f64 / poses.len() as f64).sqrt();
    let mut order: Vec<usize> = (0..poses.len()).collect();
    let mut study = Study {
        sets: Vec::with_capacity(draws),
        failed: 0,
    };
    for _ in 0..draws {
        for k in 0..size.min(poses.len()) {
            let other = k + random.below(poses.len() - k);
            order.swap(k, other);
        }
        let set: Vec<Vec<f64>> = order
            .iter()
            .take(size)
            .filter_map(|&k| poses.get(k).cloned())
            .collect();
        let found = identify(chain, start, &set).and_then(|found| {
            let linear = linearise(chain, truth, &set, None).map_err(Failure::Unbuilt)?;
            let mut jacobian = linear.jacobian;
            for (mut column, length) in jacobian.column_iter_mut().zip(&lengths) {
                column /= *length;
            }
            let o = Observability::of(&jacobian, size).map_err(Failure::Unobservable)?;
            let squares = (found.x.iter().zip(truth).zip(&lengths))
                .map(|((x, truth), length)| ((x - truth) * length * scale).powi(2));
            let error = (squares.sum::<f64>() / truth.len() as f64).sqrt();
            Ok([o.o1(), o.o2(), o.o3(), o.o4(), error])
        });
        match found {
            Ok(set) => study.sets.push(set),
            Err(_) => study.failed += 1,
        }
    }
    Ok(study)
}

impl Study {
    /// Largest over smallest value of O1 to O4, how widely each tells sets apart: NH figure 5.
    pub fn sensitivity(&self) -> [f64; 4] {
        [0, 1, 2, 3].map(|k| {
            let values = || self.sets.iter().map(|set| set[k]);
            values().fold(0.0, f64::max) / values().fold(f64::MAX, f64::min)
        })
    }

    /// By how much O1 to O4 grow from the lowest to the highest of `classes` of sets, each
    /// sorted by the index itself: medians, which no single set decides.
    pub fn growth(&self, classes: usize) -> [f64; 4] {
        [0, 1, 2, 3].map(|k| {
            let mut values: Vec<f64> = self.sets.iter().map(|set| set[k]).collect();
            values.sort_by(f64::total_cmp);
            let half = values.len() / (2 * classes.max(1));
            let from_end = values.len().saturating_sub(half + 1);
            match (values.get(half), values.get(from_end)) {
                (Some(low), Some(high)) => high / low,
                _ => f64::NAN,
            }
        })
    }

    /// Sets sorted by an index (0 to 3 for O1 to O4) into `classes` of one size; of each, the
    /// error that one set in a hundred exceeds: the upper envelope of NH figures 3 and 4.
    pub fn envelope(&self, index: usize, classes: usize) -> Vec<f64> {
        let mut sets = self.sets.clone();
        sets.sort_by(|a, b| a[index].total_cmp(&b[index]));
        sets.chunks(sets.len().div_ceil(classes.max(1)).max(1))
            .map(|class| {
                let mut errors: Vec<f64> = class.iter().map(|set| set[4]).collect();
                errors.sort_by(f64::total_cmp);
                let at = errors.len() * 99 / 100;
                errors.get(at).copied().unwrap_or(f64::NAN)
            })
            .collect()
    }
}
