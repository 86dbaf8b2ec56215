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

/// Indices of the rows that stand apart by their [`misfit`], ascending, at most a tenth of all, or
/// a fifth where more are wrong.
///
/// What the model lacks makes tails, and rows in the tails are what shows it. So the worst
/// tenth and not the median is the yardstick, and a row is only gross if the arm fits well
/// in its neighbourhood: what the arm does at a posture its neighbours do as well. Where more rows
/// than that are wrong, the worst fifth is.
pub fn gross(
    arm: &ArmModel,
    observations: &[&Observation],
    sigmas: Sigmas,
    misfit: &[f64],
) -> Vec<usize> {
    let many = many(observations, misfit);
    let (yardstick, most) = many.unwrap_or((worst(misfit, 10), misfit.len() / 10));
    let suspicious: Vec<usize> = (0..misfit.len())
        .filter(|&i| misfit[i] > APART * yardstick && misfit[i] > 1.0)
        .collect();
    if suspicious.is_empty() {
        return suspicious;
    }
    let levers = levers(arm, observations, sigmas);
    let mut apart: Vec<usize> = suspicious
        .into_iter()
        .filter(|&i| misfit[i] > APART * around(i, observations, &levers, misfit))
        .collect();
    apart.sort_by(|&a, &b| misfit[b].total_cmp(&misfit[a]).then(a.cmp(&b)));
    apart.truncate(most);
    apart.sort_unstable();
    apart
}

/// Where more than a tenth of the rows stand above the best of the worst fifth, scattered over the
/// file: that best one, and how many stand above it. Rows that follow each other are off for a
/// reason: the instrument was moved, or the arm has changed.
fn many(observations: &[&Observation], misfit: &[f64]) -> Option<(f64, usize)> {
    let fifth = worst(misfit, 5);
    let mut apart: Vec<(usize, bool)> = observations
        .iter()
        .zip(misfit)
        .map(|(o, &size)| (o.row, size > APART * fifth))
        .collect();
    apart.sort_unstable();
    let above = apart.iter().filter(|(_, is)| *is).count();
    let follow = apart.windows(2).filter(|w| w[0].1 && w[1].1).count();
    (above > misfit.len() / 10 && 2 * follow < above).then_some((fifth, above))
}

/// How many times (squared) a row stands above the best of the worst tenth where gross rows may
/// hide: of a hundred rows with normal noise the largest stands two to three times above it.
const SUSPICIOUS: f64 = 6.0;

/// True where some row is so far off that gross rows may hide, one pulling the fit from another.
pub fn may_hide(misfit: &[f64]) -> bool {
    let largest = misfit.iter().copied().fold(0.0, f64::max);
    largest > SUSPICIOUS * worst(misfit, 10)
}

/// The rows with weights by Cauchy's loss: how much each pulls a fit, the farther off the less.
/// A row's size is its mean squared residual over the median row's.
pub fn softened(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> Vec<Observation> {
    let misfit = misfit(arm, observations, sigmas);
    let mut sorted = misfit.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
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
    let tenth = worst(&before, 10);
    apart
        .into_iter()
        .filter(|&i| i >= fitted.len() && before[i] >= tenth)
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

/// Largest misfit of the nearest rows but for those that may be gross themselves.
fn around(i: usize, observations: &[&Observation], levers: &[f64], misfit: &[f64]) -> f64 {
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
    near.iter()
        .rev()
        .nth(BAD_NEIGHBOURS)
        .copied()
        .unwrap_or(0.0)
}
