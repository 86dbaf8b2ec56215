//! Newton's method for a rigid arm clear of singularities and limits, in as few instructions
//! as it takes: the plain case of [`super::descent`], which takes over wherever it is not
//! plain.
//!
//! For the regulator too, as long as it asks the same price of all corrections, which is a
//! damping towards the command that came in. It solves the same problem by the same steps and
//! so ends at the same joints. What it saves is the frames, the effort, and the last
//! evaluation: a step `p` of a chain of turns leaves
//!
//! ```text
//! |remaining| <= D |y| + sum over k of |p_k| r_k (|p_k| / 2 + sum over j < k of |p_j|)   position
//! |remaining| <= D |y| + 1/2 sum over j < k of |p_j| |p_k|                               orientation
//! ```
//! the first from the damping ([`super::damped`]), exactly, the second the remainder of
//! Taylor's series: the second derivative of the tool point by the turns j and k >= j is not
//! longer than the way `r_k` from axis k to it, and that of the orientation is half the cross
//! product of the axes. If this is below the tolerances, the step is the answer.

use nalgebra::{Matrix3, Vector3};

use super::damped::{multipliers, share};
use super::error::PoseError;
use super::rigid::{Rest, approach, square};
use super::{Compensator, Outcome, Request, Status, lqr};
use crate::budget::{Budget, Clock, PLAIN_ITERATIONS};
use crate::model::Model;
use crate::{JointKind, Method, Pose, Scalar, Settings, Twist};

/// What does not change from request to request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constants<T: Scalar, const N: usize> {
    /// Of the position and the orientation equations, the price of a correction with it.
    damping: [T; 2],
    /// Share of the price in that.
    priced: T,
    /// Squares of the weights of position and orientation.
    weights: [T; 2],
    /// Square of the smallest singular value that counts as clear.
    singular: T,
    /// Longest way from each axis to the tool point, m.
    levers: [T; N],
    /// Middle and half of where each joint may go, rad.
    travel: [[T; 2]; N],
    /// Ways that add up to more move at least one joint by half its resolution, rad.
    perceptible: T,
}

/// Room for one iteration, kept from one request to the next to save filling it with zeros.
#[derive(Clone, Copy, Debug)]
pub(super) struct Work<T: Scalar, const N: usize> {
    /// Sine and cosine of each joint.
    turns: [[T; 2]; N],
    /// The joint Jacobian.
    columns: [Twist<T>; N],
}

impl<T: Scalar, const N: usize> Default for Work<T, N> {
    fn default() -> Self {
        Self {
            turns: [[T::zero(); 2]; N],
            columns: [Twist::zero(); N],
        }
    }
}

impl<T: Scalar, const N: usize> Constants<T, N> {
    /// `None` where the model and the settings make no plain case.
    pub(super) fn of(model: &Model<'_, T, N>, settings: &Settings<T>) -> Option<Self> {
        let chain = &model.calibrated;
        let [p, o] = [settings.position_weight, settings.orientation_weight];
        let turns = chain.joints.iter().all(|j| j.kind == JointKind::Revolute);
        let least = T::of(1e-3);
        if N < 6 || !turns || !model.effects.is_empty() || p < least || o < least {
            return None;
        }
        let mut levers = [T::zero(); N];
        let mut lever = chain.tool.translation.norm_squared().root();
        for (place, joint) in levers.iter_mut().zip(&chain.joints).rev() {
            lever += (joint.tx * joint.tx + joint.ty * joint.ty).root();
            *place = lever;
        }
        let half = T::of(0.5);
        // The regulator's price, the same for all joints as long as they are clear of the
        // margins in which it grows.
        let (price, margin) = match settings.method {
            Method::Lqr => (settings.effort, T::of(lqr::MARGIN)),
            _ => (T::zero(), T::zero()),
        };
        let damping = settings.damping + price;
        Some(Self {
            damping: [damping / (p * p), damping / (o * o)],
            priced: price / damping,
            weights: [p * p, o * o],
            singular: settings.singular_value * settings.singular_value,
            levers,
            travel: model.limits.map(|[low, high]| {
                // Rounding of the middle, of the half and of what is compared with them.
                let rounding = (low.abs() + high.abs()) * T::EPSILON * T::of(4.0);
                let range = high - low;
                [(low + high) * half, range * (half - margin) - rounding]
            }),
            perceptible: model.resolution.iter().fold(T::zero(), |sum, &r| sum + r),
        })
    }
}

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
        Self {
            position: square(&e.linear),
            orientation: square(&e.angular),
        }
    }

    #[inline(always)]
    fn below(&self, tolerance: &Self) -> bool {
        self.position <= tolerance.position && self.orientation <= tolerance.orientation
    }

    #[inline(always)]
    fn weighted(&self, [position, orientation]: [T; 2]) -> T {
        self.position * position + self.orientation * orientation
    }

    #[inline(always)]
    fn error(&self) -> PoseError<T> {
        PoseError {
            position: self.position.rough_root(),
            orientation: self.orientation.rough_root(),
        }
    }
}

/// Square of the larger.
#[inline(always)]
fn square_of_larger<T: Scalar>(a: T, b: T) -> T {
    if a > b { a * a } else { b * b }
}

