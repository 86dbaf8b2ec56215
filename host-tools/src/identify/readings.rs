//! Joint readings or joint commands: whichever explains the measurements better.

use truepose::effects::Effect;

use super::held::Wish;
use super::method::Method;
use super::observation::Observation;
use super::problem::{Joints, Problem};
use super::solve::misfit;
use super::{Calibration, Failure, assess, identify};
use crate::description::Robot;
use crate::measurement::Dataset;

/// How a fit with readings compares with one with commands.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Rms of the identify rows that neither fit left out, readings, m.
    pub rms_readings: f64,
    /// The same with the commands, m.
    pub rms_commands: f64,
    /// Rms of reading minus command, one a joint, rad or m.
    pub difference: Vec<f64>,
    /// Rows without a command, whose readings were taken.
    pub without_command: usize,
}

/// An identification with what it was made from.
#[derive(Clone, Debug)]
pub struct Identified {
    /// What was fitted.
    pub problem: Problem,
    /// The result.
    pub calibration: Calibration,
    /// Joint values that the rows preferred.
    pub joints: Joints,
    /// Present where the file has both.
    pub comparison: Option<Comparison>,
}

/// What to identify, and how.
#[derive(Clone, Debug, Default)]
pub struct Task {
    /// Together with the geometry.
    pub effects: Vec<Effect<'static, f64>>,
    /// Which parameters of the geometry.
    pub wish: Wish,
    /// How. Which joint values the rows prefer is found by the usual method.
    pub method: Method,
}

/// Identifies the robot from a file, with the joint values that its rows prefer.
pub fn identify_file(
    robot: &Robot,
    data: &Dataset,
    effects: Vec<Effect<'static, f64>>,
) -> Result<Identified, Failure> {
    identify_file_as(
        robot,
        data,
        Task {
            effects,
            ..Task::default()
        },
    )
}

/// The same as `task` says.
pub fn identify_file_as(robot: &Robot, data: &Dataset, task: Task) -> Result<Identified, Failure> {
    let (joints, comparison) = if data.available.command {
        let (joints, comparison) = prefer(robot, data, &task.wish)?;
        (joints, Some(comparison))
    } else {
        (Joints::Readings, None)
    };
    let mut problem = Problem {
        method: task.method,
        ..Problem::new(robot, data, joints, task.effects)
    };
    problem.hold(&task.wish)?;
    Ok(Identified {
        calibration: identify(&problem)?,
        problem,
        joints,
        comparison,
    })
}

/// Fits geometry with both; the identify rows that neither fit left out decide.
pub fn prefer(robot: &Robot, data: &Dataset, wish: &Wish) -> Result<(Joints, Comparison), Failure> {
    let problem = |joints| {
        let mut problem = Problem::new(robot, data, joints, Vec::new());
        problem.hold(wish)?;
        Ok::<_, Failure>(problem)
    };
    let (readings, commands) = (problem(Joints::Readings)?, problem(Joints::Commands)?);
    let (by_readings, by_commands) = (identify(&readings)?, identify(&commands)?);
    let common = |o: &&Observation| {
        !by_readings.rejected.contains(&o.row) && !by_commands.rejected.contains(&o.row)
    };
    let size = |problem: &Problem, calibration: &Calibration| {
        let rows: Vec<&Observation> = problem.identify.iter().filter(common).collect();
        let arm = &calibration.geometric.arm;
        let sum: f64 = misfit(arm, &rows, problem.sigmas).iter().sum();
        let distances = assess::errors(arm, &rows).distances;
        let rms = assess::Statistics::of(&distances).map_or(0.0, |s| s.rms);
        (sum, rms)
    };
    let (misfit_readings, rms_readings) = size(&readings, &by_readings);
    let (misfit_commands, rms_commands) = size(&commands, &by_commands);
    let mut squares = vec![0.0; data.joints];
    let mut both = 0;
    for row in &data.rows {
        let Some(command) = &row.q_command else {
            continue;
        };
        both += 1;
        for (sum, (q, c)) in squares.iter_mut().zip(row.q.iter().zip(command)) {
            *sum += (q - c).powi(2);
        }
    }
    let comparison = Comparison {
        rms_readings,
        rms_commands,
        difference: squares
            .iter()
            .map(|s| (s / f64::from(both.max(1))).sqrt())
            .collect(),
        without_command: data.rows.len() - usize::try_from(both).unwrap_or(0),
    };
    let joints = if misfit_commands < misfit_readings {
        Joints::Commands
    } else {
        Joints::Readings
    };
    Ok((joints, comparison))
}
