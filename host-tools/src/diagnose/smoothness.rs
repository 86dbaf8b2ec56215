//! How large and how smooth a joint's curve is, from the residual itself.
//!
//! The amplitudes of a curve are draws from its prior, so the residual beyond what geometry and
//! all effects can express is a draw from N(0, s² (I + E P⁻¹ Eᵀ)), E the projected columns, P the
//! prior's precision. The prior that makes what was measured likeliest is taken (restricted
//! maximum likelihood), the noise s known no better than the residual tells. Unlike
//! cross-validation this uses every row for both, and it has an answer to whether there is a
//! curve at all.

use nalgebra::{DMatrix, DVector};

use super::curve::{self, Smoothness};
use crate::identify::product::{across, gradient, gram};

/// Steps of value and order in the search for the likeliest, each pair finer than the last.
const STEPS: [(f64, f64); 4] = [(4.0, 2.0), (2.0, 1.5), (1.4, 1.2), (1.15, 1.08)];

/// The residual and a curve's columns beyond what the model expresses.
pub(super) struct Evidence {
    gram: DMatrix<f64>,
    with_residual: DVector<f64>,
    rss: f64,
    freedom: f64,
}

impl Evidence {
    /// `extra`: columns of the amplitudes of [`curve::waves`], `base` those of the model so far,
    /// held at the drawing by one unit of each; `freedom`: independent equations.
    pub(super) fn new(
        base: &DMatrix<f64>,
        extra: &DMatrix<f64>,
        residual: &DVector<f64>,
        freedom: f64,
    ) -> Option<Self> {
        let p = base.ncols();
        let normal = gram(base) + DMatrix::identity(p, p);
        let factor = normal.cholesky()?;
        let mut shared = across(base, extra);
        factor.l_dirty().solve_lower_triangular_mut(&mut shared);
        let mut along = gradient(base, residual);
        factor.l_dirty().solve_lower_triangular_mut(&mut along);
        Some(Self {
            gram: gram(extra) - gram(&shared),
            with_residual: gradient(extra, residual) - shared.tr_mul(&along),
            rss: residual.norm_squared() - along.norm_squared(),
            freedom,
        })
    }

    /// Logarithm of the likelihood of what was measured, over that without a curve.
    pub(super) fn of(&self, smooth: Smoothness) -> f64 {
        let prior = curve::precision_of_waves(smooth);
        let of_prior: f64 = prior.diagonal().iter().map(|p| p.ln()).sum();
        let Some(factor) = (&self.gram + prior).cholesky() else {
            return f64::NEG_INFINITY;
        };
        let solved = factor.solve(&self.with_residual);
        let left = (self.rss - self.with_residual.dot(&solved)).max(1e-12 * self.rss);
        let l = factor.l_dirty();
        let of_both: f64 = (0..l.nrows()).map(|i| 2.0 * l[(i, i)].ln()).sum();
        0.5 * (of_prior - of_both - self.freedom * (left / self.rss).ln())
    }

    /// Share of the squared residual that the curve takes.
    pub(super) fn share(&self, smooth: Smoothness) -> f64 {
        let factor = (&self.gram + curve::precision_of_waves(smooth)).cholesky();
        factor.map_or(0.0, |factor| {
            let found = factor.solve(&self.with_residual);
            let taken = 2.0 * found.dot(&self.with_residual) - found.dot(&(&self.gram * &found));
            taken / self.rss
        })
    }

    /// The likeliest, from `first` on, and the logarithm of its likelihood over that without a
    /// curve.
    pub(super) fn likeliest(&self, first: Smoothness) -> (Smoothness, f64) {
        let mut best = (first, self.of(first));
        for (value, order) in STEPS {
            loop {
                let tried = first_better(self, best, value, order);
                match tried {
                    Some(better) => best = better,
                    None => break,
                }
            }
        }
        best
    }
}

fn first_better(
    evidence: &Evidence,
    best: (Smoothness, f64),
    value: f64,
    order: f64,
) -> Option<(Smoothness, f64)> {
    let tried = best.0.neighbours(value, order);
    let tried = tried.into_iter().map(|s| (s, evidence.of(s)));
    // not for rounding's sake
    tried.into_iter().find(|t| t.1 > best.1 + 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Rows that read one joint all round, with a curve of `value` and `order` and noise of size 1.
    fn evidence(value: f64, order: f64, seed: u64) -> Evidence {
        let mut random = Random::new(seed, 0);
        let n = 400;
        let waves = curve::waves();
        let truth = Smoothness { value, order };
        let prior = curve::precision_of_waves(truth);
        let amplitudes: Vec<f64> = (0..waves.ncols())
            .map(|k| random.normal() / prior[(k, k)].sqrt())
            .collect();
        let cells = DMatrix::from_fn(n, curve::CELLS, |row, cell| {
            let here = (row * 7919 + 13) % curve::CELLS;
            if here == cell { 2e4 } else { 0.0 }
        });
        let extra = cells * waves;
        let noise = DVector::from_fn(n, |_, _| random.normal());
        let residual = &extra * DVector::from_vec(amplitudes) + noise;
        Evidence::new(&DMatrix::from_element(n, 1, 1e3), &extra, &residual, 399.0).unwrap()
    }

    #[test]
    fn size_and_order_of_a_curve_come_back() {
        let (mut values, mut orders) = (0.0, 0.0);
        for seed in 0..20 {
            let (found, worth) = evidence(3e-4, 12.0, seed).likeliest(Smoothness::FIRST);
            assert!(worth > 50.0, "{seed}: {worth}");
            values += (found.value / 3e-4).ln() / 20.0;
            orders += (found.order / 12.0).ln() / 20.0;
        }
        assert!(values.abs() < 0.1, "{values}");
        assert!(orders.abs() < 0.15, "{orders}");
    }

    #[test]
    fn noise_is_no_curve() {
        let worths = (0..200).map(|s| evidence(1e-9, 12.0, s).likeliest(Smoothness::FIRST).1);
        let likely = worths.filter(|&w| w > 3.0).count();
        // exp(-3) of them at most, by the bound that is used
        assert!(likely <= 10, "{likely} of 200");
    }
}
