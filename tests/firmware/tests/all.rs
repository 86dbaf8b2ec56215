//! All tests of the programs for the controller, a file for each behaviour, side by side: most
//! of their time an emulator of one core is waited for.

mod blobs_are_current;
mod budget_bounds_hold;
mod c_firmware_answers_like_rust;
mod compensated_poses_are_reached;
mod emulator_agrees_with_host;
mod logs_are_decoded;

/// A file that is not named above would not be tested.
#[test]
fn every_file_is_here() -> std::io::Result<()> {
    let here = include_str!("all.rs");
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name();
        if let Some(name) = name.to_string_lossy().strip_suffix(".rs") {
            let named = format!("mod {name};");
            assert!(
                name == "all" || here.lines().any(|line| line == named),
                "{name}"
            );
        }
    }
    Ok(())
}
