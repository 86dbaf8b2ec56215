//! One more column, chosen by the rows of the fit and asked of rows that no fit has seen.
//!
//! Whatever was chosen among many is paid for on the rows that it was chosen by; on the others
//! it is a single question with a known sign, since errors of the fit's parameters do not
//! depend on what the fit leaves. The two chances are combined as Fisher's (1932).

use nalgebra::{DMatrix, DVector, Dyn, linalg::Cholesky};

use super::chance::{ln_chi_square, ln_normal};
use super::model::Extended;
use super::space::Space;
use crate::identify::observation::{Observation, Sigmas};

/// What is left of the rows of a fit and of rows that it has not seen.
pub(super) struct Confirmation {
    /// Rows of the fit.
    pub(super) space: Space,
    jacobian: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    unseen_jacobian: DMatrix<f64>,
    unseen_residual: DVector<f64>,
    /// Standard deviation of what is left of the fit's rows.
    deviation: f64,
}

impl Confirmation {
    /// `None` where the fit's columns have no solution.
    pub(super) fn new(
        model: &Extended,
        fitted: &[&Observation],
        unseen: &[&Observation],
        sigmas: Sigmas,
    ) -> Option<Self> {
        let (linear, space) = model.space(fitted, sigmas);
        let other = model.linear(unseen, sigmas);
        let normal = linear.jacobian.tr_mul(&linear.jacobian);
        let freedom = space.residual.len().saturating_sub(linear.jacobian.ncols());
        Some(Self {
            deviation: (space.rss / freedom.max(1) as f64).sqrt(),
            space,
            jacobian: linear.jacobian,
            factor: normal.cholesky()?,
            unseen_jacobian: other.jacobian,
            unseen_residual: other.residual,
        })
    }

    /// Logarithm of the chance that `column` reduces the fitted rows' residual as it does,
    /// before paying for any choice; `None` where the model has it already. Rows of the fit
    /// first, the others after them.
    pub(super) fn ln_p(&self, column: &DVector<f64>) -> Option<f64> {
        let own = column.rows(0, self.space.residual.len());
        let along = self.space.basis.tr_mul(&own);
        let left = own.norm_squared() - along.norm_squared();
        // a thousandth of the column's own is not told from what the model has
        if left < 1e-3 * own.norm_squared() {
            return None;
        }
        let reduction = own.dot(&self.space.residual).powi(2) / left;
        Some(self.space.judge(reduction, 1.0).ln_p)
    }

    /// Logarithm of the chance of `column`, chosen with chance `ln_p` on the rows of the fit
    /// (all choices paid for), on these and the other rows together.
    pub(super) fn together(&self, column: &DVector<f64>, ln_p: f64) -> f64 {
        let seen = self.space.residual.len();
        let own = column.rows(0, seen);
        let other = column.rows(seen, column.len() - seen);
        if other.is_empty() {
            return ln_p;
        }
        // what the column does to other rows once the parameters have readjusted
        let readjusted = self.factor.solve(&self.jacobian.tr_mul(&own));
        let effect = other - &self.unseen_jacobian * readjusted;
        let sign = own.dot(&self.space.residual).signum();
        let mut spread = self.unseen_jacobian.tr_mul(&effect);
        self.factor
            .l_dirty()
            .solve_lower_triangular_mut(&mut spread);
        let variance = effect.norm_squared() + spread.norm_squared();
        let standard = sign * effect.dot(&self.unseen_residual)
            / (variance.sqrt() * self.deviation).max(f64::MIN_POSITIVE);
        let both = ln_p.min(0.0) + ln_normal(standard);
        ln_chi_square(-2.0 * both, 4.0)
    }
}
