//! The iteration that the model-based compensators share: damped steps, each tested against
//! the model before it counts.

use nalgebra::Vector3;

use super::Status;
use super::damped::{cross, shared_multipliers};
use super::error::{PoseError, between};
use super::inverse_jacobian::singular_effort;
use super::solve::dot;
use super::step::{Columns, clearance, damped_step, within_box};
use crate::budget::{Budget, Clock, Cost};
use crate::jacobian::joint_column;
use crate::model::{Prediction, Room};
use crate::{BakedJoint, Frame, Pose, Prepared, Scalar, Settings, Twist};

/// One problem: reach `desired` from `start` without leaving `room`.
pub(super) struct Descent<'p, T: Scalar, const N: usize> {
    /// The calibrated arm under the request's conditions.
    pub(super) arm: &'p Prepared<'p, T>,
    pub(super) joints: &'p [BakedJoint<T>; N],
    pub(super) settings: &'p Settings<T>,
    pub(super) desired: &'p Pose<T>,
    /// The command that came in, inside the limits.
    pub(super) start: [T; N],
    /// Where each joint may go.
    pub(super) room: [[T; 2]; N],
    pub(super) resolution: &'p [T; N],
    /// What a correction costs, per square of rad or m, one a joint.
    pub(super) effort: [T; N],
    /// No effort, and joints enough for six equations.
    pub(super) free: bool,
    /// Longest iteration so far, cycles.
    pub(super) longest: u32,
}

/// A command and where the model puts it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point<T: Scalar, const N: usize> {
    pub(super) q: [T; N],
    /// Predicted to desired.
    pub(super) twist: Twist<T>,
    /// Squares of position and orientation error.
    squares: [T; 2],
    /// Square of the weighted error.
    pub(super) square: T,
    /// What is minimised: the same and the effort.
    merit: T,
    /// Tool point of the rigid chain, m.
    tool: Vector3<T>,
}

impl<T: Scalar, const N: usize> Point<T, N> {
    fn nowhere() -> Self {
        let o = T::zero();
        Self {
            q: [o; N],
            twist: Twist::zero(),
            squares: [o; 2],
            square: o,
            merit: o,
            tool: Vector3::zeros(),
        }
    }

    /// Predicted error.
    pub(super) fn error(&self) -> PoseError<T> {
        size(self.squares)
    }
}

/// Room for a search, kept from one request to the next to save filling it with zeros.
#[derive(Clone, Debug)]
pub(super) struct Work<T: Scalar, const N: usize> {
    /// Of the last evaluation.
    pub(super) room: Room<T, N>,
    /// Weighted joint Jacobian.
    columns: Columns<T, N>,
    /// The best, and those that are tried.
    pub(super) points: [Point<T, N>; 3],
}

impl<T: Scalar, const N: usize> Default for Work<T, N> {
    fn default() -> Self {
        Self {
            room: Room::default(),
            columns: [[T::zero(); 6]; N],
            points: [Point::nowhere(); 3],
        }
    }
}

/// What a search comes to.
pub(super) struct Found<'w, T: Scalar, const N: usize> {
    /// Error of the start.
    pub(super) initial: PoseError<T>,
    pub(super) best: &'w Point<T, N>,
    pub(super) status: Status,
    pub(super) iterations: u8,
}

/// Where a step begins.
enum Begin<T> {
    /// With the frames of the last evaluation.
    Frames,
    /// With its Jacobian.
    Columns,
    /// And with the solution `y` of its equations, which is of use without effort.
    Solved([T; 6]),
}

/// Steps that bring less than a quarter of what the linear model promises are shortened, at
/// most this often.
const SHORTENINGS: u8 = 3;

