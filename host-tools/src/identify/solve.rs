//! Gauss-Newton with Levenberg-Marquardt damping on scaled columns.

use nalgebra::{DMatrix, DVector};

use super::arm::ArmModel;
use super::factor::{Dropped, Selection, Triangle};
use super::linearize::residuals;
use super::normal::{Linearised, Normal};
use super::observation::{Observation, Sigmas};
use super::prior::Prior;
use super::unknown::{Unknown, apply};

/// A direction counts as seen when a change by its expected deviation moves the whole data
/// by at least this many standard deviations; below, the data say less than the drawing.
pub const VISIBLE: f64 = 0.5;

/// A column is another's combination when less than this share of it is left over.
pub(super) const RELATIVE: f64 = 1e-9;

/// Observations linearised at once: memory stays bounded for any number of rows. Sums are
/// taken over whole blocks in their order, so no result depends on the number of threads.
pub(super) const BLOCK: usize = 256;

/// Rows of each block where there are `rows` in all: one block, or the least multiple of four
/// that holds them, all of one size. Two threads have the same to do then, and one that was
/// asleep still finds something.
pub(super) fn block(rows: usize) -> usize {
    let blocks = match rows.div_ceil(BLOCK) {
        0 | 1 => 1,
        more => more.next_multiple_of(4),
    };
    rows.div_ceil(blocks).max(1)
}

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

    /// Estimated variance of a whitened residual (1 where the declared noise is right). Where
    /// there are no more equations than unknowns nothing is left to estimate it from, and the
    /// declared noise is taken.
    pub fn variance(&self) -> f64 {
        match self.equations.saturating_sub(self.unknowns.len()) {
            0 => 1.0,
            freedom => self.cost / freedom as f64,
        }
    }

    /// Standard error of an unknown in its unit, by the residual's own size.
    pub fn sigma(&self, unknown: Unknown) -> Option<f64> {
        let k = self.unknowns.iter().position(|&u| u == unknown)?;
        Some((self.covariance[(k, k)] * self.variance()).sqrt())
    }
}

