//! Newton's method for a rigid arm clear of singularities and limits, in as few instructions
//! as it takes: the plain case of [`super::descent`], which takes over wherever it is not
//! plain.
//!
//! For the regulator too, at commands clear of the margins in which it asks a price of its own
//! of each joint: what is left is one price for all, which is a damping towards the command
//! that came in. It solves the same problem by the same steps and so ends at the same joints.
//! What it saves is the frames, the effort, the damping of all steps but the first, and the
//! last evaluation: a step `p` of a chain of turns leaves
//!
//! ```text
//! |remaining| <= r s² / 2   position        |remaining| <= s² / 4   orientation
//! s = sum over k of |p_k|,   r: longest way from an axis to the tool point
//! ```
//! of the equations that it solves: the second derivative of the tool point by the turns j
//! and k >= j is not longer than the way from axis k to it, and that of the orientation is
//! half the cross product of the axes. If this is below the tolerances, the step is the
//! answer. Where it is not quite, the second order itself is worked out ([`curvature`]) and, if
//! that is too much, taken away by a further step `t` with the same equations (Chebyshev's
//! method). What is beyond it is at most `r b` and `b`, `b = (s + t)³ / 6 + t (s + t)`.

use nalgebra::{Matrix3, Vector3};

use super::damped::{cross, multipliers, share};
use super::error::PoseError;
use super::rigid::{Rest, approach, square, turn_by, turns_at};
use super::{Compensator, Outcome, Request, Status, direct, lqr};
use crate::budget::{Budget, Clock, PLAIN_ITERATIONS};
use crate::model::Model;
use crate::{JointKind, Method, Pose, Scalar, Settings, Twist};

/// What does not change from request to request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constants<T: Scalar, const N: usize> {
    /// Of the position and the orientation equations, the regulator's price with it.
    damping: [T; 2],
    /// Share of the price in that: zero without a regulator.
    priced: T,
    /// Squares of the weights of position and orientation.
    weights: [T; 2],
    /// Square of the smallest singular value that counts as clear.
    singular: T,
    /// Longest way from an axis to the tool point, m.
    reach: T,
    /// Squares of the tolerances, or of what can be told apart in this number type.
    tolerance: Squares<T>,
    /// Middle and half of where each joint may go, rad.
    travel: [[T; 2]; N],
    /// Of that half, the part at its end in which the regulator's prices differ.
    margin: T,
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
    /// The last step of each joint, rad.
    steps: [T; N],
    /// What is added to it, rad.
    more: [T; N],
}

