//! Do rows that belong together agree more than strangers do?

use nalgebra::DMatrix;

use super::projected::Projected;
use super::shapes::Design;
use super::{Group, Subject};
use crate::diagnose::chance::{ln_chi_square, ln_normal};
use crate::identify::observation::Observation;

/// Lags in row order.
const LAGS: usize = 5;
/// Largest difference of readings within one pose, rad or m.
const SAME_POSE: f64 = 1e-6;
/// Repeats that a test of them needs.
const LEAST_REPEATS: usize = 8;
/// A row's joint errors count as no longer than this, in medians: no single row decides.
const LONGEST: f64 = 3.0;

/// Which rows belong together.
pub(super) struct Quadratic<'a> {
    design: &'a Design,
    /// Pairs near in joint space.
    near: Vec<(usize, usize)>,
    /// Rows in rising order of each joint's reading.
    along: Vec<Vec<usize>>,
    /// Rows of one pose, two or more in each.
    repeats: &'a [Vec<usize>],
}

/// Statistics of one residual.
struct Statistics {
    near: f64,
    repeats: f64,
    lags: f64,
    runs: f64,
    along: Vec<f64>,
}

impl<'a> Quadratic<'a> {
    pub(super) fn new(
        design: &'a Design,
        observations: &[&Observation],
        repeats: &'a [Vec<usize>],
    ) -> Self {
        let n = observations.len();
        let neighbours = (n / 10).clamp(2, 6);
        let mut near = Vec::with_capacity(n * neighbours);
        let weighted: Vec<Vec<f64>> = observations
            .iter()
            .map(|o| o.q.iter().zip(&design.levers).map(|(q, l)| q * l).collect())
            .collect();
        let mut distances: Vec<(f64, usize)> = Vec::with_capacity(n);
        for (i, here) in weighted.iter().enumerate() {
            distances.clear();
            for (k, there) in weighted.iter().enumerate() {
                if k != i {
                    let each = here.iter().zip(there);
                    distances.push((each.map(|(a, b)| (a - b) * (a - b)).sum(), k));
                }
            }
            let order =
                |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            if distances.len() > neighbours {
                distances.select_nth_unstable_by(neighbours - 1, order);
                distances.truncate(neighbours);
            }
            near.extend(distances.iter().map(|&(_, k)| (i.min(k), i.max(k))));
        }
        near.sort_unstable();
        let joints = design.levers.len();
        let along = (0..joints)
            .map(|j| {
                let mut rows: Vec<usize> = (0..n).collect();
                let q = |i: usize| observations[i].q[j];
                rows.sort_by(|&a, &b| q(a).total_cmp(&q(b)).then(a.cmp(&b)));
                rows
            })
            .collect();
        Self {
            design,
            near,
            along,
            repeats,
        }
    }

    /// Joint errors of every row, one a column.
    fn joint_errors(&self, projected: &Projected, residual: &[f64]) -> DMatrix<f64> {
        let n = projected.len();
        let mut errors = DMatrix::zeros(self.design.levers.len(), n);
        for (i, solver) in self.design.solvers.iter().enumerate() {
            let row = residual.get(projected.equations(i)).unwrap_or(&[]);
            for (e, x) in row.iter().enumerate() {
                for j in 0..errors.nrows() {
                    errors[(j, i)] += solver[(j, e)] * x;
                }
            }
        }
        let mut lengths: Vec<f64> = errors.column_iter().map(|c| c.norm()).collect();
        let middle = lengths.len() / 2;
        let median = *lengths.select_nth_unstable_by(middle, f64::total_cmp).1;
        for mut column in errors.column_iter_mut() {
            let length = column.norm();
            if length > LONGEST * median {
                column *= LONGEST * median / length;
            }
        }
        // what all rows have in common makes no two of them alike
        let mean = errors.column_mean();
        for mut column in errors.column_iter_mut() {
            column -= &mean;
        }
        errors
    }

