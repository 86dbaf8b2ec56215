//! All methods on the same requests, one line an answer.
//!
//! `taught.tpb` is `with_effects.tpb` with tables, which two commands put in (in this crate's
//! folder):
//!
//! ```sh
//! truepose teach --params with_effects.tpb --method polynomial --targets region.csv --out P.tpb
//! truepose teach --params P.tpb --method cmac --targets region.csv --out taught.tpb
//! ```

use core::fmt::{self, Write};

use truepose::budget::{Budget, Clock};
use truepose::compensate::spherical_wrist::SphericalWrist;
use truepose::compensate::{Compensator, Outcome, Request};
use truepose::{Method, Model, Pose, Settings, params};

use crate::arm::JOINTS;
use crate::compensation::line;
use crate::draws::Draws;

/// The arm with effects, and tables.
pub const TAUGHT: &[u8] = include_bytes!("../taught.tpb");

/// Requests to each method.
pub const REQUESTS: usize = 200;

/// Middle of the region taught, and how far the requests go to each side, rad.
const MIDDLE: [f32; JOINTS] = [0.2, -0.4, 0.0, 0.3, 0.9, 0.0];
const SIDE: f32 = 0.35;

/// Every method, by name; the task point with the analytic nominal inverse besides.
pub fn methods() -> impl Iterator<Item = (Method, bool)> {
    Method::ALL
        .into_iter()
        .flat_map(|method| [(method, false), (method, true)])
        .filter(|&(method, through)| !through || method == Method::TaskPoint)
}

/// The requested joints, in order.
pub fn requests() -> impl Iterator<Item = [f32; JOINTS]> {
    let mut draws = Draws::seeded(6);
    (0..REQUESTS).map(move |_| MIDDLE.map(|q| q + SIDE * draws.symmetric()))
}

fn answer(
    model: &Model<'_, f32, JOINTS>,
    (method, through): (Method, bool),
    q: [f32; JOINTS],
    clock: &impl Clock,
) -> Outcome<f32, JOINTS> {
    let settings = Settings {
        method,
        ..model.settings
    };
    let mut compensator = Compensator::new(model).with_settings(settings);
    let wrist = SphericalWrist::of(&model.nominal);
    let inverse = |pose: &Pose<f32>, near: &[f32; JOINTS]| wrist.as_ref()?.inverse(pose, near);
    let mut budget = Budget::cycles(clock, u32::MAX);
    let inverse = through.then_some(&inverse as &dyn Fn(&_, &_) -> _);
    compensator.correct_through(&Request::joints(q), inverse, &mut budget)
}

/// Answers every request by every method, timed by `clock`.
pub fn print(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    let model = params::decode::<f32, JOINTS>(TAUGHT).map_err(|_| fmt::Error)?;
    for method in methods() {
        for q in requests() {
            line(out, &answer(&model, method, q, clock))?;
        }
    }
    Ok(())
}
