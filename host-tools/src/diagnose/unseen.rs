//! Do rows that no fit has seen fit as well as those of the fit?
//!
//! A model that bends to what it lacks fits its own rows well and others badly. Both kinds of
//! rows are compared by errors that the right model would make alike: the residual of a fitted
//! row as if it had been left out, the error of another row less what the parameters'
//! uncertainty adds. No declared noise enters.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::chance::ln_normal;
use super::curve;
use super::hypothesis::Members;
use super::model::Extended;
use crate::identify::observation::{Observation, Sigmas};

/// Chance below which other rows are called worse.
const LEVEL: f64 = 0.003;

/// Rows of either kind without which there is nothing to compare.
const LEAST: usize = 8;

/// Rows that no fit has seen against those of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unseen {
    /// Their errors over the expected, root mean square.
    pub ratio: f64,
    /// Chance of that where nothing is missing.
    pub p_value: f64,
    /// True where chance does not explain it.
    pub worse: bool,
}

/// Compares `verify` with the `fitted` rows of `model`; `None` for too few rows.
pub fn unseen(
    model: &Extended,
    fitted: &[&Observation],
    verify: &[&Observation],
    sigmas: Sigmas,
) -> Option<Unseen> {
    if fitted.len() < LEAST || verify.len() < LEAST {
        return None;
    }
    let (columns, residual) = whole(model, fitted, sigmas);
    let mut normal = columns.transpose() * &columns;
    let curves = model.accepted.iter().filter_map(|h| match h.members {
        Members::Curve(smooth) => Some(smooth),
        _ => None,
    });
    let mut at = model.fit.unknowns.len();
    for smooth in curves {
        let mut corner = normal.view_mut((at, at), (curve::CELLS, curve::CELLS));
        corner += curve::precision(smooth);
        at += curve::CELLS;
    }
    let factor = normal.cholesky()?;
    let sizes =
        |columns: &DMatrix<f64>, residual: &DVector<f64>, rows: &[&Observation], own: bool| {
            let mut spread = columns.transpose();
            factor.l_dirty().solve_lower_triangular_mut(&mut spread);
            let mut start = 0;
            let size = |o: &&Observation| {
                let n = o.equations();
                let lever = spread.columns(start, n);
                let lever = lever.transpose() * lever;
                let one = DMatrix::<f64>::identity(n, n);
                let variance = if own { one - lever } else { one + lever };
                let eigen = SymmetricEigen::new(variance);
                let along = eigen.eigenvectors.tr_mul(&residual.rows(start, n));
                let squares = along.zip_map(&eigen.eigenvalues, |x, l| x * x / l.max(1e-3));
                start += n;
                (squares.sum() / n.max(1) as f64).sqrt()
            };
            rows.iter().map(size).collect::<Vec<f64>>()
        };
    let own = sizes(&columns, &residual, fitted, true);
    let (columns, residual) = whole(model, verify, sigmas);
    let other = sizes(&columns, &residual, verify, false);
    let moments = |x: &[f64]| {
        let n = x.len() as f64;
        let mean = x.iter().sum::<f64>() / n;
        (
            mean,
            x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n,
        )
    };
    let square = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64;
    let ((a, va), (b, vb)) = (moments(&own), moments(&other));
    let p_value = ln_normal((b - a) / (va + vb).sqrt().max(f64::MIN_POSITIVE)).exp();
    Some(Unseen {
        ratio: (square(&other) / square(&own).max(f64::MIN_POSITIVE)).sqrt(),
        p_value,
        worse: p_value < LEVEL,
    })
}

/// Columns of everything that was fitted, cells of curves last, and the residual.
fn whole(
    model: &Extended,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> (DMatrix<f64>, DVector<f64>) {
    let linear = model.linear(observations, sigmas);
    let mut columns = linear.jacobian;
    for curve in &model.arm.curves {
        let cells = curve::columns(&model.arm, curve.joint, observations, sigmas);
        let at = columns.ncols();
        columns = columns.resize_horizontally(at + cells.ncols(), 0.0);
        columns.columns_mut(at, cells.ncols()).copy_from(&cells);
    }
    (columns, linear.residual)
}
