//! Corrected joint commands for a table of targets, by the controller's own code.

use std::fmt;
use std::path::Path;

use truepose::budget::Budget;
use truepose::compensate::{Compensator, Outcome, PoseError, Request, Status};
use truepose::effects::{Ambient, Conditions};
use truepose::params::{Blob, BlobError, MAX_JOINTS};
use truepose::{Method, Scalar};

use crate::error::Error;
use crate::joints::{first, with_joints};
use crate::measurement::{Dataset, Row};

/// Number type to compute in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// What a controller with a single-precision unit computes, bit for bit.
    F32,
    /// As exact as the host can.
    F64,
}

/// One corrected command.
#[derive(Clone, Debug, PartialEq)]
pub struct Corrected {
    /// Joint command to send, rad or m; exact, whatever the precision.
    pub q: Vec<f64>,
    /// Why it is as it is.
    pub status: Status,
    /// Steps that were evaluated.
    pub iterations: u8,
    /// Predicted error of the nominal command, m and rad; `None` where it was not computed.
    pub initial: Option<PoseError<f64>>,
    /// Predicted error of `q`; likewise.
    pub remaining: Option<PoseError<f64>>,
}

impl Precision {
    /// A number of this precision with as few digits as give it back exactly.
    pub fn shortest(self, x: f64) -> String {
        match self {
            Self::F32 => (x as f32).to_string(),
            Self::F64 => x.to_string(),
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        })
    }
}

/// The command for each target of `table`, whose joints are those of `blob`; every one is
/// computed as the controller's first. `method`: instead of the blob's own; `file`: where the
/// blob comes from.
pub fn compensate(
    file: &Path,
    blob: &Blob<'_>,
    table: &Dataset,
    method: Option<Method>,
    precision: Precision,
) -> Result<Vec<Corrected>, Error> {
    let joints = blob.joints();
    match precision {
        Precision::F32 => with_joints!(joints, N => rows::<f32, N>(blob, table, method)),
        Precision::F64 => with_joints!(joints, N => rows::<f64, N>(blob, table, method)),
    }
    .unwrap_or(Err(BlobError::Joints {
        found: joints,
        expected: MAX_JOINTS,
    }))
    .map_err(|cause| Error::Blob {
        file: file.to_path_buf(),
        cause,
    })
}

fn rows<T: Scalar, const N: usize>(
    blob: &Blob<'_>,
    table: &Dataset,
    method: Option<Method>,
) -> Result<Vec<Corrected>, BlobError> {
    let model = blob.model::<T, N>()?;
    let mut settings = model.settings;
    settings.method = method.unwrap_or(settings.method);
    let mut compensator = Compensator::new(&model).with_settings(settings);
    let correct = |row: &Row| {
        compensator.reset();
        corrected(compensator.correct(&request(row), &mut Budget::unlimited()))
    };
    Ok(table.rows.iter().map(correct).collect())
}

fn request<T: Scalar, const N: usize>(row: &Row) -> Request<T, N> {
    let ambient = row.ambient();
    Request {
        q: first(&row.q).map(T::of),
        pose: row.pose().map(|pose| pose.cast()),
        conditions: Conditions {
            direction: first(&row.direction).map(T::of),
            ambient: Ambient {
                payload: T::of(ambient.payload),
                payload_com: ambient.payload_com.map(T::of),
                temperature: ambient.temperature.map(T::of),
                time: T::of(ambient.time),
            },
        },
    }
}

fn corrected<T: Scalar, const N: usize>(outcome: Outcome<T, N>) -> Corrected {
    let error = |e: PoseError<T>| PoseError {
        position: e.position.widen(),
        orientation: e.orientation.widen(),
    };
    Corrected {
        q: outcome.q.iter().map(|q| q.widen()).collect(),
        status: outcome.status,
        iterations: outcome.iterations,
        initial: outcome.initial.map(error),
        remaining: outcome.remaining.map(error),
    }
}
