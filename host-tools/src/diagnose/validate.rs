//! Does a candidate help on rows that did not take part in fitting it?
//!
//! Cross-validation with refit of everything, on random folds and on blocks contiguous in
//! row order and in joint space. Rows that repeat a pose stay together.

use nalgebra::{DMatrix, DVector};

use crate::identify::observation::Observation;

/// How rows are held back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blocks {
    /// Scattered, ten folds.
    Random,
    /// Contiguous in row order, five folds.
    Time,
    /// Contiguous in joint space, eight folds.
    Space,
}

/// Fold of every observation.
pub fn folds(observations: &[&Observation], levers: &[f64], blocks: Blocks) -> Vec<usize> {
    let n = observations.len();
    match blocks {
        Blocks::Random => observations.iter().map(|o| scatter(&o.q) % 10).collect(),
        Blocks::Time => {
            let mut fold: Vec<usize> = (0..n).map(|i| i * 5 / n.max(1)).collect();
            // repeated poses follow their first visit
            let mut first = std::collections::HashMap::new();
            for (i, o) in observations.iter().enumerate() {
                fold[i] = *first.entry(scatter(&o.q)).or_insert(fold[i]);
            }
            fold
        }
        Blocks::Space => {
            let mut fold = vec![0; n];
            let all: Vec<usize> = (0..n).collect();
            bisect(observations, levers, &all, 0, 3, &mut fold);
            fold
        }
    }
}

/// A number that depends on the joints alone, to a microradian.
fn scatter(q: &[f64]) -> usize {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for x in q {
        let rounded = (x * 1e6).round() as i64;
        hash = (hash ^ rounded as u64).wrapping_mul(0x0000_0100_0000_01b3);
        hash ^= hash >> 29;
    }
    (hash >> 8) as usize
}

/// Halves the rows at the median of the joint that spreads them farthest at the tool.
fn bisect(
    observations: &[&Observation],
    levers: &[f64],
    rows: &[usize],
    label: usize,
    depth: usize,
    fold: &mut [usize],
) {
    if depth == 0 || rows.len() < 2 {
        for &i in rows {
            fold[i] = label;
        }
        return;
    }
    let spread = |j: usize| {
        let mean = rows.iter().map(|&i| observations[i].q[j]).sum::<f64>() / rows.len() as f64;
        let square = |i: &usize| (observations[*i].q[j] - mean).powi(2);
        rows.iter().map(square).sum::<f64>() * levers[j] * levers[j]
    };
    let widest = (0..levers.len())
        .max_by(|&a, &b| spread(a).total_cmp(&spread(b)).then(b.cmp(&a)))
        .unwrap_or(0);
    let mut values: Vec<f64> = rows.iter().map(|&i| observations[i].q[widest]).collect();
    values.sort_by(f64::total_cmp);
    let median = values[values.len() / 2];
    let (low, high): (Vec<usize>, Vec<usize>) = rows
        .iter()
        .partition(|&&i| observations[i].q[widest] < median);
    bisect(observations, levers, &low, 2 * label, depth - 1, fold);
    bisect(observations, levers, &high, 2 * label + 1, depth - 1, fold);
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

    /// Held-back error with over without, root mean square.
    pub fn ratio(&self) -> f64 {
        let sum = |v: &[f64]| v.iter().sum::<f64>().max(1e-300);
        (sum(&self.with) / sum(&self.without)).sqrt()
    }
}

/// Refits `base` columns alone, and with `extra`, on all folds but one, and predicts that
/// one. A direction that the remaining rows do not show stays at the drawing: one unit of
/// every scaled column counts as one standard deviation. `prior`: inverse covariance of the
/// extra columns, where that is not theirs.
pub fn compare(
    observations: &[&Observation],
    fold: &[usize],
    base: &DMatrix<f64>,
    extra: &DMatrix<f64>,
    residual: &DVector<f64>,
    prior: Option<&DMatrix<f64>>,
) -> Comparison {
    let (p, k) = (base.ncols(), extra.ncols());
    let count = fold.iter().max().map_or(0, |m| m + 1);
    let mut starts = Vec::with_capacity(observations.len());
    let mut start = 0;
    for o in observations {
        starts.push(start);
        start += o.equations();
    }
    let blocks: Vec<DMatrix<f64>> = (0..count)
        .map(|f| {
            let rows: Vec<usize> = (0..observations.len())
                .filter(|&i| fold[i] == f)
                .flat_map(|i| starts[i]..starts[i] + observations[i].equations())
                .collect();
            let mut block = DMatrix::zeros(rows.len(), p + k + 1);
            for (to, &from) in rows.iter().enumerate() {
                for c in 0..p {
                    block[(to, c)] = base[(from, c)];
                }
                for c in 0..k {
                    block[(to, p + c)] = extra[(from, c)];
                }
                block[(to, p + k)] = residual[from];
            }
            block
        })
        .collect();
    let grams: Vec<DMatrix<f64>> = blocks.iter().map(|b| b.transpose() * b).collect();
    let total = grams
        .iter()
        .fold(DMatrix::zeros(p + k + 1, p + k + 1), |sum, g| sum + g);
    let mut comparison = Comparison {
        without: vec![0.0; observations.len()],
        with: vec![0.0; observations.len()],
    };
    for f in 0..count {
        let rest = &total - &grams[f];
        let predict = |n: usize| {
            let mut normal = rest.view((0, 0), (n, n)).into_owned();
            for i in 0..n.min(p) {
                normal[(i, i)] += 1.0;
            }
            for i in p..n {
                for j in p..n {
                    normal[(i, j)] += match prior {
                        Some(prior) => prior[(i - p, j - p)],
                        None => f64::from(u8::from(i == j)),
                    };
                }
            }
            let right = rest.view((0, p + k), (n, 1)).into_owned();
            let solution = normal
                .cholesky()
                .map_or_else(|| DMatrix::zeros(n, 1), |c| c.solve(&right));
            blocks[f].column(p + k) - blocks[f].columns(0, n) * solution.column(0)
        };
        let (without, with) = (predict(p), predict(p + k));
        let mut at = 0;
        for (i, o) in observations.iter().enumerate() {
            if fold[i] == f {
                let n = o.equations();
                comparison.without[i] = without.rows(at, n).norm_squared();
                comparison.with[i] = with.rows(at, n).norm_squared();
                at += n;
            }
        }
    }
    comparison
}
