//! How good any set of poses could be.
//!
//! With N the information of the chosen K poses (and of those measured before, F), no K poses
//! give more than the determinant at which, by the inequality of the means,
//!
//!   (det N* / det N)^(1/L) <= tr(N⁻¹ N*) / L <= (tr(N⁻¹ F) + K max tr(B N⁻¹ Bᵀ)) / L
//!
//! where B are the rows of one pose and the maximum is over all poses (Kiefer and Wolfowitz,
//! SH 28). The maximum is searched for by climbing from the best of many random poses.

use nalgebra::DMatrix;

use super::design::{Blocks, Covariance};
use super::{Sensitivity, draw};
use crate::random::Random;

/// Random poses, those of them that are climbed from, and steps of a climb.
const SAMPLES: usize = 2000;
const CLIMBS: usize = 8;
const STEPS: usize = 150;

/// The factor by which O1 could still be larger, at least 1.
pub(super) fn room_for_improvement(
    arm: &mut dyn Sensitivity,
    chosen: &Blocks,
    fixed: &DMatrix<f64>,
    random: &mut Random,
) -> Option<f64> {
    let width = chosen.width;
    let mut information = fixed.clone();
    (0..chosen.len()).for_each(|i| chosen.inform(i, &mut information));
    let covariance = Covariance::of(information)?;
    let limits = arm.limits().to_vec();
    let mut block = vec![0.0; width * chosen.height];
    let sampled = draw(arm, SAMPLES, random);
    // of a pose where it can be measured
    let mut worth = |q: &mut Vec<f64>| {
        if !arm.bring(q) {
            return 0.0;
        }
        arm.rows(q, &mut block);
        covariance.variance(&block)
    };
    let mut found: Vec<(f64, Vec<f64>)> = sampled
        .into_iter()
        .map(|mut q| (worth(&mut q), q))
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(CLIMBS);
    let mut largest = 0.0_f64;
    for (mut best, mut at) in found {
        for step in 0..STEPS {
            let reach = 0.2 * (1.0 - step as f64 / STEPS as f64) + 0.01;
            let mut q: Vec<f64> = (at.iter().zip(&limits))
                .map(|(q, &[low, high])| {
                    (q + reach * (high - low) * random.between(-1.0, 1.0)).clamp(low, high)
                })
                .collect();
            let value = worth(&mut q);
            if value > best {
                (best, at) = (value, q);
            }
        }
        largest = largest.max(best);
    }
    let known = covariance.trace_with(fixed);
    let ratio = (known + chosen.len() as f64 * largest) / width as f64;
    Some(ratio.max(1.0).sqrt())
}
