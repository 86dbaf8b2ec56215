//! Before and after: new measurements, made with compensated commands, against what the
//! parameters say.
//!
//! Before is how far the arm is from where its controller's own kinematics believe it to be,
//! after is how far it is from where the calibrated model puts it, at the same commands.

mod bound;
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

use bound::Bound;
pub use iso9283::{Iso9283, PoseFigures};
use realign::{moved, placement};

/// Errors of one model on the new rows, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Distance of tool points; difference of lengths or distances; how far a touch is off;
    /// how far a bearing is off across the line of sight, m.
    pub position: Statistics,
    /// Angle between orientations, rad; with full poses.
    pub orientation: Option<Statistics>,
    /// Angle between lines of sight, rad; with bearings.
    pub bearing: Option<Statistics>,
    /// What that says of the tool point where a measurement sees it in part: root mean square
    /// distance, m, if no direction errs more than another. What was fitted to the rows first
    /// is paid for.
    pub tool_point: Option<f64>,
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
    /// True if the instrument's placement (where a wire ends, a point or plane is, a further
    /// theodolite stands) was fitted to these rows first, for either model on its own.
    pub realigned: bool,
}

/// Compares the rows of `table` with the parameters in `blob`, which come from `file`. With
/// `realign` the instrument may stand elsewhere than when the parameters were identified. What
/// the blob does not say, as where a wire ends or a touched plane is, is always found first.
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
    let no_row = || {
        Place::file(&table.file).bad(
            "no measured row",
            "at least one",
            "measure the compensated poses",
        )
    };
    if !matches!(table.measured, Measured::Position | Measured::Pose) {
        let bound = Bound::new(table, realign)?;
        return Ok(Verified {
            measured: table.measured,
            rows: bound.rows(),
            before: bound.errors(&nominal).ok_or_else(no_row)?,
            after: bound.errors(&calibrated).ok_or_else(no_row)?,
            iso9283: None,
            realigned: bound.is_realigned(),
        });
    }
    let enough = if realign { 4 } else { 1 };
    let count = table.rows.iter().filter(|row| row.position.is_some());
    let count = count.count();
    if count < enough {
        return Err(Place::file(&table.file).bad(
            format!("{count} rows with a measured tool point"),
            format!("at least {enough}"),
            "measure more poses",
        ));
    }
    let before = residuals(&table.rows, &nominal, realign);
    let after = residuals(&table.rows, &calibrated, realign);
    Ok(Verified {
        measured: table.measured,
        rows: count,
        before: errors(&before).ok_or_else(no_row)?,
        after: errors(&after).ok_or_else(no_row)?,
        iso9283: iso9283::figures(&table.rows, &after),
        realigned: realign,
    })
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
    /// Of the tool point, m; `None` where it was not measured.
    position: Option<Vector3<f64>>,
    /// Rotation vector, world axes, rad.
    orientation: Option<Vector3<f64>>,
}

fn residuals(rows: &[Row], predicted: &[Pose<f64>], realigned: bool) -> Vec<Residual> {
    let pairs = || rows.iter().zip(predicted);
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
        bearing: None,
        tool_point: None,
    })
}
