//! Each program, run on the emulated core, prints what it prints on the host, bit for bit.

use std::error::Error;
use std::fmt;
use std::path::Path;
use std::process::Command;

use truepose::budget::NoClock;
use truepose_firmware::{compensation, kinematics};

type Outcome = Result<(), Box<dyn Error>>;

/// What program `name` prints on the emulated core.
fn emulated(name: &str) -> Result<String, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let run = Command::new("tools/cargo-thumb")
        .args([
            "run",
            "--quiet",
            "--release",
            "--package",
            "truepose-firmware",
        ])
        .args(["--bin", name])
        .current_dir(root)
        .output()?;
    let text = String::from_utf8(run.stdout)?;
    if run.status.success() {
        return Ok(text);
    }
    let said = String::from_utf8_lossy(&run.stderr);
    Err(format!("{name}: {}\n{text}{said}", run.status).into())
}

/// Runs `name` on the core and `print` here.
fn compare(name: &str, print: fn(&mut dyn fmt::Write) -> fmt::Result) -> Outcome {
    let mut host = String::new();
    print(&mut host)?;
    let core = emulated(name)?;
    assert!(!host.is_empty());
    assert_eq!(host.lines().count(), core.lines().count());
    for (row, (host, core)) in host.lines().zip(core.lines()).enumerate() {
        // What the clock counted stands behind an @ and is no part of the result.
        let core = core.split(" @ ").next().unwrap_or(core);
        assert_eq!(host, core, "line {} of {name}", row + 1);
    }
    Ok(())
}

#[test]
fn forward_kinematics_has_the_same_bits() -> Outcome {
    compare("kinematics", kinematics::print)
}

#[test]
fn corrected_commands_have_the_same_bits() -> Outcome {
    compare("compensate", |out| compensation::print(out, &NoClock))
}
