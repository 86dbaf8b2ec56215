//! The controller's parameters, read back on the host.

use std::path::Path;

use truepose::effects::{KINDS, Needs};
use truepose::params::{Blob, UNLIMITED};

use crate::error::{Error, Place};
use crate::measurement::{Available, Dataset, Expected};
use crate::warning::Warning;

/// The bytes of a blob; [`decode`] borrows from them.
pub fn read(file: &Path) -> Result<Vec<u8>, Error> {
    if file.is_dir() {
        return Err(Place::file(file).bad("a directory", "a .tpb file", "name the file in it"));
    }
    std::fs::read(file).map_err(|cause| Error::Read {
        file: file.to_path_buf(),
        cause,
    })
}

/// The blob in `bytes`, which are those of `file`.
pub fn decode<'a>(file: &Path, bytes: &'a [u8]) -> Result<Blob<'a>, Error> {
    Blob::decode(bytes).map_err(|cause| Error::Blob {
        file: file.to_path_buf(),
        cause,
    })
}

impl Expected {
    /// Of the arm in a blob.
    pub fn of_blob(blob: &Blob<'_>) -> Self {
        let [lowest, highest] = UNLIMITED;
        let limited = |&[low, high]: &[f64; 2]| low > lowest || high < highest;
        Self {
            kinds: blob.calibrated.joints.iter().map(|j| j.kind).collect(),
            limits: blob
                .limits
                .iter()
                .map(|limits| limited(limits).then_some(*limits))
                .collect(),
            reach: Some(blob.calibrated.reach()),
        }
    }
}

/// Conditions that the blob's effects depend on and that `table` does not have.
pub fn missing_conditions(blob: &Blob<'_>, table: &Dataset) -> Vec<Warning> {
    let has = |needs: Needs, available: &Available, sensor: usize| match needs {
        Needs::Direction => available.direction,
        Needs::Temperature => available.temperature > sensor,
        Needs::Time => available.time,
        Needs::Joints | Needs::Masses | Needs::Gravity => true,
    };
    let mut warnings: Vec<Warning> = Vec::new();
    for effect in &blob.effects {
        let model = effect.model();
        let Some(kind) = KINDS.iter().find(|k| k.name == model.kind()) else {
            continue;
        };
        let sensor = model.selector().sensor.map_or(0, usize::from);
        if has(kind.needs, &table.available, sensor) {
            continue;
        }
        let warning = Warning::ConditionMissing {
            file: table.file.clone(),
            column: match kind.needs {
                Needs::Direction => "dir1, ...".to_owned(),
                Needs::Temperature => format!("temp{}", sensor + 1),
                _ => "t".to_owned(),
            },
            effect: kind.name,
        };
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
    warnings
}