    fn statistics(&self, y: &DMatrix<f64>) -> Statistics {
        let agree = |i: usize, k: usize| y.column(i).dot(&y.column(k));
        let n = y.ncols();
        let power = y.norm_squared().max(f64::MIN_POSITIVE);
        let mut lags = 0.0;
        for lag in 1..=LAGS {
            let sum: f64 = (lag..n).map(|i| agree(i - lag, i)).sum();
            // Ljung and Box 1978: squares of the correlations, weighted by how many make them
            lags += sum * sum / (n - lag) as f64;
        }
        let mut runs = 0.0;
        for i in 1..n {
            for (a, b) in y.column(i - 1).iter().zip(y.column(i).iter()) {
                runs += (a * b).signum();
            }
        }
        let mut repeats = 0.0;
        for group in self.repeats {
            for (a, &i) in group.iter().enumerate() {
                repeats += group.iter().skip(a + 1).map(|&k| agree(i, k)).sum::<f64>();
            }
        }
        Statistics {
            near: self.near.iter().map(|&(i, k)| agree(i, k)).sum::<f64>() / power,
            repeats: repeats / power,
            lags: lags / (power * power),
            runs,
            along: self
                .along
                .iter()
                .enumerate()
                .map(|(j, rows)| {
                    let product =
                        |pair: &[usize], step: usize| y[(j, pair[0])] * y[(j, pair[step])];
                    let next: f64 = rows.windows(2).map(|w| product(w, 1)).sum();
                    let after: f64 = rows.windows(3).map(|w| product(w, 2)).sum();
                    (next + 0.5 * after) / power
                })
                .collect(),
        }
    }

    /// The tests and their values on every draw.
    pub(super) fn tests(&self, projected: &Projected, drawn: DMatrix<f64>) -> Vec<Group> {
        let drawn = projected.complement(drawn);
        let seen = self.statistics(&self.joint_errors(projected, projected.residual.as_slice()));
        let drawn: Vec<Statistics> = drawn
            .column_iter()
            .map(|column| {
                let residual: Vec<f64> = column.iter().copied().collect();
                self.statistics(&self.joint_errors(projected, &residual))
            })
            .collect();
        let lags = drawn.iter().map(|s| s.lags).collect();
        let mut groups = vec![squares_group(
            Subject::Succession,
            "errors of rows that follow one another are correlated",
            seen.lags,
            lags,
        )];
        let mut push = |subject: Subject, says: &str, value: &dyn Fn(&Statistics) -> f64| {
            groups.push(group(
                subject,
                says,
                value(&seen),
                drawn.iter().map(value).collect(),
            ));
        };
        push(
            Subject::Neighbourhood,
            "rows near in joint space err alike",
            &|s| s.near,
        );
        push(
            Subject::Succession,
            "errors keep their sign from row to row",
            &|s| s.runs,
        );
        let repeated: usize = self.repeats.iter().map(|g| g.len() - 1).sum();
        if repeated >= LEAST_REPEATS {
            push(Subject::Repeats, "rows of one pose err alike", &|s| {
                s.repeats
            });
        }
        for j in 0..self.along.len() {
            let says = format!("joint {} errs alike at like readings", j + 1);
            push(Subject::Joint(j), &says, &|s| s.along[j]);
        }
        groups
    }
}

fn mean_and_variance(drawn: &[f64]) -> (f64, f64) {
    let n = drawn.len().max(1) as f64;
    let mean = drawn.iter().sum::<f64>() / n;
    let variance = drawn.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
    (mean, variance)
}

/// A sum of squares against its draws, as chi-square of their mean and variance
/// (Satterthwaite 1946).
fn squares_group(subject: Subject, says: &str, seen: f64, drawn: Vec<f64>) -> Group {
    let (mean, variance) = mean_and_variance(&drawn);
    let freedom = 2.0 * mean * mean / variance.max(f64::MIN_POSITIVE);
    let chance = |x: f64| ln_chi_square(x / mean.max(f64::MIN_POSITIVE) * freedom, freedom);
    Group {
        subject,
        ln_p: chance(seen),
        drawn: drawn.iter().map(|&x| chance(x)).collect(),
        saw: format!("{says} ({:.1} times as much as by chance)", seen / mean),
    }
}

/// A statistic against its draws, as normal deviates of them.
fn group(subject: Subject, says: &str, seen: f64, drawn: Vec<f64>) -> Group {
    let (mean, variance) = mean_and_variance(&drawn);
    let deviation = variance.sqrt().max(f64::MIN_POSITIVE);
    let standard = |x: f64| (x - mean) / deviation;
    Group {
        subject,
        ln_p: ln_normal(standard(seen)),
        drawn: drawn.iter().map(|&x| ln_normal(standard(x))).collect(),
        saw: format!(
            "{says} ({:.1} standard deviations above chance)",
            standard(seen)
        ),
    }
}

/// Groups of rows that stand at the same readings.
pub(super) fn repeats(observations: &[&Observation]) -> Vec<Vec<usize>> {
    let mut rows: Vec<usize> = (0..observations.len()).collect();
    let key = |i: usize| -> Vec<i64> {
        let q = &observations[i].q;
        q.iter().map(|x| (x / SAME_POSE).round() as i64).collect()
    };
    rows.sort_by_cached_key(|&i| (key(i), i));
    rows.chunk_by(|&a, &b| key(a) == key(b))
        .filter(|group| group.len() > 1)
        .map(<[usize]>::to_vec)
        .collect()
}
