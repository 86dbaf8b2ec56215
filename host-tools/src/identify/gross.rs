//! Gross errors: rows whose measurement is wrong, as against rows that the model explains
//! badly.

use super::arm::ArmModel;
use super::evaluator::Evaluator;
use super::observation::{Observation, Sigmas};
use super::solve::misfit;

/// How many times (squared) a gross row stands above the best of the worst tenth of all
/// rows, and above its neighbours.
const APART: f64 = 36.0;

/// Nearest rows in joint space that a row is compared with.
const NEIGHBOURS: usize = 10;

/// Of these, how many may be gross as well: a third. Of ten rows among which every twentieth
/// is gross, more are so once in a thousand times; a region that fits badly holds more.
const BAD_NEIGHBOURS: usize = 3;

/// The same where up to a third of all rows are gross, scattered: of ten rows more are so once in
/// fifty times or less.
const BAD_NEIGHBOURS_OF_MANY: usize = 6;

/// One row of so many is gross, or more: then the worst tenth is no yardstick for sure.
const MANY: usize = 15;

/// Indices of the rows that stand apart by their [`misfit`], ascending, at most a tenth of all, or
/// a third where they are scattered.
///
/// What the model lacks makes tails, and rows in the tails are what shows it. So the worst
/// tenth and not the median is the yardstick, and a row is only gross if the arm fits well
/// in its neighbourhood: what the arm does at a posture its neighbours do as well. Where rows that
/// are wrong may be more than that, the worst third is.
pub fn gross(
    arm: &ArmModel,
    observations: &[&Observation],
    sigmas: Sigmas,
    misfit: &[f64],
) -> Vec<usize> {
    let n = misfit.len();
    let (yardstick, most, bad) = match many(observations, misfit) {
        Some((best, above)) => (best, above, BAD_NEIGHBOURS_OF_MANY),
        None => (worst(misfit, 10), n / 10, BAD_NEIGHBOURS),
    };
    let suspicious: Vec<usize> = (0..misfit.len())
        .filter(|&i| misfit[i] > APART * yardstick && misfit[i] > 1.0)
        .collect();
    if suspicious.is_empty() {
        return suspicious;
    }
    let levers = levers(arm, observations, sigmas);
    let mut apart: Vec<usize> = suspicious
        .into_iter()
        .filter(|&i| misfit[i] > APART * around(i, observations, &levers, misfit, bad))
        .collect();
    apart.sort_by(|&a, &b| misfit[b].total_cmp(&misfit[a]).then(a.cmp(&b)));
    apart.truncate(most);
    apart.sort_unstable();
    apart
}

/// Where one row in fifteen or more stands above the best of the worst third: that best one, and how
/// many stand above it. They have to be scattered over the file and over what is written
/// down of the rows: rows that follow each other, or that carry a load, are off for a reason.
fn many(observations: &[&Observation], misfit: &[f64]) -> Option<(f64, usize)> {
    let best = worst(misfit, 3);
    let mut rows: Vec<(&Observation, bool)> = observations
        .iter()
        .zip(misfit)
        .map(|(&o, &size)| (o, size > APART * best))
        .collect();
    rows.sort_unstable_by_key(|(o, _)| o.row);
    let above = rows.iter().filter(|(_, is)| *is).count();
    let follow = rows.windows(2).filter(|w| w[0].1 && w[1].1).count();
    let scattered = 2 * follow < above && !explained(&rows);
    (MANY * above > misfit.len() && scattered).then_some((best, above))
}

/// Standard errors of a correlation from which on it is no chance.
const CORRELATED: f64 = 4.0;

/// True where rows that stand apart go with the payload, a temperature, a placement of the instrument or
/// the direction of a last move.
fn explained(rows: &[(&Observation, bool)]) -> bool {
    let conditions = |o: &Observation| -> Vec<f64> {
        let mut all = vec![o.ambient.payload, o.session as f64];
        all.extend(o.ambient.temperature);
        all.extend(&o.direction);
        all
    };
    let apart: Vec<f64> = rows
        .iter()
        .map(|(_, is)| f64::from(u8::from(*is)))
        .collect();
    let columns: Vec<Vec<f64>> = rows.iter().map(|(o, _)| conditions(o)).collect();
    let count = columns.first().map_or(0, Vec::len);
    (0..count).any(|c| {
        let column = columns.iter().filter_map(|row| row.get(c).copied());
        let known = column
            .zip(apart.iter().copied())
            .filter(|(x, _)| x.is_finite());
        correlation(&known.collect::<Vec<_>>()) > CORRELATED
    })
}

