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

use super::damped::shared_multipliers;
use super::solve::{Factor, add, dot};
use crate::{BakedJoint, JointKind, Scalar};

/// Weighted joint Jacobian, one column a joint.
pub(super) type Columns<T, const N: usize> = [[T; 6]; N];

/// The damped step `p`. `columns`: `W J`; `error`: `W e`; `effort`: diagonal of G; `away`:
/// `q - start`; `damping`: `λ²`.
#[inline(never)]
pub(super) fn damped_step<T: Scalar, const N: usize>(
    columns: &Columns<T, N>,
    error: &[T; 6],
    effort: &[T; N],
    away: &[T; N],
    damping: T,
) -> [T; N] {
    if N < 6 {
        return normal_step(columns, error, effort, away, damping);
    }
    let mut step = [T::zero(); N];
    let mut ease = [T::one(); N];
    if effort.iter().all(|g| g.is_zero()) {
        let (y, _) = shared_multipliers(columns, &ease, damping, error, false);
        T::projected(columns, &y, &mut step);
        return step;
    }
    let mut back = [T::zero(); N];
    let mut right = *error;
    let mu = T::eased(
        columns, effort, away, damping, &mut right, &mut ease, &mut back,
    );
    let (y, _) = shared_multipliers(columns, &ease, mu, &right, false);
    T::projected(columns, &y, &mut step);
    for (step, (&ease, &back)) in step.iter_mut().zip(ease.iter().zip(&back)) {
        *step = *step * ease - back;
    }
    step
}

/// Sets the diagonal of S, `ease`, and `b`, `back`, which are ones and zeros, and adds `W J b`
/// to the `right` side. Returns `μ`.
pub(crate) fn eased<T: Scalar>(
    columns: &[[T; 6]],
    effort: &[T],
    away: &[T],
    damping: T,
    right: &mut [T; 6],
    ease: &mut [T],
    back: &mut [T],
) -> T {
    let least = effort.iter().fold(None, |m: Option<T>, &g| {
        Some(m.map_or(g, |m| if g < m { g } else { m }))
    });
    let mu = damping + least.unwrap_or_else(T::zero);
    let places = ease.iter_mut().zip(back.iter_mut());
    for (((ease, back), (&g, &d)), column) in places.zip(effort.iter().zip(away)).zip(columns) {
        let stiffness = g + damping;
        *ease = mu / stiffness;
        *back = g * d / stiffness;
        add(right, column, *back);
    }
    mu
}

/// Sets `step` to `(W J)ᵀ y`.
pub(crate) fn projected<T: Scalar>(columns: &[[T; 6]], y: &[T; 6], step: &mut [T]) {
    for (step, column) in step.iter_mut().zip(columns) {
        *step = dot(column, y);
    }
}

/// The same for fewer than six joints: normal matrix with their number of rows.
fn normal_step<T: Scalar, const N: usize>(
    columns: &Columns<T, N>,
    error: &[T; 6],
    effort: &[T; N],
    away: &[T; N],
    damping: T,
) -> [T; N] {
    let mut h = normal_matrix(columns);
    let mut right = [T::zero(); N];
    for (j, (right, column)) in right.iter_mut().zip(columns).enumerate() {
        if let (Some(&g), Some(&d), Some(row)) = (effort.get(j), away.get(j), h.get_mut(j)) {
            *right = dot(column, error) - g * d;
            if let Some(diagonal) = row.get_mut(j) {
                *diagonal += g + damping;
            }
        }
    }
    Factor::of(&h, damping).solve(&right)
}

/// Lower triangle of `Jᵀ W² J`.
#[inline]
fn normal_matrix<T: Scalar, const N: usize>(columns: &Columns<T, N>) -> [[T; N]; N] {
    let mut h = [[T::zero(); N]; N];
    for (i, (row, left)) in h.iter_mut().zip(columns).enumerate() {
        for (entry, right) in row.iter_mut().zip(columns).take(i + 1) {
            *entry = dot(left, right);
        }
    }
    h
}

#[inline]
fn add_diagonal<T: Scalar, const K: usize>(a: &mut [[T; K]; K], value: T) {
    for (i, row) in a.iter_mut().enumerate() {
        if let Some(entry) = row.get_mut(i) {
            *entry += value;
        }
    }
}

/// How far the weighted Jacobian is from singular: the harmonic sum of its squared singular
/// values, `1 / (1/σ1² + 1/σ2² + ..)`, which is at most the smallest and smooth in the
/// joints. `damping` is added to each. `weights`: position and orientation; a weight of zero
/// takes its three directions out. From six joints on the `y` of `(W J Jᵀ W + λ² I) y = error`
/// comes with it.
#[inline(never)]
pub(super) fn clearance<T: Scalar, const N: usize>(
    columns: &Columns<T, N>,
    weights: [T; 2],
    damping: T,
    error: &[T; 6],
) -> (T, Option<[T; 6]>) {
    if N < 6 {
        let mut h = normal_matrix(columns);
        add_diagonal(&mut h, damping);
        let factor = Factor::of(&h, damping);
        (T::one() / factor.inverse_trace(), None)
    } else {
        let (y, [linear, angular]) =
            shared_multipliers(columns, &[T::one(); N], damping, error, true);
        let [p, o] = weights;
        (T::one() / (linear * (p * p) + angular * (o * o)), Some(y))
    }
}

/// Solves the linearised problem inside the box `low <= q <= high` by coordinate descent,
/// from the step `p` (changed to the result). A fixed number of sweeps, each a continuous map
/// of all its inputs and none raising the cost: so what comes out stays continuous where a
/// joint reaches or leaves its bound.
pub(super) fn within_box<T: Scalar, const N: usize>(
    columns: &Columns<T, N>,
    error: &[T; 6],
    effort: &[T; N],
    away: &[T; N],
    damping: T,
    room: &[[T; 2]; N],
    p: &mut [T; N],
) {
    let joints = &mut [Along::default(); N];
    for (joint, (&g, &d)) in joints.iter_mut().zip(effort.iter().zip(away)) {
        joint.stiffness = g + damping;
        joint.pull = g * d;
    }
    T::sweep(columns, error, joints, room, p);
}

/// What a joint brings into [`sweep`].
#[derive(Clone, Copy, Debug)]
pub struct Along<T> {
    /// One over the second derivative of half the cost.
    inverse: T,
    /// Of effort and damping alone.
    stiffness: T,
    /// Of the effort, at no step.
    pull: T,
}

impl<T: Scalar> Default for Along<T> {
    fn default() -> Self {
        let o = T::zero();
        Self {
            inverse: o,
            stiffness: o,
            pull: o,
        }
    }
}

pub(crate) fn sweep<T: Scalar>(
    columns: &[[T; 6]],
    error: &[T; 6],
    joints: &mut [Along<T>],
    room: &[[T; 2]],
    p: &mut [T],
) {
    let mut left = *error;
    let places = p.iter_mut().zip(room);
    for ((p, room), (column, joint)) in places.zip(columns.iter().zip(joints.iter_mut())) {
        joint.inverse = T::one() / (dot(column, column) + joint.stiffness);
        *p = confined(*p, room);
        add(&mut left, column, -*p);
    }
    for _ in 0..SWEEPS {
        for (p, ((column, room), joint)) in p.iter_mut().zip(columns.iter().zip(room).zip(&*joints))
        {
            let pull = dot(column, &left) - joint.pull - joint.stiffness * *p;
            let moved = confined(*p + pull * joint.inverse, room);
            add(&mut left, column, *p - moved);
            *p = moved;
        }
    }
}

/// Sweeps of [`within_box`].
const SWEEPS: usize = 8;

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
