//! Commands in whole steps of the joints. MRD 5.5 to 5.8.

use super::error::between;
use super::solve::dot;
use super::step::Columns;
use crate::effects::Conditions;
use crate::jacobian::joint_column;
use crate::model::{Model, Room};
use crate::{Pose, PreparedJoint, Scalar, Twist};

/// Joints that are tried together; the ones after these are rounded one by one.
const TOGETHER: usize = 12;

/// The command near `q` in whole steps of the joints' resolution whose predicted weighted
/// pose error to `desired` is least: of the two neighbours of each joint, all combinations.
///
/// Rounding joint by joint (MRD 5.5) adds up to half a step of every joint, whichever way it
/// falls (5.6); here the errors of the joints are set against each other. Joints without a
/// resolution stay as they are; none leaves its limits, except that a joint whose limits hold
/// no whole step stays as it is. `q`, rad or m, is a command that the compensator gave; NaN
/// in it comes back. Cost: one evaluation of the model and 18 operations for each of the 2^N
/// combinations.
pub fn nearest<T: Scalar, const N: usize>(
    model: &Model<'_, T, N>,
    desired: &Pose<T>,
    q: &[T; N],
    conditions: &Conditions<T, N>,
) -> [T; N] {
    let mut room = Room::<T, N>::default();
    let mut joints = [PreparedJoint::empty(); N];
    let prepared = model.prepare(conditions, &mut joints);
    let prediction = prepared.predict(q, &mut room.scratch());
    let weighted = |twist: &Twist<T>| {
        let (p, o) = (
            model.settings.position_weight,
            model.settings.orientation_weight,
        );
        let [a, b, c, d, e, f] = twist.rows();
        [a * p, b * p, c * p, d * o, e * o, f * o]
    };
    let tool = prediction.rigid.translation;
    // What each joint's choice adds to the error: its lower neighbour to begin with, its
    // upper neighbour on top.
    let mut error = weighted(&between(&prediction.pose(), desired));
    let mut base = *q;
    let mut change: Columns<T, N> = [[T::zero(); 6]; N];
    let joints = model.calibrated.joints.iter().zip(room.frames());
    let places = base.iter_mut().zip(&mut change);
    let steps = model.resolution.iter().zip(&model.limits);
    for (((q, change), (joint, frame)), (&step, limits)) in places.zip(joints).zip(steps) {
        let Some((low, high)) = neighbours(*q, step, limits) else {
            continue;
        };
        let column = weighted(&joint_column(joint.kind, frame, &tool));
        for (error, &c) in error.iter_mut().zip(&column) {
            *error -= c * (low - *q);
        }
        *change = column.map(|c| c * (high - low));
        *q = low;
    }
    // Gray code: every combination once, one joint changing at a time.
    let count = if N < TOGETHER { N } else { TOGETHER };
    let mut raised = 0u32;
    let mut best = (dot(&error, &error), raised);
    for k in 1..1u32 << count {
        let bit = k.trailing_zeros();
        raised ^= 1 << bit;
        let up = raised & (1 << bit) != 0;
        if let Some(change) = usize::try_from(bit).ok().and_then(|j| change.get(j)) {
            for (error, &c) in error.iter_mut().zip(change) {
                *error = if up { *error - c } else { *error + c };
            }
        }
        let square = dot(&error, &error);
        if square < best.0 {
            best = (square, raised);
        }
    }
    let mut out = base;
    let steps = model.resolution.iter().zip(&model.limits);
    for (j, ((out, &q), (&step, limits))) in out.iter_mut().zip(q).zip(steps).enumerate() {
        if let Some((low, high)) = neighbours(q, step, limits) {
            let upper = if j < count {
                best.1 & (1 << j) != 0
            } else {
                high - q < q - low
            };
            *out = if upper { high } else { low };
        }
    }
    out
}

/// The whole steps below and above `q` inside the limits; the same one twice where only one
/// is. `None` without a resolution or where no step is inside.
fn neighbours<T: Scalar>(q: T, step: T, limits: &[T; 2]) -> Option<(T, T)> {
    if step <= T::zero() || !q.finite() {
        return None;
    }
    let k = libm::floor((q / step).widen());
    let place = |k: f64| T::of(k * step.widen());
    let inside = |x: &T| *x >= limits[0] && *x <= limits[1];
    let low = Some(place(k)).filter(inside);
    let high = Some(place(k + 1.0)).filter(inside);
    Some((low.or(high)?, high.or(low)?))
}
