//! How far the arm may be from its drawing, found by cross-validation: of several sizes of the
//! prior the one with which rows that are left out are predicted best.
//!
//! Rows of the fit alone take part. They are left out in ten random folds, each once, everything
//! else is fitted with each size in turn, and the squared errors of the rows left out are added
//! up, in units of the noise (Stone 1974). No prior at all is one of the sizes.

use rayon::prelude::*;

use super::assess::errors;
use super::folds::{Blocks, folds};
use super::method::Task;
use super::observation::Observation;
use super::prior::Prior;
use super::solve;

/// Halves of the largest tolerance: 10 mm and 1 deg to 10 um and 0.001 deg by default.
const SIZES: i32 = 11;

/// More rows than this say no more of the size.
const ENOUGH: usize = 300;

/// One size, and the rows left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tried {
    /// One standard deviation of joint parameters from the drawing, m and rad; infinite without
    /// a prior.
    pub tolerance: [f64; 2],
    /// Rms of the whitened residual of the rows left out: 1 is the declared noise.
    pub whitened: f64,
    /// Rms of their distances, m.
    pub rms: f64,
}

/// All sizes, no prior first, then the largest tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct Sizes {
    /// Each with what it left.
    pub tried: Vec<Tried>,
    /// Place of the best.
    pub chosen: usize,
    /// Rows that took part.
    pub rows: usize,
}

impl Sizes {
    /// Of the best.
    pub fn tolerance(&self) -> Option<[f64; 2]> {
        self.tried.get(self.chosen).map(|tried| tried.tolerance)
    }
}

/// Tries all sizes with lengths to angles as in `tolerance`. `None` where no fold can be fitted.
pub(super) fn sizes(
    task: &Task<'_>,
    tolerance: [f64; 2],
    observations: &[&Observation],
) -> Option<Sizes> {
    let n = observations.len();
    let wanted = n.min(ENOUGH);
    // evenly over the file
    let taken = |i: &usize| (i + 1) * wanted / n != i * wanted / n;
    let rows: Vec<&Observation> = (0..n).filter(taken).map(|i| observations[i]).collect();
    let fold = folds(&rows, &[], Blocks::Random);
    let count = fold.iter().max().map_or(0, |last| last + 1);
    let sides: Vec<(Vec<&Observation>, Vec<&Observation>)> = (0..count)
        .map(|f| part(&rows, |i| fold[i] == f))
        .filter(|(unseen, seen)| !unseen.is_empty() && !seen.is_empty())
        .collect();
    let halves = (0..SIZES).map(|k| tolerance.map(|x| x * 2.0_f64.powi(1 - k)));
    let all: Vec<[f64; 2]> = std::iter::once([f64::INFINITY; 2]).chain(halves).collect();
    let tried: Vec<Tried> = all
        .into_par_iter()
        .filter_map(|tolerance| left(task, tolerance, &sides))
        .collect();
    let best = |a: &(usize, &Tried), b: &(usize, &Tried)| a.1.whitened.total_cmp(&b.1.whitened);
    let (chosen, _) = tried.iter().enumerate().min_by(best)?;
    Some(Sizes {
        chosen,
        tried,
        rows: rows.len(),
    })
}

/// Rows of which something holds, and the others.
fn part<'a>(
    rows: &[&'a Observation],
    holds: impl Fn(usize) -> bool,
) -> (Vec<&'a Observation>, Vec<&'a Observation>) {
    let side = |is: bool| {
        (0..rows.len())
            .filter(|&i| holds(i) == is)
            .map(|i| rows[i])
            .collect()
    };
    (side(true), side(false))
}

/// What fits with a size leave of the rows left out; `None` where one does not settle.
fn left(
    task: &Task<'_>,
    tolerance: [f64; 2],
    sides: &[(Vec<&Observation>, Vec<&Observation>)],
) -> Option<Tried> {
    let prior = Prior::Drawing {
        arm: task.drawing,
        tolerance,
    };
    let (mut whitened, mut equations) = (0.0, 0);
    let mut distances = Vec::new();
    for (unseen, seen) in sides {
        let mut arm = task.drawing.clone();
        let (fit, _) = solve::fit(&mut arm, task.candidates, seen, task.sigmas, prior);
        if !fit.converged {
            return None;
        }
        whitened += super::linearize::residuals(&arm, unseen, task.sigmas).norm_squared();
        equations += unseen.iter().map(|o| o.equations()).sum::<usize>();
        distances.extend(errors(&arm, unseen).distances);
    }
    let squares: f64 = distances.iter().map(|x| x * x).sum();
    let tried = Tried {
        tolerance,
        whitened: (whitened / equations.max(1) as f64).sqrt(),
        rms: (squares / distances.len().max(1) as f64).sqrt(),
    };
    tried.whitened.is_finite().then_some(tried)
}
