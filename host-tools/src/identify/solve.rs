//! Gauss-Newton with Levenberg-Marquardt damping on scaled columns.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::arm::ArmModel;
use super::factor::{Dropped, Preconditioner, Selection, Triangle, select};
use super::linearize::{Linear, linearize, residuals};
use super::observation::{Observation, Sigmas};
use super::unknown::{Unknown, apply, largest};

/// A direction counts as seen when a change by its expected deviation moves the whole data
/// by at least this many standard deviations; below, the data say less than the drawing.
pub const VISIBLE: f64 = 0.5;

/// A column is another's combination when less than this share of it is left over.
const RELATIVE: f64 = 1e-9;

/// Observations linearised at once: memory stays bounded for any number of rows. Sums are
/// taken over whole blocks in their order, so no result depends on the number of threads.
pub(super) const BLOCK: usize = 256;

const MAX_ITERATIONS: usize = 60;

/// Result of a fit. Covariances are for residuals of unit variance in units of the declared
/// noise.
#[derive(Clone, Debug)]
pub struct Solved {
    /// What was fitted.
    pub unknowns: Vec<Unknown>,
    /// Of `unknowns`, SI units.
    pub covariance: DMatrix<f64>,
    /// Upper triangle of the scaled Jacobian.
    pub triangle: DMatrix<f64>,
    /// Sum of squares of the whitened residual.
    pub cost: f64,
    /// Scalar equations.
    pub equations: usize,
    /// Linearisations used.
    pub iterations: usize,
    /// False where the iterations ended before the step had vanished.
    pub converged: bool,
}

impl Solved {
    /// Singular values of the scaled Jacobian, largest first.
    pub fn singular_values(&self) -> Vec<f64> {
        super::structure::singular_values(&self.triangle)
    }

    /// Estimated variance of a whitened residual (1 where the declared noise is right).
    pub fn variance(&self) -> f64 {
        let freedom = self.equations.saturating_sub(self.unknowns.len()).max(1);
        self.cost / freedom as f64
    }

    /// Standard error of an unknown in its unit, by the residual's own size.
    pub fn sigma(&self, unknown: Unknown) -> Option<f64> {
        let k = self.unknowns.iter().position(|&u| u == unknown)?;
        Some((self.covariance[(k, k)] * self.variance()).sqrt())
    }
}

/// Does `work` on the linearisation of every block and folds the results in their order.
fn over_blocks<R: Send>(
    at: &Linearised<'_>,
    observations: &[&Observation],
    work: impl Fn(Linear) -> R + Sync,
    mut fold: impl FnMut(R),
) {
    let each =
        |block: &[&Observation]| work(linearize(at.arm, at.unknowns, at.scales, block, at.sigmas));
    if observations.len() <= BLOCK {
        fold(each(observations));
        return;
    }
    let results: Vec<R> = observations.par_chunks(BLOCK).map(each).collect();
    results.into_iter().for_each(fold);
}

/// What is linearised, and where.
#[derive(Clone, Copy)]
struct Linearised<'a> {
    arm: &'a ArmModel,
    unknowns: &'a [Unknown],
    scales: &'a [f64],
    sigmas: Sigmas,
}

/// Normal equations of all blocks, for the iterations only.
struct Normal {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    cost: f64,
    /// The block itself, where there is only one.
    only: Option<Linear>,
}

impl Normal {
    fn new(at: &Linearised<'_>, observations: &[&Observation]) -> Self {
        let n = at.unknowns.len();
        let mut sum = Self {
            matrix: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            cost: 0.0,
            only: None,
        };
        let single = observations.len() <= BLOCK;
        over_blocks(
            at,
            observations,
            |linear| {
                let transposed = linear.jacobian.transpose();
                let matrix = &transposed * &linear.jacobian;
                let gradient = &transposed * &linear.residual;
                let cost = linear.residual.norm_squared();
                (matrix, gradient, cost, single.then_some(linear))
            },
            |(matrix, gradient, cost, linear)| {
                sum.matrix += matrix;
                sum.gradient += gradient;
                sum.cost += cost;
                sum.only = linear;
            },
        );
        sum
    }

    /// Which columns the observations can tell apart: orthogonal columns decide, except where
    /// the normal equations already prove that all of them do.
    fn selection(&self, at: &Linearised<'_>, observations: &[&Observation]) -> Selection {
        if Preconditioner::new(&self.matrix).is_some_and(|p| p.keeps_all(VISIBLE, RELATIVE)) {
            return Selection {
                kept: (0..at.unknowns.len()).collect(),
                dropped: Vec::new(),
            };
        }
        select(
            &self.triangle(at, observations, Prior::None).r,
            VISIBLE,
            RELATIVE,
        )
    }

