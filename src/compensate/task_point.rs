//! Redefinition of the task point: which pose to ask of the nominal inverse kinematics.
//! MRD 5.2.2.
//!
//! ```text
//! F_c(F_n⁻¹(X_m)) = X_d        MRD 5.55
//! X_m <- X_d displaced by the error that is left, again and again
//! ```
//! For controllers that take no joint corrections. Three ways:
//! - [`first`], the book's first-order move: the pose error at the nominal solution, which is
//!   the sum of the kinematic sensitivities times the parameter errors (5.57, 5.58;
//!   `tests/task_point_moves.rs`). It needs no inverse of anything and stands at singular
//!   configurations too. One evaluation of the calibrated and one of the nominal chain.
//! - Without a function of the caller's, the task point is where the corrected joints q_c of
//!   [`super::inverse_jacobian`] are nominally, `X_m = F_n(q_c)`: then F_n⁻¹(X_m) is q_c, and
//!   everything that is promised of q_c holds for it. Cost: as there, and a forward pass.
//! - With the caller's nominal inverse, the above is iterated through it: one inverse and one
//!   evaluation an iteration, two or three iterations. A step that the limits or a change of
//!   branch make worse is not taken, so the joints are as continuous as the caller's inverse.

use super::descent::{Descent, Found, Work};
use super::{Request, Status, step};
use crate::budget::{Budget, Clock, Cost};
use crate::model::Model;
use crate::{Pose, Scalar};

/// A caller's nominal inverse kinematics: joints for a pose in the world, near a command.
pub type Inverse<'f, T, const N: usize> = &'f dyn Fn(&Pose<T>, &[T; N]) -> Option<[T; N]>;

/// What a nominal inverse takes at most, in iterations of the joint-space methods.
pub(super) const SHARE: u32 = 4;

/// The task point moved to first order, in the world: the pose that `request` asks for,
/// displaced by the predicted error at its nominal joints. MRD 5.54 with 5.57, 5.58.
pub fn first<T: Scalar, const N: usize>(
    model: &Model<'_, T, N>,
    request: &Request<T, N>,
) -> Pose<T> {
    let nominal = model.nominal_pose(&request.q);
    let predicted = model.predict(&request.q, &request.conditions);
    request
        .pose
        .unwrap_or(nominal)
        .displaced(&predicted.twist_to(&nominal))
}

/// Moves the task point until the calibrated arm reaches the pose that `descent` desires,
/// through the caller's inverse. Returns what was found and its task point; `None` where the
/// model gives no finite pose.
pub(super) fn run<'w, C: Clock, T: Scalar, const N: usize>(
    descent: &mut Descent<'_, T, N>,
    inverse: Inverse<'_, T, N>,
    work: &'w mut Work<T, N>,
    budget: &Budget<'_, C>,
    cost: &Cost,
) -> Option<(Found<'w, T, N>, Pose<T>)> {
    let Work { room, points, .. } = work;
    let [mut best, mut trial, _] = points.each_mut();
    best.q = descent.start;
    if !descent.evaluate(best, room) {
        return None;
    }
    let initial = best.error();
    let mut best_asked = *descent.desired;
    let mut asked = best_asked;
    let cost = cost.iteration.saturating_mul(SHARE);
    let mut iterations = 0;
    let status = loop {
        if descent.converged(best) {
            break Status::Converged;
        }
        if let Some(status) = descent.halt(iterations, budget, cost) {
            break status;
        }
        let begun = budget.spent();
        asked = asked.displaced(&best.twist);
        let q = inverse(&asked, &best.q);
        iterations += 1;
        let better = q.is_some_and(|q| {
            let places = trial.q.iter_mut().zip(&q).zip(&descent.room);
            for (((place, &q), room), &from) in places.zip(&best.q) {
                let inside = step::confined(q, room);
                *place = if inside.finite() { inside } else { from };
            }
            descent.evaluate(trial, room) && trial.square < best.square
        });
        let spent = budget.spent().wrapping_sub(begun) / SHARE;
        descent.longest = descent.longest.max(spent);
        if !better {
            break Status::Settled;
        }
        core::mem::swap(&mut best, &mut trial);
        best_asked = asked;
    };
    let found = Found {
        initial,
        best,
        status,
        iterations,
    };
    Some((found, best_asked))
}
