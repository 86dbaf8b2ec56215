//! Arms that calibrate themselves: a loop must close at every pose, NH 1 and 2.
//!
//! `f(x, v) = 0` holds for the true parameters x and exact readings v of every pose. Where a
//! mechanism has more sensors than freedoms the loop is its own ([`ParallelDrive`]); where an
//! instrument measures the tool, it closes the loop ([`PlanarArm`]).

mod parallel_drive;
mod planar_arm;
mod study;

use nalgebra::{DMatrix, DVector};

use crate::observability::{Observability, Unobservable, scale_columns};

pub use parallel_drive::ParallelDrive;
pub use planar_arm::PlanarArm;
pub use study::{Study, study};

/// A loop that closes.
pub trait Loop {
    /// Names and units of the parameters.
    fn parameters(&self) -> Vec<(String, &'static str)>;

    /// Equations that one pose gives.
    fn equations(&self) -> usize;

    /// How far the loop is from closing with parameters `x` at the readings `v`, one number an
    /// equation; their derivatives by the parameters, row after row; and the standard deviation
    /// of each by the noise of the readings. `None` where it cannot be built at all.
    fn closure(&self, x: &[f64], v: &[f64]) -> Option<Closure>;
}

/// One pose of a [`Loop`].
#[derive(Clone, Debug, PartialEq)]
pub struct Closure {
    /// One an equation.
    pub residual: Vec<f64>,
    /// d residual / d parameters, row after row.
    pub gradient: Vec<f64>,
    /// Of each residual.
    pub sigma: Vec<f64>,
}

/// Result of [`identify`].
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// Parameters.
    pub x: Vec<f64>,
    /// Their standard errors by the noise of the readings.
    pub errors: Vec<f64>,
    /// Root mean square of the residuals over their standard deviations: 1 for a right model.
    pub misfit: f64,
    /// Linearisations used.
    pub iterations: usize,
}

/// Why a loop was not identified.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// It cannot be built with the parameters to start from, at this pose (from 0).
    Unbuilt(usize),
    /// These poses do not show all parameters.
    Unobservable(Unobservable),
    /// The steps did not vanish.
    NotConverged,
}

/// All poses of a loop, linearised.
struct Linearised {
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    /// What both are over, one an equation.
    sigmas: Vec<f64>,
}

/// Residual and Jacobian of all poses over `sigmas`, or over what they are here; the number of the first pose that cannot be built otherwise.
fn linearise(
    chain: &dyn Loop,
    x: &[f64],
    poses: &[Vec<f64>],
    sigmas: Option<&[f64]>,
) -> Result<Linearised, usize> {
    let (rows, columns) = (poses.len() * chain.equations(), x.len());
    let (mut numbers, mut residual) = (Vec::with_capacity(rows * columns), Vec::new());
    let mut here = Vec::with_capacity(rows);
    for (pose, v) in poses.iter().enumerate() {
        let closure = chain.closure(x, v).ok_or(pose)?;
        let parts = [&closure.residual, &closure.gradient, &closure.sigma];
        if parts.iter().any(|n| n.iter().any(|x| !x.is_finite())) {
            return Err(pose);
        }
        let rows = closure.gradient.chunks(columns);
        for ((f, row), sigma) in closure.residual.iter().zip(rows).zip(&closure.sigma) {
            let sigma = sigmas
                .and_then(|all| all.get(here.len()))
                .copied()
                .unwrap_or(*sigma);
            residual.push(f / sigma);
            numbers.extend(row.iter().map(|g| g / sigma));
            here.push(sigma);
        }
    }
    Ok(Linearised {
        jacobian: DMatrix::from_row_slice(rows, columns, &numbers),
        residual: DVector::from_vec(residual),
        sigmas: here,
    })
}

/// Observability of the parameters by a set of poses, columns of unit length (NH 3.1.2), rows
/// over their noise.
pub fn observe(chain: &dyn Loop, x: &[f64], poses: &[Vec<f64>]) -> Result<Observability, Failure> {
    let mut linear = linearise(chain, x, poses, None).map_err(Failure::Unbuilt)?;
    scale_columns(&mut linear.jacobian);
    Observability::of(&linear.jacobian, poses.len()).map_err(Failure::Unobservable)
}

const STEPS: usize = 60;

/// Least squares of what is left open of the loop over its noise, from `start`: Gauss-Newton,
/// NH 3 and 4, on columns of unit length. The noise of a residual changes with the parameters
/// a little: it is taken anew after each step, which is halved while it makes the sum over the
/// same noise larger or the loop impossible.
pub fn identify(
    chain: &dyn Loop,
    start: &[f64],
    poses: &[Vec<f64>],
) -> Result<Identified, Failure> {
    let mut x = start.to_vec();
    for iterations in 1..=STEPS {
        let Linearised {
            mut jacobian,
            residual,
            sigmas,
        } = linearise(chain, &x, poses, None).map_err(Failure::Unbuilt)?;
        let lengths = scale_columns(&mut jacobian);
        let svd = jacobian.clone().svd(true, true);
        Observability::of(&jacobian, poses.len()).map_err(Failure::Unobservable)?;
        let Ok(step) = svd.solve(&residual, 0.0) else {
            return Err(Failure::NotConverged);
        };
        // In standard errors of the parameters: far below one there is nothing left to gain.
        let small = step.norm() < 1e-9 * (1.0 + residual.norm());
        if small {
            let inverse = (jacobian.transpose() * &jacobian)
                .try_inverse()
                .ok_or(Failure::NotConverged)?;
            let freedom = residual.len().saturating_sub(x.len()).max(1);
            return Ok(Identified {
                errors: (lengths.iter().enumerate())
                    .map(|(k, length)| inverse[(k, k)].sqrt() / length)
                    .collect(),
                misfit: (residual.norm_squared() / freedom as f64).sqrt(),
                x,
                iterations,
            });
        }
        let mut share = 1.0;
        loop {
            let tried: Vec<f64> = (x.iter().zip(step.iter().zip(&lengths)))
                .map(|(x, (step, length))| x - share * step / length)
                .collect();
            if let Ok(there) = linearise(chain, &tried, poses, Some(&sigmas))
                && there.residual.norm() <= residual.norm() * (1.0 + 1e-12)
            {
                x = tried;
                break;
            }
            share /= 2.0;
            if share < 1e-6 {
                return Err(Failure::NotConverged);
            }
        }
    }
    Err(Failure::NotConverged)
}