    /// The same for some of the unknowns.
    fn of(self, kept: &[usize]) -> Self {
        if kept.len() == self.gradient.len() {
            return self;
        }
        Self {
            matrix: self.matrix.select_rows(kept).select_columns(kept),
            gradient: self.gradient.select_rows(kept),
            cost: self.cost,
            only: self.only.map(|linear| Linear {
                jacobian: linear.jacobian.select_columns(kept),
                residual: linear.residual,
            }),
        }
    }

    /// Orthogonal factorisation of the same Jacobian, `prior` being what has been added.
    fn triangle(
        &self,
        at: &Linearised<'_>,
        observations: &[&Observation],
        prior: Prior,
    ) -> Triangle {
        let prior = prior.rows(at);
        if let Some(first) = Preconditioner::new(&self.matrix)
            && let Some(triangle) = self.second_round(&first, at, observations, prior.as_ref())
        {
            return triangle;
        }
        let mut triangle = Triangle::new(at.unknowns.len());
        match &self.only {
            Some(linear) => triangle.push(&linear.jacobian, &linear.residual),
            None => {
                for block in observations.chunks(BLOCK) {
                    let linear = linearize(at.arm, at.unknowns, at.scales, block, at.sigmas);
                    triangle.push(&linear.jacobian, &linear.residual);
                }
            }
        }
        if let Some(rows) = &prior {
            triangle.push(&rows.jacobian, &rows.residual);
        }
        triangle
    }

    fn second_round(
        &self,
        first: &Preconditioner,
        at: &Linearised<'_>,
        observations: &[&Observation],
        prior: Option<&Linear>,
    ) -> Option<Triangle> {
        let products = |linear: &Linear| {
            let whitened = first.whitened(&linear.jacobian);
            let transposed = whitened.transpose();
            let gram = &transposed * whitened;
            (gram, transposed * &linear.residual)
        };
        let n = at.unknowns.len();
        let (mut gram, mut projected) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut add = |(g, p): (DMatrix<f64>, DVector<f64>)| {
            gram += g;
            projected += p;
        };
        match &self.only {
            Some(linear) => add(products(linear)),
            None => over_blocks(at, observations, |linear| products(&linear), &mut add),
        }
        if let Some(rows) = prior {
            add(products(rows));
        }
        first.triangle(&gram, &projected)
    }
}

/// The unit of each column.
fn scales(arm: &ArmModel, unknowns: &[Unknown]) -> Vec<f64> {
    unknowns.iter().map(|u| u.expected(arm)).collect()
}

/// Sorts `candidates` (in order of priority) into those that these observations can tell
/// apart, and those that they cannot.
pub fn distinguishable(
    arm: &ArmModel,
    candidates: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Selection {
    let scales = scales(arm, candidates);
    let at = Linearised {
        arm,
        unknowns: candidates,
        scales: &scales,
        sigmas,
    };
    Normal::new(&at, observations).selection(&at, observations)
}

/// Whether effects have a prior.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Prior {
    /// Data alone.
    None,
    /// Values of effects are expected within what machines have, as one more measurement
    /// each (linear minimum variance, MRD 4.3.2): what the data do not show stays small.
    Effects,
}

impl Prior {
    /// Standard deviation expected of an unknown, in its unit.
    fn deviation(self, unknown: Unknown, arm: &ArmModel) -> Option<f64> {
        match (self, unknown) {
            (Self::Effects, Unknown::Effect { .. } | Unknown::EarlyReading) => {
                Some(0.5 * largest(unknown.unit(arm)))
            }
            _ => None,
        }
    }

    /// Adds the prior's share to the normal equations.
    fn add(self, normal: &mut Normal, arm: &ArmModel, unknowns: &[Unknown], scales: &[f64]) {
        for (k, (unknown, scale)) in unknowns.iter().zip(scales).enumerate() {
            if let Some(deviation) = self.deviation(*unknown, arm) {
                let value = unknown.value(arm) / deviation;
                normal.matrix[(k, k)] += (scale / deviation).powi(2);
                normal.gradient[k] -= value * scale / deviation;
                normal.cost += value * value;
            }
        }
    }

    /// The same as rows of the Jacobian and the residual.
    fn rows(self, at: &Linearised<'_>) -> Option<Linear> {
        let rows: Vec<(usize, f64, f64)> = at
            .unknowns
            .iter()
            .zip(at.scales)
            .enumerate()
            .filter_map(|(k, (unknown, scale))| {
                let deviation = self.deviation(*unknown, at.arm)?;
                Some((k, scale / deviation, -unknown.value(at.arm) / deviation))
            })
            .collect();
        let mut jacobian = DMatrix::zeros(rows.len(), at.unknowns.len());
        let mut residual = DVector::zeros(rows.len());
        for (i, (k, weight, value)) in rows.iter().enumerate() {
            jacobian[(i, *k)] = *weight;
            residual[i] = *value;
        }
        (!rows.is_empty()).then_some(Linear { jacobian, residual })
    }
}

