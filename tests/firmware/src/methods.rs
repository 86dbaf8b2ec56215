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
use truepose::compensate::task_point::Inverse;
use truepose::compensate::{Compensator, Outcome, Request};
use truepose::{Method, Pose, Settings, params};

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

/// One answer of the method that is number `K` in [`methods`]: a function for each, so that
/// `tools/methods` tells what code ran. Of another budget, or they would become one.
#[inline(never)]
fn answer<const K: u32>(
    compensator: &mut Compensator<'_, f32, JOINTS>,
    request: &Request<f32, JOINTS>,
    inverse: Option<Inverse<'_, f32, JOINTS>>,
    clock: &impl Clock,
) -> Outcome<f32, JOINTS> {
    let mut budget = Budget::cycles(clock, u32::MAX - K);
    compensator.correct_through(request, inverse, &mut budget)
}

/// Answers every request by every method, timed by `clock`.
pub fn print(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    let model = params::decode::<f32, JOINTS>(TAUGHT).map_err(|_| fmt::Error)?;
    let wrist = SphericalWrist::of(&model.nominal);
    let inverse = |pose: &Pose<f32>, near: &[f32; JOINTS]| wrist.as_ref()?.inverse(pose, near);
    for (number, (method, through)) in methods().enumerate() {
        let settings = Settings {
            method,
            ..model.settings
        };
        let inverse = through.then_some(&inverse as &dyn Fn(&_, &_) -> _);
        for q in requests() {
            let mut compensator = Compensator::new(&model).with_settings(settings);
            let request = Request::joints(q);
            let answer = match number {
                0 => answer::<0>,
                1 => answer::<1>,
                2 => answer::<2>,
                3 => answer::<3>,
                4 => answer::<4>,
                _ => answer::<5>,
            };
            line(out, &answer(&mut compensator, &request, inverse, clock))?;
        }
    }
    Ok(())
}
