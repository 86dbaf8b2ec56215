//! What a step leaves to second order, and the further step that takes it away (Chebyshev's
//! method).

use nalgebra::Vector3;

use super::super::error::PoseError;
use super::{Constants, Squares};
use crate::vector::{add_cross, cross};
use crate::{Scalar, Twist};

/// How far the pose is off what the equations of the step `steps` say. Where that is too much,
/// a further step takes the second order away: it is added to `q`, `steps` and `way`, the sum of
/// all. A regulator's steps stay those of the linear equations.
#[inline(never)]
pub(super) fn second_order<T: Scalar, const N: usize>(
    constants: &Constants<T>,
    columns: &[Twist<T>; N],
    to_point: &Vector3<T>,
    steps: &mut [T; N],
    q: &mut [T; N],
    more: &mut [T; N],
    way: &mut T,
) -> PoseError<T> {
    let second = curvature(columns, steps);
    let squares = Squares::of(&second);
    if squares.below(&constants.tolerance) {
        return constants.beyond(&constants.tangent.of(&squares), *way);
    }
    // Nothing of this is prepared above.
    core::hint::black_box(());
    let mut off = squares.error();
    let mut mixed = T::zero();
    if !constants.regulator
        && let Some(left) = straighten(constants, columns, to_point, &second, steps, q, more, way)
    {
        mixed = left;
        off = PoseError {
            position: T::zero(),
            orientation: T::zero(),
        };
    }
    let left = constants.beyond(&off, *way);
    PoseError {
        position: left.position + constants.reach * mixed,
        orientation: left.orientation + mixed,
    }
}

/// Takes the second order of a step away by a further one, both together in `steps` and `way`
/// then. Returns the second order that is left where they meet, in rad. `None` without the
/// further step.
#[inline(never)]
#[expect(clippy::too_many_arguments, reason = "the places of one step")]
fn straighten<T: Scalar, const N: usize>(
    constants: &Constants<T>,
    columns: &[Twist<T>; N],
    to_point: &Vector3<T>,
    second: &Twist<T>,
    steps: &mut [T; N],
    q: &mut [T; N],
    more: &mut [T; N],
    way: &mut T,
) -> Option<T> {
    let back = second.scaled(-T::one());
    constants.undamped(columns, to_point, &back, more, false, T::zero())?;
    let mut further = T::zero();
    for ((q, step), &more) in q.iter_mut().zip(steps.iter_mut()).zip(more.iter()) {
        *q += more;
        *step += more;
        further += more.abs();
    }
    let mixed = further * (*way + further);
    *way += further;
    Some(mixed)
}

/// The second order of the step `steps`: with axis z_k and motion v_k of the point per unit of
/// joint k,
///
/// ```text
/// sum over k of p_k w_k x v_k   and   1/2 sum over k of p_k w_k x z_k,
/// w_k = p_k z_k / 2 + sum over j < k of p_j z_j
/// ```
///
/// The first joint turns about z.
#[inline(always)]
fn curvature<T: Scalar>(columns: &[Twist<T>], steps: &[T]) -> Twist<T> {
    let (o, half) = (T::zero(), T::of(0.5));
    let ([first, next, columns @ ..], [p1, p2, steps @ ..]) = (columns, steps) else {
        return Twist::zero();
    };
    let (v, square) = (&first.linear, *p1 * *p1 * half);
    let halfway = next.angular * (*p2 * half);
    let mut turned = Vector3::new(halfway.x, halfway.y, halfway.z + *p1);
    let w = cross(&turned, &next.linear) * *p2;
    let mut position = Vector3::new(w.x - square * v.y, w.y + square * v.x, w.z);
    let mut orientation = Vector3::new(-(halfway.y * *p1), halfway.x * *p1, o);
    turned += halfway;
    // Not unrolled, as in `shared_multipliers`.
    let count = core::hint::black_box(columns.len());
    for (column, &p) in columns.iter().zip(steps).take(count) {
        let halfway = column.angular * (p * half);
        orientation = add_cross(&orientation, &turned, &halfway);
        turned += halfway;
        position += cross(&turned, &column.linear) * p;
        turned += halfway;
    }
    Twist::new(position, orientation)
}
