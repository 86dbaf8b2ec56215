//! Is anything left in the residual but noise?
//!
//! Every test compares the residual with draws from itself: rows dealt out anew, each with a
//! new sign. Noise that is symmetric and alike in all rows does not mind, whatever its size
//! and tails, while structure is lost. Drawn residuals are put through the fit's projection
//! again, so what the fit took up is missing in them just as in the residual. The verdict is
//! by the best of all tests against the best of all tests of every draw (Westfall and Young
//! 1993, 2.6), so their number and their dependence are paid for. The declared noise is in
//! none of them: positions and orientations are first weighted by their own residuals, and
//! [`Whiteness::noise`] compares these with what was declared.

mod noise;
pub(crate) mod projected;
mod quadratic;
pub(crate) mod shapes;

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

pub use noise::{Component, Noise};

use super::chance::{ln_best_of, ln_chi_square};
use crate::identify::arm::ArmModel;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::product::across;
use crate::identify::unknown::Unknown;
use noise::noise;
use projected::Projected;
use quadratic::{Quadratic, repeats};
use shapes::{Design, design};

/// Draws. The verdict's p-value is a multiple of one over this plus one.
const DRAWS: usize = 299;
/// Probability that nothing is called structure.
const LEVEL: f64 = 0.01;
/// Rows looked at, evenly taken out of more: work and memory stay bounded.
const ROWS: usize = 400;
/// Degrees of freedom that a test needs.
const LEAST_FREEDOM: usize = 20;

/// What a test looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Rows near one another in joint space.
    Neighbourhood,
    /// Rows that repeat a pose.
    Repeats,
    /// Rows that follow one another.
    Succession,
    /// The row's number.
    Order,
    /// The reading of a joint, from 0.
    Joint(usize),
    /// Signs of the last moves.
    Direction,
    /// Size and sign of the last moves of all joints together.
    LastMove,
    /// Gravity's lever on each joint.
    Gravity,
    /// The payload.
    Payload,
    /// A temperature sensor, from 0.
    Temperature(usize),
    /// The time.
    Time,
}

/// One test.
#[derive(Clone, Debug, PartialEq)]
pub struct Test {
    /// What it looks at.
    pub subject: Subject,
    /// Chance of so much in noise alone, all of this test's own trials paid for.
    pub p_value: f64,
    /// What it saw, in one line.
    pub saw: String,
}

/// Result of [`whiteness`].
#[derive(Clone, Debug, PartialEq)]
pub struct Whiteness {
    /// Smallest p-value first.
    pub tests: Vec<Test>,
    /// Chance that noise alone makes any of the tests as good as the best of them was.
    pub p_value: f64,
    /// More than noise: `p_value` below 1 %.
    pub structure: bool,
    /// Size of the noise, by the residual.
    pub noise: Noise,
    /// Rows that were looked at.
    pub rows: usize,
}

/// Tests the residual of `arm`, fitted in `unknowns` to `observations`, for structure.
/// `None` where too few equations are left over for any test. The same `seed` gives the
/// same result. Cost: 0.05 s for 100 poses of a six-joint arm.
pub fn whiteness(
    arm: &ArmModel,
    unknowns: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    seed: u64,
) -> Option<Whiteness> {
    let stride = observations.len().div_ceil(ROWS).max(1);
    let rows: Vec<&Observation> = observations.iter().copied().step_by(stride).collect();
    let projected = Projected::new(arm, unknowns, &rows, sigmas);
    if projected.freedom() < LEAST_FREEDOM {
        return None;
    }
    let repeats = repeats(&rows);
    let noise = noise(&projected, &rows, sigmas, &repeats);
    let sigmas = noise.weights(sigmas);
    let projected = Projected::new(arm, unknowns, &rows, sigmas);
    let design = design(arm, &rows, sigmas);
    let drawn = draws(&projected, seed);
    let mut groups = scores(&projected, &design, &drawn);
    groups.extend(Quadratic::new(&design, &rows, &repeats).tests(&projected, drawn));
    merge(&mut groups);

    let best_of_draw = |draw: usize| {
        let each = groups.iter().filter_map(|g| g.drawn.get(draw));
        each.copied().fold(0.0, f64::min)
    };
    let best = groups.iter().map(|g| g.ln_p).fold(0.0, f64::min);
    let as_good = (0..DRAWS).filter(|&d| best_of_draw(d) <= best).count();
    let p_value = (1 + as_good) as f64 / (1 + DRAWS) as f64;
    let mut tests: Vec<Test> = groups
        .into_iter()
        .map(|g| Test {
            subject: g.subject,
            p_value: g.ln_p.exp(),
            saw: g.saw,
        })
        .collect();
    tests.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    Some(Whiteness {
        tests,
        p_value,
        structure: p_value < LEVEL,
        noise,
        rows: rows.len(),
    })
}

