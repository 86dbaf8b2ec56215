//! Corrections from what was taught, polynomials or tables, made safe to send. MRD 5.4.
//!
//! Needs tables in the blob, taught for the pose that the joints nominally mean: what a
//! requested pose is off from that is not corrected, and neither is what the conditions change.
//! Cost: two evaluations of the model and one of the table; a third where it does not fit.
//!
//! The approximation knows no limits and no model. So its correction `p` is confined to the
//! limits and the correction bound, both ends are evaluated, and of the way between them only
//! as much is taken as leads nearer:
//!
//! ```text
//! q = q_n + s p,   s = min(1, 3/2 s*),   s* = e0 · (e0 - e1) / |e0 - e1|²
//! ```
//! with e0 and e1 the weighted errors at both ends and s* where their line comes nearest to
//! zero. A correction that at least halves the error counts in full; one that does not help is
//! not taken; and s is continuous in both errors.

use super::Status;
use super::descent::{Descent, Found, Work};
use crate::budget::{Budget, CYCLES, Clock, Cost};
use crate::taught::Taught;
use crate::{Method, Scalar, Twist};

/// Applies the tables of the method that the settings name. `None` where the model gives no
/// finite pose for the start.
pub(super) fn run<'w, C: Clock, T: Scalar, const N: usize>(
    taught: &Taught<'_, T>,
    descent: &mut Descent<'_, T, N>,
    work: &'w mut Work<T, N>,
    budget: &Budget<'_, C>,
    cost: &Cost,
) -> Option<Found<'w, T, N>> {
    let Work { room, points, .. } = work;
    let [initial, full, part] = points;
    initial.q = descent.start;
    if !descent.evaluate(initial, room) {
        return None;
    }
    let initial = &*initial;
    let stay = |status| {
        Some(Found {
            initial: initial.error(),
            best: initial,
            status,
            iterations: 0,
        })
    };
    if descent.converged(initial) {
        return stay(Status::Converged);
    }
    let method = descent.settings.method;
    let cost = cost
        .iteration
        .saturating_add(lookup_cycles::<_, N>(taught, method));
    if let Some(status) = descent.halt(0, budget, cost.saturating_mul(2)) {
        return stay(status);
    }
    let begun = budget.spent();
    let correction = match method {
        Method::Polynomial => match &taught.polynomial {
            Some(polynomial) => polynomial.evaluate(&descent.start).map(|(mut p, miss)| {
                if polynomial.tool.is_some() {
                    let miss = descent.desired.rotation * nalgebra::Vector3::from(miss);
                    let back = Twist::new(-miss, nalgebra::Vector3::zeros());
                    let moves = descent.damped(initial, &back, room);
                    for (p, moved) in p.iter_mut().zip(moves) {
                        *p += moved;
                    }
                }
                p
            }),
            None => return stay(Status::NotTaught),
        },
        _ => match &taught.cmac {
            Some(cmac) => cmac.evaluate(&descent.start),
            None => return stay(Status::NotTaught),
        },
    };
    let Some(correction) = correction else {
        return stay(Status::OutsideRegion);
    };
    let mut best = initial;
    descent.move_to(&descent.start, &correction, T::one(), &mut full.q);
    if descent.evaluate(full, room) {
        let share = way(
            &descent.weighted(&initial.twist),
            &descent.weighted(&full.twist),
        );
        let found = if share < T::one() {
            let ends = full.q.iter().zip(&descent.start);
            for (part, (&full, &start)) in part.q.iter_mut().zip(ends) {
                *part = start + (full - start) * share;
            }
            descent.evaluate(part, room).then_some(part)
        } else {
            Some(full)
        };
        if let Some(found) = found
            && found.square < best.square
        {
            best = found;
        }
    }
    let spent = budget.spent().wrapping_sub(begun) / 2;
    descent.longest = descent.longest.max(spent);
    Some(Found {
        initial: initial.error(),
        best,
        status: if descent.converged(best) {
            Status::Converged
        } else {
            Status::Settled
        },
        iterations: 1,
    })
}

/// What looking up takes at worst, cycles of a Cortex-M4F.
fn lookup_cycles<T: Scalar, const N: usize>(taught: &Taught<'_, T>, method: Method) -> u32 {
    let instructions = match method {
        Method::Polynomial => taught.polynomial.as_ref().map(|p| p.instructions(N)),
        Method::Cmac => taught.cmac.as_ref().map(|c| c.instructions(N)),
        Method::InverseJacobian | Method::Lqr | Method::TaskPoint => None,
    };
    u32::try_from(instructions.unwrap_or(0))
        .unwrap_or(u32::MAX)
        .saturating_mul(CYCLES)
}

/// How much of the way from the error `from` to the error `to` is taken, 0 to 1.
fn way<T: Scalar>(from: &[T; 6], to: &[T; 6]) -> T {
    let (mut along, mut square) = (T::zero(), T::zero());
    for (&from, &to) in from.iter().zip(to) {
        let change = from - to;
        along += from * change;
        square += change * change;
    }
    let along = along * T::of(1.5);
    if along >= square {
        T::one()
    } else if along > T::zero() {
        along / square
    } else {
        T::zero()
    }
}
