//! Fits that a few wrong rows do not spoil: iteratively reweighted least squares.
//!
//! A row's residual is the root mean square of its whitened equations, in units of the median
//! row's. Its weight follows from the loss (Huber 1964; Beaton and Tukey 1974), the fit is made
//! again with the weights, until they stay. Tukey's loss has many minima: it starts from
//! Huber's.

use super::arm::ArmModel;
use super::method::{Fitted, Loss, Method, Task};
use super::observation::Observation;
use super::solve::misfit;

/// Where the loss leaves the square, in standard deviations: 95 % as good as least squares on
/// normal noise.
const HUBER: f64 = 1.345;
const TUKEY: f64 = 4.685;

/// Weights that move less than this stay.
const STAYS: f64 = 1e-6;

const MAX_ROUNDS: usize = 100;

/// A row that the fit trusts less than half.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Data row in the file, from 1.
    pub row: usize,
    /// 0 to 1.
    pub weight: f64,
}

/// Weight of a residual of `x` standard deviations.
fn weight(loss: Loss, x: f64) -> f64 {
    match loss {
        Loss::Square => 1.0,
        Loss::Huber => HUBER / x.max(HUBER),
        Loss::Tukey => (1.0 - (x / TUKEY).powi(2)).max(0.0).powi(2),
    }
}

/// Median of a mean of `n` squares of standard normal numbers (Wilson and Hilferty 1931).
fn median_of_squares(n: usize) -> f64 {
    (1.0 - 2.0 / (9.0 * n.max(1) as f64)).powi(3)
}

/// Residual of every row over the noise, as `arm` leaves it.
fn sizes(arm: &ArmModel, task: &Task<'_>, rows: &[&Observation]) -> Vec<f64> {
    let squares = misfit(arm, rows, task.sigmas);
    let typical = rows.iter().map(|o| median_of_squares(o.equations()));
    let mut relative: Vec<f64> = squares.iter().zip(typical).map(|(s, t)| s / t).collect();
    relative.sort_by(f64::total_cmp);
    let scale = relative.get(relative.len() / 2).copied().unwrap_or(1.0);
    let scale = scale.max(f64::MIN_POSITIVE).sqrt();
    squares.iter().map(|s| s.sqrt() / scale).collect()
}

/// Fits with the method's loss; on return `arm` holds the solution.
pub(super) fn fit(
    method: &Method,
    arm: &mut ArmModel,
    task: &Task<'_>,
    rows: &[&Observation],
) -> Fitted {
    let mut weighted: Vec<Observation> = rows.iter().map(|&o| o.clone()).collect();
    let mut fitted = once(method, arm, task, &weighted);
    let losses = [Loss::Huber, Loss::Tukey];
    let wanted = losses.iter().position(|l| *l == method.loss).unwrap_or(0);
    for loss in &losses[..=wanted] {
        for _ in 0..MAX_ROUNDS {
            let mut moved = 0.0_f64;
            for ((o, row), x) in weighted.iter_mut().zip(rows).zip(sizes(arm, task, rows)) {
                let new = row.weight * weight(*loss, x).sqrt();
                moved = moved.max((new - o.weight).abs());
                o.weight = new;
            }
            fitted = once(method, arm, task, &weighted);
            if moved < STAYS {
                break;
            }
        }
    }
    // What the weights leave of the equations.
    let share = |(o, row): (&Observation, &&Observation)| {
        (o.weight / row.weight.max(f64::MIN_POSITIVE)).powi(2) * o.equations() as f64
    };
    let left: f64 = weighted.iter().zip(rows).map(share).sum();
    fitted.solved.equations = left.round() as usize;
    fitted.outliers = weighted
        .iter()
        .filter(|o| o.weight.powi(2) < 0.5)
        .map(|o| Outlier {
            row: o.row,
            weight: o.weight.powi(2),
        })
        .collect();
    fitted
}

fn once(method: &Method, arm: &mut ArmModel, task: &Task<'_>, rows: &[Observation]) -> Fitted {
    let rows: Vec<&Observation> = rows.iter().collect();
    method.once(arm, task, &rows)
}
