//! All tests of the host tools, a file for each behaviour: one program is linked once, and its
//! tests run side by side. `cargo test -p truepose-host-tools --test all truth_comes_back` runs
//! those of one file.

#![expect(clippy::unwrap_used, reason = "a test may stop at what cannot happen")]
#![expect(clippy::panic, reason = "a test may stop at what cannot happen")]

mod a_camera_on_the_arm_is_enough;
mod arm_is_found_without_a_drawing;
mod bad_input_is_named;
mod blob_is_put_to_use;
mod cell_effects_show;
mod cell_is_the_robot_of_its_files;
mod closed_chains_calibrate_themselves;
mod commands_hold_or_free_by_name;
mod complete_models_count_as_theory_says;
mod damaged_files_do_not_panic;
mod demo_closes_the_loop;
mod dependent_columns_are_found;
mod descriptions_are_read;
mod diagnosis_names_what_is_hidden;
mod diagnosis_reads_every_kind;
mod effects_are_recovered;
mod effects_explain_the_cell;
mod estimators_agree;
mod every_kind_of_measurement_is_enough;
mod findings_serve_later_series;
mod five_axis_study_shows_its_trends;
mod gross_rows_are_named_and_left_out;
mod inputs_are_checked_before_the_arm;
mod masses_may_be_unknown_or_wrong;
mod measured_robots_come_out_as_expected;
mod measurements_are_read;
mod measurements_of_every_kind_are_read;
mod observability_indices_follow_their_papers;
mod outputs_are_whole;
mod parameters_are_held_or_free;
mod parameters_reach_a_controller;
mod plan_chooses_telling_poses;
mod plan_tells_explanations_apart;
mod plan_writes_poses_to_measure;
mod puma_tables_come_out;
mod rank_loss_ends_with_a_report;
mod real_measurements_are_read;
mod robot_is_the_same_in_every_convention;
mod scatter_matches_standard_errors;
mod several_hidden_effects_are_named;
mod tables_are_put_into_parameters;
mod taught_commands_are_continuous;
mod teaching_follows_the_book;
mod truth_comes_back;
mod two_link_arm_needs_repetitions;
mod uncertainty_is_honest;
mod urdf_is_read;
mod verify_says_before_and_after;
mod whiteness_tells_structure_from_noise;

// What they share.
mod bound;
mod diagnosed;
#[path = "../examples/parallel_drive.rs"]
#[expect(dead_code, reason = "its main")]
mod parallel_drive;
#[path = "../../tests/support/path.rs"]
mod path;
#[path = "../examples/planar_arm.rs"]
#[expect(dead_code, reason = "its main")]
mod planar_arm;
#[path = "../../tests/support/puma.rs"]
#[expect(
    dead_code,
    reason = "poses away from singularities are for the controller"
)]
mod puma;
#[path = "../../tests/support/random.rs"]
#[expect(dead_code, reason = "random arms are for the controller")]
mod random;
mod robots;
mod support;
mod synthetic;

/// A file that is not named above would not be tested.
#[test]
fn every_file_is_here() {
    let here = include_str!("all.rs");
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name();
        if let Some(name) = name.to_str().unwrap().strip_suffix(".rs") {
            let (named, itself) = (
                format!("mod {name};"),
                ["all", "controller_takes_parameters"].contains(&name),
            );
            assert!(itself || here.lines().any(|line| line == named), "{name}");
        }
    }
}
