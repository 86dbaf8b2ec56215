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

use super::descent::{Next, Search, Tried};
use super::{Request, Status, step};
use crate::budget::Moment;
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

/// Moves the task point by what is left, unless that is enough.
pub(super) fn ask<T: Scalar>(search: &mut Search<'_, T>, now: &Moment) -> Next {
    if search.converged() {
        return Next::Done(Status::Converged);
    }
    if let Some(status) = search.halt(now) {
        return Next::Done(status);
    }
    let course = &mut *search.course;
    course.asked = course.asked.displaced(&course.best.twist);
    course.tried = Tried::Answer;
    Next::Ask
}

/// Takes what the caller's inverse kinematics gave for that pose.
pub(crate) fn answer<T: Scalar>(search: &mut Search<'_, T>, q: &[T]) {
    let places = search.trial.iter_mut().zip(q).zip(&*search.reach);
    for (((place, &q), reach), &from) in places.zip(&*search.best) {
        let inside = step::confined(q, reach);
        *place = if inside.finite() { inside } else { from };
    }
}