/// The unit of each column.
pub(super) fn scales(arm: &ArmModel, unknowns: &[Unknown]) -> Vec<f64> {
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

/// Fits `unknowns`, all of which the observations must be able to tell apart. On return `arm`
/// holds the solution.
pub fn solve(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior<'_>,
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
    prior: Prior<'_>,
) -> (Solved, Vec<(Unknown, Dropped)>) {
    let (unknowns, scales, start, dropped) = begin(arm, candidates, observations, sigmas);
    let fit = descend(arm, &unknowns, scales, start, observations, sigmas, prior);
    (fit, dropped)
}

/// The same without damping: full steps, each from an orthogonal factorisation, until they
/// vanish. Does not converge where the model is far from linear.
pub(super) fn fit_undamped(
    arm: &mut ArmModel,
    candidates: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior<'_>,
) -> (Solved, Vec<(Unknown, Dropped)>) {
    let (unknowns, scales, mut here, dropped) = begin(arm, candidates, observations, sigmas);
    let mut iterations = 1;
    let mut converged = false;
    loop {
        let at = Linearised {
            arm,
            unknowns: &unknowns,
            scales: &scales,
            sigmas,
        };
        here.add(&at, prior);
        let triangle = here.triangle(&at, observations, prior);
        let Some(step) = triangle.step() else { break };
        let promised = triangle.z.norm_squared();
        let enough = promised <= enough(here.cost);
        let step: Vec<f64> = step.iter().zip(&scales).map(|(x, s)| x * s).collect();
        apply(arm, &unknowns, &step);
        if enough || iterations >= MAX_ITERATIONS || !promised.is_finite() {
            converged = enough;
            break;
        }
        let at = Linearised {
            arm,
            unknowns: &unknowns,
            scales: &scales,
            sigmas,
        };
        here = Normal::new(&at, observations);
        iterations += 1;
    }
    let fit = at_solution(
        arm,
        &unknowns,
        observations,
        sigmas,
        prior,
        iterations,
        converged,
    );
    (fit, dropped)
}

/// What the arm as it is says of its uncertainty.
pub(super) fn at_solution(
    arm: &ArmModel,
    unknowns: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior<'_>,
    iterations: usize,
    converged: bool,
) -> Solved {
    let scales = scales(arm, unknowns);
    let at = Linearised {
        arm,
        unknowns,
        scales: &scales,
        sigmas,
    };
    let here = Normal::new(&at, observations);
    let equations = observations.iter().map(|o| o.equations()).sum();
    // the data's share alone
    let cost = here.cost;
    let mut with = here;
    with.add(&at, prior);
    let triangle = with.triangle(&at, observations, prior);
    triangle.solved(unknowns, &scales, cost, equations, iterations, converged)
}

/// Unknowns that can be told apart, their scales, the normal equations, and the others.
type Beginning = (Vec<Unknown>, Vec<f64>, Normal, Vec<(Unknown, Dropped)>);

fn begin(
    arm: &ArmModel,
    candidates: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Beginning {
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
    let dropped = dropped
        .into_iter()
        .map(|(k, why)| (candidates[k], why))
        .collect();
    (unknowns, scales, start.of(&kept), dropped)
}

/// Iterates from `start`, which is `arm` as it is.
fn descend(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    scales: Vec<f64>,
    start: Normal,
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior<'_>,
) -> Solved {
    let mut here = start;
    here.add(
        &Linearised {
            arm,
            unknowns,
            scales: &scales,
            sigmas,
        },
        prior,
    );
    let mut damping = 0.0_f64;
    let mut iterations = 1;
    let mut converged = false;
    let equations: usize = observations.iter().map(|o| o.equations()).sum();
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
        // What the linear model promises, in units of the noise squared.
        let promised = step.dot(&here.gradient);
        if promised <= enough(here.cost) {
            converged = true;
            break;
        }
        let near = iterations > 1 && promised <= NEAR * equations as f64;
        if near && let Some(end) = chord(arm, unknowns, &scales, &here, observations, sigmas, prior)
        {
            *arm = end.arm;
            return end
                .triangle
                .solved(unknowns, &scales, end.cost, equations, iterations, true);
        }
        here.forget();
        let mut there_arm = arm.clone();
        apply(&mut there_arm, unknowns, &scaled(&step));
        let at = Linearised {
            arm: &there_arm,
            unknowns,
            scales: &scales,
            sigmas,
        };
        let mut there = Normal::new(&at, observations);
        there.add(&at, prior);
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
    last.solved(unknowns, &scales, cost, equations, iterations, converged)
}

/// What a step may still promise when the iterations are at their end, of a fit that costs
/// `cost`. In units of the noise squared: a ten-thousandth of one standard deviation in all,
/// and the last step leaves the square of that. Where the model is far from the
/// measurements, the same of what it leaves.
fn enough(cost: f64) -> f64 {
    1e-8_f64.max(1e-11 * cost)
}

/// A step that promises less than this an equation is so short that the Jacobian is the same
/// after it, to a few thousandths.
const NEAR: f64 = 1e-2;

/// Where [`chord`] came to.
struct End {
    arm: ArmModel,
    triangle: Triangle,
    cost: f64,
}

/// The last steps with one factorisation of the Jacobian, that of `here`: each leaves a few
/// thousandths of the one before (chord method; Dennis and Schnabel 1983, 6.2). `None` where
/// they do not shrink so, or where the Jacobian was too large to be kept.
fn chord(
    arm: &ArmModel,
    unknowns: &[Unknown],
    scales: &[f64],
    here: &Normal,
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior<'_>,
) -> Option<End> {
    if !prior.is_none() {
        return None;
    }
    let at = Linearised {
        arm,
        unknowns,
        scales,
        sigmas,
    };
    let triangle = here.triangle(&at, observations, prior);
    let mut there = arm.clone();
    let scaled =
        |step: &DVector<f64>| -> Vec<f64> { step.iter().zip(scales).map(|(x, s)| x * s).collect() };
    let mut step = triangle.step()?;
    let mut before = f64::INFINITY;
    loop {
        apply(&mut there, unknowns, &scaled(&step));
        let (cost, gradient) = here.elsewhere(&there, observations, sigmas)?;
        step = triangle.step_along(&gradient)?;
        let promised = step.dot(&gradient);
        if cost > here.cost {
            return None;
        }
        if promised <= enough(cost) {
            apply(&mut there, unknowns, &scaled(&step));
            return Some(End {
                arm: there,
                triangle,
                cost: (cost - promised).max(0.0),
            });
        }
        if promised.is_nan() || promised > 1e-2 * before {
            return None;
        }
        before = promised;
    }
}

impl Triangle {
    fn solved(
        self,
        unknowns: &[Unknown],
        scales: &[f64],
        cost: f64,
        equations: usize,
        iterations: usize,
        converged: bool,
    ) -> Solved {
        let mut covariance = self
            .covariance()
            .unwrap_or_else(|| DMatrix::zeros(unknowns.len(), unknowns.len()));
        for (column, by) in covariance.column_iter_mut().zip(scales) {
            for (x, scale) in column.into_iter().zip(scales) {
                *x *= scale * by;
            }
        }
        Solved {
            unknowns: unknowns.to_vec(),
            covariance,
            triangle: self.r,
            cost,
            equations,
            iterations,
            converged,
        }
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