/// Size of the correlation of pairs in its standard errors under independence; 0 for constants.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| of(p.0 - x, p.1 - y)).sum::<f64>();
    let squares = sum(&|a, _| a * a) * sum(&|_, b| b * b);
    match squares > 0.0 {
        true => sum(&|a, b| a * b).abs() / squares.sqrt() * n.sqrt(),
        false => 0.0,
    }
}

/// How many times (squared) a row stands above the best of the worst tenth where gross rows may
/// hide: of a hundred rows with normal noise the largest stands two to three times above it.
const SUSPICIOUS: f64 = 6.0;

/// How many times (squared) the best of the worst tenth stands above the median row where more than
/// a tenth of the rows may be gross: with normal noise three times, six where rows are single
/// numbers.
const HEAVY: f64 = 10.0;

/// True where some rows are so far off that gross rows may hide, one pulling the fit from another.
pub fn may_hide(misfit: &[f64]) -> bool {
    let largest = misfit.iter().copied().fold(0.0, f64::max);
    let tenth = worst(misfit, 10);
    largest > SUSPICIOUS * tenth || tenth > HEAVY * median(misfit)
}

/// The median row's misfit.
pub fn median(misfit: &[f64]) -> f64 {
    worst(misfit, 2)
}

/// The rows with weights by Cauchy's loss: how much each pulls a fit, the farther off the less.
/// A row's size is its mean squared residual over the median row's.
pub fn softened(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> Vec<Observation> {
    let misfit = misfit(arm, observations, sigmas);
    let median = median(&misfit);
    let weighted = observations.iter().zip(misfit).map(|(&o, size)| {
        let mut o = o.clone();
        o.weight /= (1.0 + 0.5 * size / median.max(f64::MIN_POSITIVE)).sqrt();
        o
    });
    weighted.collect()
}

/// The best of the worst of `parts` parts.
fn worst(misfit: &[f64], parts: usize) -> f64 {
    let mut sorted = misfit.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = sorted.len() * (parts - 1) / parts;
    sorted.get(place).copied().unwrap_or(0.0)
}

/// Rows of `unseen`, by their number in the file, that stand apart under the complete model and
/// are among the worst under geometry alone as well: whatever is wrong with them, it is not
/// what was added to geometry.
pub fn gross_unseen(
    geometric: &ArmModel,
    complete: &ArmModel,
    fitted: &[&Observation],
    unseen: &[&Observation],
    sigmas: Sigmas,
) -> Vec<usize> {
    if unseen.is_empty() {
        return Vec::new();
    }
    let all: Vec<&Observation> = fitted.iter().chain(unseen).copied().collect();
    let apart = gross(complete, &all, sigmas, &misfit(complete, &all, sigmas));
    let before = misfit(geometric, &all, sigmas);
    let mut sorted = before.clone();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let among = (2 * apart.len()).max(all.len() / 10);
    let least = sorted.get(among).copied().unwrap_or(0.0);
    apart
        .into_iter()
        .filter(|&i| i >= fitted.len() && before[i] >= least)
        .map(|i| all[i].row)
        .collect()
}

/// How far the tool moves per unit of each joint, root mean square over the rows, m: what
/// makes distances in joint space comparable.
pub(crate) fn levers(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> Vec<f64> {
    let mut evaluator = Evaluator::new(arm, sigmas);
    let mut sums = vec![0.0; arm.joint_count()];
    for o in observations {
        evaluator.observe(o);
        for (j, sum) in sums.iter_mut().enumerate() {
            *sum += evaluator.joint_twist(j).linear.norm_squared();
        }
    }
    let n = observations.len().max(1) as f64;
    sums.into_iter().map(|s| (s / n).sqrt()).collect()
}

/// Largest misfit of the nearest rows but for `bad` that may be gross themselves.
fn around(
    i: usize,
    observations: &[&Observation],
    levers: &[f64],
    misfit: &[f64],
    bad: usize,
) -> f64 {
    let here = &observations[i].q;
    let mut distances: Vec<(f64, usize)> = observations
        .iter()
        .enumerate()
        .filter(|&(k, _)| k != i)
        .map(|(k, o)| {
            let each = here.iter().zip(&o.q).zip(levers);
            (each.map(|((a, b), l)| ((a - b) * l).powi(2)).sum(), k)
        })
        .collect();
    distances.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut near: Vec<f64> = distances
        .iter()
        .take(NEIGHBOURS)
        .map(|&(_, k)| misfit[k])
        .collect();
    near.sort_by(f64::total_cmp);
    near.iter().rev().nth(bad).copied().unwrap_or(0.0)
}
