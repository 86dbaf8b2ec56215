//! The subcommands, one file each.
//!
//! To add one: a file with `Options` (its arguments, shared ones from [`options`]),
//! `files(&Options)`, which names what it reads and writes, and `run(&Options)`, a line in
//! [`Command`] and one in [`run`]. The outputs are checked before `run` starts. It says what
//! it noticed with [`warn`] and hands back what is printed and written: nothing is written
//! before all of it is there.

mod circle_points;
mod compensate;
mod convert;
mod deliver;
mod demo;
mod diagnose;
mod identify;
mod inspect;
mod monitor;
mod options;
mod plan;
mod predict;
mod progress;
mod send;
mod teach;
mod verify;

use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};
use truepose_host::error::Error;
use truepose_host::output::{self, Output};
use truepose_host::warning::Warning;

const EXIT: &str = "Exit status: 0 done; 1 done, and the answer is no; 2 could not.";

/// Measures what a robot arm really is and tells its controller.
#[derive(Debug, Parser)]
#[command(name = "truepose", version, about, after_help = EXIT)]
pub(crate) struct Arguments {
    /// Write what is printed to FILE as JSON too
    #[arg(long, global = true, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Identify(identify::Options),
    Diagnose(diagnose::Options),
    Predict(predict::Options),
    Teach(teach::Options),
    Compensate(compensate::Options),
    Verify(verify::Options),
    Plan(plan::Options),
    CirclePoints(circle_points::Options),
    Convert(convert::Options),
    Demo(demo::Options),
    Inspect(inspect::Options),
    Send(send::Options),
    Monitor(monitor::Options),
}

/// What a command reads and writes, `--json` aside.
#[derive(Debug)]
pub(crate) struct Files<'a> {
    pub(crate) inputs: Vec<&'a Path>,
    pub(crate) outputs: Vec<&'a Path>,
}

/// What a command found out.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// For stdout, with its last line break.
    pub(crate) text: String,
    /// The same for `--json`.
    pub(crate) json: serde_json::Value,
    /// Files to write.
    pub(crate) outputs: Vec<Output>,
    /// False if the answer is no, such as an accuracy that is not met: exit status 1.
    pub(crate) answer: bool,
}

/// Runs the command and writes its files.
pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Error> {
    let mut files = match &arguments.command {
        Command::Identify(options) => identify::files(options),
        Command::Diagnose(options) => diagnose::files(options),
        Command::Predict(options) => predict::files(options),
        Command::Teach(options) => teach::files(options),
        Command::Compensate(options) => compensate::files(options),
        Command::Verify(options) => verify::files(options),
        Command::Plan(options) => plan::files(options),
        Command::CirclePoints(options) => circle_points::files(options),
        Command::Convert(options) => convert::files(options),
        Command::Demo(options) => demo::files(options),
        Command::Inspect(options) => inspect::files(options),
        Command::Send(options) => send::files(options),
        Command::Monitor(options) => monitor::files(options),
    };
    files.outputs.extend(arguments.json.as_deref());
    output::check(&files.outputs, &files.inputs)?;
    let mut outcome = match &arguments.command {
        Command::Identify(options) => identify::run(options),
        Command::Diagnose(options) => diagnose::run(options),
        Command::Predict(options) => predict::run(options),
        Command::Teach(options) => teach::run(options),
        Command::Compensate(options) => compensate::run(options),
        Command::Verify(options) => verify::run(options),
        Command::Plan(options) => plan::run(options),
        Command::CirclePoints(options) => circle_points::run(options),
        Command::Convert(options) => convert::run(options),
        Command::Demo(options) => demo::run(options),
        Command::Inspect(options) => inspect::run(options),
        Command::Send(options) => send::run(options),
        Command::Monitor(options) => monitor::run(options),
    }?;
    if let Some(file) = &arguments.json {
        let mut bytes = format!("{:#}", outcome.json).into_bytes();
        bytes.push(b'\n');
        outcome.outputs.push(Output {
            file: file.clone(),
            bytes,
        });
    }
    output::commit(&outcome.outputs)?;
    Ok(outcome)
}

/// Says on stderr what was noticed.
fn warn(warnings: &[Warning]) {
    for warning in warnings {
        eprintln!("warning: {warning}");
    }
}
