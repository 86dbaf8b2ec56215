#![cfg_attr(target_os = "none", no_std)]
#![expect(
    unsafe_code,
    reason = "C hands over pointers, which only its own care makes valid; functions that C finds \
              by name have a name that nothing keeps unique"
)]
//! truepose for firmware in C, `f32`, without a heap.
//!
//! `include/truepose.h` is written from arm source by cbindgen; what a C programmer has to know
//! stands there. Each function takes pointers and returns an [`truepose_error`]; a null pointer
//! is refused, everything else about a pointer is the caller's word.
//!
//! The number of joints is chosen when the library is built, `TRUEPOSE_JOINTS=7 cargo build`, 6
//! without it. The header is the same for all.

mod error;
mod instance;
mod values;

use core::slice;

use truepose::budget::{Budget, Clock};
use truepose::compensate::Compensator;
use truepose::{Model, params};

pub use error::truepose_error;
use instance::Parts;
pub use instance::{TRUEPOSE_WORDS, truepose_compensator};
pub use values::{
    truepose_budget, truepose_conditions, truepose_outcome, truepose_pose, truepose_request,
    truepose_status,
};

/// Most joints that any build of the library has.
pub const TRUEPOSE_MAX_JOINTS: usize = 12;

/// Temperature sensors.
pub const TRUEPOSE_MAX_SENSORS: usize = 8;

/// Joints of arm build.
const JOINTS: usize = match option_env!("TRUEPOSE_JOINTS") {
    Some(text) => number(text.as_bytes()),
    None => 6,
};

const _: () = {
    assert!(
        JOINTS >= 1 && JOINTS <= TRUEPOSE_MAX_JOINTS,
        "TRUEPOSE_JOINTS: 1 to 12"
    );
    assert!(TRUEPOSE_MAX_JOINTS == params::MAX_JOINTS);
    assert!(TRUEPOSE_MAX_SENSORS == truepose::effects::MAX_SENSORS);
};

const fn number(digits: &[u8]) -> usize {
    let (mut value, mut k) = (0, 0);
    while k < digits.len() {
        assert!(digits[k].is_ascii_digit(), "TRUEPOSE_JOINTS is no number");
        value = 10 * value + (digits[k] - b'0') as usize;
        k += 1;
    }
    value
}

/// The library cannot panic (`tools/no-panic` and the example's link prove it), but Rust wants
/// to know what would happen.
#[cfg(all(target_os = "none", not(test)))]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// The caller's counter.
struct Counter(truepose_budget);

impl Clock for Counter {
    fn now(&self) -> u32 {
        self.0.now.map_or(0, |now| now(self.0.context))
    }

    fn elapsed(&self, since: u32) -> u32 {
        self.now().wrapping_sub(since)
    }
}

/// Number of joints that this build of the library is for.
#[unsafe(no_mangle)]
pub extern "C" fn truepose_joints() -> usize {
    JOINTS
}

/// Reads a blob and makes `arm` ready. The blob is checked first: if it is refused, `arm`
/// stays as it was, ready with its old blob or not ready.
///
/// `arm`: all zero, or ready. `blob`: `length` bytes of a `.tpb` file, anywhere in memory,
/// flash for instance; tables are read in place, so they have to stay there unchanged as long
/// as `arm` is used.
///
/// # Safety
/// As above; nobody else uses `arm` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truepose_init(
    arm: *mut truepose_compensator,
    blob: *const u8,
    length: usize,
) -> truepose_error {
    if arm.is_null() || blob.is_null() {
        return truepose_error::TRUEPOSE_NULL_POINTER;
    }
    // SAFETY: not null, and the caller says that there are `length` bytes to stay.
    let bytes: &'static [u8] = unsafe { slice::from_raw_parts(blob, length) };
    // SAFETY: not null, and the caller says that it is all zero or ready, and used by us alone.
    let parts = unsafe { Parts::of(arm) };
    // SAFETY: as before; a model that is not there yet is put there first.
    unsafe {
        if !parts.is_ready() {
            parts.model.write(Model::empty());
        }
        match params::decode_into(bytes, &mut *parts.model) {
            Ok(()) => {
                // It borrows the model, which stays where it is: the header says so.
                parts.compensator.write(Compensator::new(&*parts.model));
                parts.set_ready();
                truepose_error::TRUEPOSE_OK
            }
            Err(refusal) => refusal.into(),
        }
    }
}

