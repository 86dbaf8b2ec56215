//! Requests to the compensator in `f64`, one line an answer.

use core::fmt::{self, Write};

use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::params;

use crate::arm::{JOINTS, TRAVEL};
use crate::compensation::BLOBS;
use crate::draws::Draws;

/// Requests a blob.
const REQUESTS: usize = 200;

/// Decodes each blob, answers the requests and writes the answers: `q` as bits, the status,
/// the iterations.
pub fn print(out: &mut dyn Write) -> fmt::Result {
    for blob in BLOBS {
        // A blob that is refused ends the program with a failure.
        let model = params::decode::<f64, JOINTS>(blob).map_err(|_| fmt::Error)?;
        let mut compensator = Compensator::new(&model);
        let mut draws = Draws::seeded(6);
        for index in 0..REQUESTS {
            let q = TRAVEL.map(|travel| f64::from(travel * draws.symmetric()));
            let request = if index.is_multiple_of(2) {
                Request::pose(model.nominal_pose(&q), q)
            } else {
                Request::joints(q)
            };
            compensator.reset();
            let outcome = compensator.correct(&request, &mut Budget::unlimited());
            for q in outcome.q {
                write!(out, "{:016x} ", q.to_bits())?;
            }
            writeln!(out, "{:?} {}", outcome.status, outcome.iterations)?;
        }
    }
    Ok(())
}
