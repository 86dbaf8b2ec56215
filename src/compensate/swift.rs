//! Newton's method for a rigid arm clear of singularities and limits, in as few instructions
//! as it takes: the plain case of [`super::descent`], which takes over wherever it is not
//! plain.
//!
//! For the regulator too, at commands clear of the margins in which it asks a price of its own
//! of each joint: what is left is one price for all, which is a damping towards the command
//! that came in. One that is so small that it could change no step by more than [`UNFELT`] of
//! it is left out. It solves the same problem by the same steps and so ends at the same joints.
//! What it saves is the frames, the effort, the damping, and the last evaluation: a step `p` of
//! a chain of turns leaves
//!
//! ```text
//! |remaining| <= r s² / 2   position        |remaining| <= s² / 4   orientation
//! s = sum over k of |p_k|,   r: longest way from an axis to the tool point
//! ```
//! of the equations that it solves: what turns about the axes j < k one after the other are off
//! the turn by their sum is half the Lie bracket of the two, `z_j x v_k - z_k x v_j` and
//! `z_j x z_k`, with axis z and motion v of the tool point per unit of the joint; and the error
//! is that of a screw ([`Rest`]). If this is below the tolerances, the step is the answer. Where
//! it is not quite, the second order itself is worked out ([`second_order`]) and, if that is too
//! much, taken away by a further step `t` with the same equations (Chebyshev's method). What is
//! beyond it is at most `r b` and `b`, `b = (s + t)³ / 6 + t (s + t)`.
//!
//! Damping is there for where the arm comes near a singularity. Steps go without it, in closed
//! form where the calibrated arm still has a spherical wrist ([`wrist_jacobian`]), by blocks of
//! three elsewhere ([`direct`]); the first, which decides whether the case is plain, where a bound of the inverse
//! Jacobian says that it would change next to nothing: a share of at most `λ² |J⁻¹|²`, which is
//! below `λ² / singular_value²`.

pub(crate) mod eased;
mod second_order;
mod squares;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Vector3};

use self::second_order::second_order;
use self::squares::{Squares, Tangent};
use super::error::{PoseError, weighted};
use super::rigid::{Rest, approach, turn_by, turns_at};
use super::solve::dot;
use super::{Compensator, Outcome, Request, Status, direct, lqr, spherical_wrist, wrist_jacobian};
use crate::budget::{Budget, Clock, PLAIN_ITERATIONS};
use crate::vector::{along, square};
use crate::{BakedJoint, JointKind, Method, Pose, Scalar, Settings, Twist};

/// Share of a step up to which a regulator's price may change it without being asked. The cost
/// is above its minimum by as small a share of what the step's effort costs.
const UNFELT: f64 = 1.0 / 4096.0;

/// What does not change from request to request.
#[derive(Clone, Copy, Debug)]
pub struct Constants<T: Scalar> {
    /// Of the position and the orientation equations, the regulator's price with it.
    damping: [T; 2],
    /// Share of the price in that: zero without a regulator.
    priced: T,
    /// Squares of the weights of position and orientation.
    weights: [T; 2],
    /// Square of the smallest singular value that counts as clear.
    singular: T,
    /// Longest way from an axis to the tool point, m,
    reach: T,
    /// and twice that.
    twice_reach: T,
    /// Whether [`wrist_jacobian`] solves the undamped equations, not [`direct`].
    spherical: bool,
    wrist: direct::Wrist<T>,
    /// Times a sixteenth of the weighted square of an error: at least half the product of its
    /// parts, which its pose about a point halfway is off that of the tool point.
    screw: T,
    /// Squares of the tolerances, or of what can be told apart in this number type.
    tolerance: Squares<T>,
    tangent: Tangent<T>,
    /// How wide the regulator's margins are at least, rad; zero without one.
    margin: T,
    regulator: bool,
    /// Ways that add up to more move at least one joint by half its resolution, rad.
    perceptible: T,
}

