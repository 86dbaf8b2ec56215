//! Which harmonics of a joint's turn the residual holds, up to high orders.

use truepose::JointKind;
use truepose::effects::{Effect, Place, Selector};

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::space::{Moving, Space, postures};
use crate::identify::observation::{Observation, Sigmas};

/// Highest order looked for, periods a joint turn.
const HIGHEST: f64 = 450.0;

/// Lowest order looked for; lower ones are candidates of their own.
const LOWEST: f64 = 12.5;

/// Peaks of each joint that become candidates.
const PEAKS: usize = 2;

/// The residual's power at one order of one joint.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Periods a turn.
    pub order: f64,
    /// Share of the squared residual that sine and cosine take.
    pub share: f64,
    /// Logarithm of the probability by chance, of this order alone.
    pub ln_p: f64,
}

/// Orders of joint `j` in steps finer than its measured range can resolve.
///
/// A harmonic's column is the joint's own column times a function of its reading, so all
/// that is needed of each row are three things: the joint column's squared length, its
/// product with the residual, and its coordinates in the fitted space.
pub fn periodogram(
    model: &Extended,
    space: &Space,
    observations: &[&Observation],
    sigmas: Sigmas,
    j: usize,
) -> Vec<Line> {
    let place = Place::Joint(u8::try_from(j).unwrap_or(u8::MAX));
    let moving = Moving::new(&model.arm, place, space, observations, sigmas);
    let Moving {
        along,
        rows,
        shared,
    } = moving;
    let p = along.nrows();
    let readings: Vec<f64> = postures(observations).iter().map(|o| o.q[j]).collect();
    let low = readings.iter().copied().fold(f64::INFINITY, f64::min);
    let high = readings.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let width = std::f64::consts::TAU / (high - low).max(0.1);
    let step = (width / 3.0).clamp(0.25, 5.0);
    let mut lines = Vec::new();
    let mut order = LOWEST;
    // sine and cosine of order * q by turning on from one order to the next
    let mut turning: Vec<[f64; 4]> = readings
        .iter()
        .map(|q| {
            let ((s, c), (ds, dc)) = ((order * q).sin_cos(), (step * q).sin_cos());
            [s, c, ds, dc]
        })
        .collect();
    let mut a = vec![0.0; p];
    let mut b = vec![0.0; p];
    while order <= HIGHEST {
        a.fill(0.0);
        b.fill(0.0);
        let (mut ss, mut sc, mut cc, mut sr, mut cr) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (i, t) in turning.iter_mut().enumerate() {
            let [s, c, ds, dc] = *t;
            let (length, product) = (rows[(i, 0)], rows[(i, 1)]);
            ss += length * s * s;
            sc += length * s * c;
            cc += length * c * c;
            sr += product * s;
            cr += product * c;
            let column = &along.as_slice()[i * p..(i + 1) * p];
            for ((x, y), v) in a.iter_mut().zip(b.iter_mut()).zip(column) {
                *x += v * s;
                *y += v * c;
            }
            *t = [s * dc + c * ds, c * dc - s * ds, ds, dc];
        }
        for &(i, k, product) in &shared {
            // both have been turned on to the next order: turn back
            let back = |[s, c, ds, dc]: [f64; 4]| [s * dc - c * ds, c * dc + s * ds];
            let ([s, c], [t, d]) = (back(turning[i]), back(turning[k]));
            ss += 2.0 * product * s * t;
            sc += product * (s * d + c * t);
            cc += 2.0 * product * c * d;
        }
        let dot = |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(p, q)| p * q).sum() };
        let (aa, ab, bb) = (ss - dot(&a, &a), sc - dot(&a, &b), cc - dot(&b, &b));
        let determinant = aa * bb - ab * ab;
        if determinant > 1e-6 * aa * bb && aa > 0.0 && bb > 0.0 {
            let reduction = (sr * sr * bb - 2.0 * sr * cr * ab + cr * cr * aa) / determinant;
            let score = space.judge(reduction, 2.0);
            lines.push(Line {
                order,
                share: reduction / space.rss,
                ln_p: score.ln_p,
            });
        }
        order += step;
    }
    lines
}

/// The strongest lines of every revolute joint as hypotheses, each weighted by the number of
/// lines that were looked at.
pub fn peaks(
    model: &Extended,
    space: &Space,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Vec<Hypothesis> {
    let mut found = Vec::new();
    for j in 0..model.arm.joint_count() {
        if model.arm.joints[j].kind != JointKind::Revolute {
            continue;
        }
        let lines = periodogram(model, space, observations, sigmas, j);
        let looked_at = (lines.len() * model.arm.joint_count()).max(1) as f64;
        let mut tops: Vec<Line> = lines
            .windows(3)
            .filter(|w| w[1].share >= w[0].share && w[1].share >= w[2].share)
            .map(|w| w[1])
            .collect();
        tops.sort_by(|a, b| b.share.total_cmp(&a.share));
        for line in tops.iter().take(PEAKS) {
            // a line of a tooth or pole count is a whole number
            let whole = line.order.round();
            let order = if (whole - line.order).abs() < 0.5 {
                whole
            } else {
                line.order
            };
            let selector = Selector {
                joint: Some(j),
                order: Some(order),
                ..Selector::default()
            };
            let kind = ["gear-ripple", "gear-eccentricity"]
                .into_iter()
                .find_map(|kind| Effect::named(kind, &selector).map(|e| (kind, e)));
            if let Some((kind, effect)) = kind {
                found.push(Hypothesis {
                    kind,
                    joint: Some(j),
                    order: Some(order),
                    from: None,
                    members: Members::Effects(vec![effect]),
                    ln_weight: -(looked_at * 10.0).ln(),
                });
            }
        }
    }
    found
}
