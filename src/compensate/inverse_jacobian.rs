//! Damped inverse Jacobian, iterated. MRD 5.2.1.
//!
//! ```text
//! q <- q + J⁻¹ dx        MRD 5.43, 5.44
//! ```
//! until the predicted pose error is below the tolerances or the step below the joints'
//! resolution. Needs the calibrated chain and its effects. Cost: one evaluation of the model
//! and one 6 x 6 solution an iteration; two iterations away from singularities.
//!
//! The book's J is of the nominal model and its inverse does not exist at singularities.
//! Here J is of the calibrated chain, whose frames are there anyway, and what is solved is
//! the least-squares problem of [`super`]:
//!
//! ```text
//! minimise   |W e(q)|² + γ |q - q_n|²
//! ```
//! with γ = 0 where the arm is clear of singularities: there it is Newton's method. Nearer
//! than [`crate::Settings::singular_value`] γ grows smoothly with the nearness
//! (`singular_effort`). Since γ belongs to the problem and not to the step, the answer is
//! the minimum, whatever it was found from and in however many iterations; the minimum moves
//! continuously with the request because the problem is then well conditioned everywhere;
//! and since the command that came in has the merit `|W e(q_n)|²`, whatever has a smaller
//! merit has a smaller error. Bounding the step's length instead would not do: its direction
//! flips where the arm passes through the singularity.

use crate::Scalar;

/// The price γ of a correction near a singular configuration.
///
/// ```text
/// γ = s² (1 - c / s²)²  for c < s²,  0 beyond;   s² = singular_value² + |W e(q_n)|²
/// ```
/// `clearance`: harmonic sum of the squared singular values, at most the smallest of them;
/// `singular_value`: from the settings; `square`: `|W e(q_n)|²`. Continuous with its first
/// derivative. With it a correction is at most about 27 times the error; and γ is well above
/// the square of the error, which is what keeps the problem convex: to turn the arm about a
/// singular direction changes the pose in second order by the error times the turn.
pub(super) fn singular_effort<T: Scalar>(clearance: T, singular_value: T, square: T) -> T {
    let threshold = singular_value * singular_value + square;
    if clearance < threshold && threshold > T::zero() {
        let near = T::one() - clearance / threshold;
        threshold * near * near
    } else {
        T::zero()
    }
}
