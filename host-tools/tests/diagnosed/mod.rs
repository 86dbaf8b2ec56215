//! The whole way from a table to its diagnosis.

use truepose_host::description::Robot;
use truepose_host::diagnose::{Diagnosis, diagnose};
use truepose_host::identify::assess::{Statistics, errors};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::readings::identify_file;
use truepose_host::measurement::Dataset;

pub(crate) fn diagnosed(robot: &Robot, data: &Dataset) -> Diagnosis {
    let identified = identify_file(robot, data, Vec::new()).unwrap();
    diagnose(identified, &|_| {}).unwrap()
}

/// Verify rms of geometry alone and of the complete model, m.
pub(crate) fn rms(diagnosis: &Diagnosis) -> [f64; 2] {
    let verify: Vec<&Observation> = diagnosis.identified.problem.verify.iter().collect();
    let calibration = &diagnosis.identified.calibration;
    [&calibration.geometric, &calibration.complete].map(|stage| {
        Statistics::of(&errors(&stage.arm, &verify).distances)
            .unwrap()
            .rms
    })
}
