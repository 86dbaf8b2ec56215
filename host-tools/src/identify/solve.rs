//! Gauss-Newton with Levenberg-Marquardt damping on scaled columns.

use nalgebra::{DMatrix, DVector};

use super::arm::ArmModel;
use super::factor::{Selection, Triangle, select};
use super::linearize::{Linear, linearize, residuals};
use super::observation::{Observation, Sigmas};
use super::unknown::{Unknown, apply};

/// A direction counts as seen when a change by its expected deviation moves the whole data
/// by at least this many standard deviations; below, the data say less than the drawing.
pub const VISIBLE: f64 = 0.5;

/// Observations linearised at once: memory stays bounded for any number of rows.
pub(super) const BLOCK: usize = 512;

const MAX_ITERATIONS: usize = 60;

/// Result of a fit. Covariances are for residuals of unit variance in units of the declared
/// noise.
#[derive(Clone, Debug)]
pub struct Solved {
    /// What was fitted.
    pub unknowns: Vec<Unknown>,
    /// Of `unknowns`, SI units.
    pub covariance: DMatrix<f64>,
    /// Singular values of the scaled Jacobian, largest first.
    pub singular_values: Vec<f64>,
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

fn blocks<'a, 'b>(
    observations: &'a [&'b Observation],
) -> impl Iterator<Item = &'a [&'b Observation]> {
    observations.chunks(BLOCK)
}

/// Normal equations of all blocks, for the iterations only.
struct Normal {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    cost: f64,
    /// The block itself, where there is only one.
    only: Option<Linear>,
}

fn normal(
    arm: &ArmModel,
    unknowns: &[Unknown],
    scales: &[f64],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Normal {
    let n = unknowns.len();
    let mut normal = Normal {
        matrix: DMatrix::zeros(n, n),
        gradient: DVector::zeros(n),
        cost: 0.0,
        only: None,
    };
    let single = observations.len() <= BLOCK;
    for block in blocks(observations) {
        let linear = linearize(arm, unknowns, scales, block, sigmas);
        let transposed = linear.jacobian.transpose();
        normal.matrix += &transposed * &linear.jacobian;
        normal.gradient += &transposed * &linear.residual;
        normal.cost += linear.residual.norm_squared();
        if single {
            normal.only = Some(linear);
        }
    }
    normal
}

fn triangle(
    arm: &ArmModel,
    unknowns: &[Unknown],
    scales: &[f64],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Triangle {
    let mut triangle = Triangle::new(unknowns.len());
    for block in blocks(observations) {
        let linear = linearize(arm, unknowns, scales, block, sigmas);
        triangle.push(&linear.jacobian, &linear.residual);
    }
    triangle
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
    let triangle = triangle(arm, candidates, &scales, observations, sigmas);
    select(&triangle.r, VISIBLE, 1e-9)
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
                Some(match unknown.unit(arm) {
                    "rad" | "m" => 3e-3,
                    "rad/(N m)" => 3e-4,
                    "m/N" => 1e-6,
                    _ => 1e-2,
                })
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

    /// The same as rows of the factorisation.
    fn push(self, triangle: &mut Triangle, arm: &ArmModel, unknowns: &[Unknown], scales: &[f64]) {
        for (k, (unknown, scale)) in unknowns.iter().zip(scales).enumerate() {
            if let Some(deviation) = self.deviation(*unknown, arm) {
                let mut row = DMatrix::zeros(1, unknowns.len());
                row[(0, k)] = scale / deviation;
                let value = DVector::from_element(1, -unknown.value(arm) / deviation);
                triangle.push(&row, &value);
            }
        }
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
    let mut here = normal(arm, unknowns, &scales, observations, sigmas);
    prior.add(&mut here, arm, unknowns, &scales);
    let mut damping = 0.0_f64;
    let mut iterations = 1;
    let mut converged = false;
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
        // What the linear model promises, in units of the noise squared.
        let promised = step.dot(&here.gradient);
        if promised <= 1e-10_f64.max(1e-13 * here.cost) {
            converged = true;
            break;
        }
        let mut there_arm = arm.clone();
        let moved: Vec<f64> = step.iter().zip(&scales).map(|(x, s)| x * s).collect();
        apply(&mut there_arm, unknowns, &moved);
        let mut there = normal(&there_arm, unknowns, &scales, observations, sigmas);
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
    let mut last = match &here.only {
        Some(linear) => {
            let mut triangle = Triangle::new(unknowns.len());
            triangle.push(&linear.jacobian, &linear.residual);
            triangle
        }
        None => triangle(arm, unknowns, &scales, observations, sigmas),
    };
    prior.push(&mut last, arm, unknowns, &scales);
    let mut cost = here.cost;
    if converged && let Some(step) = last.step() {
        let mut polished = arm.clone();
        let moved: Vec<f64> = step.iter().zip(&scales).map(|(x, s)| x * s).collect();
        apply(&mut polished, unknowns, &moved);
        *arm = polished;
        cost = last.remainder.max(0.0);
    }
    let mut covariance = last
        .covariance()
        .unwrap_or_else(|| DMatrix::zeros(unknowns.len(), unknowns.len()));
    for i in 0..unknowns.len() {
        for j in 0..unknowns.len() {
            covariance[(i, j)] *= scales[i] * scales[j];
        }
    }
    Solved {
        unknowns: unknowns.to_vec(),
        covariance,
        singular_values: super::structure::singular_values(&last.r),
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
