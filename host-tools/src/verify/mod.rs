//! Before and after: new measurements, made with compensated commands, against what the
//! parameters say.
//!
//! Before is how far the arm is from where its controller's own kinematics believe it to be,
//! after is how far it is from where the calibrated model puts it, at the same commands.

mod iso9283;
mod realign;

use std::path::Path;

use nalgebra::Vector3;
use truepose::effects::Conditions;
use truepose::params::{Blob, BlobError, MAX_JOINTS};
use truepose::{Pose, Twist};

use crate::error::{Error, Place};
use crate::identify::assess::Statistics;
use crate::joints::{first, with_joints};
use crate::measurement::{Dataset, Measured, Row};

pub use iso9283::{Iso9283, PoseFigures};
use realign::{anchor, moved, placement};

/// Errors of one model on the new rows, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Distance of tool points, or difference of lengths, m.
    pub position: Statistics,
    /// Angle between orientations, rad; with full poses.
    pub orientation: Option<Statistics>,
}

/// What new measurements say of a set of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Verified {
    /// What was measured.
    pub measured: Measured,
    /// Rows compared.
    pub rows: usize,
    /// With the controller's own kinematics.
    pub before: Errors,
    /// With the calibrated model.
    pub after: Errors,
    /// Accuracy and repeatability, where poses were measured more than once.
    pub iso9283: Option<Iso9283>,
    /// True if the instrument's placement (lengths: the wire's fixed end) was fitted to these
    /// rows first, for either model on its own.
    pub realigned: bool,
}

/// Compares the rows of `table` with the parameters in `blob`, which come from `file`. With
/// `realign` the instrument may stand elsewhere than when the parameters were identified;
/// lengths are always realigned, since the blob does not say where their fixed end is.
pub fn verify(
    file: &Path,
    blob: &Blob<'_>,
    table: &Dataset,
    realign: bool,
) -> Result<Verified, Error> {
    let joints = blob.joints();
    let (nominal, calibrated) = with_joints!(joints, N => predict::<N>(blob, table))
        .unwrap_or(Err(BlobError::Joints {
            found: joints,
            expected: MAX_JOINTS,
        }))
        .map_err(|cause| Error::Blob {
            file: file.to_path_buf(),
            cause,
        })?;
    let realigned = realign || table.measured == Measured::Length;
    let enough = match table.measured {
        Measured::Length => 4,
        _ if realign => 4,
        _ => 1,
    };
    let count = table.rows.iter().filter(|row| shows(row)).count();
    if count < enough {
        return Err(Place::file(&table.file).bad(
            format!("{count} rows with a measured tool point"),
            format!("at least {enough}"),
            "measure more poses",
        ));
    }
    let before = residuals(&table.rows, &nominal, table.measured, realigned);
    let after = residuals(&table.rows, &calibrated, table.measured, realigned);
    let (Some(errors_before), Some(errors_after)) = (errors(&before), errors(&after)) else {
        return Err(Place::file(&table.file).bad(
            "no measured row",
            "at least one",
            "measure the compensated poses",
        ));
    };
    let iso9283 = match table.measured {
        Measured::Length | Measured::Nothing => None,
        _ => iso9283::figures(&table.rows, &after),
    };
    Ok(Verified {
        measured: table.measured,
        rows: count,
        before: errors_before,
        after: errors_after,
        iso9283,
        realigned,
    })
}

fn shows(row: &Row) -> bool {
    row.position.is_some() || row.length.is_some()
}

/// Nominal and calibrated tool poses at every row, by the controller's code in `f64`.
type Predicted = (Vec<Pose<f64>>, Vec<Pose<f64>>);

fn predict<const N: usize>(blob: &Blob<'_>, table: &Dataset) -> Result<Predicted, BlobError> {
    let model = blob.model::<f64, N>()?;
    Ok(table
        .rows
        .iter()
        .map(|row| {
            let q = first(&row.q);
            let conditions = Conditions {
                direction: first(&row.direction),
                ambient: row.ambient(),
            };
            (model.nominal_pose(&q), model.predict(&q, &conditions))
        })
        .unzip())
}

/// Measured minus predicted of one row.
#[derive(Clone, Copy, Debug)]
struct Residual {
    /// Of the tool point or, in x, of the length, m; `None` where it was not measured.
    position: Option<Vector3<f64>>,
    /// Rotation vector, world axes, rad.
    orientation: Option<Vector3<f64>>,
}

fn residuals(
    rows: &[Row],
    predicted: &[Pose<f64>],
    measured: Measured,
    realigned: bool,
) -> Vec<Residual> {
    let pairs = || rows.iter().zip(predicted);
    if measured == Measured::Length {
        let lengths: Vec<(Vector3<f64>, f64)> = pairs()
            .filter_map(|(row, pose)| Some((pose.translation, row.length?)))
            .collect();
        let from = anchor(&lengths);
        return pairs()
            .map(|(row, pose)| Residual {
                position: row.length.map(|length| {
                    Vector3::new(length - (pose.translation - from).norm(), 0.0, 0.0)
                }),
                orientation: None,
            })
            .collect();
    }
    let points: Vec<(Vector3<f64>, Vector3<f64>)> = pairs()
        .filter_map(|(row, pose)| Some((pose.translation, row.position?.into())))
        .collect();
    let place = match realigned {
        true => placement(&points),
        false => Pose::identity(),
    };
    pairs()
        .map(|(row, pose)| {
            let pose = moved(&place, pose);
            let position = row.position.map(Vector3::from);
            let twist = row.pose().map(|measured| pose.twist_to(&measured));
            Residual {
                position: position.map(|p| p - pose.translation),
                orientation: twist.map(|twist: Twist<f64>| twist.angular),
            }
        })
        .collect()
}

fn errors(residuals: &[Residual]) -> Option<Errors> {
    let norms = |pick: fn(&Residual) -> Option<Vector3<f64>>| -> Vec<f64> {
        residuals
            .iter()
            .filter_map(pick)
            .map(|v| v.norm())
            .collect()
    };
    Some(Errors {
        position: Statistics::of(&norms(|r| r.position))?,
        orientation: Statistics::of(&norms(|r| r.orientation)),
    })
}