/// Room for one iteration, kept from one request to the next to save filling it with zeros.
#[derive(Clone, Copy, Debug)]
pub(super) struct Work<T: Scalar, const N: usize> {
    /// Where the search is.
    q: [T; N],
    /// Sine and cosine of each joint.
    turns: [[T; 2]; N],
    /// The joint Jacobian.
    columns: [Twist<T>; N],
    /// The last step of each joint, rad.
    steps: [T; N],
    /// What is added to it, rad.
    more: [T; N],
    /// The weighted Jacobian.
    rows: [[T; 6]; N],
    /// Middle and half of where each joint may go, rad,
    pub(super) travel: [[T; 2]; N],
    /// and the part of that half in which the regulator's prices are the same.
    pub(super) inner: [T; N],
}

impl<T: Scalar, const N: usize> Default for Work<T, N> {
    fn default() -> Self {
        Self {
            q: [T::zero(); N],
            turns: [[T::zero(); 2]; N],
            columns: [Twist::zero(); N],
            steps: [T::zero(); N],
            more: [T::zero(); N],
            rows: [[T::zero(); 6]; N],
            travel: [[T::zero(); 2]; N],
            inner: [T::zero(); N],
        }
    }
}

/// What a plain case is made of.
#[derive(Debug)]
pub struct Plan<'m, T: Scalar> {
    pub(super) joints: &'m [BakedJoint<T>],
    pub(super) tool: &'m Vector3<T>,
    pub(super) limits: &'m [[T; 2]],
    pub(super) resolution: &'m [T],
    pub(super) settings: &'m Settings<T>,
}

/// Sets the constants, `travel` and `inner`. `None` where the model and the settings make no
/// plain case.
pub(crate) fn constants<T: Scalar>(
    plan: &Plan<'_, T>,
    travel: &mut [[T; 2]],
    inner: &mut [T],
) -> Option<Constants<T>> {
    let settings = plan.settings;
    let [p, o] = [settings.position_weight, settings.orientation_weight];
    let turns = plan.joints.iter().all(|j| j.kind == JointKind::Revolute);
    let least = T::of(1e-3);
    if plan.joints.len() < 6 || !turns || p < least || o < least {
        return None;
    }
    let tool = square(plan.tool).root();
    let mut reach = tool;
    // Ways from the last axes to the next: from the last, 0, from the one before, ...
    let mut ways = [T::zero(); 3];
    for joint in plan.joints {
        let way = (joint.tx * joint.tx + joint.ty * joint.ty).root();
        reach += way;
        ways = [way, ways[0], ways[1]];
    }
    let [_, before, across] = ways;
    // Coordinates add up to less than twice the way.
    let floor = T::EPSILON * (T::one() + reach + reach);
    let tolerance = |asked: T| if asked > floor { asked } else { floor };
    let tolerance = PoseError {
        position: tolerance(settings.position_tolerance),
        orientation: tolerance(settings.orientation_tolerance),
    };
    let regulator = settings.method == Method::Lqr;
    let share = T::of(2.0 * lqr::MARGIN);
    let mut margin = if regulator { T::one() } else { T::zero() };
    for ((travel, inner), &[low, high]) in travel.iter_mut().zip(inner).zip(plan.limits) {
        // Rounding of the middle, of the half and of what is compared with them.
        let rounding = (low.abs() + high.abs()) * T::EPSILON * T::of(4.0);
        let half = (high - low) * T::of(0.5) - rounding;
        *travel = [(low + high) * T::of(0.5), half];
        *inner = half * (T::one() - share);
        margin = margin.min(half * share);
    }
    let singular = settings.singular_value * settings.singular_value;
    // Clear of singularities `|(W J)⁻¹|²` is at most one over this.
    let clear = singular * if p < o { p * p } else { o * o };
    let mut price = T::zero();
    if regulator && settings.effort > clear * T::of(UNFELT) {
        price = settings.effort;
    }
    let damping = settings.damping + price;
    Some(Constants {
        damping: [damping / (p * p), damping / (o * o)],
        priced: price / damping,
        weights: [p * p, o * o],
        singular,
        reach,
        twice_reach: reach + reach,
        // What that is off by moves a point by less than an evaluation is rounded by.
        spherical: spherical_wrist::fits(plan.joints, T::EPSILON * T::of(16.0)),
        wrist: direct::Wrist::of(tool + before, across, before),
        screw: T::of(4.0) / (p * o),
        tolerance: Squares::of_error(&tolerance),
        tangent: Tangent::at(&tolerance),
        margin,
        regulator,
        perceptible: plan.resolution.iter().fold(T::zero(), |sum, &r| sum + r),
    })
}

