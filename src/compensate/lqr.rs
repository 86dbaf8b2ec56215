//! Linear quadratic regulator: pose error against the size of the correction. MRD 5.3.
//!
//! ```text
//! minimise   Δyᵀ Q Δy + sum over k of γ_k u_k²         MRD 5.158, reduced error model
//! ```
//! Needs the calibrated chain and its effects. Cost as the inverse Jacobian's. Exists at
//! singularities and near limits, where it trades one for the other.
//!
//! The book solves it by a recursion over the joints (5.84 to 5.87). The minimum is that of a
//! damped weighted least-squares problem, one 6 x 6 solution ([`corrections`]; that the two
//! are equal, and equal to the recursion on the redundant model of twelve, is tested in
//! `tests/regulator_is_least_squares.rs`). Where one linearisation is not enough (end of
//! 5.3.5) it is repeated from where it led, with the exact error (5.145), until it settles:
//! the minimum of the exact error with the same prices.
//!
//! A price that could change no step by more than a 4096th of it clear of singularities, of at
//! most `singular_value² / 4096` times the square of the smaller weight, is not asked there and
//! clear of the limits' margins, of a rigid arm of turns: the steps are the inverse Jacobian's
//! then, and shorter (`regulated_pose` in `docs/COST.md`).
//!
//! Weights: `Q = diag(k2/|p|², .., 2 k1, ..)` of 5.170 is the square of
//! [`crate::Settings::position_weight`] and [`crate::Settings::orientation_weight`].

use super::step::damped_step;
use crate::{BakedJoint, JointKind, Scalar};

/// Share of a joint's travel at each end in which corrections of it become dearer.
pub(super) const MARGIN: f64 = 0.02;

/// The correction `u` that minimises `|error - columns u|² + sum of γ_k u_k²`: MRD 5.159 with
/// `error` desired minus predicted, both already weighted.
///
/// ```text
/// u = (Bᵀ Q B + Γ)⁻¹ Bᵀ Q y
/// ```
/// `columns`: one a joint; `gamma`: positive, smaller than 1e-9 counts as 1e-9.
pub fn corrections<T: Scalar, const N: usize>(
    columns: &[[T; 6]; N],
    error: &[T; 6],
    gamma: &[T; N],
) -> [T; N] {
    let least = T::of(1e-9);
    let effort = gamma.map(|g| if g > least { g - least } else { T::zero() });
    let (zero, mut step) = ([T::zero(); N], [T::zero(); N]);
    let ends: [&[T]; 2] = [&zero, &zero];
    match N < 6 {
        true => damped_step::<T, true>(columns, error, &effort, ends, least, &mut step),
        false => damped_step::<T, false>(columns, error, &effort, ends, least, &mut step),
    }
    step
}

/// The prices γ_k of MRD 5.136 at the nominal command `q`.
///
/// ```text
/// γ_k = (γ + nearness_k²) / travel_k²
/// ```
/// `travel`: of a prismatic joint from limit to limit, m; 1 for a revolute joint. `nearness`:
/// 0 in the middle, rising from 0 to 1 over the last fiftieth of the travel before a limit,
/// in place of the book's inverse distance, which has no bound. (That the price also grows
/// near singularities is the same for all methods.)
pub(crate) fn prices<T: Scalar>(
    gamma: T,
    q: &[T],
    joints: &[BakedJoint<T>],
    limits: &[[T; 2]],
    prices: &mut [T],
) {
    let places = q.iter().zip(joints).zip(limits);
    for (price, ((&q, joint), &[low, high])) in prices.iter_mut().zip(places) {
        *price = gamma;
        let range = high - low;
        let margin = range * T::of(MARGIN);
        let (below, above) = (q - low, high - q);
        let distance = if below < above { below } else { above };
        if distance < margin {
            // A joint that cannot move at all has no margin and never comes here.
            let nearness = T::one() - distance / margin;
            *price += nearness * nearness;
        }
        if joint.kind == JointKind::Prismatic && range > T::zero() {
            *price /= range * range;
        }
    }
}
