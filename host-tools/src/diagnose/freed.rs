//! Would what a person holds explain the residual, were it free?
//!
//! An effect may look like a parameter that is held at a wrong value, and be named in its place.
//! So geometry with everything free and without effects is set against the model that was found,
//! on the same rows.

use super::UNDECIDED;
use crate::identify::assess::{Statistics, errors};
use crate::identify::held::Held;
use crate::identify::linearize::residuals;
use crate::identify::noise::{fitted, unseen};
use crate::identify::observation::Observation;
use crate::identify::problem::Problem;
use crate::identify::unknown::Unknown;
use crate::identify::{Calibration, Stage, identify};

/// Geometry with nothing held.
#[derive(Clone, Debug)]
pub struct Freed {
    /// The arm and its fit.
    pub stage: Stage,
    /// BIC of the model with what is held, less that of this one: above zero, this one is
    /// likelier.
    pub delta_bic: f64,
    /// Rms of rows that no fit has seen, m.
    pub rms: f64,
    /// The held parameter that leaves its drawn value most clearly, and by how many standard
    /// errors.
    pub farthest: Option<(Unknown, f64)>,
}

/// `None` where nothing is held, where geometry is no better with it free, as with a known tool
/// whose place the last joint takes, or where the rows do not do for more.
pub fn freed(problem: &Problem, calibration: &Calibration) -> Option<Freed> {
    if problem.held.is_empty() {
        return None;
    }
    let free = Problem {
        held: Held::default(),
        effects: Vec::new(),
        ..problem.clone()
    };
    let stage = identify(&free).ok()?.geometric;
    let rows = fitted(problem, calibration);
    let bic = |stage: &Stage, rows: &[&Observation]| {
        let residual = residuals(&stage.arm, rows, problem.sigmas);
        let n = residual.len().max(1) as f64;
        n * (residual.norm_squared() / n).ln() + stage.fit.unknowns.len() as f64 * n.ln()
    };
    let freer = bic(&stage, &rows);
    if bic(&calibration.geometric, &rows) - freer < UNDECIDED {
        return None;
    }
    let rms = Statistics::of(&errors(&stage.arm, &unseen(problem, calibration)).distances)?.rms;
    let held = stage
        .fit
        .unknowns
        .iter()
        .filter(|u| problem.held.contains(u));
    let away = |unknown: &Unknown| {
        let off = unknown.value(&stage.arm) - unknown.value(&problem.drawing);
        Some((*unknown, off.abs() / stage.sigma(*unknown)?))
    };
    Some(Freed {
        delta_bic: bic(&calibration.complete, &rows) - freer,
        rms,
        farthest: held.filter_map(away).max_by(|a, b| a.1.total_cmp(&b.1)),
        stage,
    })
}
