//! Does a candidate help on rows that did not take part in fitting it?
//!
//! Cross-validation with refit of everything, on random folds and on blocks contiguous in
//! row order and in joint space. Rows that repeat a pose stay together.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::space::reduction;
use crate::identify::folds::scatter;
pub use crate::identify::folds::{Blocks, folds};
use crate::identify::observation::Observation;

/// Beyond the readings of all other rows by more than this share of their range, a row lies
/// apart.
pub(super) const APART: f64 = 0.5;

/// The same with rows that lie apart from all other folds dealt out to all of them; `None` where
/// there are none. What a fold that holds all of them would be predicted from cannot choose
/// between explanations that differ nowhere else.
pub fn dealt_out(observations: &[&Observation], fold: &[usize]) -> Option<Vec<usize>> {
    let count = fold.iter().max().map_or(0, |m| m + 1);
    let joints = observations.first().map_or(0, |o| o.q.len());
    let mut apart = vec![false; fold.len()];
    for j in 0..joints {
        for f in 0..count {
            let rows = || observations.iter().zip(fold.iter());
            let others = rows().filter(|(_, fold)| **fold != f).map(|(o, _)| o.q[j]);
            let [low, high] = others.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], q| {
                [a.min(q), b.max(q)]
            });
            let margin = APART * (high - low);
            for ((o, fold), apart) in rows().zip(&mut apart) {
                *apart |= *fold == f && (o.q[j] < low - margin || o.q[j] > high + margin);
            }
        }
    }
    // rows of one pose together
    let mut next = std::collections::HashMap::new();
    let mut dealt = fold.to_vec();
    for ((o, fold), apart) in observations.iter().zip(&mut dealt).zip(&apart) {
        if *apart {
            let place = next.len() % count;
            *fold = *next.entry(scatter(&o.q)).or_insert(place);
        }
    }
    apart.contains(&true).then_some(dealt)
}

/// Held-back squared error of every observation, fitted without and with more columns.
pub struct Comparison {
    /// Without them.
    pub without: Vec<f64>,
    /// With them.
    pub with: Vec<f64>,
}

impl Comparison {
    /// Mean gain over its standard error, over the observations.
    pub fn t(&self) -> f64 {
        let n = self.without.len().max(2) as f64;
        let gains = || self.without.iter().zip(&self.with).map(|(a, b)| a - b);
        let mean = gains().sum::<f64>() / n;
        let variance = gains().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean / (variance / n).sqrt().max(1e-300)
    }

    /// Both together.
    pub fn and(&self, other: &Self) -> Self {
        let joined = |a: &[f64], b: &[f64]| [a, b].concat();
        Self {
            without: joined(&self.without, &other.without),
            with: joined(&self.with, &other.with),
        }
    }

    /// Held-back error with over without, root mean square.
    pub fn ratio(&self) -> f64 {
        let sum = |v: &[f64]| v.iter().sum::<f64>().max(1e-300);
        (sum(&self.with) / sum(&self.without)).sqrt()
    }
}

/// Columns cut into folds, so that any of them can be fitted on all folds but one.
///
/// A direction that the remaining rows do not show stays at the drawing: one unit of every
/// scaled column counts as one standard deviation.
pub struct HeldBack<'a> {
    fold: &'a [usize],
    equations: Vec<usize>,
    /// Columns of the model so far.
    base: usize,
    /// Rows of each fold: columns of the model so far, further columns, residual.
    blocks: Vec<DMatrix<f64>>,
    grams: Vec<DMatrix<f64>>,
    total: DMatrix<f64>,
}

impl<'a> HeldBack<'a> {
    /// `base`: columns of the model so far, `extra`: columns of candidates; one row an
    /// equation.
    pub fn new(
        observations: &[&Observation],
        fold: &'a [usize],
        base: &DMatrix<f64>,
        extra: &DMatrix<f64>,
        residual: &DVector<f64>,
    ) -> Self {
        let (p, k) = (base.ncols(), extra.ncols());
        let count = fold.iter().max().map_or(0, |m| m + 1);
        let equations: Vec<usize> = observations.iter().map(|o| o.equations()).collect();
        let mut rows: Vec<Vec<usize>> = vec![Vec::new(); count];
        let mut start = 0;
        for (&n, &f) in equations.iter().zip(fold) {
            rows[f].extend(start..start + n);
            start += n;
        }
        let block = |rows: &Vec<usize>| {
            let mut block = DMatrix::zeros(rows.len(), p + k + 1);
            for (c, mut column) in block.column_iter_mut().enumerate() {
                for (to, &from) in column.iter_mut().zip(rows) {
                    *to = if c < p {
                        base[(from, c)]
                    } else if c < p + k {
                        extra[(from, c - p)]
                    } else {
                        residual[from]
                    };
                }
            }
            block
        };
        let blocks: Vec<DMatrix<f64>> = rows.iter().map(block).collect();
        let grams: Vec<DMatrix<f64>> = blocks.iter().map(|b| b.transpose() * b).collect();
        let none = DMatrix::zeros(p + k + 1, p + k + 1);
        Self {
            fold,
            equations,
            base: p,
            total: grams.iter().fold(none, |sum, g| sum + g),
            blocks,
            grams,
        }
    }