/// Forgets what was remembered from the cycle before: the next request is answered as the
/// first one.
///
/// # Safety
/// `arm`: made by `truepose_init`, not moved since, used by nobody else meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truepose_reset(arm: *mut truepose_compensator) -> truepose_error {
    // SAFETY: the caller's word.
    match unsafe { instance::compensator(arm) } {
        Ok(compensator) => {
            compensator.reset();
            truepose_error::TRUEPOSE_OK
        }
        Err(refusal) => refusal,
    }
}

/// Fills `request` with a joint command without a pose, under conditions of which nothing is
/// known: no load, temperatures and time not a number.
///
/// # Safety
/// `request`: to write to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truepose_request_default(
    request: *mut truepose_request,
) -> truepose_error {
    if request.is_null() {
        return truepose_error::TRUEPOSE_NULL_POINTER;
    }
    // SAFETY: not null, and the caller's word that it may be written.
    unsafe { request.write(truepose_request::unknown()) };
    truepose_error::TRUEPOSE_OK
}

/// The corrected command for `request` within `budget` goes to `outcome`, whose joints are
/// always safe to send. No allocation, no panic; time: `docs/COST.md`.
///
/// `budget`: null if there is no deadline.
///
/// # Safety
/// `arm`: made by `truepose_init`, not moved since, used by nobody else meanwhile. `request`
/// and `budget` (or null): to read. `outcome`: to write to; it may not overlap the others.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truepose_correct(
    arm: *mut truepose_compensator,
    request: *const truepose_request,
    budget: *const truepose_budget,
    outcome: *mut truepose_outcome,
) -> truepose_error {
    if request.is_null() || outcome.is_null() {
        return truepose_error::TRUEPOSE_NULL_POINTER;
    }
    // SAFETY: the caller's word.
    let compensator = match unsafe { instance::compensator(arm) } {
        Ok(compensator) => compensator,
        Err(refusal) => return refusal,
    };
    // SAFETY: not null, and the caller's word.
    let (request, budget) = unsafe { ((*request).read(), budget.as_ref()) };
    let clock = Counter(budget.copied().unwrap_or_default());
    let cycles = budget.map_or(u32::MAX, |budget| budget.cycles);
    let answer = compensator.correct(&request, &mut Budget::cycles(&clock, cycles));
    // SAFETY: not null, and the caller's word.
    unsafe { outcome.write(truepose_outcome::from(&answer)) };
    truepose_error::TRUEPOSE_OK
}

/// Where the arm as it was identified has its tool at the joint readings `q` (rad or m).
///
/// # Safety
/// `arm`: made by `truepose_init`, not moved since. `q`: `truepose_joints` values.
/// `conditions`: to read. `pose`: to write to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truepose_predict(
    arm: *const truepose_compensator,
    q: *const f32,
    conditions: *const truepose_conditions,
    pose: *mut truepose_pose,
) -> truepose_error {
    if q.is_null() || conditions.is_null() || pose.is_null() {
        return truepose_error::TRUEPOSE_NULL_POINTER;
    }
    // SAFETY: the caller's word.
    let model = match unsafe { instance::model(arm) } {
        Ok(model) => model,
        Err(refusal) => return refusal,
    };
    // SAFETY: not null, and the caller's word.
    unsafe {
        let q = q.cast::<[f32; JOINTS]>().read();
        let conditions = (*conditions).read();
        pose.write(truepose_pose::from(&model.predict(&q, &conditions)));
    }
    truepose_error::TRUEPOSE_OK
}

/// Where the controller's own kinematics put the tool at the joint command `q` (rad or m).
///
/// # Safety
/// `arm`: made by `truepose_init`, not moved since. `q`: `truepose_joints` values.
/// `pose`: to write to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truepose_nominal_pose(
    arm: *const truepose_compensator,
    q: *const f32,
    pose: *mut truepose_pose,
) -> truepose_error {
    if q.is_null() || pose.is_null() {
        return truepose_error::TRUEPOSE_NULL_POINTER;
    }
    // SAFETY: the caller's word.
    let model = match unsafe { instance::model(arm) } {
        Ok(model) => model,
        Err(refusal) => return refusal,
    };
    // SAFETY: not null, and the caller's word.
    unsafe {
        let q = q.cast::<[f32; JOINTS]>().read();
        pose.write(truepose_pose::from(&model.nominal_pose(&q)));
    }
    truepose_error::TRUEPOSE_OK
}
