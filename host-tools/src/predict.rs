//! Where the calibrated model puts the tool.

use std::path::Path;

use nalgebra::Matrix6;
use truepose::Pose;
use truepose::effects::Conditions;
use truepose::params::{Blob, BlobError, MAX_JOINTS};

use crate::error::{Error, Place};
use crate::identify::arm::ArmModel;
use crate::identify::observation::Observation;
use crate::identify::predicted::{Covariance, Uncertainty};
use crate::joints::{first, with_joints};
use crate::measurement::{Dataset, Row};

/// Tool pose in the world at each row of `table`, whose joints are those of `blob`, by the
/// controller's own code in `f64`. `file`: where the blob comes from.
pub fn predict(file: &Path, blob: &Blob<'_>, table: &Dataset) -> Result<Vec<Pose<f64>>, Error> {
    let joints = blob.joints();
    with_joints!(joints, N => rows::<N>(blob, table))
        .unwrap_or(Err(BlobError::Joints {
            found: joints,
            expected: MAX_JOINTS,
        }))
        .map_err(|cause| Error::Blob {
            file: file.to_path_buf(),
            cause,
        })
}

/// The calibrated arm of a blob, as identification sees it. Effects borrow from the blob, so it
/// must live as long.
pub fn calibrated(blob: &Blob<'static>) -> ArmModel {
    let of = &blob.calibrated;
    let mut arm = ArmModel::new(
        (&of.base).into(),
        of.joints.to_vec(),
        of.masses.to_vec(),
        (&of.tool).into(),
        blob.gravity.into(),
    );
    arm.effects = blob.effects.to_vec();
    arm.bake();
    arm
}

/// Covariance of the predicted tool pose at each row of `table`, by the parameters' covariance
/// alone. `report`: where that comes from.
pub fn uncertainty(
    report: &Path,
    blob: &Blob<'static>,
    table: &Dataset,
) -> Result<Vec<Matrix6<f64>>, Error> {
    let arm = calibrated(blob);
    let covariance = Covariance::read(report)?;
    let uncertainty = Uncertainty::new(&covariance, &arm).map_err(|name| {
        Place::file(report).column("covariance").bad(
            format!("a parameter {name}, which the blob's arm does not have"),
            "the report that was written with these parameters",
            "give the two files that one run of identify or diagnose wrote",
        )
    })?;
    let rows: Vec<Observation> = table
        .rows
        .iter()
        .map(|row| Observation {
            row: row.number,
            q: row.q.clone(),
            direction: row.direction.clone(),
            travel: vec![0.0; row.q.len()],
            ambient: row.ambient(),
            ..Observation::default()
        })
        .collect();
    let rows: Vec<&Observation> = rows.iter().collect();
    Ok(uncertainty.at(&arm, &rows))
}

fn rows<const N: usize>(blob: &Blob<'_>, table: &Dataset) -> Result<Vec<Pose<f64>>, BlobError> {
    let model = blob.model::<f64, N>()?;
    let predict = |row: &Row| {
        let conditions = Conditions {
            direction: first(&row.direction),
            ambient: row.ambient(),
        };
        model.predict(&first(&row.q), &conditions)
    };
    Ok(table.rows.iter().map(predict).collect())
}
