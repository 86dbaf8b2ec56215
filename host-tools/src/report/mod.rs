//! What was found, for people and for programs.
//!
//! [`Report`] is what every output takes; `identify` makes one with [`Report::new`], whoever
//! finds more than it puts that in. To add an output: a file here with one function of a
//! [`Report`].

mod compose;
mod diagnosed;
pub mod evidence;
mod figures;
mod found;
pub mod html;
mod rows;
pub mod schema;
mod svg;
pub mod text;
mod verdict;
mod words;

use evidence::Evidence;
use schema::{Spread, Summary};

pub use verdict::Judgement;

/// Everything that an output may show.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// What `--json` writes.
    pub summary: Summary,
    /// Errors of the verify rows, one a measured point, mm, for histograms.
    pub distances_mm: Distances,
    /// The verify rows, for plots against joints.
    pub rows: Vec<Row>,
    /// One a joint: `"deg"` or `"mm"`.
    pub joint_units: Vec<&'static str>,
    /// What gave each effect away, in the order of addition.
    pub evidence: Vec<Evidence>,
    /// Why the verdict is what it is, a sentence each.
    pub reasons: Vec<String>,
    /// What the program assumed, a sentence each.
    pub assumed: Vec<String>,
    /// What it held back or left out, a sentence each.
    pub held_back: Vec<String>,
    /// What deserves a look, a sentence each.
    pub noticed: Vec<String>,
    /// A parameter that is held as asked may be what is wrong.
    pub held_explains: bool,
}

/// Errors of the same points by three models, mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distances {
    /// Geometry as drawn, base and tool aligned.
    pub nominal: Vec<f64>,
    /// Geometry identified.
    pub geometric: Vec<f64>,
    /// Geometry and effects.
    pub complete: Vec<f64>,
}

/// What the final model leaves of one verify row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number in the file, from 1.
    pub number: usize,
    /// Joint values, deg or mm.
    pub q: Vec<f64>,
    /// Measured minus predicted tool point in the axes of the robot base, or the length's
    /// difference alone, mm.
    pub residual_mm: Vec<f64>,
}

impl Report {
    /// The rms of the verify rows before and after, mm.
    pub fn before_and_after_mm(&self) -> [f64; 2] {
        let Spread { rms: before, .. } = self.summary.error_mm.nominal;
        [before, self.summary.error_mm.complete.spread.rms]
    }
}