/// Whether the command `q` is clear of a regulator's margins.
#[inline(never)]
fn clear_of_margins<T: Scalar>(q: &[T], travel: &[[T; 2]], inner: &[T]) -> bool {
    for (&q, (&[middle, _], &inner)) in q.iter().zip(travel.iter().zip(inner)) {
        // NaN is not clear.
        let clear = (q - middle).abs() < inner;
        if !clear {
            return false;
        }
    }
    true
}

/// Whether `start` and all that is as near to it as `way` are inside the travel.
#[inline(always)]
fn inside<T: Scalar>(start: &[T], travel: &[[T; 2]], way: T) -> bool {
    for (&start, &[middle, half]) in start.iter().zip(travel) {
        // NaN is outside.
        let inside = (start - middle).abs() < half - way;
        if !inside {
            return false;
        }
    }
    true
}

impl<T: Scalar> Constants<T> {
    /// The undamped step of six joints, with a bound of `|J⁻¹|²` at the `first`.
    /// `way`: from the last joint's origin to the columns' point, m; `off`: square of the way
    /// from the tool point to it.
    #[inline(always)]
    fn undamped<const N: usize>(
        &self,
        columns: &[Twist<T>; N],
        way: &Vector3<T>,
        error: &Twist<T>,
        steps: &mut [T; N],
        first: bool,
        off: T,
    ) -> Option<T> {
        let columns = columns.as_slice().try_into().ok()?;
        let steps = steps.as_mut_slice().try_into().ok()?;
        let wrist = first.then_some(&self.wrist);
        match self.spherical {
            true => wrist_jacobian::step(columns, way, error, steps, wrist, off),
            false => direct::step(columns, error, steps, wrist, off),
        }
    }

