//! Which rows are held back together, where a fit is judged by rows that it has not seen.
//! Rows that repeat a pose stay together.

use super::observation::Observation;

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
pub(crate) fn scatter(q: &[f64]) -> usize {
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
