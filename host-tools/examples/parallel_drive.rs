//! The redundant parallel-drive shoulder of Nahvi and Hollerbach, section 3.2: four length
//! sensors on three freedoms calibrate each other, without any instrument.
//!
//! `cargo run --release -p truepose-host-tools --example parallel_drive`

use std::error::Error;
use std::fmt::Write;

use truepose_host::closed_chain::{Loop, ParallelDrive, identify, study};
use truepose_host::random::Random;

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", report(1000)?);
    Ok(())
}

/// All poses at once, then `draws` sets of them.
pub(crate) fn report(draws: usize) -> Result<String, Box<dyn Error>> {
    // A tenth of the noise of its sensors, as in the paper's simulation.
    let drive = ParallelDrive::new(4e-3);
    let (truth, start) = (ParallelDrive::built(), ParallelDrive::nominal());
    let poses = drive.measure(&truth, 280, &mut Random::new(1, 0));
    let found = identify(&drive, &start, &poses).map_err(|why| format!("{why:?}"))?;
    let mut out = format!("all 280 poses, 4 mV of noise; misfit {:.3}\n", found.misfit);
    for ((name, unit), ((x, error), truth)) in
        (drive.parameters().iter()).zip(found.x.iter().zip(&found.errors).zip(&truth))
    {
        let [x, error, truth] = [x, error, truth].map(|x| x * 1e3);
        writeln!(
            out,
            "  {name:<4}{x:>9.4} +- {error:.4}  (true {truth:.4}) m{unit}"
        )?;
    }
    let mut random = Random::new(2, 0);
    let sets = study(&drive, [&truth, &start], &poses, 30, draws, &mut random)
        .map_err(|why| format!("{why:?}"))?;
    writeln!(
        out,
        "{} sets of 30 poses, {} not identified",
        sets.sets.len(),
        sets.failed
    )?;
    writeln!(out, "largest over smallest value:")?;
    for (k, span) in sets.sensitivity().iter().enumerate() {
        writeln!(out, "  O{} {span:.2}", k + 1)?;
    }
    writeln!(
        out,
        "99 % of scaled errors are below, from the fifth of sets with least to most:"
    )?;
    for k in 0..4 {
        let classes: Vec<String> = (sets.envelope(k, 5).iter())
            .map(|e| format!("{e:.3}"))
            .collect();
        writeln!(out, "  by O{}  {}", k + 1, classes.join("  "))?;
    }
    Ok(out)
}
