//! How large the residual is, apart for positions, orientations and lengths.

use crate::identify::arm::ArmModel;
use crate::identify::linearize::residuals;
use crate::identify::observation::{Observation, Sigmas};

/// Standard deviations per axis that the residual of a fit with `fitted` unknowns has, m and
/// rad: each kind of measurement loses its share of the degrees of freedom. What is not
/// measured keeps its value in `declared`.
pub fn estimated(
    arm: &ArmModel,
    observations: &[&Observation],
    declared: Sigmas,
    fitted: usize,
) -> Sigmas {
    let all = residuals(arm, observations, declared);
    let (mut squares, mut counts) = ([0.0; 3], [0.0_f64; 3]);
    let mut start = 0;
    for o in observations {
        let mut take = |kind: usize, n: usize| {
            squares[kind] += all.rows(start, n).norm_squared();
            counts[kind] += n as f64;
            start += n;
        };
        if o.position.is_some() {
            take(0, 3);
        }
        if o.rotation.is_some() {
            take(1, 3);
        }
        take(0, 3 * o.targets.iter().flatten().count());
        if o.length.is_some() {
            take(2, 1);
        }
    }
    let total: f64 = counts.iter().sum();
    let left = (1.0 - fitted as f64 / total.max(1.0)).max(0.05);
    let factor = |kind: usize| {
        if counts[kind] > 0.0 {
            (squares[kind] / (counts[kind] * left)).sqrt().max(1e-9)
        } else {
            1.0
        }
    };
    Sigmas {
        position: declared.position * factor(0),
        orientation: declared.orientation * factor(1),
        length: declared.length * factor(2),
    }
}
