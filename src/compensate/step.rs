//! One step of the regularised least-squares problem that the model-based compensators solve.
//!
//! ```text
//! minimise over q   |W e(q)|² + sum over j of effort_j (q_j - start_j)²
//! ```
//! with `e` the pose error (desired minus predicted, MRD 5.32 with the sign of a correction),
//! `W` its weights and `start` the command that came in. Each step solves the problem with
//! `e` linearised, exactly and for any effort, zero included:
//!
//! ```text
//! (Jᵀ W² J + G + λ² I) p = Jᵀ W² e - G (q - start)
//! ```
//! From six joints on it is solved in the 6 x 6 form
//! `p = S Jᵀ W (W J S Jᵀ W + μ I)⁻¹ W (e + J b) - b` with `M = G + λ² I`, `μ = min M`,
//! `S = μ M⁻¹`, `b = M⁻¹ G (q - start)`; below, as it stands.

use super::solve::{Factor, add, dot};
use crate::{BakedJoint, JointKind, Scalar};

/// The damped step `p`. `columns`: `W J`; `error`: `W e`; `effort`: diagonal of G; `[q, start]`;
/// `damping`: `λ²`. `FEW`: fewer than six joints.
pub(super) fn damped_step<T: Scalar, const FEW: bool>(
    columns: &[[T; 6]],
    error: &[T; 6],
    effort: &[T],
    [q, start]: [&[T]; 2],
    damping: T,
    step: &mut [T],
) {
    let places = effort.iter().zip(q.iter().zip(start));
    if FEW {
        let mut h = normal_matrix(columns);
        let mut right = [T::zero(); FEW_JOINTS];
        let rows = h.iter_mut().zip(&mut right).enumerate();
        for ((j, (row, right)), (column, (&g, (&q, &start)))) in
            rows.zip(columns.iter().zip(places))
        {
            *right = dot(column, error) - g * (q - start);
            if let Some(diagonal) = row.get_mut(j) {
                *diagonal += g + damping;
            }
        }
        copy(step, &Factor::of(&h, damping).solve(&right));
        return;
    }
    let mut least = None;
    for &g in effort {
        least = Some(least.map_or(g, |least| if g < least { g } else { least }));
    }
    let mu = damping + least.unwrap_or_else(T::zero);
    let mut right = *error;
    for ((ease, (&g, (&q, &start))), column) in step.iter_mut().zip(places.clone()).zip(columns) {
        let stiffness = g + damping;
        *ease = mu / stiffness;
        add(&mut right, column, g * (q - start) / stiffness);
    }
    let (y, _) = T::shared_multipliers(columns, step, mu, &right, false);
    for ((step, (&g, (&q, &start))), column) in step.iter_mut().zip(places).zip(columns) {
        *step = dot(column, &y) * *step - g * (q - start) / (g + damping);
    }
}

/// Sets `step` to `(W J)ᵀ y`.
pub(super) fn projected<T: Scalar>(columns: &[[T; 6]], y: &[T; 6], step: &mut [T]) {
    for (step, column) in step.iter_mut().zip(columns) {
        *step = dot(column, y);
    }
}

/// Joints that are too few for six equations, at most: then it is solved as it stands.
const FEW_JOINTS: usize = 5;

/// Lower triangle of `Jᵀ W² J` of a few joints; ones on the diagonal for those that are not
/// there.
fn normal_matrix<T: Scalar>(columns: &[[T; 6]]) -> [[T; FEW_JOINTS]; FEW_JOINTS] {
    let mut h = [[T::zero(); FEW_JOINTS]; FEW_JOINTS];
    for (i, row) in h.iter_mut().enumerate() {
        if let Some(left) = columns.get(i) {
            for (entry, right) in row.iter_mut().zip(columns).take(i + 1) {
                *entry = dot(left, right);
            }
        } else if let Some(diagonal) = row.get_mut(i) {
            *diagonal = T::one();
        }
    }
    h
}

/// How far the weighted Jacobian is from singular: the harmonic sum of its squared singular
/// values, `1 / (1/σ1² + 1/σ2² + ..)`, which is at most the smallest and smooth in the
/// joints. `damping` is added to each. `weights`: position and orientation; a weight of zero
/// takes its three directions out. From six joints on the `y` of `(W J Jᵀ W + λ² I) y = error`
/// comes with it. `ones`: set to that.
pub(super) fn clearance<T: Scalar, const FEW: bool>(
    columns: &[[T; 6]],
    weights: [T; 2],
    damping: T,
    error: &[T; 6],
    ones: &mut [T],
) -> (T, Option<[T; 6]>) {
    if FEW {
        let mut h = normal_matrix(columns);
        for (i, row) in h.iter_mut().enumerate().take(columns.len()) {
            if let Some(entry) = row.get_mut(i) {
                *entry += damping;
            }
        }
        let factor = Factor::of(&h, damping);
        return (T::one() / factor.inverse_trace(columns.len()), None);
    }
    for one in ones.iter_mut() {
        *one = T::one();
    }
    let (y, [linear, angular]) = T::shared_multipliers(columns, ones, damping, error, true);
    let [p, o] = weights;
    (T::one() / (linear * (p * p) + angular * (o * o)), Some(y))
}

