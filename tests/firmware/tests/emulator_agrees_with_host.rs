//! Each program, run on the emulated cores, prints what it prints on the host, bit for bit.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

use truepose::budget::NoClock;
use truepose_firmware::{compensation, double, kinematics, methods};

type Outcome = Result<(), Box<dyn Error>>;

/// A core and the board it sits on.
struct Core {
    board: &'static str,
    cpu: &'static str,
}

/// Single precision in hardware, double in software.
const CORTEX_M4F: Core = Core {
    board: "mps2-an386",
    cpu: "cortex-m4",
};

/// Both in hardware.
const CORTEX_M7: Core = Core {
    board: "mps2-an500",
    cpu: "cortex-m7",
};

impl Core {
    /// Program `name`, built for this core.
    fn build(&self, name: &str) -> Result<PathBuf, Box<dyn Error>> {
        let target = "thumbv7em-none-eabihf";
        let mut cargo = Command::new("tools/cargo-thumb");
        cargo
            .args(["build", "--quiet", "--release", "--target", target])
            .args(["--package", "truepose-firmware", "--bin", name])
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."));
        let mut folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("..");
        if self.cpu != CORTEX_M4F.cpu {
            // The target's default is the M4F. A rustflags variable replaces the configuration
            // file's, so the linker script is repeated.
            let flags = format!("-C link-arg=-Tlink.x -C target-cpu={}", self.cpu);
            folder = folder.join(self.cpu);
            cargo
                .env("RUSTFLAGS", flags)
                .env("CARGO_TARGET_DIR", &folder);
        }
        let build = cargo.output()?;
        if !build.status.success() {
            let said = String::from_utf8_lossy(&build.stderr);
            return Err(format!("{name} for {}: {said}", self.cpu).into());
        }
        Ok(folder.join(target).join("release").join(name))
    }

    /// What program `name` prints on this core.
    fn prints(&self, name: &str) -> Result<String, Box<dyn Error>> {
        let run = Command::new("qemu-system-arm")
            .args(["-M", self.board, "-cpu", self.cpu, "-nographic"])
            .args(["-monitor", "none", "-serial", "null", "-icount", "shift=8"])
            .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
            .arg(self.build(name)?)
            .output()?;
        let text = String::from_utf8(run.stdout)?;
        if run.status.success() {
            return Ok(text);
        }
        let said = String::from_utf8_lossy(&run.stderr);
        Err(format!("{name} on {}: {}\n{text}{said}", self.cpu, run.status).into())
    }

    /// Runs `name` on the core and `print` here.
    fn compare(&self, name: &str, print: fn(&mut dyn fmt::Write) -> fmt::Result) -> Outcome {
        let mut host = String::new();
        print(&mut host)?;
        let core = self.prints(name)?;
        assert!(!host.is_empty());
        assert_eq!(host.lines().count(), core.lines().count());
        for (row, (host, core)) in host.lines().zip(core.lines()).enumerate() {
            // What the clock counted stands behind an @ and is no part of the result.
            let core = core.split(" @ ").next().unwrap_or(core);
            assert_eq!(host, core, "line {} of {name} on {}", row + 1, self.cpu);
        }
        Ok(())
    }
}

#[test]
fn forward_kinematics_has_the_same_bits() -> Outcome {
    CORTEX_M4F.compare("kinematics", kinematics::print)
}

#[test]
fn corrected_commands_have_the_same_bits() -> Outcome {
    for core in [CORTEX_M4F, CORTEX_M7] {
        core.compare("compensate", |out| compensation::print(out, &NoClock))?;
    }
    Ok(())
}

#[test]
fn commands_in_double_precision_have_the_same_bits() -> Outcome {
    for core in [CORTEX_M4F, CORTEX_M7] {
        core.compare("double", double::print)?;
    }
    Ok(())
}

#[test]
fn commands_of_every_method_have_the_same_bits() -> Outcome {
    CORTEX_M4F.compare("methods", |out| methods::print(out, &NoClock))
}
