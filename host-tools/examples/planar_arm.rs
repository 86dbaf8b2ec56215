//! The planar arm of Nahvi and Hollerbach, section 3.1: 50 of 343 poses, many times. How the
//! largest errors fall with the noise amplification index O4, and which index tells most.
//!
//! `cargo run --release -p truepose-host-tools --example planar_arm`

use std::error::Error;
use std::fmt::Write;

use truepose_host::closed_chain::{Loop, PlanarArm, identify, study};
use truepose_host::random::Random;

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", report(2000)?);
    Ok(())
}

/// All poses at once, then `draws` sets of them.
pub(crate) fn report(draws: usize) -> Result<String, Box<dyn Error>> {
    let arm = PlanarArm { sigma: 3e-3 };
    let truth = PlanarArm::nominal();
    let poses = arm.measure(&truth, &mut Random::new(1, 0));
    let start: Vec<f64> = truth.iter().map(|x| 1.01 * x).collect();
    let found = identify(&arm, &start, &poses).map_err(|why| format!("{why:?}"))?;
    let mut out = format!("all 343 poses, 3 mm of noise; misfit {:.3}\n", found.misfit);
    for ((name, unit), ((x, error), truth)) in
        (arm.parameters().iter()).zip(found.x.iter().zip(&found.errors).zip(&truth))
    {
        writeln!(
            out,
            "  {name:<8}{x:>10.5} +- {error:.5}  (true {truth:.5}) {unit}"
        )?;
    }
    let mut random = Random::new(2, 0);
    let sets = study(&arm, [&truth, &start], &poses, 50, draws, &mut random)
        .map_err(|why| format!("{why:?}"))?;
    writeln!(
        out,
        "{} sets of 50 poses, {} not identified",
        sets.sets.len(),
        sets.failed
    )?;
    writeln!(
        out,
        "by how much it grows from the lowest tenth of sets to the highest:"
    )?;
    for (k, growth) in sets.growth(10).iter().enumerate() {
        writeln!(out, "  O{} {growth:.3}", k + 1)?;
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
