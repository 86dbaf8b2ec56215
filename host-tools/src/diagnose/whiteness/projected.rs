//! The residual seen from where the fit left it.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::identify::arm::ArmModel;
use crate::identify::linearize::linearize;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::product::across;
use crate::identify::unknown::Unknown;

/// A whitened residual on the orthogonal complement of what was fitted.
#[derive(Clone, Debug)]
pub(crate) struct Projected {
    /// Orthonormal, equations x rank: what the fit could take up.
    pub(crate) basis: DMatrix<f64>,
    /// Measured minus predicted over sigma, none of it left in `basis`.
    pub(crate) residual: DVector<f64>,
    /// The same, each row scaled up to what it would be had the fit not bent to it:
    /// `(I - H_ii)^(-1/2) r_i`, of unit variance under independent noise.
    pub(crate) inflated: DVector<f64>,
    /// One minus leverage of every equation.
    kept: Vec<f64>,
    /// Where each row's equations begin, and the end of all.
    starts: Vec<usize>,
}

/// A direction that the fit took up to less than this is not inflated further.
const LEAST_KEPT: f64 = 0.05;

impl Projected {
    /// Of `observations` after a fit of `unknowns`.
    pub(crate) fn new(
        arm: &ArmModel,
        unknowns: &[Unknown],
        observations: &[&Observation],
        sigmas: Sigmas,
    ) -> Self {
        let scales: Vec<f64> = unknowns.iter().map(|u| u.expected(arm)).collect();
        let linear = linearize(arm, unknowns, &scales, observations, sigmas);
        let basis = orthonormal(linear.jacobian);
        let mut starts = vec![0];
        for o in observations {
            starts.push(starts.last().copied().unwrap_or(0) + o.equations());
        }
        let residual = &linear.residual - &basis * basis.tr_mul(&linear.residual);
        let mut inflated = residual.clone();
        let mut kept = vec![1.0; residual.len()];
        for pair in starts.windows(2) {
            let (from, count) = (pair[0], pair[1] - pair[0]);
            let rows = basis.rows(from, count);
            let left = DMatrix::identity(count, count) - rows * rows.transpose();
            for e in 0..count {
                kept[from + e] = left[(e, e)].clamp(0.0, 1.0);
            }
            let eigen = SymmetricEigen::new(left);
            let along = eigen.eigenvectors.tr_mul(&residual.rows(from, count));
            let scaled = along.zip_map(&eigen.eigenvalues, |x, l| x / l.max(LEAST_KEPT).sqrt());
            inflated
                .rows_mut(from, count)
                .copy_from(&(&eigen.eigenvectors * scaled));
        }
        Self {
            basis,
            residual,
            inflated,
            kept,
            starts,
        }
    }

    /// Number of observations.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Equations of row `i`.
    pub(crate) fn equations(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Residual of row `i`.
    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.residual.as_slice()[self.equations(i)]
    }

    /// One minus leverage of the equations of row `i`.
    pub(crate) fn kept(&self, i: usize) -> &[f64] {
        &self.kept[self.equations(i)]
    }

    /// Equations less what was fitted.
    pub(crate) fn freedom(&self) -> usize {
        self.residual.len().saturating_sub(self.basis.ncols())
    }

    /// Sum of squares.
    pub(crate) fn square(&self) -> f64 {
        self.residual.norm_squared()
    }

    /// Mean square of row `i`.
    pub(crate) fn row_square(&self, i: usize) -> f64 {
        let row = self.row(i);
        row.iter().map(|x| x * x).sum::<f64>() / row.len().max(1) as f64
    }

    /// The same with `columns` taken up as well.
    pub(crate) fn beyond(&self, columns: &DMatrix<f64>) -> Self {
        let more = orthonormal(self.free(columns));
        let (old, new) = (self.basis.ncols(), more.ncols());
        let mut basis = self.basis.clone().resize_horizontally(old + new, 0.0);
        basis.columns_mut(old, new).copy_from(&more);
        let residual = &self.residual - &more * more.tr_mul(&self.residual);
        Self {
            basis,
            residual,
            ..self.clone()
        }
    }

    /// The same after the prediction has changed by `change`.
    pub(crate) fn shifted(&self, change: &DVector<f64>) -> Self {
        let residual = &self.residual - change;
        Self {
            residual: &residual - &self.basis * self.basis.tr_mul(&residual),
            ..self.clone()
        }
    }

    /// By how much the sum of squares sinks when `columns` are fitted as well.
    pub(crate) fn explained(&self, columns: &DMatrix<f64>) -> f64 {
        orthonormal(self.free(columns))
            .tr_mul(&self.residual)
            .norm_squared()
    }

    /// The same for one column, and its coefficient.
    pub(crate) fn explained_by_one(&self, column: &DMatrix<f64>) -> (f64, f64) {
        let free = self.free(column);
        let (along, square) = (free.tr_mul(&self.residual).sum(), free.norm_squared());
        if square > 1e-12 * column.norm_squared() && square > 0.0 {
            (along * along / square, along / square)
        } else {
            (0.0, 0.0)
        }
    }

    /// Columns less what was fitted; those of which nothing but rounding is left are zero.
    fn free(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut free = self.complement(self.complement(columns.clone()));
        for (mut left, before) in free.column_iter_mut().zip(columns.column_iter()) {
            if left.norm() <= 1e-4 * before.norm() {
                left.fill(0.0);
            }
        }
        free
    }

    /// The part of every column that the fit cannot take up.
    pub(crate) fn complement(&self, columns: DMatrix<f64>) -> DMatrix<f64> {
        let taken = &self.basis * across(&self.basis, &columns);
        columns - taken
    }
}

/// Orthonormal basis of the columns, by Gram-Schmidt done twice; columns that are
/// combinations of others to rounding are left out.
fn orthonormal(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    let mut rank = 0;
    for k in 0..columns.ncols() {
        let mut column = columns.column(k).into_owned();
        let length = column.norm();
        for _ in 0..2 {
            let basis = columns.columns(0, rank);
            let along = basis.tr_mul(&column);
            column -= basis * along;
        }
        let rest = column.norm();
        if rest > 1e-9 * length && rest > 0.0 {
            columns.set_column(rank, &(column / rest));
            rank += 1;
        }
    }
    columns.resize_horizontally(rank, 0.0)
}
