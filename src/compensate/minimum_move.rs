//! Commands in whole steps of the joints. MRD 5.5 to 5.8.

use super::error::weighted;
use super::solve::{add, dot};
use crate::effects::Conditions;
use crate::model::{Model, Room};
use crate::{Pose, Scalar};

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
    let prediction = model.evaluate(q, conditions, &mut room);
    let settings = &model.settings;
    let weights = [settings.position_weight, settings.orientation_weight];
    let error = T::between(&prediction.pose(), desired);
    let mut columns: [[T; 6]; N] = [[T::zero(); 6]; N];
    let tool = &prediction.rigid.translation;
    let joints = &model.calibrated.joints;
    T::weighted_jacobian(joints, room.frames(), tool, weights, &mut columns);
    let mut out = *q;
    let (steps, limits) = (&model.resolution, &model.limits);
    T::choose(
        &mut columns,
        weighted(&error, weights),
        steps,
        limits,
        &mut out,
    );
    out
}

/// [`nearest`] to `q`, which is changed to it, with the weighted Jacobian `columns`, which are
/// changed, and the weighted `error` there.
pub(crate) fn choose<T: Scalar>(
    columns: &mut [[T; 6]],
    mut error: [T; 6],
    steps: &[T],
    limits: &[[T; 2]],
    q: &mut [T],
) {
    // What each joint's choice adds to the error: its lower neighbour to begin with, its
    // upper neighbour on top.
    let places = q.iter().zip(steps).zip(limits);
    for (change, ((&q, &step), limits)) in columns.iter_mut().zip(places) {
        let (low, high) = T::neighbours(q, step, limits).unwrap_or((q, q));
        add(&mut error, change, q - low);
        for change in change {
            *change *= high - low;
        }
    }
    // Gray code: every combination once, one joint changing at a time.
    let count = q.len().min(TOGETHER);
    let mut raised = 0u32;
    let mut best = (dot(&error, &error), raised);
    for k in 1..1u32 << count {
        let bit = k.trailing_zeros();
        raised ^= 1 << bit;
        let up = raised & (1 << bit) != 0;
        if let Some(change) = usize::try_from(bit).ok().and_then(|j| columns.get(j)) {
            add(&mut error, change, if up { -T::one() } else { T::one() });
        }
        let square = dot(&error, &error);
        if square < best.0 {
            best = (square, raised);
        }
    }
    for (j, ((q, &step), limits)) in q.iter_mut().zip(steps).zip(limits).enumerate() {
        if let Some((low, high)) = T::neighbours(*q, step, limits) {
            let upper = if j < count {
                best.1 & (1 << j) != 0
            } else {
                high - *q < *q - low
            };
            *q = if upper { high } else { low };
        }
    }
}

/// The whole steps below and above `q` inside the limits; the same one twice where only one
/// is. `None` without a resolution or where no step is inside.
pub(crate) fn neighbours<T: Scalar>(q: T, step: T, limits: &[T; 2]) -> Option<(T, T)> {
    if step <= T::zero() || !q.finite() {
        return None;
    }
    let k = (q / step).whole();
    let inside = |x: &T| *x >= limits[0] && *x <= limits[1];
    let low = Some(k * step).filter(inside);
    let high = Some((k + T::one()) * step).filter(inside);
    Some((low.or(high)?, high.or(low)?))
}
