//! The firmware in C, linked with the static library and run on the emulated core, gives the
//! commands that the Rust source gives, bit for bit.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use truepose::budget::NoClock;
use truepose_firmware::compensation;

#[test]
fn every_answer_has_the_same_bits() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_example.elf");
    let build = Command::new(root.join("capi/example/build"))
        .arg(&program)
        .output()?;
    assert!(
        build.status.success(),
        "{}",
        String::from_utf8_lossy(&build.stderr)
    );
    let run = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic"])
        .args(["-monitor", "none", "-serial", "null"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(&program)
        .output()?;
    let core = String::from_utf8(run.stdout)?;
    assert!(
        run.status.success(),
        "{}\n{}",
        run.status,
        String::from_utf8_lossy(&run.stderr)
    );
    let mut host = String::new();
    compensation::print(&mut host, &NoClock)?;
    assert!(host.lines().count() > 1000);
    assert_eq!(host.lines().count(), core.lines().count());
    for (row, (host, core)) in host.lines().zip(core.lines()).enumerate() {
        assert_eq!(host, core, "answer {}", row + 1);
    }
    Ok(())
}
