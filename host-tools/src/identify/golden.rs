//! Direct search: golden-section line searches on the cost alone, without a Jacobian.
//!
//! MRD 4.4.1 varies the parameters one after the other, over and over. Parameters of an arm
//! hang together, and such a cycle then creeps. So after each cycle the way that it went as a
//! whole takes the place of the direction that gained most (Powell 1964): the directions come
//! to be conjugate, and as many cycles as there are parameters find the least cost of a
//! quadratic function.

use super::arm::ArmModel;
use super::linearize::residuals;
use super::observation::{Observation, Sigmas};
use super::prior::Prior;
use super::solve::{Solved, at_solution};
use super::unknown::{Unknown, apply};

const MAX_CYCLES: usize = 2000;

/// 2 / (1 + √5). MRD 4.124.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Cycles that gain less than this share of the cost, one after the other, end the search.
const GAIN: f64 = 1e-11;

/// Searches for the parameters of least cost. On return `arm` holds them. Covariance and
/// singular values come from the Jacobian at the end, which the search does not use.
pub(super) fn search(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Solved {
    let n = unknowns.len();
    let start = arm.clone();
    let scales: Vec<f64> = unknowns.iter().map(|u| 1e-3 * u.expected(&start)).collect();
    let placed = |x: &[f64]| {
        let mut there = start.clone();
        let steps: Vec<f64> = x.iter().zip(&scales).map(|(x, s)| x * s).collect();
        apply(&mut there, unknowns, &steps);
        there
    };
    let cost = |x: &[f64]| residuals(&placed(x), observations, sigmas).norm_squared();
    let unit = |i: usize| (0..n).map(|k| f64::from(u8::from(k == i))).collect();
    let mut directions: Vec<Vec<f64>> = (0..n).map(unit).collect();
    let mut reach = vec![1.0; n];
    let mut x = vec![0.0; n];
    let mut here = cost(&x);
    let mut cycles = 0;
    let mut idle = 0;
    while cycles < MAX_CYCLES && idle < 2 && n > 0 {
        cycles += 1;
        let (from, before) = (x.clone(), here);
        let (mut best, mut most) = (0, 0.0);
        for (i, direction) in directions.iter().enumerate() {
            let was = here;
            (here, reach[i]) = line(&cost, &mut x, here, direction, reach[i]);
            if was - here > most {
                (best, most) = (i, was - here);
            }
        }
        let way: Vec<f64> = x.iter().zip(&from).map(|(a, b)| a - b).collect();
        let twice: Vec<f64> = x.iter().zip(&way).map(|(a, b)| a + b).collect();
        let beyond = cost(&twice);
        // Powell's rule: the new direction must not make the set dependent.
        let curved = 2.0 * (before - 2.0 * here + beyond) * (before - here - most).powi(2);
        if beyond < before && curved < most * (before - beyond).powi(2) {
            let (value, length) = line(&cost, &mut x, here, &way, 1.0);
            here = value;
            directions.remove(best);
            reach.remove(best);
            directions.push(way);
            reach.push(length);
        }
        idle = match before - here <= GAIN * before {
            true => idle + 1,
            false => 0,
        };
        if idle == 1 {
            // once more from the axes
            directions = (0..n).map(unit).collect();
        }
    }
    *arm = placed(&x);
    at_solution(
        arm,
        unknowns,
        observations,
        sigmas,
        Prior::None,
        cycles,
        idle >= 2,
    )
}

/// Least cost along `direction` from `x`, which moves there. `reach`: a step to begin with,
/// in units of the direction; the one found is returned beside the cost.
fn line(
    cost: &impl Fn(&[f64]) -> f64,
    x: &mut [f64],
    here: f64,
    direction: &[f64],
    reach: f64,
) -> (f64, f64) {
    let at = |t: f64| -> Vec<f64> { x.iter().zip(direction).map(|(x, d)| x + t * d).collect() };
    let value = |t: f64| cost(&at(t));
    // Downhill, in growing steps, until it rises: the least lies between low and high.
    let mut step = reach;
    let mut ahead = value(step);
    if ahead > here {
        step = -step;
        ahead = value(step);
    }
    let (mut low, mut high) = (-step.abs(), step.abs());
    if ahead < here {
        let (mut back, mut front, mut at_front) = (0.0, step, ahead);
        loop {
            let next = front + (front - back) / GOLDEN;
            let at_next = value(next);
            if at_next >= at_front || next.abs() > 1e9 || at_next.is_nan() {
                (low, high) = (back.min(next), back.max(next));
                break;
            }
            (back, front, at_front) = (front, next, at_next);
        }
    }
    // MRD 4.123 to 4.127.
    let tolerance = 1e-7 * low.abs().max(high.abs());
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(value);
    while high - low > tolerance {
        if values[0] < values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [value(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], value(inner[1])];
        }
    }
    let (t, least) = match values[0] < values[1] {
        true => (inner[0], values[0]),
        false => (inner[1], values[1]),
    };
    if least < here {
        let there = at(t);
        x.copy_from_slice(&there);
        (least, t.abs().max(1e-9))
    } else {
        (here, (reach * 0.1).max(1e-9))
    }
}
