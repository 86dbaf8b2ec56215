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

use super::descent::{Descent, Point};
use super::{Request, Status, step};
use crate::budget::{Budget, Clock, Cost};
use crate::model::{Model, Room};
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

/// What [`run`] found.
pub(super) struct Found<T: Scalar, const N: usize> {
    pub(super) initial: Point<T, N>,
    pub(super) best: Point<T, N>,
    /// Task point of the best.
    pub(super) asked: Pose<T>,
    pub(super) status: Status,
    pub(super) iterations: u8,
}

/// Moves the task point until the calibrated arm reaches the pose that `descent` desires,
/// through the caller's inverse. `None` where the model gives no finite pose.
pub(super) fn run<C: Clock, T: Scalar, const N: usize>(
    descent: &mut Descent<'_, T, N>,
    inverse: Inverse<'_, T, N>,
    budget: &Budget<'_, C>,
    cost: &Cost,
) -> Option<Found<T, N>> {
    let mut room = Room::default();
    let initial = descent.evaluate(descent.start, &mut room)?;
    let mut best = (initial, descent.desired);
    let mut asked = descent.desired;
    let mut last = initial;
    let cost = cost.iteration.saturating_mul(SHARE);
    let mut iterations = 0;
    let status = loop {
        if descent.converged(&best.0) {
            break Status::Converged;
        }
        if let Some(status) = descent.halt(iterations, budget, cost) {
            break status;
        }
        let begun = budget.spent();
        asked = asked.displaced(&last.twist);
        let q = inverse(&asked, &last.q);
        iterations += 1;
        let point = q.and_then(|mut q| {
            for ((q, room), &from) in q.iter_mut().zip(&descent.room).zip(&last.q) {
                let inside = step::confined(*q, room);
                *q = if inside.finite() { inside } else { from };
            }
            descent.evaluate(q, &mut room)
        });
        let spent = budget.spent().wrapping_sub(begun) / SHARE;
        descent.longest = descent.longest.max(spent);
        match point {
            Some(point) if point.square < best.0.square => {
                best = (point, asked);
                last = point;
            }
            _ => break Status::Settled,
        }
    };
    Some(Found {
        initial,
        best: best.0,
        asked: best.1,
        status,
        iterations,
    })
}