    /// Adds to `off` what is beyond the second order of a step of the length `way`.
    #[inline(always)]
    fn beyond(&self, off: &PoseError<T>, way: T) -> PoseError<T> {
        let third = way * way * way * T::of(1.0 / 6.0);
        PoseError {
            position: off.position + self.reach * third,
            orientation: off.orientation + third,
        }
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
pub struct Plain<T> {
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
        let target = without(desired, &chain.base, &chain.tool);
        let Work { travel, inner, .. } = &self.work;
        if constants.regulator && !clear_of_margins(&request.q, travel, inner) {
            return self.eased(request, &target, budget.fits(iteration_cycles));
        }
        let tip = &chain.tool.translation;
        let regulated = !constants.priced.is_zero();
        let Work {
            q,
            turns,
            columns,
            steps,
            more,
            rows,
            travel,
            ..
        } = &mut self.work;
        *q = request.q;
        let mut iterations = 0;
        let mut initial = Squares {
            position: T::zero(),
            orientation: T::zero(),
        };
        let (mut before, mut travelled) = (T::zero(), T::zero());
        turns_at(&chain.joints, q, turns);
        let (status, remaining) = loop {
            let first = iterations == 0;
            let rest = approach(&chain.joints, turns, tip, &target, columns, first);
            let error = &rest.twist;
            let [position, orientation] = rest.squares;
            let now = Squares {
                position,
                orientation,
            };
            let merit = now.weighted(constants.weights);
            if first {
                initial = now;
                if !rest.turned(&now) {
                    return None;
                }
            } else {
                // Newton's pace, which NaN does not have either.
                let converging = merit <= before;
                if !converging || u32::from(iterations) >= PLAIN_ITERATIONS {
                    return None;
                }
            }
            // A quarter, in the square.
            before = merit * T::of(1.0 / 16.0);
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
            let trace = match regulated {
                false => constants.undamped(columns, &rest.way, error, steps, first, position),
                true => None,
            };
            // Clear of singularities, where damping would change next to nothing.
            let undamped = trace
                .is_some_and(|trace| !first || trace * (constants.singular + merit) <= T::one());
            if !undamped {
                let ends: [&[T]; 2] = [q, &request.q];
                let (trace, left) = T::damped_step(
                    constants, settings, error, columns, rows, more, ends, first, steps,
                );
                // No price is put on corrections: `inverse_jacobian::singular_effort` is 0.
                // NaN is not clear.
                let clear = !first || trace * (constants.singular + merit) <= T::one();
                if !clear {
                    return None;
                }
                if last || !first {
                    kept = left;
                }
            }
            let mut way = T::zero();
            for (q, &step) in q.iter_mut().zip(steps.iter()) {
                *q += step;
                way += step.abs();
            }
            // Perhaps no joint moves by half its resolution.
            if way <= constants.perceptible {
                return None;
            }
            // A first step hardly ever is enough, so there is nothing to be bounded.
            if first && !last {
                travelled += way;
            } else {
                let quarter = way * way * T::of(0.25);
                let pace = |left: &Squares<T>| left.weighted(constants.weights) <= before;
                let mut left = bound(kept, [constants.twice_reach * quarter, quarter]);
                let mut squares = Squares::of_error(&left);
                let mut reached = squares.below(&constants.tolerance);
                let enough = if last { pace(&squares) } else { reached };
                if !enough {
                    left = second_order(constants, columns, &rest.way, steps, q, more, &mut way);
                    let screw = before * constants.screw;
                    left = bound(kept, [left.position + screw, left.orientation]);
                    squares = Squares::of_error(&left);
                    reached = squares.below(&constants.tolerance);
                }
                travelled += way;
                if pace(&squares) {
                    if reached {
                        break (Status::Converged, left);
                    }
                    if last {
                        break (Status::IterationLimit, left);
                    }
                }
            }
            if way <= T::of(0.12) {
                turn_by(steps, turns);
            } else {
                T::turn_to(&chain.joints, q, turns);
            }
        };
        // NaN is not near.
        let near = travelled < settings.correction_bound[0];
        // From where the margins are clear no joint comes to its end by less than they are wide.
        let short = constants.regulator && travelled < constants.margin;
        if !near || !(short || inside(&request.q, travel, travelled)) {
            return None;
        }
        self.state.asked = request.q;
        self.state.found = *q;
        self.state.last = *q;
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

/// Sets the damped step to `error` from `q`, which was `start` before the `first`. Returns at the
/// first the trace of `(J Jᵀ + D)⁻¹`, the reciprocal of [`super::step::clearance`], and what the
/// step leaves of the position and the orientation equations. `rows` and `shares`: one place a
/// joint.
#[expect(clippy::too_many_arguments, reason = "the places of one step")]
pub(crate) fn damped_step<T: Scalar>(
    constants: &Constants<T>,
    settings: &Settings<T>,
    error: &Twist<T>,
    columns: &[Twist<T>],
    rows: &mut [[T; 6]],
    shares: &mut [T],
    [q, start]: [&[T]; 2],
    first: bool,
    steps: &mut [T],
) -> (T, [T; 2]) {
    let mut asked = *error;
    // What the price asks back of the way so far, none yet at first.
    for (back, (&q, &start)) in steps.iter_mut().zip(q.iter().zip(start)) {
        *back = (q - start) * constants.priced;
    }
    let weights @ [p, o] = [settings.position_weight, settings.orientation_weight];
    for (((row, share), column), &back) in
        rows.iter_mut().zip(&mut *shares).zip(columns).zip(&*steps)
    {
        asked.linear = along(&asked.linear, &column.linear, back);
        asked.angular = along(&asked.angular, &column.angular, back);
        *row = weighted(column, weights);
        *share = T::one();
    }
    let [damping, _] = constants.damping;
    let mu = damping * (p * p);
    let asked = weighted(&asked, weights);
    let (y, [linear, angular]) = T::shared_multipliers(rows, shares, mu, &asked, first);
    for (step, row) in steps.iter_mut().zip(&*rows) {
        *step = dot(row, &y) - *step;
    }
    // It leaves `λ² y` of the weighted equations.
    let [a, b, c, d, e, f] = y.map(|y| y.abs() * mu);
    let left = [(a + b + c) / p, (d + e + f) / o];
    (linear * (p * p) + angular * (o * o), left)
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
