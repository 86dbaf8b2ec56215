//! How far the parameters scatter when the rows are drawn anew, with replacement: standard
//! errors that trust neither the declared noise nor its being the same everywhere (Efron 1979).

use rayon::prelude::*;

use super::Calibration;
use super::noise::fitted;
use super::observation::Observation;
use super::problem::Problem;
use super::unknown::Unknown;
use crate::random::Random;

/// The stream of random numbers that rows are drawn by.
const DRAWS: u64 = 71;

/// Scatter of one parameter, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation.
    pub sigma: f64,
    /// 2.5 and 97.5 % of the values.
    pub interval95: [f64; 2],
}

/// Result of [`bootstrap`].
#[derive(Clone, Debug, PartialEq)]
pub struct Bootstrap {
    /// Draws that gave a fit.
    pub draws: usize,
    /// Draws that did not: their rows could not tell the parameters apart.
    pub failed: usize,
    /// Every identified unknown.
    pub each: Vec<(Unknown, Scatter)>,
}

/// Draws the fitted rows anew `count` times and fits each draw from the solution on. Draw k is
/// the same on every machine, for any number of threads.
pub fn bootstrap(problem: &Problem, calibration: &Calibration, count: usize) -> Bootstrap {
    let rows = fitted(problem, calibration);
    let stage = &calibration.complete;
    let unknowns = &stage.fit.unknowns;
    let draws: Vec<Option<Vec<f64>>> = (0..count)
        .into_par_iter()
        .map(|draw| {
            let mut random = Random::new(draw as u64, DRAWS);
            let drawn: Vec<&Observation> = rows
                .iter()
                .map(|_| rows[random.below(rows.len())])
                .collect();
            let mut arm = stage.arm.clone();
            let drawing = &calibration.nominal.arm;
            let method = &calibration.method;
            let fit = method.fit(&mut arm, drawing, unknowns, &drawn, problem.sigmas);
            let whole = fit.dropped.is_empty() && fit.solved.converged;
            let off = |u: &Unknown| {
                let off = u.value(&arm) - u.value(&stage.arm);
                match u.unit(&arm) {
                    // a roll of pi is one of -pi
                    "rad" => {
                        let turn = std::f64::consts::TAU;
                        off - turn * (off / turn).round()
                    }
                    _ => off,
                }
            };
            whole.then(|| unknowns.iter().map(off).collect())
        })
        .collect();
    let good: Vec<&Vec<f64>> = draws.iter().flatten().collect();
    let each = unknowns.iter().enumerate().map(|(k, unknown)| {
        let mut values: Vec<f64> = good.iter().map(|v| v[k]).collect();
        values.sort_by(f64::total_cmp);
        (*unknown, scatter(&values, unknown.value(&stage.arm)))
    });
    Bootstrap {
        draws: good.len(),
        failed: count - good.len(),
        each: if good.len() > 1 {
            each.collect()
        } else {
            Vec::new()
        },
    }
}

/// Of sorted deviations from `value`.
fn scatter(deviations: &[f64], value: f64) -> Scatter {
    let n = deviations.len().max(2) as f64;
    let mean = deviations.iter().sum::<f64>() / n;
    let squares: f64 = deviations.iter().map(|x| (x - mean).powi(2)).sum();
    let at = |share: f64| {
        let place = share * (deviations.len().saturating_sub(1)) as f64;
        let (low, part) = (place.floor() as usize, place.fract());
        let of = |i: usize| {
            deviations
                .get(i)
                .or(deviations.last())
                .copied()
                .unwrap_or(0.0)
        };
        value + of(low) * (1.0 - part) + of(low + 1) * part
    };
    Scatter {
        sigma: (squares / (n - 1.0)).sqrt(),
        interval95: [at(0.025), at(0.975)],
    }
}
