//! Newton's method for a rigid arm clear of singularities and limits, in as few instructions
//! as it takes: the plain case of [`super::descent`], which takes over wherever it is not
//! plain.
//!
//! It solves the same problem by the same steps and so ends at the same joints. What it saves
//! is the frames, the effort, and the last evaluation: a step `p` of a chain of turns leaves
//!
//! ```text
//! |remaining| <= D |y| + 1/2 (sum |p|)² reach        position
//! |remaining| <= D |y| + 1/2 (sum |p|)²              orientation
//! ```
//! the first from the damping ([`super::damped`]), exactly, the second the remainder of
//! Taylor's series, since no second derivative of a pose by joint angles is longer than the
//! arm. If this is below the tolerances, the step is the answer.

use nalgebra::{Matrix3, Vector3};

use super::damped::{multipliers, share};
use super::error::PoseError;
use super::rigid::approach;
use super::{Compensator, Outcome, Status};
use crate::budget::{Budget, Clock};
use crate::{JointKind, Pose, Scalar, Settings, Twist};

/// `rᵀ v`.
#[inline(always)]
fn back<T: Scalar>(r: &Matrix3<T>, v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        r.m11 * v.x + r.m21 * v.y + r.m31 * v.z,
        r.m12 * v.x + r.m22 * v.y + r.m32 * v.z,
        r.m13 * v.x + r.m23 * v.y + r.m33 * v.z,
    )
}

/// `desired` as [`approach`] wants it: seen from `base`, its rotation without `tool`'s.
#[inline(always)]
fn without<T: Scalar>(desired: &Pose<T>, base: &Pose<T>, tool: &Pose<T>) -> Pose<T> {
    let from = &base.rotation;
    let d = &desired.rotation;
    let x = back(from, &Vector3::new(d.m11, d.m21, d.m31));
    let y = back(from, &Vector3::new(d.m12, d.m22, d.m32));
    let z = back(from, &Vector3::new(d.m13, d.m23, d.m33));
    let t = &tool.rotation;
    Pose::new(
        Matrix3::from_columns(&[
            x * t.m11 + y * t.m12 + z * t.m13,
            x * t.m21 + y * t.m22 + z * t.m23,
            x * t.m31 + y * t.m32 + z * t.m33,
        ]),
        back(from, &(desired.translation - base.translation)),
    )
}

/// Squares of position and orientation error.
#[derive(Clone, Copy)]
struct Squares<T> {
    position: T,
    orientation: T,
}

impl<T: Scalar> Squares<T> {
    #[inline(always)]
    fn of(e: &Twist<T>) -> Self {
        let (v, w) = (&e.linear, &e.angular);
        Self {
            position: v.x * v.x + v.y * v.y + v.z * v.z,
            orientation: w.x * w.x + w.y * w.y + w.z * w.z,
        }
    }

    #[inline(always)]
    fn below(&self, tolerance: &Self) -> bool {
        self.position <= tolerance.position && self.orientation <= tolerance.orientation
    }

    fn error(&self) -> PoseError<T> {
        PoseError {
            position: self.position.root(),
            orientation: self.orientation.root(),
        }
    }
}

/// Square of the larger.
#[inline(always)]
fn square_of_larger<T: Scalar>(a: T, b: T) -> T {
    if a > b { a * a } else { b * b }
}

