//! A pin that is high while something runs.

use embedded_hal::digital::OutputPin;

/// Runs `work` with `pin` high, and low again afterwards. Put it round
/// [`crate::compensate::Compensator::correct`] and an oscilloscope shows the time it takes.
///
/// What `work` returns is returned whatever the pin does: a command must not hang on a strobe.
/// The second is the pin's first error.
pub fn strobed<P: OutputPin, R>(
    pin: &mut P,
    work: impl FnOnce() -> R,
) -> (R, Result<(), P::Error>) {
    let up = pin.set_high();
    let result = work();
    let down = pin.set_low();
    (result, up.and(down))
}
