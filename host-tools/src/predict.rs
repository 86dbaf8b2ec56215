//! Where the calibrated model puts the tool.

use std::path::Path;

use truepose::Pose;
use truepose::effects::Conditions;
use truepose::params::{Blob, BlobError, MAX_JOINTS};

use crate::error::Error;
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
