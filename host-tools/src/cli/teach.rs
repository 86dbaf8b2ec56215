//! `truepose teach`: corrections that the controller looks up.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use clap::{Args, value_parser};
use serde_json::json;
use truepose::taught::polynomial::terms;
use truepose::{JointKind, Method};
use truepose_host::deploy::encoded;
use truepose_host::error::Error;
use truepose_host::measurement::{self, Expected, Purpose};
use truepose_host::output::Output;
use truepose_host::parameters;
use truepose_host::teach::wrist::ARM;
use truepose_host::teach::{Form, Held, TESTED, region, teach, test};

use super::options::{Out, Params};
use super::verify::three_digits;
use super::{Files, Outcome, warn};

/// Put corrections that are looked up into the parameters, for the methods polynomial and cmac
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    params: Params,
    /// What is taught: polynomials of the joints, or tables
    #[arg(long, value_name = "M", value_parser = PossibleValuesParser::new([Method::Polynomial.name(), Method::Cmac.name()]))]
    method: String,
    /// Polynomials of the first three joints, and of the wrist as a translation of the tool: a
    /// fraction of the memory, positions only
    #[arg(long)]
    wrist: bool,
    /// Commands (q1, ...) that span the region to teach; without them, all between the limits
    #[arg(long, value_name = "T.csv")]
    targets: Option<PathBuf>,
    /// Flash that the tables may take on the controller, in kB of 1000 bytes
    #[arg(long, value_name = "KB", default_value_t = 16, value_parser = value_parser!(u32).range(1..=16_000))]
    memory: u32,
    #[command(flatten)]
    out: Out,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let mut inputs = vec![options.params.params.as_path()];
    inputs.extend(options.targets.as_deref());
    Files {
        inputs,
        outputs: vec![&options.out.out],
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let (params, out) = (&options.params.params, &options.out.out);
    let bytes = parameters::read(params)?;
    let blob = parameters::decode(params, &bytes)?;
    let joints = blob.joints();
    let refused = |why: String| Error::Usage(format!("{}: {why}", params.display()));
    let rows = match &options.targets {
        Some(targets) => {
            let table = measurement::read(targets, &Expected::of_blob(&blob), Purpose::Joints)?;
            warn(&table.warnings);
            table.rows.into_iter().map(|row| row.q).collect()
        }
        None => Vec::new(),
    };
    let region = region(&blob, &rows).map_err(|joint| {
        refused(format!(
            "joint {} has no limits: name commands that span the region with --targets",
            joint + 1
        ))
    })?;
    let room = 1000 * options.memory as usize;
    let method = Method::named(&options.method);
    let largest = match (options.wrist, method) {
        (true, Some(Method::Polynomial)) if joints > ARM => Some(Form::largest_wrist(joints, room)),
        (true, _) => {
            let why = "--wrist is for polynomials of arms of more than three joints";
            return Err(refused(why.to_owned()));
        }
        (false, method) => method.and_then(|method| Form::largest(method, joints, room)),
    };
    let form = largest
        .ok_or_else(|| refused(format!("{} is not taught", options.method)))?
        .map_err(|bytes| {
            refused(format!(
                "{} of {joints} joints takes {} at least: raise --memory",
                options.method,
                kilobytes(bytes)
            ))
        })?;
    let memory = form.bytes(joints).unwrap_or(usize::MAX);
    let what = described(form, joints);
    // Before it is spent.
    eprintln!("{}: {what}: {} of tables", blob.robot, kilobytes(memory));
    let taught = teach(&blob, form, &region).map_err(|why| refused(why.to_owned()))?;
    let mut blob = parameters::decode(params, &bytes)?;
    taught.put(&mut blob);
    let unsound = |cause| Error::Blob {
        file: params.clone(),
        cause,
    };
    let [before, after] = test(&blob, &region).map_err(unsound)?;
    let encoded = encoded(&blob).map_err(unsound)?;

    let better = after.position < before.position
        && (options.wrist || after.orientation < before.orientation);
    let mut text = format!(
        "{}: {what}, {} of tables, written to {} ({})\n\
         error of {TESTED} commands that were not taught, rms: {} before, {} after\n\
         taught at no payload, no direction, no temperature; region:\n",
        blob.robot,
        kilobytes(memory),
        out.display(),
        kilobytes(encoded.len()),
        for_people(&before),
        for_people(&after),
    );
    for (j, (joint, [low, high])) in blob.nominal.joints.iter().zip(&region).enumerate() {
        let (scale, unit) = match joint.kind {
            JointKind::Revolute => (1.0_f64.to_degrees(), "deg"),
            JointKind::Prismatic => (1e3, "mm"),
        };
        let (low, high) = (low * scale, high * scale);
        text += &format!("  joint {}: {low:.1} to {high:.1} {unit}\n", j + 1);
    }
    if !better {
        text += "commands are not better for it: teach a smaller region, or allow more memory\n";
    }
    let error =
        |held: &Held| json!({ "mm": held.position * 1e3, "deg": held.orientation.to_degrees() });
    Ok(Outcome {
        text,
        json: json!({
            "robot": blob.robot.as_str(),
            "method": options.method,
            "form": what,
            "bytes": { "tables": memory, "blob": encoded.len() },
            "region": region,
            "tested": TESTED,
            "before": error(&before),
            "after": error(&after),
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: encoded,
        }],
        answer: better,
    })
}

fn described(form: Form, joints: usize) -> String {
    match form {
        Form::Polynomial { degree } => format!(
            "polynomials of degree {degree} in {joints} joints, {} terms",
            terms(joints, usize::from(degree))
        ),
        Form::Wrist { degree } => format!(
            "polynomials of degree {degree} in {ARM} joints, the wrist's {} as a translation",
            joints - ARM
        ),
        Form::Cmac(layout) => format!(
            "CMAC of {joints} joints, {} quantising functions of {} cells along each",
            layout.layers,
            usize::from(layout.cells) + 1
        ),
    }
}

fn kilobytes(bytes: usize) -> String {
    format!("{:.1} kB", bytes as f64 / 1e3)
}

fn for_people(held: &Held) -> String {
    let mm = three_digits(held.position * 1e3);
    let deg = three_digits(held.orientation.to_degrees());
    format!("{mm} mm, {deg} deg")
}
