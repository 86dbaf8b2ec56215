//! `truepose predict`: where the calibrated model puts the tool.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use truepose_host::error::Error;
use truepose_host::identify::assess::Statistics;
use truepose_host::measurement::{self, Expected, Purpose};
use truepose_host::output::Output;
use truepose_host::parameters::{self, missing_conditions};
use truepose_host::predict::{predict, uncertainty};

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
    /// Add how sure the model is of each pose, columns sx, sy, sz (m), srx, sry, srz (rad), by
    /// the covariance in the report that identify wrote with --json
    #[arg(long, value_name = "REPORT.json")]
    sigma: Option<PathBuf>,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let mut inputs = vec![options.params.params.as_path(), &options.data.data];
    inputs.extend(options.sigma.as_deref());
    Files {
        inputs,
        outputs: vec![&options.out.out],
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let (params, data, out) = (&options.params.params, &options.data.data, &options.out.out);
    // The program ends with the prediction, and the effects borrow from these bytes.
    let bytes: &'static [u8] = parameters::read(params)?.leak();
    let blob = parameters::decode(params, bytes)?;
    let table = measurement::read(data, &Expected::of_blob(&blob), Purpose::Joints)?;
    warn(&table.warnings);
    warn(&missing_conditions(&blob, &table));

    let poses = predict(params, &blob, &table)?;
    let spread = match &options.sigma {
        Some(report) => Some(uncertainty(report, &blob, &table)?),
        None => None,
    };
    let mut csv = String::from("x,y,z,qw,qx,qy,qz");
    if spread.is_some() {
        csv.push_str(",sx,sy,sz,srx,sry,srz");
    }
    csv.push('\n');
    for (i, pose) in poses.iter().enumerate() {
        let p = &pose.translation;
        let [w, x, y, z] = pose.quaternion();
        csv.push_str(&format!("{},{},{},{w},{x},{y},{z}", p.x, p.y, p.z));
        if let Some(covariance) = spread.as_ref().and_then(|all| all.get(i)) {
            for variance in covariance.diagonal().iter() {
                csv.push_str(&format!(",{}", variance.max(0.0).sqrt()));
            }
        }
        csv.push('\n');
    }
    let points = spread.as_ref().and_then(|all| {
        let point = |c: &nalgebra::Matrix6<f64>| c.diagonal().rows(0, 3).sum().max(0.0).sqrt();
        Statistics::of(&all.iter().map(point).collect::<Vec<f64>>())
    });
    let mut text = String::new();
    let mut sure = json!(null);
    if let Some(s) = points {
        text = format!(
            "tool point by the parameters' covariance, 1 sigma: {:.4} mm rms, {:.4} mm at most\n",
            s.rms * 1e3,
            s.max * 1e3
        );
        sure = json!({ "rms": s.rms * 1e3, "mean": s.mean * 1e3, "max": s.max * 1e3 });
    }
    let rows = poses.len();
    let robot = blob.robot.as_str();
    Ok(Outcome {
        text: format!(
            "{robot}: {rows} poses predicted from {}, written to {}\n{text}",
            data.display(),
            out.display()
        ),
        json: match sure.is_null() {
            true => json!({ "robot": robot, "rows": rows, "out": out }),
            false => json!({ "robot": robot, "rows": rows, "out": out, "model_sigma_mm": sure }),
        },
        outputs: vec![Output {
            file: out.clone(),
            bytes: csv.into_bytes(),
        }],
        answer: true,
    })
}
