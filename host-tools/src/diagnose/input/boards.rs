//! Poses of a board, seen from the tool: whether they are written the other way round, and as
//! poses of the tool in the board's frame, so that all else that is asked of those is asked.

use truepose::Pose;

use super::columns::{FACTOR, LEAST_ROWS, PLAUSIBLE};
use super::placing::{Flanges, LEVER, Placing, Reading, Sample};
use super::{Finding, Kind, millimetres};
use crate::description::Robot;
use crate::identify::observation::Observation;
use crate::identify::problem::Problem;
use crate::identify::view::board;

/// How a pose may have been written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Written {
    /// The board's in the tool's frame, its quaternion in some way.
    Board(Reading),
    /// The tool's in the board's frame.
    Tool,
}

impl Written {
    /// Pose of the tool in the board's frame.
    fn tool(self, seen: &Pose<f64>) -> Pose<f64> {
        match self {
            Self::Board(reading) => {
                Pose::new(reading.of(&seen.rotation), seen.translation).inverse()
            }
            Self::Tool => *seen,
        }
    }

    /// What is wrong, the columns that it shows in, and what to do.
    fn said(self) -> (&'static str, &'static [&'static str], &'static str) {
        const TURN: &[&str] = &["seen_qw", "seen_qx", "seen_qy", "seen_qz"];
        const POSE: &[&str] = &[
            "seen_x", "seen_y", "seen_z", "seen_qw", "seen_qx", "seen_qy", "seen_qz",
        ];
        match self {
            Self::Tool => (
                "the poses are those of the camera in the board's frame",
                POSE,
                "write their inverses: the board as the camera sees it",
            ),
            Self::Board(Reading::AsWritten) => ("the poses are as they are named", POSE, "nothing"),
            Self::Board(Reading::Inverse) => (
                "the quaternions are of the inverse rotation (the camera seen from the board)",
                TURN,
                "change the signs of seen_qx, seen_qy, seen_qz",
            ),
            Self::Board(Reading::ScalarLast) => (
                "the quaternions are in the order x y z w",
                TURN,
                "name the columns seen_qx, seen_qy, seen_qz, seen_qw in this order",
            ),
            Self::Board(Reading::ScalarLastInverse) => (
                "the quaternions are in the order x y z w and of the inverse rotation (the camera \
                 seen from the board)",
                TURN,
                "name the columns seen_qx, seen_qy, seen_qz, seen_qw in this order and change the \
                 signs of the first three",
            ),
        }
    }
}

/// A row that sees a board as one of the tool in the board's frame.
pub(super) fn of_tool(o: &Observation) -> Observation {
    let Some(seen) = board(o) else {
        return o.clone();
    };
    let tool = Written::Board(Reading::AsWritten).tool(&seen);
    Observation {
        position: Some(tool.translation),
        rotation: Some(tool.rotation),
        relations: Vec::new(),
        ..o.clone()
    }
}

/// What is wrong with the way all poses of a board are written; `None` where nothing is, or
/// too little is known.
pub(super) fn check(problem: &Problem, robot: &Robot) -> Option<Finding> {
    let flanges = Flanges::new(&problem.drawing);
    let seen = problem.identify.iter();
    let seen: Vec<(&Observation, Pose<f64>)> = seen.filter_map(|o| Some((o, board(o)?))).collect();
    // one placement of the board at a time: the one with most rows
    let count = |session: usize| seen.iter().filter(|(o, _)| o.session == session).count();
    let largest = seen
        .iter()
        .map(|(o, _)| o.session)
        .max_by_key(|&s| count(s))?;
    if count(largest) < LEAST_ROWS {
        return None;
    }
    let misfit = |written: Written| -> Option<f64> {
        let of_session = seen.iter().filter(|(o, _)| o.session == largest);
        let samples: Vec<Sample> = of_session
            .map(|(o, seen)| {
                let tool = written.tool(seen);
                Sample {
                    flange: flanges.at(&o.q),
                    point: tool.translation,
                    rotation: Some(tool.rotation),
                }
            })
            .collect();
        let placing = Placing::find(&samples, problem.drawing.tool.translation)?;
        let (angle, _) = placing.orient(&samples, Reading::AsWritten)?;
        Some(placing.distance + LEVER * angle)
    };
    let before = misfit(Written::Board(Reading::AsWritten))?;
    let others = Reading::ALL.into_iter().skip(1).map(Written::Board);
    let (written, after) = others
        .chain([Written::Tool])
        .filter_map(|written| Some((written, misfit(written)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    if after > PLAUSIBLE * robot.reach() || after * FACTOR > before {
        return None;
    }
    let (what, columns, advice) = written.said();
    Some(Finding {
        kind: Kind::RotationConvention,
        rows: Vec::new(),
        columns: columns.iter().map(ToString::to_string).collect(),
        saw: format!(
            "{what}: base and tool placed on the drawing, the typical misfit is {} as the table \
             is and {} so",
            millimetres(before),
            millimetres(after)
        ),
        advice: advice.to_owned(),
        misfit: [before, after],
        p_value: None,
    })
}