impl<T: Scalar, const N: usize> Descent<'_, T, N> {
    /// From the start, or from the start plus the `remembered` correction where that is
    /// better. `None` where the model gives no finite pose for the start.
    pub(super) fn run<'w, C: Clock>(
        &mut self,
        remembered: &[T; N],
        work: &'w mut Work<T, N>,
        budget: &Budget<'_, C>,
        cost: &Cost,
    ) -> Option<Found<'w, T, N>> {
        let Work {
            room,
            columns,
            points: [best, trial, _],
        } = work;
        best.q = self.start;
        if !self.evaluate(best, room) {
            return None;
        }
        let (initial, squares, square) = (best.error(), best.squares, best.square);
        let found = |best, status, iterations| Found {
            initial,
            best,
            status,
            iterations,
        };
        if self.converged(best) {
            return Some(found(best, Status::Converged, 0));
        }
        if self.settings.max_iterations == 0 {
            return Some(found(best, Status::IterationLimit, 0));
        }
        // From the start's own configuration, wherever the search begins: so that the problem,
        // and with it the answer, does not depend on what is remembered.
        let mut begin = self.add_singular_effort(best, room, columns);
        let (mut best, mut trial) = (best, trial);
        if remembered.iter().any(|d| !d.is_zero()) {
            self.move_to(&self.start, remembered, T::one(), &mut trial.q);
            if self.evaluate(trial, room) && trial.merit < square {
                core::mem::swap(&mut best, &mut trial);
                begin = Begin::Frames;
            }
        }
        let (best, status, iterations) =
            self.iterate(best, trial, begin, room, columns, budget, cost);
        // Never worse: the merit only falls, so this guards against rounding alone.
        if best.square > square {
            best.q = self.start;
            best.squares = squares;
        }
        Some(found(best, status, iterations))
    }

    #[expect(clippy::too_many_arguments, reason = "the places of one search")]
    fn iterate<'w, C: Clock>(
        &mut self,
        mut best: &'w mut Point<T, N>,
        mut trial: &'w mut Point<T, N>,
        mut begin: Begin<T>,
        room: &mut Room<T, N>,
        columns: &mut Columns<T, N>,
        budget: &Budget<'_, C>,
        cost: &Cost,
    ) -> (&'w mut Point<T, N>, Status, u8) {
        let mut iterations = 0;
        loop {
            if self.converged(best) {
                return (best, Status::Converged, iterations);
            }
            if let Some(status) = self.halt(iterations, budget, cost.iteration) {
                return (best, status, iterations);
            }
            let begun = budget.spent();
            if matches!(begin, Begin::Frames) {
                self.set_columns(best, room, columns);
            }
            let mut step = [T::zero(); N];
            let Some(slope) = self.step(best, &begin, columns, &mut step) else {
                return (best, Status::Settled, iterations);
            };
            begin = Begin::Frames;
            let mut scale = T::one();
            for shortening in 0..=SHORTENINGS {
                self.move_to(&best.q, &step, scale, &mut trial.q);
                let finite = self.evaluate(trial, room);
                iterations += 1;
                self.longest = self.longest.max(budget.spent().wrapping_sub(begun));
                let gain = if finite {
                    (best.merit - trial.merit) / (slope * scale)
                } else {
                    -T::one() / T::EPSILON
                };
                if gain >= T::of(0.25) {
                    core::mem::swap(&mut best, &mut trial);
                    break;
                }
                let stop = if shortening == SHORTENINGS {
                    Some(Status::Settled)
                } else {
                    self.halt(iterations, budget, cost.iteration)
                };
                match stop {
                    // No time to shorten it: it still may be better than nothing.
                    Some(status) if gain > T::zero() => return (trial, status, iterations),
                    Some(status) => return (best, status, iterations),
                    // Half as far again as the parabola through value, slope and new value
                    // has its minimum: the full step for a gain of one quarter, and less
                    // without a jump below.
                    None => scale *= T::of(0.75) / (T::one() - gain),
                }
            }
        }
    }

    /// Why not to go on, if so.
    pub(super) fn halt<C: Clock>(
        &self,
        iterations: u8,
        budget: &Budget<'_, C>,
        cost: u32,
    ) -> Option<Status> {
        if iterations >= self.settings.max_iterations {
            Some(Status::IterationLimit)
        } else if !budget.fits(cost) {
            Some(Status::OutOfBudget)
        } else {
            None
        }
    }

    /// The step from `best`, whose Jacobian is in `columns`, and twice what the merit falls
    /// along it at first; `None` where there is nothing to gain.
    #[inline(never)]
    fn step(
        &self,
        best: &Point<T, N>,
        begin: &Begin<T>,
        columns: &Columns<T, N>,
        step: &mut [T; N],
    ) -> Option<T> {
        let error = self.weighted(&best.twist);
        let damping = self.settings.damping;
        let mut half_slope = if self.free {
            let y = match begin {
                Begin::Solved(y) => *y,
                _ => shared_multipliers(columns, &[T::one(); N], damping, &error, false).0,
            };
            T::projected(columns, &y, step);
            // (W J p) · W e, since W J p = W e - λ² y.
            dot(&error, &error) - damping * dot(&y, &error)
        } else {
            let away = self.away(best);
            *step = damped_step(columns, &error, &self.effort, &away, damping);
            self.half_slope(&error, columns, &away, step)
        };
        let (mut inside, mut resolved) = (true, false);
        let joints = step.iter().zip(self.resolution);
        for ((&p, &r), (&q, &[low, high])) in joints.zip(best.q.iter().zip(&self.room)) {
            inside &= p >= low - q && p <= high - q;
            resolved |= p.abs() * T::of(2.0) > r;
        }
        if !inside {
            let away = self.away(best);
            let mut reach = self.room;
            for (reach, &q) in reach.iter_mut().zip(&best.q) {
                *reach = reach.map(|x| x - q);
            }
            within_box(columns, &error, &self.effort, &away, damping, &reach, step);
            half_slope = self.half_slope(&error, columns, &away, step);
            let mut moves = step.iter().zip(self.resolution);
            resolved = moves.any(|(p, &r)| p.abs() * T::of(2.0) > r);
        }
        let slope = half_slope * T::of(2.0);
        // NaN fails both.
        (resolved && slope > best.merit * T::EPSILON).then_some(slope)
    }

    /// From the start.
    fn away(&self, point: &Point<T, N>) -> [T; N] {
        let mut away = point.q;
        for (away, &start) in away.iter_mut().zip(&self.start) {
            *away -= start;
        }
        away
    }

    /// Half of what the merit falls along `step` at first.
    fn half_slope(
        &self,
        error: &[T; 6],
        columns: &Columns<T, N>,
        away: &[T; N],
        step: &[T; N],
    ) -> T {
        T::half_slope(error, columns, &self.effort, away, step)
    }

    /// Where the model puts the command in `point`, whose other fields are set; false if
    /// nowhere finite.
    #[inline(never)]
    pub(super) fn evaluate(&self, point: &mut Point<T, N>, room: &mut Room<T, N>) -> bool {
        let prediction = self.arm.predict(&point.q, &mut room.scratch());
        let twist = rest(&prediction, self.desired);
        let weighted = self.weighted(&twist);
        let square = dot(&weighted, &weighted);
        let squares = [twist.linear.norm_squared(), twist.angular.norm_squared()];
        let mut merit = square;
        if !self.free {
            for ((&g, &q), &start) in self.effort.iter().zip(&point.q).zip(&self.start) {
                merit += g * ((q - start) * (q - start));
            }
        }
        point.twist = twist;
        point.squares = squares;
        point.square = square;
        point.merit = merit;
        point.tool = prediction.rigid.translation;
        square.finite() && squares.iter().all(|x| x.finite())
    }

    /// Sets `q` to `from` plus `scale` times `step`, inside the room.
    pub(super) fn move_to(&self, from: &[T; N], step: &[T; N], scale: T, q: &mut [T; N]) {
        T::advance(from, step, scale, &self.room, q);
    }

    pub(super) fn weighted(&self, twist: &Twist<T>) -> [T; 6] {
        let settings = self.settings;
        weighted(
            twist,
            [settings.position_weight, settings.orientation_weight],
        )
    }

    /// The joints' share of a small displacement `twist` of the tool at `point`, whose frames
    /// are in `room`.
    pub(super) fn damped(
        &self,
        point: &Point<T, N>,
        twist: &Twist<T>,
        room: &Room<T, N>,
    ) -> [T; N] {
        let (mut columns, none) = ([[T::zero(); 6]; N], [T::zero(); N]);
        self.set_columns(point, room, &mut columns);
        let twist = self.weighted(twist);
        damped_step(&columns, &twist, &none, &none, self.settings.damping)
    }

    /// Sets the weighted joint Jacobian at `point`, whose frames are in `room`.
    fn set_columns(&self, point: &Point<T, N>, room: &Room<T, N>, columns: &mut Columns<T, N>) {
        let weights = [
            self.settings.position_weight,
            self.settings.orientation_weight,
        ];
        T::weighted_jacobian(self.joints, room.frames(), &point.tool, weights, columns);
    }

    /// Adds to the effort what the nearness of a singular configuration asks for. Sets the
    /// columns, and solves for the first step where there is no effort at all.
    fn add_singular_effort(
        &mut self,
        start: &Point<T, N>,
        room: &Room<T, N>,
        columns: &mut Columns<T, N>,
    ) -> Begin<T> {
        self.set_columns(start, room, columns);
        let weights = [
            self.settings.position_weight,
            self.settings.orientation_weight,
        ];
        let error = self.weighted(&start.twist);
        let (clear, y) = clearance(columns, weights, self.settings.damping, &error);
        let extra = singular_effort(clear, self.settings.singular_value, start.square);
        for effort in &mut self.effort {
            *effort += extra;
        }
        self.free = N >= 6 && self.effort.iter().all(|g| g.is_zero());
        y.map_or(Begin::Columns, Begin::Solved)
    }

    /// Whether both errors are below their tolerances, or below what can be told apart in
    /// this number type.
    pub(super) fn converged(&self, point: &Point<T, N>) -> bool {
        below(self.settings, &point.squares, &point.tool)
    }
}