impl<T: Scalar, const N: usize> Compensator<'_, T, N> {
    /// The answer to a request for the pose `desired`, or `None` where this is no plain case.
    #[inline(always)]
    pub(super) fn swift<C: Clock>(
        &mut self,
        request: &Request<T, N>,
        desired: &Pose<T>,
        budget: &Budget<'_, C>,
        iteration_cycles: u32,
    ) -> Option<Outcome<T, N>> {
        let constants = self.constants.as_ref()?;
        let settings = &self.settings;
        let chain = &self.model.calibrated;
        let target = without(desired, &chain.base, &chain.tool);
        let place = &target.translation;
        let floor = T::EPSILON * (T::one() + place.x.abs() + place.y.abs() + place.z.abs());
        let tolerance = Squares {
            position: square_of_larger(settings.position_tolerance, floor),
            orientation: square_of_larger(settings.orientation_tolerance, floor),
        };
        let tip = &chain.tool.translation;
        let Work { turns, columns } = &mut self.work;
        let mut q = request.q;
        let mut iterations = 0;
        let mut initial = Squares {
            position: T::zero(),
            orientation: T::zero(),
        };
        let mut before = T::zero();
        let (status, remaining) = loop {
            let rest = approach(&chain.joints, &q, tip, &target, turns, columns)?;
            let error = rest.twist;
            let now = Squares::of(&error);
            let first = iterations == 0;
            let merit = now.weighted(constants.weights);
            if first {
                initial = now;
                if !rest.turned(&now) {
                    return None;
                }
            } else {
                // Newton's pace, which NaN does not have either.
                let converging = merit * T::of(16.0) <= before;
                if !converging || u32::from(iterations) >= PLAIN_ITERATIONS {
                    return None;
                }
            }
            before = merit;
            if now.below(&tolerance) {
                break (Status::Converged, now);
            }
            if iterations >= settings.max_iterations {
                break (Status::IterationLimit, now);
            }
            if !budget.fits(iteration_cycles) {
                break (Status::OutOfBudget, now);
            }
            // What a price asks back of the way so far, none yet at first.
            let priced = if first { T::zero() } else { constants.priced };
            let asked = if priced.is_zero() {
                error
            } else {
                with_undone(&error, columns, &q, &request.q, priced)
            };
            let (y, trace) = multipliers(columns, constants.damping, &asked, first);
            // No price is put on corrections: `inverse_jacobian::singular_effort` is 0. NaN
            // is not clear.
            let clear = !first || trace * (constants.singular + merit) <= T::one();
            if !clear {
                return None;
            }
            let mut way = T::zero();
            let mut curved = Squares {
                position: T::zero(),
                orientation: T::zero(),
            };
            let half = T::of(0.5);
            let joints = q.iter_mut().zip(&request.q).zip(columns.iter());
            for (((q, &start), column), &lever) in joints.zip(&constants.levers) {
                let step = share(column, &y) - (*q - start) * priced;
                *q += step;
                let step = step.abs();
                curved.position += step * lever * (half * step + way);
                curved.orientation += step * way;
                way += step;
            }
            // Perhaps no joint moves by half its resolution.
            if way <= constants.perceptible {
                return None;
            }
            iterations += 1;
            let left = bound(&y, constants.damping, &curved);
            // Below a sixteenth of the error before, in the square: a quarter.
            if left.weighted(constants.weights) * T::of(16.0) <= before {
                if left.below(&tolerance) {
                    break (Status::Converged, left);
                }
                if iterations >= settings.max_iterations {
                    break (Status::IterationLimit, left);
                }
            }
        };
        let bound = settings.correction_bound[0];
        let joints = q.iter().zip(&request.q).zip(&constants.travel);
        for ((&q, &start), &[middle, half]) in joints {
            let away = (q - start).abs();
            // Both ends of the way are inside then; NaN is outside.
            let inside = away < bound && (q - middle).abs() + away < half;
            if !inside {
                return None;
            }
        }
        let places = self.state.correction.iter_mut().zip(&mut self.state.last);
        for ((correction, last), (&q, &start)) in places.zip(q.iter().zip(&request.q)) {
            *correction = q - start;
            *last = q;
        }
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
}

impl<T: Scalar> Rest<T> {
    /// Whether the target's rotation is one, to a thousandth, which is told from the present
    /// pose not too far from it; false for NaN.
    #[inline(always)]
    fn turned(&self, squares: &Squares<T>) -> bool {
        // For rotations the difference is the square of `2 (1 - cos angle)`, over 2.
        let off = self.apart - (squares.orientation + squares.orientation);
        off.abs() <= T::of(1e-6)
    }
}

/// The error if `share` of the way from `start` to `q` were undone.
#[inline(never)]
fn with_undone<T: Scalar>(
    error: &Twist<T>,
    columns: &[Twist<T>],
    q: &[T],
    start: &[T],
    share: T,
) -> Twist<T> {
    let mut undone = *error;
    for ((column, &q), &start) in columns.iter().zip(q).zip(start) {
        undone = undone.plus(&column.scaled((q - start) * share));
    }
    undone
}

/// What a step by `y` leaves at most: what the damping keeps back, and the remainder of
/// Taylor's series.
#[inline(always)]
fn bound<T: Scalar>(y: &Twist<T>, damping: [T; 2], curved: &Squares<T>) -> Squares<T> {
    let [position, orientation] = damping;
    let sum = |v: &Vector3<T>| v.x.abs() + v.y.abs() + v.z.abs();
    let position = position * sum(&y.linear) + curved.position;
    let orientation = orientation * sum(&y.angular) + curved.orientation * T::of(0.5);
    Squares {
        position: position * position,
        orientation: orientation * orientation,
    }
}
