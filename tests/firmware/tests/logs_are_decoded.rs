//! What the emulated controller logs with defmt is read back as text.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use defmt_decoder::{DecodeError, Table};
use truepose::Model;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::params::{checksum, decode_into};
use truepose_firmware::arm::{CLEAR_OF_SINGULAR, JOINTS};
use truepose_firmware::parameters::RIGID;

/// The lines that the program logs, with their levels.
fn logged() -> Result<Vec<String>, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let run = Command::new("tools/cargo-thumb")
        .args(["run", "--quiet", "--release"])
        .args(["--package", "truepose-firmware"])
        .args(["--features", "defmt", "--bin", "logs"])
        .env("DEFMT_LOG", "trace")
        .current_dir(&root)
        .stderr(Stdio::inherit())
        .output()?;
    if !run.status.success() {
        return Err(format!("the program ended: {}", run.status).into());
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    let program = std::fs::read(target.join("thumbv7em-none-eabihf/release/logs"))?;
    let table = Table::parse(&program)?.ok_or("the program has no texts")?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(&run.stdout);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let level = frame.level().map_or("", |level| level.as_str());
                lines.push(format!("{level} {}", frame.display_message()));
            }
            Err(DecodeError::UnexpectedEof) => return Ok(lines),
            Err(DecodeError::Malformed) => return Err("a frame is malformed".into()),
        }
    }
}

#[test]
fn what_a_controller_meets_is_logged() -> Result<(), Box<dyn Error>> {
    // The same on the host, whose numbers have the same bits.
    let mut model = Model::<f32, JOINTS>::empty();
    decode_into(RIGID, &mut model)?;
    let answer = Compensator::new(&model).correct(
        &Request::joints(CLEAR_OF_SINGULAR),
        &mut Budget::unlimited(),
    );
    let (length, crc) = (RIGID.len(), checksum(RIGID));
    let expected = [
        format!("info parameters in use, {length} bytes"),
        format!(
            "info {:?}: {:?} after {} iterations, 0 cycles, error {:?} to {:?}, clamped {:?}",
            answer.status,
            answer.q,
            answer.iterations,
            answer.initial,
            answer.remaining,
            answer.clamped
        ),
        "warn JointsNotFinite".into(),
        "error Some(TooShort { bytes: 3 })".into(),
        "error Some(Checksum)".into(),
        "error Some(NotLoaded)".into(),
        "info Some(None)".into(),
        "info Some(1)".into(),
        format!(
            "info Some(Some(Stored {{ length: {length}, crc: {crc}, sequence: 1, passed_over: None }}))"
        ),
        format!("error Some(RoomTooSmall {{ length: {length} }})"),
        "warn Robot".into(),
        format!("debug Receiving {{ received: 0, length: {length} }}"),
        "debug Checking".into(),
        "debug Saving".into(),
        format!("info Saved(Active {{ length: {length}, crc: {crc}, sequence: 1 }})"),
        "debug Idle".into(),
    ];
    assert_eq!(logged()?, expected);
    Ok(())
}

/// Functions and data of a program that belong to the logging.
fn symbols_of_logs(program: &str) -> Result<usize, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    let program = target.join("thumbv7em-none-eabihf/release").join(program);
    let run = Command::new("arm-none-eabi-nm").arg(program).output()?;
    if !run.status.success() {
        return Err(String::from_utf8_lossy(&run.stderr).into());
    }
    let symbols = String::from_utf8(run.stdout)?;
    assert!(symbols.lines().count() > 100, "{symbols}");
    let of_logs = |line: &&str| line.contains("defmt");
    Ok(symbols.lines().filter(of_logs).count())
}

#[test]
fn without_the_feature_nothing_of_it_is_linked() -> Result<(), Box<dyn Error>> {
    // With it, to see that the search finds something.
    logged()?;
    assert!(symbols_of_logs("logs")? > 10);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // The loop, decoding, the link and a memory.
    let built = Command::new("tools/cargo-thumb")
        .args(["build", "--quiet", "--release"])
        .args(["--package", "truepose-firmware", "--bin", "link"])
        .current_dir(&root)
        .status()?;
    assert!(built.success(), "{built}");
    assert_eq!(symbols_of_logs("link")?, 0);
    Ok(())
}
