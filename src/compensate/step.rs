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
use super::solve::{Factor, dot};
use crate::Scalar;

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
    let free = effort.iter().all(|g| g.is_zero());
    let mut ease = [T::one(); N];
    let mut back = [T::zero(); N];
    let mut right = *error;
    let mut smallest = damping;
    if !free {
        let least = effort.iter().fold(None, |m: Option<T>, &g| {
            Some(m.map_or(g, |m| if g < m { g } else { m }))
        });
        smallest = damping + least.unwrap_or_else(T::zero);
        let places = ease.iter_mut().zip(&mut back);
        for (((ease, back), (&g, &d)), column) in places.zip(effort.iter().zip(away)).zip(columns) {
            let stiffness = g + damping;
            *ease = smallest / stiffness;
            *back = g * d / stiffness;
            for (right, &c) in right.iter_mut().zip(column) {
                *right += c * *back;
            }
        }
    }
    let (y, _) = shared_multipliers(columns, &ease, smallest, &right, false);
    let mut step = [T::zero(); N];
    for ((step, column), (&ease, &back)) in step.iter_mut().zip(columns).zip(ease.iter().zip(&back))
    {
        *step = dot(column, &y) * ease - back;
    }
    step
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
    let mut joints = [Along::default(); N];
    let places = joints.iter_mut().zip(columns).zip(effort);
    for (((joint, column), &g), &d) in places.zip(away) {
        let stiffness = g + damping;
        *joint = Along {
            inverse: T::one() / (dot(column, column) + stiffness),
            stiffness,
            pull: g * d,
        };
    }
    sweep(columns, error, &joints, room, p);
}

/// What a joint brings into [`sweep`].
#[derive(Clone, Copy)]
struct Along<T> {
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

#[inline(never)]
fn sweep<T: Scalar>(
    columns: &[[T; 6]],
    error: &[T; 6],
    joints: &[Along<T>],
    room: &[[T; 2]],
    p: &mut [T],
) {
    let mut left = *error;
    let take = |left: &mut [T; 6], column: &[T; 6], change: T| {
        for (left, &c) in left.iter_mut().zip(column) {
            *left -= c * change;
        }
    };
    for ((p, room), column) in p.iter_mut().zip(room).zip(columns) {
        *p = confined(*p, room);
        take(&mut left, column, *p);
    }
    for _ in 0..SWEEPS {
        for (p, ((column, room), joint)) in p.iter_mut().zip(columns.iter().zip(room).zip(joints)) {
            let pull = dot(column, &left) - joint.pull - joint.stiffness * *p;
            let moved = confined(*p + pull * joint.inverse, room);
            take(&mut left, column, moved - *p);
            *p = moved;
        }
    }
}

/// Sweeps of [`within_box`].
const SWEEPS: usize = 8;

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
