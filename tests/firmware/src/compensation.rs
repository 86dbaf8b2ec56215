//! Requests to the compensator in `f32`, one line an answer.

use core::fmt::{self, Write};

use nalgebra::Vector3;
use truepose::budget::{Budget, Clock};
use truepose::compensate::{Compensator, Outcome, Request};
use truepose::effects::{Ambient, Conditions};
use truepose::{Model, params};

use crate::arm::{JOINTS, TRAVEL};
use crate::draws::Draws;
use crate::parameters::{RIGID, SPHERICAL, WITH_EFFECTS};

/// Requests a blob that are answered each as the first one.
pub const SCATTERED: usize = 2000;

/// Requests a blob along one path, each answered with what the last one left.
pub const ALONG_A_PATH: usize = 100;

/// The blobs, in the order of the answers.
pub const BLOBS: [&[u8]; 3] = [RIGID, SPHERICAL, WITH_EFFECTS];

/// Request number `index` of the scattered ones: every other one names the pose to reach, the
/// others leave it to the nominal joints.
pub fn scattered(
    model: &Model<'_, f32, JOINTS>,
    draws: &mut Draws,
    index: usize,
) -> Request<f32, JOINTS> {
    let q = TRAVEL.map(|travel| travel * draws.symmetric());
    let request = if index.is_multiple_of(2) {
        Request::pose(model.nominal_pose(&q), q)
    } else {
        Request::joints(q)
    };
    let mut conditions = Conditions {
        ambient: Ambient {
            payload: 2.0 + 2.0 * draws.symmetric(),
            payload_com: Vector3::new(0.0, 0.02, 0.05),
            ..Ambient::default()
        },
        ..Conditions::default()
    };
    for direction in &mut conditions.direction {
        *direction = if draws.symmetric() < 0.0 { -1.0 } else { 1.0 };
    }
    request.conditions(conditions)
}

/// Request number `index` along the path: a slow move of all joints.
fn along_the_path(index: usize) -> Request<f32, JOINTS> {
    let way = index as f32 / ALONG_A_PATH as f32 - 0.5;
    Request::joints(TRAVEL.map(|travel| 0.6 * travel * way + 0.3))
}

/// `q` as bits, the status, the iterations; after `@` what the clock counted, if it runs.
pub(crate) fn line(out: &mut dyn Write, outcome: &Outcome<f32, JOINTS>) -> fmt::Result {
    for q in outcome.q {
        write!(out, "{:08x} ", q.to_bits())?;
    }
    write!(out, "{:?} {}", outcome.status, outcome.iterations)?;
    match outcome.cycles {
        0 => writeln!(out),
        cycles => writeln!(out, " @ {cycles}"),
    }
}

/// Decodes each blob, answers the requests and writes the answers, timed by `clock`.
pub fn print(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    for blob in BLOBS {
        // A blob that is refused ends the program with a failure.
        let model = params::decode::<f32, JOINTS>(blob).map_err(|_| fmt::Error)?;
        let mut compensator = Compensator::new(&model);
        let mut draws = Draws::seeded(3);
        for index in 0..SCATTERED {
            compensator.reset();
            let request = scattered(&model, &mut draws, index);
            let outcome = compensator.correct(&request, &mut Budget::cycles(clock, u32::MAX));
            line(out, &outcome)?;
        }
        compensator.reset();
        for index in 0..ALONG_A_PATH {
            let request = along_the_path(index);
            let outcome = compensator.correct(&request, &mut Budget::cycles(clock, u32::MAX));
            line(out, &outcome)?;
        }
    }
    Ok(())
}
