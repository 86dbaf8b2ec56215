//! The functions of the control loop, called so that `tools/cost` can count them.

use core::fmt::{self, Write};
use core::hint::black_box;

use truepose::{Frame, Scalar};

use crate::arm::{self, JOINTS, TRAVEL};
use crate::draws::Draws;

/// Calls of each function.
const CALLS: usize = 64;

/// What is counted: each function's whole call, arguments already in place.
pub mod measured {
    use truepose::{BakedJoint, Frame, Pose, Scalar, forward};

    use crate::arm::JOINTS;

    /// Sine and cosine of one angle (rad).
    #[inline(never)]
    pub fn sine_and_cosine(angle: f32) -> (f32, f32) {
        angle.sincos()
    }

    /// All frames and the tool pose of a rigid chain.
    #[inline(never)]
    pub fn forward_kinematics(
        base: &Pose<f32>,
        joints: &[BakedJoint<f32>; JOINTS],
        tool: &Pose<f32>,
        q: &[f32; JOINTS],
        frames: &mut [Frame<f32>; JOINTS],
    ) -> Pose<f32> {
        forward(base, joints, q, frames).then(tool)
    }
}

/// Calls each function of [`measured`] and names it.
pub fn print(out: &mut dyn Write) -> fmt::Result {
    let mut draws = Draws::seeded(2);
    writeln!(out, "sine_and_cosine: of one angle, both")?;
    for _ in 0..CALLS {
        black_box(measured::sine_and_cosine(black_box(
            draws.symmetric() * f32::of(6.3),
        )));
    }
    writeln!(
        out,
        "forward_kinematics: all frames and the tool pose, 6 revolute joints, base and tool"
    )?;
    let chain = arm::baked(&arm::built()).cast::<f32>();
    let mut frames = [Frame::identity(); JOINTS];
    for _ in 0..CALLS {
        let q = TRAVEL.map(|travel| travel * draws.symmetric());
        black_box(measured::forward_kinematics(
            black_box(&chain.base),
            black_box(&chain.joints),
            black_box(&chain.tool),
            black_box(&q),
            &mut frames,
        ));
        black_box(&frames);
    }
    Ok(())
}
