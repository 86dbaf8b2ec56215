//! All tests of the crate, a file for each behaviour: one program is linked once, and its tests
//! run side by side. `cargo test --test all elbow_arm` runs those of one file.

#![expect(clippy::unwrap_used, reason = "a test may stop at what cannot happen")]
#![expect(clippy::panic, reason = "a test may stop at what cannot happen")]

mod blob_survives_corruption;
mod chain_agrees_with_its_description;
mod commands_stay_continuous;
mod compensation_keeps_its_promises;
mod compensation_reaches_the_pose;
mod damaged_input_is_refused;
mod effects_do_what_they_say;
mod effects_keep_their_contract;
mod elbow_arm;
mod hardware_at_the_edge;
mod link_takes_parameters;
mod plain_cases_are_general_ones;
mod polynomials_are_sums;
mod prepared_is_the_contract;
mod regulator_is_least_squares;
mod roots_are_exact;
mod sine_and_cosine;
mod storage_survives_power_cuts;
mod task_point_moves;
mod whole_steps_add_least_error;

// What they share.
#[path = "support/blobs.rs"]
mod blobs;
#[path = "support/controller.rs"]
mod controller;
#[path = "support/described.rs"]
mod described;
#[path = "support/memories.rs"]
mod memories;
#[path = "support/path.rs"]
mod path;
#[path = "support/puma.rs"]
mod puma;
#[path = "support/random.rs"]
mod random;
#[path = "support/samples.rs"]
mod samples;
#[path = "support/tables.rs"]
mod tables;

/// A file that is not named above would not be tested.
#[test]
fn every_file_is_here() {
    let here = include_str!("all.rs");
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name();
        if let Some(name) = name.to_str().unwrap().strip_suffix(".rs") {
            let (named, itself) = (format!("mod {name};"), name == "all");
            assert!(itself || here.lines().any(|line| line == named), "{name}");
        }
    }
}
