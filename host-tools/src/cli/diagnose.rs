//! `truepose diagnose`: geometry, then what the residual says is missing.

use std::path::Path;

use clap::Args;
use truepose_host::description::Robot;
use truepose_host::diagnose::input::{self, Finding};
use truepose_host::diagnose::{Diagnosis, diagnose};
use truepose_host::error::Error;
use truepose_host::identify::Failure;
use truepose_host::identify::held::Wish;
use truepose_host::identify::readings::{Task, identify_file_as};
use truepose_host::measurement::{self, Dataset, Expected, Purpose};
use truepose_host::report::Report;

use super::deliver::deliver;
use super::options::{Chosen, Data, Out, Page, RobotFile};
use super::{Files, Outcome, warn};

/// Identify the geometry, then find, name and add what the residual says is missing
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    robot: RobotFile,
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    out: Out,
    #[command(flatten)]
    page: Page,
    #[command(flatten)]
    chosen: Chosen,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let mut outputs = vec![options.out.out.as_path()];
    outputs.extend(options.page.report.as_deref());
    Files {
        inputs: vec![&options.robot.robot, &options.data.data],
        outputs,
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let file = &options.data.data;
    let robot = Robot::read(&options.robot.robot)?;
    let data = measurement::read(file, &Expected::of(&robot), Purpose::Fit)?;
    let (diagnosis, findings) = diagnosed(&robot, file, &data, options.chosen.wish())?;
    let report = Report::of_diagnosis(&robot.name, &data, &diagnosis, &findings)
        .map_err(|failure| failure.explain(file))?;
    deliver(
        &robot,
        file,
        &diagnosis.identified.calibration,
        &report,
        &options.out,
        &options.page,
    )
}

/// The diagnosis of `data`, read from `file`, and what is wrong with the table itself.
pub(super) fn diagnosed(
    robot: &Robot,
    file: &Path,
    data: &Dataset,
    wish: Wish,
) -> Result<(Diagnosis, Vec<Finding>), Error> {
    warn(&data.warnings);
    let explain = |failure: Failure| failure.explain(file);
    let task = Task {
        wish,
        ..Task::default()
    };
    let identified = identify_file_as(robot, data, task)
        .map_err(|failure| input::explain(&failure, robot, data, file))?;
    let findings = input::check(
        &identified.problem,
        data,
        robot,
        Some(&identified.calibration.geometric),
    );
    let bar = indicatif::ProgressBar::new_spinner();
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let diagnosis = diagnose(identified, &|step| bar.set_message(step.to_owned()));
    bar.finish_and_clear();
    Ok((diagnosis.map_err(explain)?, findings))
}