/// `step · ((W J)ᵀ error - G away)`.
pub(crate) fn half_slope<T: Scalar>(
    error: &[T; 6],
    columns: &[[T; 6]],
    effort: &[T],
    away: &[T],
    step: &[T],
) -> T {
    let mut slope = T::zero();
    let efforts = effort.iter().zip(away);
    for ((&p, column), (&g, &d)) in step.iter().zip(columns).zip(efforts) {
        slope += p * (dot(column, error) - g * d);
    }
    slope
}

/// The twist from what is predicted to `desired`.
///
/// Of a small displacement t it is that from the rigid chain's pose, e, less t: the logarithm of
/// `exp(e) exp(-t)` is `e - t - e x t / 2`, and what is left out is below |t|² / 6 of the result.
#[inline(always)]
fn rest<T: Scalar>(prediction: &Prediction<T>, desired: &Pose<T>) -> Twist<T> {
    let t = &prediction.twist;
    if t.angular.norm_squared() > T::of(1e-4) {
        return between(&prediction.pose(), desired);
    }
    let e = between(&prediction.rigid, desired);
    Twist::new(
        e.linear - t.linear,
        e.angular - t.angular - cross(&e.angular, &t.angular) * T::of(0.5),
    )
}

/// Whether errors with these `squares` are below the tolerances, or below what can be told
/// apart where the tool is.
#[inline(never)]
fn below<T: Scalar>(settings: &Settings<T>, squares: &[T; 2], tool: &Vector3<T>) -> bool {
    let far = tool.x.abs() + tool.y.abs() + tool.z.abs();
    let floor = T::EPSILON * (T::one() + far);
    let below =
        |square: T, tolerance: T| square <= tolerance * tolerance || square <= floor * floor;
    let [position, orientation] = *squares;
    below(position, settings.position_tolerance)
        && below(orientation, settings.orientation_tolerance)
}

/// Of squares of position and orientation error.
#[inline(never)]
fn size<T: Scalar>([position, orientation]: [T; 2]) -> PoseError<T> {
    PoseError {
        position: position.rough_root(),
        orientation: orientation.rough_root(),
    }
}

/// Position rows by the first weight, orientation rows by the second.
#[inline]
pub(super) fn weighted<T: Scalar>(twist: &Twist<T>, [p, o]: [T; 2]) -> [T; 6] {
    let [a, b, c, d, e, f] = twist.rows();
    [a * p, b * p, c * p, d * o, e * o, f * o]
}

/// Columns of the weighted joint Jacobian about `tool`.
pub(crate) fn weighted_jacobian<T: Scalar>(
    joints: &[BakedJoint<T>],
    frames: &[Frame<T>],
    tool: &Vector3<T>,
    weights: [T; 2],
    columns: &mut [[T; 6]],
) {
    for (column, (joint, frame)) in columns.iter_mut().zip(joints.iter().zip(frames)) {
        *column = weighted(&joint_column(joint.kind, frame, tool), weights);
    }
}
