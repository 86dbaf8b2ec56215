//! `truepose diagnose`: geometry, then what the residual says is missing.

use std::path::PathBuf;

use clap::Args;
use truepose_host::deploy::{Origin, blob};
use truepose_host::description::Robot;
use truepose_host::diagnose::diagnose;
use truepose_host::diagnose::input;
use truepose_host::error::{Error, Place};
use truepose_host::identify::readings::identify_file;
use truepose_host::measurement::{self, Expected, Purpose};
use truepose_host::output::Output;
use truepose_host::report::Report;
use truepose_host::report::html::html;
use truepose_host::report::text::text;

use super::options::{Data, Out, Page, RobotFile};
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
    let (data_file, out): (&PathBuf, &PathBuf) = (&options.data.data, &options.out.out);
    let robot = Robot::read(&options.robot.robot)?;
    let data = measurement::read(data_file, &Expected::of(&robot), Purpose::Fit)?;
    warn(&data.warnings);
    if data.rows.iter().any(|row| row.relations.pair.is_some()) {
        return Err(Place::file(data_file).column("pair").bad(
            "distances between pairs of poses",
            "one pose a row: what an effect does at two poses at once is not searched for",
            "take identify, and name effects with --effect",
        ));
    }
    let explain = |failure: truepose_host::identify::Failure| failure.explain(data_file);
    let identified = identify_file(&robot, &data, Vec::new()).map_err(explain)?;
    let findings = input::check(
        &identified.problem,
        &data,
        &robot,
        Some(&identified.calibration.geometric),
    );
    let bar = indicatif::ProgressBar::new_spinner();
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let diagnosis = diagnose(identified, &|step| bar.set_message(step.to_owned()));
    bar.finish_and_clear();
    let diagnosis = diagnosis.map_err(explain)?;
    let report =
        Report::of_diagnosis(&robot.name, &data, &diagnosis, &findings).map_err(explain)?;
    let bytes = blob(
        &robot,
        &diagnosis.identified.calibration,
        data_file,
        &Origin {
            rows_identify: report.summary.rows.identify,
            rows_verify: report.summary.rows.verify,
            rms: report.before_and_after_mm().map(|mm| mm * 1e-3),
        },
    )?;
    let mut outputs = vec![Output {
        file: out.clone(),
        bytes,
    }];
    if let Some(file) = &options.page.report {
        outputs.push(Output {
            file: file.clone(),
            bytes: html(&report).map_err(Error::Drawing)?.into_bytes(),
        });
    }
    Ok(Outcome {
        text: text(&report),
        json: serde_json::to_value(&report.summary).map_err(Error::Json)?,
        outputs,
        answer: true,
    })
}