/// Result of one test and of the same test on every draw, as logarithms of chances.
struct Group {
    subject: Subject,
    ln_p: f64,
    drawn: Vec<f64>,
    saw: String,
}

/// Equations x draws: inflated residuals of rows of the same make dealt out anew, with signs.
/// Not projected yet.
fn draws(projected: &Projected, seed: u64) -> DMatrix<f64> {
    let mut bits = ChaCha8Rng::seed_from_u64(seed);
    let mut makes: Vec<usize> = (0..projected.len())
        .map(|i| projected.equations(i).len())
        .collect();
    makes.sort_unstable();
    makes.dedup();
    let mut drawn = DMatrix::zeros(projected.residual.len(), DRAWS);
    for make in makes {
        let places: Vec<usize> = (0..projected.len())
            .filter(|&i| projected.equations(i).len() == make)
            .collect();
        let mut cards = places.clone();
        for mut draw in drawn.column_iter_mut() {
            for last in (1..cards.len()).rev() {
                // the remainder's bias is below 1e-15
                cards.swap(last, (bits.next_u64() % (last as u64 + 1)) as usize);
            }
            for (&place, &card) in places.iter().zip(&cards) {
                let sign = if bits.next_u32() & 1 == 0 { 1.0 } else { -1.0 };
                for (to, from) in projected.equations(place).zip(projected.equations(card)) {
                    draw[to] = sign * projected.inflated[from];
                }
            }
        }
    }
    drawn
}

/// Tests of the residual against every column of the design: per subject the best column.
///
/// A column's score is its product with the residual over its own length and the noise's
/// estimate from the same residual: near standard normal in noise of any size.
fn scores(projected: &Projected, design: &Design, drawn: &DMatrix<f64>) -> Vec<Group> {
    let mut free = projected.complement(design.columns.clone());
    let count = design.shapes.len();
    let mut visible = vec![false; count];
    for (k, visible) in visible.iter_mut().enumerate() {
        let (left, before) = (free.column(k).norm(), design.columns.column(k).norm());
        // less has been taken up by the fit
        *visible = left > 1e-3 * before;
        let scale = if *visible { left.recip() } else { 0.0 };
        free.column_mut(k).scale_mut(scale);
    }
    let freedom = projected.freedom() as f64;
    let deviation = |square: f64| (square / freedom).sqrt().max(f64::MIN_POSITIVE);
    let score = free.tr_mul(&projected.residual) / deviation(projected.residual.norm_squared());
    let mut of_draws = across(&free, drawn);
    let taken = across(&projected.basis, drawn);
    let each = drawn.column_iter().zip(taken.column_iter());
    for (mut scores, (draw, taken)) in of_draws.column_iter_mut().zip(each) {
        let taken = taken.norm_squared();
        scores.unscale_mut(deviation(draw.norm_squared() - taken));
    }
    let mut subjects: Vec<Subject> = Vec::new();
    for shape in &design.shapes {
        if !subjects.contains(&shape.subject) {
            subjects.push(shape.subject);
        }
    }
    let of = |subject: Subject| -> Option<Group> {
        let members: Vec<usize> = (0..count)
            .filter(|&k| design.shapes[k].subject == subject && visible[k])
            .collect();
        let chance = |z: f64| ln_best_of(ln_chi_square(z * z, 1.0), members.len());
        let &best = members
            .iter()
            .max_by(|&&a, &&b| score[a].abs().total_cmp(&score[b].abs()))?;
        let shape = &design.shapes[best];
        Some(Group {
            subject,
            ln_p: chance(score[best]),
            drawn: of_draws
                .column_iter()
                .map(|draw| {
                    let sizes = members.iter().map(|&k| draw[k].abs());
                    chance(sizes.fold(0.0, f64::max))
                })
                .collect(),
            saw: format!(
                "error of {} in proportion to {} ({:.1} standard errors, the most of {})",
                shape.mover.name(),
                shape.function,
                score[best].abs(),
                members.len()
            ),
        })
    };
    subjects.into_iter().filter_map(of).collect()
}

/// Two tests of one subject become one.
fn merge(groups: &mut Vec<Group>) {
    let mut merged: Vec<Group> = Vec::new();
    for group in groups.drain(..) {
        let Some(same) = merged.iter_mut().find(|g| g.subject == group.subject) else {
            merged.push(group);
            continue;
        };
        if group.ln_p < same.ln_p {
            same.saw = group.saw;
        }
        same.ln_p = ln_best_of(same.ln_p.min(group.ln_p), 2);
        for (a, b) in same.drawn.iter_mut().zip(&group.drawn) {
            *a = ln_best_of(a.min(*b), 2);
        }
    }
    *groups = merged;
}