/// Solves the linearised problem inside the box `low <= q + p <= high` by coordinate descent,
/// from the step `p` (changed to the result). A fixed number of sweeps, each a continuous map
/// of all its inputs and none raising the cost: so what comes out stays continuous where a
/// joint reaches or leaves its bound. `inverse`: one place a joint.
#[expect(clippy::too_many_arguments, reason = "the places of one search")]
pub(super) fn within_box<T: Scalar>(
    columns: &[[T; 6]],
    error: &[T; 6],
    effort: &[T],
    [q, start]: [&[T]; 2],
    damping: T,
    reaches: &[[T; 2]],
    inverse: &mut [T],
    p: &mut [T],
) {
    let reach = |(&[low, high], &q): (&[T; 2], &T)| [low - q, high - q];
    let mut left = *error;
    let places = p.iter_mut().zip(reaches.iter().zip(q).map(reach));
    for (((p, room), column), (inverse, &g)) in
        places.zip(columns).zip(inverse.iter_mut().zip(effort))
    {
        // Of the second derivative of half the cost.
        *inverse = T::one() / (dot(column, column) + (g + damping));
        *p = confined(*p, &room);
        add(&mut left, column, -*p);
    }
    for _ in 0..SWEEPS {
        let places = p.iter_mut().zip(reaches.iter().zip(q).map(reach));
        let ends = effort.iter().zip(q.iter().zip(start));
        for (((p, room), column), (&inverse, (&g, (&q, &start)))) in
            places.zip(columns).zip(inverse.iter().zip(ends))
        {
            let pull = dot(column, &left) - g * (q - start) - (g + damping) * *p;
            let moved = confined(*p + pull * inverse, &room);
            add(&mut left, column, *p - moved);
            *p = moved;
        }
    }
}

/// Sweeps of [`within_box`].
const SWEEPS: usize = 8;

/// `step · ((W J)ᵀ error - G (q - start))`.
pub(super) fn half_slope<T: Scalar>(
    error: &[T; 6],
    columns: &[[T; 6]],
    effort: &[T],
    [q, start]: [&[T]; 2],
    step: &[T],
) -> T {
    let mut slope = T::zero();
    let efforts = effort.iter().zip(q.iter().zip(start));
    for ((&p, column), (&g, (&q, &start))) in step.iter().zip(columns).zip(efforts) {
        slope += p * (dot(column, error) - g * (q - start));
    }
    slope
}

/// Sets `to` to `from`.
pub(super) fn copy<T: Copy>(to: &mut [T], from: &[T]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to = from;
    }
}

/// Cuts off of `room` what is further from `q` than the `bound` of a revolute or a prismatic
/// joint.
pub(crate) fn keep_near<T: Scalar>(
    room: &mut [[T; 2]],
    joints: &[BakedJoint<T>],
    q: &[T],
    bound: &[T; 2],
) {
    for ((room, joint), &q) in room.iter_mut().zip(joints).zip(q) {
        let [revolute, prismatic] = *bound;
        let bound = match joint.kind {
            JointKind::Revolute => revolute,
            JointKind::Prismatic => prismatic,
        };
        let [low, high] = *room;
        *room = [
            if q - bound > low { q - bound } else { low },
            if q + bound < high { q + bound } else { high },
        ];
    }
}

/// Says which of `q` stand at an end of their interval, or beyond.
pub(crate) fn bounded<T: Scalar>(q: &[T], room: &[[T; 2]], clamped: &mut [bool]) {
    for ((clamped, &q), &[low, high]) in clamped.iter_mut().zip(q).zip(room) {
        *clamped = q <= low || q >= high;
    }
}

/// Moves each of `q` into its interval.
pub(crate) fn confine<T: Scalar>(q: &mut [T], room: &[[T; 2]]) {
    for (q, room) in q.iter_mut().zip(room) {
        *q = confined(*q, room);
    }
}

/// Sets `q` to `from` plus `scale` times `step`, each in its interval.
pub(crate) fn advance<T: Scalar>(from: &[T], step: &[T], scale: T, room: &[[T; 2]], q: &mut [T]) {
    for ((q, room), (&from, &p)) in q.iter_mut().zip(room).zip(from.iter().zip(step)) {
        *q = confined(from + p * scale, room);
    }
}

/// `x` in the interval `[low, high]`.
#[inline]
pub(super) fn confined<T: Scalar>(x: T, [low, high]: &[T; 2]) -> T {
    if x < *low {
        *low
    } else if x > *high {
        *high
    } else {
        x
    }
}