/// Fits `unknowns`, all of which the observations must be able to tell apart. On return `arm`
/// holds the solution.
pub fn solve(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior,
) -> Solved {
    let scales = scales(arm, unknowns);
    let at = Linearised {
        arm,
        unknowns,
        scales: &scales,
        sigmas,
    };
    let start = Normal::new(&at, observations);
    descend(arm, unknowns, scales, start, observations, sigmas, prior)
}

/// Fits those of `candidates` (in order of priority) that these observations can tell apart;
/// returns the others with the reason. On return `arm` holds the solution.
pub fn fit(
    arm: &mut ArmModel,
    candidates: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior,
) -> (Solved, Vec<(Unknown, Dropped)>) {
    let scales = scales(arm, candidates);
    let at = Linearised {
        arm,
        unknowns: candidates,
        scales: &scales,
        sigmas,
    };
    let start = Normal::new(&at, observations);
    let Selection { kept, dropped } = start.selection(&at, observations);
    let unknowns: Vec<Unknown> = kept.iter().map(|&k| candidates[k]).collect();
    let scales = kept.iter().map(|&k| scales[k]).collect();
    let start = start.of(&kept);
    let fit = descend(arm, &unknowns, scales, start, observations, sigmas, prior);
    let dropped = dropped
        .into_iter()
        .map(|(k, why)| (candidates[k], why))
        .collect();
    (fit, dropped)
}

/// Iterates from `start`, which is `arm` as it is.
fn descend(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    scales: Vec<f64>,
    start: Normal,
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior,
) -> Solved {
    let mut here = start;
    prior.add(&mut here, arm, unknowns, &scales);
    let mut damping = 0.0_f64;
    let mut iterations = 1;
    let mut converged = false;
    let scaled = |step: &DVector<f64>| -> Vec<f64> {
        step.iter().zip(&scales).map(|(x, s)| x * s).collect()
    };
    while iterations < MAX_ITERATIONS {
        let mut damped = here.matrix.clone();
        for k in 0..unknowns.len() {
            damped[(k, k)] += damping * here.matrix[(k, k)].max(f64::MIN_POSITIVE);
        }
        let Some(factor) = damped.cholesky() else {
            damping = (damping * 10.0).max(1e-9);
            if damping > 1e9 {
                break;
            }
            continue;
        };
        let step = factor.solve(&here.gradient);
        // What the linear model promises, in units of the noise squared: a ten-thousandth of one
        // standard deviation in all, and the last step leaves the square of that.
        let promised = step.dot(&here.gradient);
        if promised <= 1e-8_f64.max(1e-13 * here.cost) {
            converged = true;
            break;
        }
        let mut there_arm = arm.clone();
        apply(&mut there_arm, unknowns, &scaled(&step));
        let at = Linearised {
            arm: &there_arm,
            unknowns,
            scales: &scales,
            sigmas,
        };
        let mut there = Normal::new(&at, observations);
        prior.add(&mut there, &there_arm, unknowns, &scales);
        iterations += 1;
        if there.cost <= here.cost {
            *arm = there_arm;
            here = there;
            damping = if damping > 1e-7 { damping * 0.1 } else { 0.0 };
        } else if promised <= 1e-6 * here.cost {
            // Nothing to gain: derivatives leave out how an effect of the posture changes with
            // the geometry, so the promise need not vanish exactly where the cost is least.
            converged = true;
            break;
        } else {
            damping = (damping * 10.0).max(1e-4);
            if damping > 1e9 {
                break;
            }
        }
    }
    // Last step and covariance from an orthogonal factorisation.
    let at = Linearised {
        arm,
        unknowns,
        scales: &scales,
        sigmas,
    };
    let last = here.triangle(&at, observations, prior);
    let mut cost = here.cost;
    if converged && let Some(step) = last.step() {
        let mut polished = arm.clone();
        apply(&mut polished, unknowns, &scaled(&step));
        cost = residuals(&polished, observations, sigmas).norm_squared();
        *arm = polished;
    }
    let mut covariance = last
        .covariance()
        .unwrap_or_else(|| DMatrix::zeros(unknowns.len(), unknowns.len()));
    for (j, mut column) in covariance.column_iter_mut().enumerate() {
        for (x, scale) in column.iter_mut().zip(&scales) {
            *x *= scale * scales[j];
        }
    }
    Solved {
        unknowns: unknowns.to_vec(),
        covariance,
        triangle: last.r,
        cost,
        equations: observations.iter().map(|o| o.equations()).sum(),
        iterations,
        converged,
    }
}

/// Mean squared whitened residual of every observation.
pub fn misfit(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> Vec<f64> {
    let all = residuals(arm, observations, sigmas);
    let mut start = 0;
    observations
        .iter()
        .map(|o| {
            let n = o.equations();
            let sum: f64 = all.rows(start, n).norm_squared();
            start += n;
            sum / n.max(1) as f64
        })
        .collect()
}