impl<T: Scalar, const N: usize> Compensator<'_, T, N> {
    /// The answer to a request for the pose `desired` from the joints `start`, or `None`
    /// where this is no plain case.
    pub(super) fn swift<C: Clock>(
        &self,
        start: &[T; N],
        desired: &Pose<T>,
        budget: &Budget<'_, C>,
        iteration_cycles: u32,
    ) -> Option<Outcome<T, N>> {
        let settings = &self.settings;
        let chain = &self.model.calibrated;
        let (p, o) = (settings.position_weight, settings.orientation_weight);
        if N < 6 || !self.model.effects.is_empty() || p < T::of(1e-3) || o < T::of(1e-3) {
            return None;
        }
        let damping = [settings.damping / (p * p), settings.damping / (o * o)];
        let target = without(desired, &chain.base, &chain.tool);
        let place = &target.translation;
        let floor = T::EPSILON * (T::one() + place.x.abs() + place.y.abs() + place.z.abs());
        let tolerance = Squares {
            position: square_of_larger(settings.position_tolerance, floor),
            orientation: square_of_larger(settings.orientation_tolerance, floor),
        };
        let tip = &chain.tool.translation;
        let mut columns = [Twist::zero(); N];
        let mut q = *start;
        let mut error = approach(&chain.joints, &q, tip, &target, &mut columns);
        let initial = Squares::of(&error);
        let mut now = initial;
        let mut iterations = 0;
        let (status, remaining) = loop {
            if now.below(&tolerance) {
                break (Status::Converged, now);
            }
            if iterations >= settings.max_iterations {
                break (Status::IterationLimit, now);
            }
            if !budget.fits(iteration_cycles) {
                break (Status::OutOfBudget, now);
            }
            let first = iterations == 0;
            let (y, trace) = multipliers(&chain.joints, &columns, damping, &error, first);
            let square = now.position * (p * p) + now.orientation * (o * o);
            if first && !clear(settings, trace, square) {
                return None;
            }
            let moved = self.stepped(&mut q, start, &columns, &y)?;
            iterations += 1;
            let left = bound(&y, damping, moved, self.reach);
            let left_square = left.position * (p * p) + left.orientation * (o * o);
            // Below a sixteenth of the error before, in the square: a quarter.
            if left.below(&tolerance) && left_square * T::of(16.0) <= square {
                break (Status::Converged, left);
            }
            error = approach(&chain.joints, &q, tip, &target, &mut columns);
            now = Squares::of(&error);
            let better = now.position * (p * p) + now.orientation * (o * o);
            // Newton's pace, which NaN does not have either.
            let converging = better * T::of(16.0) <= square;
            if !converging {
                return None;
            }
        };
        Some(Outcome {
            q,
            status,
            iterations,
            initial: Some(initial.error()),
            remaining: Some(remaining.error()),
            clamped: [false; N],
            task_point: None,
            cycles: budget.spent(),
        })
    }

    /// Moves `q` by `Jᵀ y`. Returns the sum of the joints' ways, or `None` where one would
    /// come to a limit or to the correction bound, or where perhaps no joint would move by half its
    /// resolution.
    #[inline(always)]
    fn stepped(
        &self,
        q: &mut [T; N],
        start: &[T; N],
        columns: &[Twist<T>; N],
        y: &Twist<T>,
    ) -> Option<T> {
        let [revolute, prismatic] = self.settings.correction_bound;
        let mut way = T::zero();
        let joints = self.model.calibrated.joints.iter().zip(columns);
        let places = q.iter_mut().zip(start);
        for (((q, &start), (joint, column)), &[low, high]) in
            places.zip(joints).zip(&self.model.limits)
        {
            let bound = match joint.kind {
                JointKind::Revolute => revolute,
                JointKind::Prismatic => prismatic,
            };
            let step = share(column, y);
            *q += step;
            // NaN is outside.
            let inside = *q > low && *q < high && (*q - start).abs() < bound;
            if !inside {
                return None;
            }
            way += step.abs();
        }
        (way > self.perceptible).then_some(way)
    }
}

/// Whether no price is put on corrections: [`super::inverse_jacobian::singular_effort`] is 0.
#[inline(always)]
fn clear<T: Scalar>(settings: &Settings<T>, trace: T, square: T) -> bool {
    let threshold = settings.singular_value * settings.singular_value + square;
    trace * threshold <= T::one()
}

/// What a step by `y` leaves at most; `way`: sum of the joints' ways.
#[inline(always)]
fn bound<T: Scalar>(y: &Twist<T>, damping: [T; 2], way: T, reach: T) -> Squares<T> {
    let [position, orientation] = damping;
    let curved = T::of(0.5) * way * way;
    let sum = |v: &Vector3<T>| v.x.abs() + v.y.abs() + v.z.abs();
    let position = position * sum(&y.linear) + curved * reach;
    let orientation = orientation * sum(&y.angular) + curved;
    Squares {
        position: position * position,
        orientation: orientation * orientation,
    }
}
