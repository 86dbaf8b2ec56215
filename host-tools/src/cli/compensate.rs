//! `truepose compensate`: corrected commands for a table of targets.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use clap::{Args, ValueEnum};
use serde_json::json;
use truepose::Method;
use truepose::compensate::{PoseError, Status};
use truepose::params::Blob;
use truepose_host::compensate::{Corrected, Precision, compensate};
use truepose_host::error::Error;
use truepose_host::measurement::{self, Dataset, Expected, Purpose};
use truepose_host::output::Output;
use truepose_host::parameters::{self, missing_conditions};
use truepose_host::predict::predict;

use super::options::{Out, Params};
use super::{Files, Outcome, warn};

/// Correct joint commands so that the arm as it is reaches the targets
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    params: Params,
    /// Poses to reach and the joints that nominally reach them
    #[arg(long, value_name = "T.csv", required_unless_present = "taught")]
    targets: Option<PathBuf>,
    /// Joint commands (q1, ...) taught on another robot, to reach the same poses with
    #[arg(long, value_name = "T.csv", conflicts_with = "targets")]
    taught: Option<PathBuf>,
    /// Parameters of the robot that was taught, in the same world; without them, it was as
    /// nominal as drawn
    #[arg(long, value_name = "A.tpb", requires = "taught")]
    from: Option<PathBuf>,
    #[command(flatten)]
    out: Out,
    /// Compensator, instead of the one that the parameters name
    #[arg(long, value_name = "M", value_parser = PossibleValuesParser::new(Method::ALL.map(Method::name)))]
    method: Option<String>,
    /// Number type to compute in: f32 gives the bits of a single-precision controller
    #[arg(long, value_enum, default_value_t = NumberType::F64)]
    precision: NumberType,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum NumberType {
    F32,
    F64,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let mut inputs = vec![options.params.params.as_path()];
    let tables = [&options.targets, &options.taught, &options.from];
    inputs.extend(tables.into_iter().flatten().map(PathBuf::as_path));
    Files {
        inputs,
        outputs: vec![&options.out.out],
    }
}

/// The rows to compensate, each with its pose, or without one where it is what the joints
/// nominally mean.
fn rows(options: &Options, blob: &Blob<'_>) -> Result<Dataset, Error> {
    let expected = Expected::of_blob(blob);
    let Some(taught) = &options.taught else {
        let targets = options.targets.as_deref().unwrap_or(Path::new(""));
        return measurement::read(targets, &expected, Purpose::Targets);
    };
    let mut table = measurement::read(taught, &expected, Purpose::Joints)?;
    // MRD 5.22: where the robot that was taught had its tool.
    let poses = match &options.from {
        Some(from) => {
            let bytes = parameters::read(from)?;
            let other = parameters::decode(from, &bytes)?;
            let kinds = |blob: &Blob<'_>| -> Vec<_> {
                blob.nominal.joints.iter().map(|joint| joint.kind).collect()
            };
            if kinds(&other) != kinds(blob) {
                return Err(Error::Usage(format!(
                    "{} and {}: not of the same joints",
                    from.display(),
                    options.params.params.display()
                )));
            }
            warn(&missing_conditions(&other, &table));
            predict(from, &other, &table)?
                .into_iter()
                .map(Some)
                .collect()
        }
        None => vec![None; table.rows.len()],
    };
    for (row, pose) in table.rows.iter_mut().zip(poses) {
        row.position = pose.map(|pose| pose.translation.into());
        row.orientation = pose.map(|pose| pose.quaternion());
    }
    Ok(table)
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let (params, out) = (&options.params.params, &options.out.out);
    let bytes = parameters::read(params)?;
    let blob = parameters::decode(params, &bytes)?;
    let table = rows(options, &blob)?;
    warn(&table.warnings);
    warn(&missing_conditions(&blob, &table));

    let method = options.method.as_deref().and_then(Method::named);
    let precision = match options.precision {
        NumberType::F32 => Precision::F32,
        NumberType::F64 => Precision::F64,
    };
    let used = method.unwrap_or(blob.settings.method);
    if !blob.taught.has(used) {
        let (file, name) = (params.display(), used.name());
        return Err(Error::Usage(format!(
            "{file}: no {name} was taught: truepose teach --params {file} --method {name} --out \
             FILE puts one in"
        )));
    }
    let corrected = compensate(params, &blob, &table, method, precision)?;

    let mut csv: String = (1..=blob.joints()).map(|k| format!("q{k},")).collect();
    csv.push_str("converged,iterations\n");
    for one in &corrected {
        for &q in &one.q {
            csv.push_str(&precision.shortest(q));
            csv.push(',');
        }
        let converged = u8::from(one.status == Status::Converged);
        csv.push_str(&format!("{converged},{}\n", one.iterations));
    }
    let method = used.name();
    let count = |is: fn(Status) -> bool| corrected.iter().filter(|c| is(c.status)).count();
    let converged = count(|s| s == Status::Converged);
    let refused = count(|s| !s.compensated());
    let stopped = corrected.len() - converged - refused;
    let iterations = corrected.iter().map(|c| c.iterations).max().unwrap_or(0);
    let before = largest(&corrected, |c| c.initial);
    let after = largest(&corrected, |c| c.remaining);
    let text = format!(
        "{}: {} targets by {method} in {precision}, written to {}\n\
         {converged} converged, {stopped} stopped before, {refused} refused; \
         at most {iterations} iterations\n\
         largest predicted error: {} before, {} after\n",
        blob.robot,
        corrected.len(),
        out.display(),
        for_people(&before),
        for_people(&after),
    );
    Ok(Outcome {
        text,
        json: json!({
            "robot": blob.robot.as_str(),
            "method": method,
            "precision": precision.to_string(),
            "targets": corrected.len(),
            "converged": converged,
            "stopped": stopped,
            "refused": refused,
            "iterations": iterations,
            "largest_before": { "mm": before.position * 1e3, "deg": before.orientation.to_degrees() },
            "largest_after": { "mm": after.position * 1e3, "deg": after.orientation.to_degrees() },
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: csv.into_bytes(),
        }],
        answer: true,
    })
}

fn largest(
    corrected: &[Corrected],
    error: impl Fn(&Corrected) -> Option<PoseError<f64>>,
) -> PoseError<f64> {
    let zero = PoseError {
        position: 0.0,
        orientation: 0.0,
    };
    corrected
        .iter()
        .filter_map(error)
        .fold(zero, |a, b| PoseError {
            position: a.position.max(b.position),
            orientation: a.orientation.max(b.orientation),
        })
}

fn for_people(error: &PoseError<f64>) -> String {
    format!(
        "{:.3e} mm, {:.3e} deg",
        error.position * 1e3,
        error.orientation.to_degrees()
    )
}
