//! How large the residual is, each kind of measured number apart.

use crate::identify::arm::ArmModel;
use crate::identify::linearize::residuals;
use crate::identify::observation::{Kind, Observation, Sigmas};

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
    let mut sums = Kind::ALL.map(|kind| (kind, 0.0, 0.0));
    let mut start = 0;
    for (kind, n) in observations.iter().flat_map(|o| o.kinds()) {
        for (_, square, count) in sums.iter_mut().filter(|(k, ..)| *k == kind) {
            *square += all.rows(start, n).norm_squared();
            *count += n as f64;
        }
        start += n;
    }
    let total: f64 = sums.iter().map(|(_, _, count)| count).sum();
    let left = (1.0 - fitted as f64 / total.max(1.0)).max(0.05);
    let factor = |kind: Kind| {
        let of_kind = sums.iter().find(|(k, _, count)| *k == kind && *count > 0.0);
        of_kind.map_or(1.0, |(_, square, count)| {
            (square / (count * left)).sqrt().max(1e-9)
        })
    };
    Sigmas::per_kind(|kind| declared.of(kind) * factor(kind))
}
