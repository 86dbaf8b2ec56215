//! Choosing blocks: greedy, by exchange with a pool, by annealing in the joints themselves.

use nalgebra::DMatrix;

use super::Sensitivity;
use super::design::{Blocks, Covariance, gain};
use crate::random::Random;

/// Sweeps of exchange after which it is good enough; it usually ends by itself in five.
const SWEEPS: usize = 12;

/// Where poses come from: a pool of joint values with their blocks.
pub(crate) struct Pool {
    pub(crate) q: Vec<Vec<f64>>,
    pub(crate) blocks: Blocks,
}

/// `count` members of the pool that make the determinant of the information large: one after
/// the other, then exchanged as long as that gains. `fixed`: information that is there
/// already. Fedorov's exchange; every candidate's spread is kept up to date by rank-one
/// changes.
pub(crate) fn exchange(pool: &Pool, fixed: &DMatrix<f64>, count: usize) -> Vec<usize> {
    let Blocks { width, height, .. } = pool.blocks;
    let available = pool.blocks.len();
    // A hint of information makes the start regular; it is taken out again at the end.
    let mut scale = 0.0;
    for i in 0..available {
        scale += pool.blocks.get(i).iter().map(|x| x * x).sum::<f64>();
    }
    let hint = 1e-9 * scale / (available.max(1) * width.max(1)) as f64 + f64::MIN_POSITIVE;
    let start = fixed + DMatrix::identity(width, width) * hint;
    let Some(mut covariance) = Covariance::of(start.clone()) else {
        return Vec::new();
    };
    let mut spreads: Vec<Vec<f64>> = Vec::with_capacity(available);
    let refresh = |covariance: &Covariance, spreads: &mut Vec<Vec<f64>>| {
        spreads.clear();
        spreads.extend((0..available).map(|i| covariance.spread(pool.blocks.get(i))));
    };
    refresh(&covariance, &mut spreads);
    let mut chosen = vec![false; available];
    let mut members: Vec<usize> = Vec::with_capacity(count);
    let best = |spreads: &[Vec<f64>], chosen: &[bool]| {
        (0..available)
            .filter(|&i| !chosen[i])
            .map(|i| (i, gain(&spreads[i], height)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let change = |covariance: &mut Covariance, spreads: &mut [Vec<f64>], i: usize, sign: f64| {
        let Some((update, log_det)) = covariance.update(pool.blocks.get(i), sign) else {
            return false;
        };
        covariance.apply(&update, log_det);
        for (k, spread) in spreads.iter_mut().enumerate() {
            update.of_spread(pool.blocks.get(k), width, spread);
        }
        true
    };
    while members.len() < count.min(available) {
        let Some((i, _)) = best(&spreads, &chosen) else {
            break;
        };
        if !change(&mut covariance, &mut spreads, i, 1.0) {
            break;
        }
        chosen[i] = true;
        members.push(i);
        // The hint's huge variances leave rounding behind: clean up while they shrink.
        if members.len() * height <= 3 * width
            && let Some(clean) = inform(pool, &start, &members)
        {
            covariance = clean;
            refresh(&covariance, &mut spreads);
        }
    }
    for _ in 0..SWEEPS {
        let mut changed = false;
        for member in &mut members {
            let old = *member;
            if !change(&mut covariance, &mut spreads, old, -1.0) {
                continue;
            }
            chosen[old] = false;
            let back = gain(&spreads[old], height);
            let new = match best(&spreads, &chosen) {
                Some((new, better)) if better > back + 1e-9 => new,
                _ => old,
            };
            if !change(&mut covariance, &mut spreads, new, 1.0) {
                return members;
            }
            chosen[new] = true;
            changed |= new != old;
            *member = new;
        }
        if !changed {
            break;
        }
        if let Some(clean) = inform(pool, &start, &members) {
            covariance = clean;
            refresh(&covariance, &mut spreads);
        }
    }
    members
}

fn inform(pool: &Pool, fixed: &DMatrix<f64>, members: &[usize]) -> Option<Covariance> {
    let mut information = fixed.clone();
    for &i in members {
        pool.blocks.inform(i, &mut information);
    }
    Covariance::of(information)
}

/// What an annealing makes small.
pub(crate) enum Aim<'a> {
    /// Minus the log determinant of the information.
    Determinant,
    /// The largest variance that any of these blocks predicts (minimax).
    Largest(&'a Blocks),
}

impl Aim<'_> {
    /// What is accepted at the start with a probability of 1/e: far below what one pose is
    /// worth.
    fn heat(&self) -> f64 {
        match self {
            Self::Determinant => 0.02,
            Self::Largest(_) => 2e-4,
        }
    }
}

/// Logarithm of the largest variance, smoothed: of the mean of 16th powers, so that a move can
/// help before it helps at the very worst place.
fn largest(variances: &[f64]) -> f64 {
    let worst = variances.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let mean: f64 = variances.iter().map(|v| (v / worst).powi(16)).sum::<f64>();
    worst.ln() + (mean / variances.len().max(1) as f64).ln() / 16.0
}

/// Poses under annealing.
pub(crate) struct Chosen {
    pub(crate) q: Vec<Vec<f64>>,
    pub(crate) blocks: Blocks,
}

/// Moves poses at random within `limits`, one at a time, and keeps what lowers the aim, at
/// first also some of what does not (simulated annealing).
pub(crate) fn anneal(
    chosen: &mut Chosen,
    fixed: &DMatrix<f64>,
    limits: &[[f64; 2]],
    aim: &Aim<'_>,
    proposals: usize,
    chance: &mut Random,
    arm: &mut dyn Sensitivity,
) {
    let Blocks { width, height, .. } = chosen.blocks;
    let count = chosen.q.len();
    let information = |blocks: &Blocks| {
        let mut information = fixed.clone();
        (0..blocks.len()).for_each(|i| blocks.inform(i, &mut information));
        Covariance::of(information)
    };
    let Some(mut covariance) = information(&chosen.blocks) else {
        return;
    };
    let variances_of = |covariance: &Covariance| -> Vec<f64> {
        match aim {
            Aim::Determinant => Vec::new(),
            Aim::Largest(places) => (0..places.len())
                .map(|k| covariance.variance(places.get(k)))
                .collect(),
        }
    };
    let mut variances = variances_of(&covariance);
    let mut block = vec![0.0; width * height];
    let mut best = (chosen.q.clone(), chosen.blocks.clone(), 0.0_f64);
    let mut value = 0.0_f64;
    for proposal in 0..proposals {
        let left = 1.0 - proposal as f64 / proposals as f64;
        let member = chance.below(count);
        let old = chosen.q[member].clone();
        // Small steps more and more; now and then anywhere.
        let mut q: Vec<f64> = if chance.unit() < 0.1 * left {
            limits
                .iter()
                .map(|&[low, high]| chance.between(low, high))
                .collect()
        } else {
            let reach = 0.3 * left * left + 0.01;
            let all = chance.unit() < 0.3;
            let one = chance.below(limits.len());
            (old.iter().zip(limits).enumerate())
                .map(|(j, (&q, &[low, high]))| {
                    let step = reach * (high - low) * chance.between(-1.0, 1.0);
                    if all || j == one {
                        (q + step).clamp(low, high)
                    } else {
                        q
                    }
                })
                .collect()
        };
        if !arm.bring(&mut q) {
            continue;
        }
        arm.rows(&q, &mut block);
        // Add first, remove then: the information is never singular in between.
        let Some((add, gained)) = covariance.update(&block, 1.0) else {
            continue;
        };
        let mut tried = covariance.clone();
        tried.apply(&add, gained);
        let Some((remove, lost)) = tried.update(chosen.blocks.get(member), -1.0) else {
            continue;
        };
        let mut new_variances = Vec::new();
        let step = match aim {
            Aim::Determinant => -(gained + lost),
            Aim::Largest(places) => {
                new_variances.extend(variances.iter().enumerate().map(|(k, v)| {
                    let place = places.get(k);
                    v - add.of_variance(place, width) - remove.of_variance(place, width)
                }));
                largest(&new_variances) - largest(&variances)
            }
        };
        let heat = aim.heat() * left * left;
        if step <= 0.0 || chance.unit() < (-step / heat).exp() {
            tried.apply(&remove, lost);
            covariance = tried;
            variances = new_variances;
            chosen.q[member] = q;
            chosen.blocks.set(member, &block);
            value += step;
            if value < best.2 - 1e-9 && (left < 0.3 || proposal % 64 == 0) {
                best = (chosen.q.clone(), chosen.blocks.clone(), value);
            }
        }
        if proposal % 2048 == 2047
            && let Some(clean) = information(&chosen.blocks)
        {
            covariance = clean;
            variances = variances_of(&covariance);
        }
    }
    if best.2 < value || value > 0.0 {
        (chosen.q, chosen.blocks, _) = best;
    }
}