    /// Held-back errors without and with some further columns. `prior`: inverse covariance of
    /// these, where that is not the unit matrix.
    pub fn compare(&self, extra: Range<usize>, prior: Option<&DMatrix<f64>>) -> Comparison {
        let mut comparison = self.nothing();
        for f in 0..self.blocks.len() {
            let rest = &self.total - &self.grams[f];
            self.predict(f, &rest, extra.clone(), prior, &mut comparison);
        }
        comparison
    }

    /// Held-back errors without and with the best of several groups of columns, each fold
    /// choosing its own: what choosing is worth and not what was chosen. Also returns the
    /// choices. `ln_weights`: one a group, as in a [`Hypothesis`].
    ///
    /// [`Hypothesis`]: super::hypothesis::Hypothesis
    pub fn nested(
        &self,
        groups: &[(usize, usize)],
        ln_weights: &[f64],
    ) -> (Comparison, Vec<usize>) {
        let p = self.base;
        let last = self.total.ncols() - 1;
        let mut comparison = self.nothing();
        let mut choices = Vec::new();
        for f in 0..self.blocks.len() {
            let rest = &self.total - &self.grams[f];
            let mut corner = rest.view((0, 0), (p, p)).into_owned();
            for i in 0..p {
                corner[(i, i)] += 1.0;
            }
            let Some(factor) = corner.cholesky() else {
                continue;
            };
            let mut whitened = rest.view((0, p), (p, last + 1 - p)).into_owned();
            factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
            let residual = whitened.column(last - p).into_owned();
            let rss = rest[(last, last)] - residual.norm_squared();
            let freedom = self.effective(f);
            let worth = |&(start, len): &(usize, usize), ln_weight: f64| {
                let w = whitened.columns(start, len);
                let gram = rest.view((p + start, p + start), (len, len)) - w.transpose() * w;
                let z = rest.view((p + start, last), (len, 1)).column(0) - w.tr_mul(&residual);
                let (reduction, directions) = reduction(gram, &z.into_owned());
                let left = (rss - reduction).max(1e-12 * rss).max(1e-300);
                freedom * (rss / left).ln() - directions * freedom.ln() + 2.0 * ln_weight
            };
            let worths: Vec<f64> = groups
                .iter()
                .zip(ln_weights)
                .map(|(group, &ln_weight)| worth(group, ln_weight))
                .collect();
            let best =
                (0..groups.len()).max_by(|&a, &b| worths[a].total_cmp(&worths[b]).then(b.cmp(&a)));
            let Some(best) = best else {
                continue;
            };
            let (start, len) = groups[best];
            self.predict(f, &rest, start..start + len, None, &mut comparison);
            choices.push(best);
        }
        (comparison, choices)
    }

    /// Equations of all folds but `f` that count as independent.
    fn effective(&self, f: usize) -> f64 {
        let rest = self.equations.iter().zip(self.fold);
        let counts = rest.filter(|&(_, &fold)| fold != f).map(|(&n, _)| n.min(6));
        counts.sum::<usize>().max(1) as f64
    }

    fn nothing(&self) -> Comparison {
        Comparison {
            without: vec![0.0; self.fold.len()],
            with: vec![0.0; self.fold.len()],
        }
    }

    /// Predicts fold `f` from `rest`, the products of all others.
    fn predict(
        &self,
        f: usize,
        rest: &DMatrix<f64>,
        extra: Range<usize>,
        prior: Option<&DMatrix<f64>>,
        into: &mut Comparison,
    ) {
        let p = self.base;
        let last = rest.ncols() - 1;
        let all: Vec<usize> = (0..p).chain(extra.map(|k| p + k)).collect();
        let predict = |columns: &[usize]| {
            let mut normal = rest.select_columns(columns).select_rows(columns);
            for i in 0..columns.len() {
                match prior {
                    Some(prior) if i >= p => {
                        for j in p..columns.len() {
                            normal[(i, j)] += prior[(i - p, j - p)];
                        }
                    }
                    _ => normal[(i, i)] += 1.0,
                }
            }
            let right = rest.select_columns(&[last]).select_rows(columns);
            let solution = normal
                .cholesky()
                .map_or_else(|| DMatrix::zeros(columns.len(), 1), |c| c.solve(&right));
            self.blocks[f].column(last)
                - self.blocks[f].select_columns(columns) * solution.column(0)
        };
        let (without, with) = (predict(&all[..p]), predict(&all));
        let mut at = 0;
        for (i, &n) in self.equations.iter().enumerate() {
            if self.fold[i] == f {
                into.without[i] = without.rows(at, n).norm_squared();
                into.with[i] = with.rows(at, n).norm_squared();
                at += n;
            }
        }
    }
}
