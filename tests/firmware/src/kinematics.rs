//! Forward kinematics in `f32`, one line a pose.

use core::fmt::{self, Write};

use truepose::{Frame, forward};

use crate::arm::{self, JOINTS, TRAVEL};
use crate::draws::Draws;

/// Poses that [`print()`] computes.
pub const POSES: usize = 64;

/// Bakes the arm as built, runs through [`POSES`] random poses and writes the bits of each
/// tool pose: nine entries of the rotation by columns, then the translation (m).
pub fn print(out: &mut dyn Write) -> fmt::Result {
    let chain = arm::baked(&arm::built()).cast::<f32>();
    let mut frames = [Frame::identity(); JOINTS];
    let mut draws = Draws::seeded(1);
    for _ in 0..POSES {
        let q = TRAVEL.map(|travel| travel * draws.symmetric());
        let pose = forward(&chain.base, &chain.joints, &q, &mut frames).then(&chain.tool);
        for x in pose.rotation.iter().chain(pose.translation.iter()) {
            write!(out, "{:08x} ", x.to_bits())?;
        }
        writeln!(out)?;
    }
    Ok(())
}