impl<T: Scalar, const N: usize> Default for Work<T, N> {
    fn default() -> Self {
        Self {
            turns: [[T::zero(); 2]; N],
            columns: [Twist::zero(); N],
            steps: [T::zero(); N],
            more: [T::zero(); N],
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
        let mut reach = chain.tool.translation.norm_squared().root();
        for joint in &chain.joints {
            reach += (joint.tx * joint.tx + joint.ty * joint.ty).root();
        }
        // Coordinates add up to less than twice the way.
        let floor = T::EPSILON * (T::one() + reach + reach);
        let tolerance = |asked: T| {
            let tolerance = if asked > floor { asked } else { floor };
            tolerance * tolerance
        };
        let half = T::of(0.5);
        let (price, margin) = match settings.method {
            Method::Lqr => (settings.effort, T::of(2.0 * lqr::MARGIN)),
            _ => (T::zero(), T::zero()),
        };
        let damping = settings.damping + price;
        Some(Self {
            damping: [damping / (p * p), damping / (o * o)],
            priced: price / damping,
            weights: [p * p, o * o],
            singular: settings.singular_value * settings.singular_value,
            reach,
            tolerance: Squares {
                position: tolerance(settings.position_tolerance),
                orientation: tolerance(settings.orientation_tolerance),
            },
            travel: model.limits.map(|[low, high]| {
                // Rounding of the middle, of the half and of what is compared with them.
                let rounding = (low.abs() + high.abs()) * T::EPSILON * T::of(4.0);
                [(low + high) * half, (high - low) * half - rounding]
            }),
            margin,
            perceptible: model.resolution.iter().fold(T::zero(), |sum, &r| sum + r),
        })
    }

    /// Whether the command `q` is clear of a regulator's margins, if there is one.
    #[inline(always)]
    fn clear_of_margins(&self, q: &[T; N]) -> bool {
        if self.margin.is_zero() {
            return true;
        }
        let inner = T::one() - self.margin;
        let mut clear = true;
        for (&q, &[middle, half]) in q.iter().zip(&self.travel) {
            // NaN is not clear.
            clear &= (q - middle).abs() < half * inner;
        }
        clear
    }

    /// Whether the ways from `start` to `q` are inside the travel.
    #[inline(always)]
    fn inside(&self, q: &[T; N], start: &[T; N]) -> bool {
        let mut inside = true;
        for ((&q, &start), &[middle, half]) in q.iter().zip(start).zip(&self.travel) {
            // Both ends are inside then; NaN is outside.
            inside &= (q - middle).abs() + (q - start).abs() < half;
        }
        inside
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

/// How a plain case ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plain<T> {
    status: Status,
    iterations: u8,
    initial: Squares<T>,
    remaining: PoseError<T>,
}

impl<T: Scalar> Plain<T> {
    /// As it is told, with the command `q`.
    #[inline(always)]
    pub(super) fn outcome<const N: usize>(&self, q: &[T; N], cycles: u32) -> Outcome<T, N> {
        Outcome {
            q: *q,
            status: self.status,
            iterations: self.iterations,
            initial: Some(self.initial.error()),
            remaining: Some(self.remaining),
            clamped: [false; N],
            task_point: None,
            cycles,
        }
    }
}

/// Squares of position and orientation error.
#[derive(Clone, Copy, Debug)]
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
    fn of_error(e: &PoseError<T>) -> Self {
        Self {
            position: e.position * e.position,
            orientation: e.orientation * e.orientation,
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

impl<T: Scalar, const N: usize> Compensator<'_, T, N> {
    /// Answers a request for the pose `desired`: the command is in the state. `None`, and the
    /// state as it was, where this is no plain case.
    #[inline(always)]
    pub(super) fn swift<C: Clock>(
        &mut self,
        request: &Request<T, N>,
        desired: &Pose<T>,
        budget: &Budget<'_, C>,
        iteration_cycles: u32,
    ) -> Option<Plain<T>> {
        let constants = self.constants.as_ref()?;
        let settings = &self.settings;
        let chain = &self.model.calibrated;
        if !constants.clear_of_margins(&request.q) {
            return None;
        }
        let target = without(desired, &chain.base, &chain.tool);
        let tip = &chain.tool.translation;
        let regulated = !constants.priced.is_zero();
        let Work {
            turns,
            columns,
            steps,
            more,
        } = &mut self.work;
        let mut q = request.q;
        let mut iterations = 0;
        let mut initial = Squares {
            position: T::zero(),
            orientation: T::zero(),
        };
        let (mut before, mut travelled) = (T::zero(), T::zero());
        // Of the last step, in sum: none yet.
        let mut way = T::one();
        let (status, remaining) = loop {
            let first = iterations == 0;
            if way <= T::of(0.12) {
                turn_by(steps, turns);
            } else {
                turns_at(&chain.joints, &q, turns);
            }
            let rest = approach(&chain.joints, turns, tip, &target, columns, first)?;
            let error = rest.twist;
            let now = Squares::of(&error);
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
            if now.below(&constants.tolerance) {
                break (Status::Converged, now.error());
            }
            if iterations >= settings.max_iterations {
                break (Status::IterationLimit, now.error());
            }
            if !budget.fits(iteration_cycles) {
                break (Status::OutOfBudget, now.error());
            }
            iterations += 1;
            let last = iterations >= settings.max_iterations;
            let mut kept = [T::zero(); 2];
            if first || regulated || !direct::step(columns, &error, steps) {
                let mut asked = error;
                if regulated && !first {
                    // What the price asks back of the way so far, none yet at first.
                    undo(&mut asked, columns, &q, &request.q, constants.priced);
                }
                let (y, trace) = multipliers(columns, constants.damping, &asked, first);
                // No price is put on corrections: `inverse_jacobian::singular_effort` is 0.
                // NaN is not clear.
                let clear = !first || trace * (constants.singular + merit) <= T::one();
                if !clear {
                    return None;
                }
                for (step, column) in steps.iter_mut().zip(columns.iter()) {
                    *step = share(column, &y);
                }
                if regulated && !first {
                    for (step, (&q, &start)) in steps.iter_mut().zip(q.iter().zip(&request.q)) {
                        *step -= (q - start) * constants.priced;
                    }
                }
                if last || !first {
                    let [position, orientation] = constants.damping;
                    let sum = |v: &Vector3<T>| v.x.abs() + v.y.abs() + v.z.abs();
                    kept = [position * sum(&y.linear), orientation * sum(&y.angular)];
                }
            }
            way = T::zero();
            for (q, &step) in q.iter_mut().zip(steps.iter()) {
                *q += step;
                way += step.abs();
            }
            // Perhaps no joint moves by half its resolution.
            if way <= constants.perceptible {
                return None;
            }
            travelled += way;
            // A first step hardly ever is enough, so there is nothing to be bounded.
            if last || !first {
                let quarter = way * way * T::of(0.25);
                let reach = constants.reach + constants.reach;
                // Below a sixteenth of the error before, in the square: a quarter.
                let pace =
                    |left: &Squares<T>| left.weighted(constants.weights) * T::of(16.0) <= before;
                let mut left = bound(kept, [reach * quarter, quarter]);
                let mut squares = Squares::of_error(&left);
                let enough = if last {
                    pace(&squares)
                } else {
                    squares.below(&constants.tolerance)
                };
                if !enough {
                    let second = curvature(columns, steps);
                    let mut mixed = T::zero();
                    let off_squares = Squares::of(&second);
                    let mut off = off_squares.error();
                    // What the second order leaves is taken away as well where it is too much.
                    if !regulated
                        && !off_squares.below(&constants.tolerance)
                        && direct::step(columns, &second.scaled(-T::one()), more)
                    {
                        let mut further = T::zero();
                        for ((q, step), &more) in q.iter_mut().zip(steps.iter_mut()).zip(&*more) {
                            *q += more;
                            *step += more;
                            further += more.abs();
                        }
                        mixed = further * (way + further);
                        way += further;
                        travelled += further;
                        off = PoseError {
                            position: T::zero(),
                            orientation: T::zero(),
                        };
                    }
                    let beyond = way * way * way * T::of(1.0 / 6.0) + mixed;
                    left = bound(
                        kept,
                        [
                            off.position + constants.reach * beyond,
                            off.orientation + beyond,
                        ],
                    );
                    squares = Squares::of_error(&left);
                }
                if pace(&squares) {
                    if squares.below(&constants.tolerance) {
                        break (Status::Converged, left);
                    }
                    if last {
                        break (Status::IterationLimit, left);
                    }
                }
            }
        };
        // NaN is not near.
        let near = travelled < settings.correction_bound[0];
        if !near || !constants.inside(&q, &request.q) {
            return None;
        }
        self.state.asked = request.q;
        self.state.found = q;
        self.state.last = q;
        Some(Plain {
            status,
            iterations,
            initial,
            remaining,
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

/// Adds to `error` what it would grow by if `share` of the way from `start` to `q` were undone.
#[inline(never)]
fn undo<T: Scalar>(error: &mut Twist<T>, columns: &[Twist<T>], q: &[T], start: &[T], share: T) {
    for ((column, &q), &start) in columns.iter().zip(q).zip(start) {
        *error = error.plus(&column.scaled((q - start) * share));
    }
}

/// What a step leaves at most: what was `kept` back of the equations, and how far the pose
/// is `off` what they say.
#[inline(always)]
fn bound<T: Scalar>(kept: [T; 2], off: [T; 2]) -> PoseError<T> {
    PoseError {
        position: kept[0] + off[0],
        orientation: kept[1] + off[1],
    }
}

/// The second order of the step `steps`: with axis z_k and motion v_k of the point per unit of
/// joint k,
///
/// ```text
/// sum over k of p_k w_k x v_k   and   1/2 sum over k of p_k w_k x z_k,
/// w_k = p_k z_k / 2 + sum over j < k of p_j z_j
/// ```
#[inline(never)]
fn curvature<T: Scalar>(columns: &[Twist<T>], steps: &[T]) -> Twist<T> {
    let mut turned = Vector3::zeros();
    let (mut position, mut orientation) = (Vector3::zeros(), Vector3::zeros());
    let half = T::of(0.5);
    // Not unrolled, as in `multipliers`.
    let count = core::hint::black_box(columns.len());
    for (column, &p) in columns.iter().zip(steps).take(count) {
        let halfway = column.angular * (p * half);
        turned += halfway;
        position += cross(&turned, &column.linear) * p;
        orientation += cross(&turned, &column.angular) * p;
        turned += halfway;
    }
    Twist::new(position, orientation * half)
}
