//! `truepose circle-points`: the arm from sweeps of its joints, without a drawing.

use std::path::Path;

use clap::{Args, ValueEnum};
use serde_json::json;
use truepose_host::circle_points::{Drawn, Method, analyse, describe};
use truepose_host::convert::convention_name;
use truepose_host::error::{Error, Place};
use truepose_host::measurement::{self, Expected, Measured, Purpose};
use truepose_host::output::Output;

use super::options::{Data, Out};
use super::verify::three_digits;
use super::{Files, Outcome, warn};

/// Find the arm from sweeps of its joints, one at a time, without any drawing of it
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    out: Out,
    /// How link parameters are got from the axes
    #[arg(long, value_enum, default_value_t = By::Stone)]
    method: By,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum By {
    /// Frames on the axes, and the transforms between them
    Stone,
    /// Common normals of the axes
    Sklar,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    Files {
        inputs: vec![&options.data.data],
        outputs: vec![&options.out.out],
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let (file, out) = (&options.data.data, &options.out.out);
    let (expected, kinds) = Expected::of_table(file)?;
    let table = measurement::read(file, &expected, Purpose::Check)?;
    warn(&table.warnings);
    if table.measured == Measured::Length {
        return Err(Place::file(file).bad(
            "lengths",
            "x, y and z of a target on the arm",
            "measure points",
        ));
    }
    let analysis = analyse(&table, &kinds).map_err(|failure| failure.explain(file))?;
    let method = match options.method {
        By::Stone => Method::Stone,
        By::Sklar => Method::Sklar,
    };
    let name = out.file_stem().unwrap_or_default().to_string_lossy();
    let robot = describe(&name, Path::new(out), &analysis, method);

    let mut text = format!(
        "{}: {} joints from {} sweeps, written to {}\n  \
         joint  rows            drew            noise mm  axis mrad  axis mm\n",
        file.display(),
        robot.joints.len(),
        analysis.traced.len(),
        out.display()
    );
    let mut sweeps = Vec::new();
    for sweep in &analysis.traced {
        let (shape, size) = match sweep.drawn {
            Drawn::Circle(radius) => ("circle", radius),
            Drawn::Line(length) => ("line", length),
        };
        let [first, last] = sweep.rows;
        let rows = format!("{first} to {last}");
        let drew = format!("{shape} {:.1} mm", size * 1e3);
        let [noise, tilt, place] =
            [sweep.sigma, sweep.direction_error, sweep.point_error].map(|x| three_digits(x * 1e3));
        text += &format!(
            "  {:>5}  {rows:<14}  {drew:<16}{noise:>8}  {tilt:>9}  {place:>7}\n",
            sweep.joint + 1
        );
        sweeps.push(json!({
            "joint": sweep.joint + 1, "rows": sweep.rows, "shape": shape,
            "size_mm": size * 1e3, "noise_mm": sweep.sigma * 1e3,
            "direction_error_mrad": sweep.direction_error * 1e3,
            "point_error_mm": sweep.point_error * 1e3,
        }));
    }
    text += &format!(
        "swept points are {} mm rms from where this arm puts them\n",
        three_digits(analysis.rms * 1e3)
    );
    if !analysis.unused.is_empty() {
        text += &format!(
            "{} of {} rows belong to no sweep\n",
            analysis.unused.len(),
            table.rows.len()
        );
    }
    text += "not known from sweeps: how the tool is turned, masses, limits and gravity, which is \
             taken to be along -z of the base, axis 1\n";
    let conventions: Vec<&str> = (robot.joints.iter())
        .map(|j| convention_name(j.joint.convention))
        .collect();
    Ok(Outcome {
        text,
        json: json!({
            "joints": robot.joints.len(),
            "conventions": conventions,
            "sweeps": sweeps,
            "rms_mm": analysis.rms * 1e3,
            "unused": analysis.unused,
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: robot.to_toml().into_bytes(),
        }],
        answer: true,
    })
}
