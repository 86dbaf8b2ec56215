//! `truepose convert`: one robot in another convention, as drawn or as identified.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;
use truepose_host::convert::{Form, calibrated, convention_name, convert};
use truepose_host::description::Robot;
use truepose_host::error::Error;
use truepose_host::output::Output;
use truepose_host::parameters;

use super::options::{Out, RobotFile};
use super::{Files, Outcome};

/// Write the robot, as drawn or as identified, in another convention or as URDF
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    robot: RobotFile,
    /// Identified parameters: write the arm as it is, not as it is drawn
    #[arg(long, value_name = "P.tpb")]
    params: Option<PathBuf>,
    /// The form to write; hayati is dh, and Hayati's form between nearly parallel axes
    #[arg(long, value_enum)]
    to: To,
    #[command(flatten)]
    out: Out,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum To {
    /// Standard Denavit-Hartenberg
    Dh,
    /// The same, with Hayati's form from each axis to one nearly parallel to it
    Hayati,
    /// Craig's modified Denavit-Hartenberg
    Mdh,
    /// Axes and points in the base frame at zero
    ZeroReference,
    /// URDF; a --robot that is URDF keeps all else that stands in its file
    Urdf,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let inputs = std::iter::once(&options.robot.robot).chain(&options.params);
    Files {
        inputs: inputs.map(PathBuf::as_path).collect(),
        outputs: vec![&options.out.out],
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let file = &options.robot.robot;
    let drawn = Robot::read(file)?;
    let mut notes = Vec::new();
    let robot = match &options.params {
        None => drawn.clone(),
        Some(params) => {
            let bytes = parameters::read(params)?;
            let blob = parameters::decode(params, &bytes)?;
            for effect in &blob.effects {
                notes.push(format!(
                    "{} is not geometry and stays behind in {}",
                    effect.model().kind(),
                    params.display()
                ));
            }
            notes.dedup();
            calibrated(&drawn, &blob).ok_or_else(|| {
                Error::Usage(format!(
                    "{} is not of {}: it has other joints; give the parameters of this robot",
                    params.display(),
                    file.display()
                ))
            })?
        }
    };
    let form = match options.to {
        To::Dh => Form::Dh,
        To::Hayati => Form::Hayati,
        To::Mdh => Form::Mdh,
        To::ZeroReference | To::Urdf => Form::ZeroReference,
    };
    let converted = convert(&robot, form)
        .map_err(|refused| Error::Usage(format!("{}: {refused}", file.display())))?;
    for pair in &converted.nearly_parallel {
        notes.push(format!(
            "axes {} and {} are {:.4} deg from parallel: joint {} is in Hayati's form",
            pair.first + 1,
            pair.first + 2,
            pair.angle.to_degrees(),
            pair.first + 1
        ));
    }
    let text = match options.to {
        To::Urdf => match drawn.rewrite_urdf(file, &robot)? {
            Some(text) => {
                let [x, y, z] = robot.base.translation.map(|x| x * 1e3).into();
                let [roll, pitch, yaw] = robot.base.rpy().map(f64::to_degrees).into();
                notes.push(format!(
                    "the root link stands in the world at xyz {x:.4} {y:.4} {z:.4} mm, \
                     rpy {roll:.5} {pitch:.5} {yaw:.5} deg"
                ));
                text
            }
            None => converted.robot.to_urdf()?,
        },
        _ => converted.robot.to_toml(),
    };
    let conventions: Vec<&str> = (converted.robot.joints.iter())
        .map(|j| convention_name(j.joint.convention))
        .collect();
    let name = match options.to.to_possible_value() {
        Some(value) => value.get_name().to_owned(),
        None => String::new(),
    };
    let out = &options.out.out;
    let mut said = format!(
        "{}: {} as {name}, written to {}\n",
        drawn.name,
        match options.params {
            Some(_) => "as identified",
            None => "as drawn",
        },
        out.display()
    );
    for note in &notes {
        said += &format!("  {note}\n");
    }
    Ok(Outcome {
        text: said,
        json: json!({
            "robot": drawn.name,
            "to": name,
            "conventions": conventions,
            "calibrated": options.params.is_some(),
            "notes": notes,
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: text.into_bytes(),
        }],
        answer: true,
    })
}
