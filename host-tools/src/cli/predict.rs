//! `truepose predict`: where the calibrated model puts the tool.

use clap::Args;
use serde_json::json;
use truepose_host::error::Error;
use truepose_host::measurement::{self, Expected, Purpose};
use truepose_host::output::Output;
use truepose_host::parameters::{self, missing_conditions};
use truepose_host::predict::predict;

use super::options::{Data, Out, Params};
use super::{Files, Outcome, warn};

/// Say where the calibrated model puts the tool at each row's joints
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    params: Params,
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    out: Out,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    Files {
        inputs: vec![&options.params.params, &options.data.data],
        outputs: vec![&options.out.out],
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let (params, data, out) = (&options.params.params, &options.data.data, &options.out.out);
    let bytes = parameters::read(params)?;
    let blob = parameters::decode(params, &bytes)?;
    let table = measurement::read(data, &Expected::of_blob(&blob), Purpose::Joints)?;
    warn(&table.warnings);
    warn(&missing_conditions(&blob, &table));

    let poses = predict(params, &blob, &table)?;
    let mut csv = String::from("x,y,z,qw,qx,qy,qz\n");
    for pose in &poses {
        let p = &pose.translation;
        let [w, x, y, z] = pose.quaternion();
        csv.push_str(&format!("{},{},{},{w},{x},{y},{z}\n", p.x, p.y, p.z));
    }
    let rows = poses.len();
    let robot = blob.robot.as_str();
    Ok(Outcome {
        text: format!(
            "{robot}: {rows} poses predicted from {}, written to {}\n",
            data.display(),
            out.display()
        ),
        json: json!({ "robot": robot, "rows": rows, "out": out }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: csv.into_bytes(),
        }],
        answer: true,
    })
}
