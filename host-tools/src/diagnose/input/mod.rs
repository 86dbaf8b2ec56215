//! Is the input right? Asked before anything mechanical.
//!
//! Every suspicion is tried: the rows or columns are taken as they would be without the
//! fault, base and tool are placed anew, and only a fit that is better by a large factor
//! makes a finding. Tables of lengths are checked for duplicates only: six unknowns placed by
//! one number a row fit too many wrong tables too well.

mod boards;
mod columns;
mod moves;
mod placing;
mod rows;

use std::path::Path;

use crate::description::Robot;
use crate::error::{Error, Place};
use crate::identify::observation::Observation;
use crate::identify::problem::{Joints, Problem};
use crate::identify::{Failure, Stage};
use crate::measurement::Dataset;

/// What is wrong with an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Measured values of two rows stand in each other's place.
    SwappedRows,
    /// A row, or its measured values or joints, stands in the table twice.
    DuplicatedRows,
    /// Measured values stand beside the joints of another row, a fixed number away.
    ShiftedRows,
    /// Numbers of a column are in another unit than its name says.
    WrongUnit,
    /// A joint counts the other way.
    WrongSign,
    /// Two joint columns stand in each other's place.
    ExchangedJoints,
    /// A joint's reading leaves out another joint's, which moves it as well.
    CoupledJoint,
    /// Quaternions in another order, or of the inverse rotation.
    RotationConvention,
    /// Positions in a left-handed frame.
    MirroredFrame,
    /// The instrument's frame is another one from some row on.
    InstrumentMoved,
    /// Joints read before the arm had settled.
    EarlyReading,
    /// The commanded joints are where the arm was, the readings are not.
    CommandsFitBetter,
}

/// Something wrong with the input.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What.
    pub kind: Kind,
    /// Data rows concerned, from 1; empty where it is all of them.
    pub rows: Vec<usize>,
    /// Columns concerned, as files name them.
    pub columns: Vec<String>,
    /// What is wrong and how one sees it.
    pub saw: String,
    /// What to do.
    pub advice: String,
    /// Typical misfit as the input is and as it should be, m, or in standard deviations of
    /// the noise for what is found in the residual of a fit; both zero for duplicates.
    pub misfit: [f64; 2],
    /// Chance of so much in right input, where one can be given.
    pub p_value: Option<f64>,
}

/// Checks a table. `stage`: the geometric fit, where there is one; without it, what only
/// shows behind a fit (an instrument that moved, joints read early, commands) is not looked
/// for.
pub fn check(
    problem: &Problem,
    data: &Dataset,
    robot: &Robot,
    stage: Option<&Stage>,
) -> Vec<Finding> {
    if !data.has_board() {
        return check_posed(problem, data, robot, stage, problem);
    }
    if let Some(finding) = boards::check(problem, robot) {
        return vec![finding];
    }
    let of_tool = |rows: &[Observation]| rows.iter().map(boards::of_tool).collect();
    let posed = Problem {
        identify: of_tool(&problem.identify),
        verify: of_tool(&problem.verify),
        ..problem.clone()
    };
    check_posed(problem, data, robot, stage, &posed)
}

/// Why no fit settled, by what the check says of the table: as an error of `file`.
pub fn explain(failure: &Failure, robot: &Robot, data: &Dataset, file: &Path) -> Error {
    if matches!(failure, Failure::NotAligned | Failure::NotConverged(_)) {
        let problem = Problem::new(robot, data, Joints::Readings, Vec::new());
        if let Some(finding) = check(&problem, data, robot, None).first() {
            let place = match finding.columns.as_slice() {
                [] => Place::file(file),
                columns => Place::file(file).column(&columns.join(", ")),
            };
            let expected = "rows that a fit settles on";
            return place.bad(&finding.saw, expected, &finding.advice);
        }
    }
    failure.explain(file)
}

/// `posed`: the problem with its rows as poses of the tool, where they are.
fn check_posed(
    problem: &Problem,
    data: &Dataset,
    robot: &Robot,
    stage: Option<&Stage>,
    posed: &Problem,
) -> Vec<Finding> {
    let mut all: Vec<&Observation> = posed.identify.iter().chain(&posed.verify).collect();
    all.sort_by_key(|o| o.row);
    let (mut findings, known) = rows::duplicates(&all);
    let prefix = if data.has_board() { "seen_" } else { "" };
    let Some(placed) = columns::check(posed, &all, robot, prefix, &mut findings) else {
        return findings;
    };
    let columns_are_right = findings.iter().all(|f| f.kind == Kind::DuplicatedRows);
    let arm = stage.filter(|_| columns_are_right).map(|s| &s.arm);
    rows::check(posed, &all, &placed, arm, &known, &mut findings);
    let rows_are_right = findings
        .iter()
        .all(|f| matches!(f.kind, Kind::DuplicatedRows | Kind::SwappedRows));
    if let Some(stage) = stage.filter(|_| rows_are_right) {
        let wrong: Vec<usize> = findings.iter().flat_map(|f| f.rows.clone()).collect();
        moves::check(problem, data, stage, &wrong, &mut findings);
    }
    findings
}

fn millimetres(metres: f64) -> String {
    let mm = metres * 1e3;
    let digits = if mm >= 10.0 {
        0
    } else if mm >= 1.0 {
        1
    } else {
        3
    };
    format!("{mm:.digits$} mm")
}
