//! What the controller does in one cycle, on a workstation: takes a blob and a nominal joint
//! command, prints the corrected one and what is known of it.
//!
//! ```sh
//! cargo run --example corrected_command -- tests/firmware/rigid.tpb 10 -60 90 0 45 20
//! ```

use std::error::Error;

use truepose::budget::{Budget, Counter};
use truepose::compensate::{Compensator, Request};

/// Joints of the arm: the number is part of the types, so that nothing needs a heap.
const JOINTS: usize = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("usage: corrected_command BLOB Q1 Q2 .. (deg, revolute joints)")?;
    let mut q = [0.0_f32; JOINTS];
    for (joint, angle) in (1..).zip(&mut q) {
        let text = arguments
            .next()
            .ok_or_else(|| format!("joint {joint} of {JOINTS} is missing"))?;
        *angle = text
            .parse::<f32>()
            .map_err(|e| format!("joint {joint}, `{text}`: {e}"))?
            .to_radians();
    }

    let blob = std::fs::read(&file).map_err(|e| format!("{file}: {e}"))?;
    let model =
        truepose::params::decode::<f32, JOINTS>(&blob).map_err(|e| format!("{file}: {e:?}"))?;
    let mut compensator = Compensator::new(&model);
    // A controller has its cycle counter here; a clock that stands still never runs out.
    let clock = Counter::up(|| 0);
    let outcome = compensator.correct(&Request::joints(q), &mut Budget::cycles(&clock, u32::MAX));

    println!(
        "{:?} after {} iterations",
        outcome.status, outcome.iterations
    );
    if let (Some(before), Some(after)) = (outcome.initial, outcome.remaining) {
        println!(
            "pose error by the model: {:.4} mm before, {:.4} mm after",
            1e3 * before.position,
            1e3 * after.position
        );
    }
    for (joint, (nominal, corrected)) in (1..).zip(q.iter().zip(&outcome.q)) {
        println!(
            "q{joint}: {:9.4} deg -> {:9.4} deg",
            nominal.to_degrees(),
            corrected.to_degrees()
        );
    }
    Ok(())
}
