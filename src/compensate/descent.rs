//! The iteration that the model-based compensators share: damped steps, each tested against
//! the model before it counts.

use nalgebra::Vector3;

use super::Status;
use super::error::{PoseError, between};
use super::inverse_jacobian::singular_effort;
use super::step::{Columns, Ready, clearance, confined, damped_step, within_box};
use crate::budget::{Budget, Clock, Cost};
use crate::jacobian::joint_column;
use crate::model::Room;
use crate::{BakedJoint, Frame, Pose, Prepared, Scalar, Settings, Twist};

/// One problem: reach `desired` from `start` without leaving `room`.
pub(super) struct Descent<'p, T: Scalar, const N: usize> {
    /// The calibrated arm under the request's conditions.
    pub(super) arm: &'p Prepared<'p, T>,
    pub(super) joints: &'p [BakedJoint<T>; N],
    pub(super) settings: &'p Settings<T>,
    pub(super) desired: Pose<T>,
    /// The command that came in, inside the limits.
    pub(super) start: [T; N],
    /// Where each joint may go.
    pub(super) room: [[T; 2]; N],
    pub(super) resolution: &'p [T; N],
    /// What a correction costs, per square of rad or m, one a joint.
    pub(super) effort: [T; N],
    /// Longest iteration so far, cycles.
    pub(super) longest: u32,
}

/// A command and where the model puts it.
#[derive(Clone, Copy)]
pub(super) struct Point<T: Scalar, const N: usize> {
    pub(super) q: [T; N],
    pub(super) error: PoseError<T>,
    /// Predicted to desired.
    pub(super) twist: Twist<T>,
    /// Square of the weighted error.
    pub(super) square: T,
    /// Tool point of the rigid chain, m.
    tool: Vector3<T>,
}

/// Steps that bring less than a quarter of what the linear model promises are shortened, at
/// most this often.
const SHORTENINGS: u8 = 3;

impl<T: Scalar, const N: usize> Descent<'_, T, N> {
    /// From the start, or from the start plus the `remembered` correction where that is
    /// better. Returns the start's error, the best command, why it ended and the iterations;
    /// `None` where the model gives no finite pose for the start.
    pub(super) fn run<C: Clock>(
        &mut self,
        remembered: &[T; N],
        budget: &Budget<'_, C>,
        cost: &Cost,
    ) -> Option<(PoseError<T>, Point<T, N>, Status, u8)> {
        let mut room = Room::default();
        let initial = self.evaluate(self.start, &mut room)?;
        if self.converged(&initial) {
            return Some((initial.error, initial, Status::Converged, 0));
        }
        if self.settings.max_iterations == 0 {
            return Some((initial.error, initial, Status::IterationLimit, 0));
        }
        // From the start's own configuration, wherever the search begins: so that the problem,
        // and with it the answer, does not depend on what is remembered.
        let mut ready = self.add_singular_effort(&initial, &room);
        let mut best = initial;
        if remembered.iter().any(|d| !d.is_zero()) {
            let warm = self.evaluate(self.moved(&self.start, remembered, T::one()), &mut room);
            best = match warm.filter(|warm| self.merit(warm) < initial.square) {
                Some(warm) => {
                    ready = None;
                    warm
                }
                // The frames have to be the start's again.
                None => self.evaluate(self.start, &mut room)?,
            };
        }
        let (found, status, iterations) = self.iterate(best, ready, &mut room, budget, cost);
        // Never worse: the merit only falls, so this guards against rounding alone.
        let found = if found.square <= initial.square {
            found
        } else {
            initial
        };
        Some((initial.error, found, status, iterations))
    }

    fn iterate<C: Clock>(
        &mut self,
        mut best: Point<T, N>,
        mut ready: Option<Ready<T, N>>,
        room: &mut Room<T, N>,
        budget: &Budget<'_, C>,
        cost: &Cost,
    ) -> (Point<T, N>, Status, u8) {
        let mut iterations = 0;
        loop {
            if self.converged(&best) {
                return (best, Status::Converged, iterations);
            }
            if let Some(status) = self.halt(iterations, budget, cost.iteration) {
                return (best, status, iterations);
            }
            let begun = budget.spent();
            let Some((step, slope)) = self.step(&best, ready.take(), room) else {
                return (best, Status::Settled, iterations);
            };
            let mut scale = T::one();
            for shortening in 0..=SHORTENINGS {
                let trial = self.evaluate(self.moved(&best.q, &step, scale), room);
                iterations += 1;
                self.longest = self.longest.max(budget.spent().wrapping_sub(begun));
                let gain = match &trial {
                    Some(trial) => (self.merit(&best) - self.merit(trial)) / (slope * scale),
                    None => -T::one() / T::EPSILON,
                };
                let stop = if shortening == SHORTENINGS {
                    Some(Status::Settled)
                } else {
                    self.halt(iterations, budget, cost.iteration)
                };
                let quarter = T::of(0.25);
                match (trial, stop) {
                    (Some(trial), _) if gain >= quarter => {
                        best = trial;
                        break;
                    }
                    // No time to shorten it: it still may be better than nothing.
                    (Some(trial), Some(status)) if gain > T::zero() => {
                        return (trial, status, iterations);
                    }
                    (_, Some(status)) => return (best, status, iterations),
                    // Half as far again as the parabola through value, slope and new value
                    // has its minimum: the full step for a gain of one quarter, and less
                    // without a jump below.
                    (_, None) => scale *= T::of(0.75) / (T::one() - gain),
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

    /// The step from `best`, whose frames are in `room`, and twice what the merit falls along
    /// it at first; `None` where there is nothing to gain.
    #[inline(never)]
    fn step(
        &self,
        best: &Point<T, N>,
        ready: Option<Ready<T, N>>,
        room: &Room<T, N>,
    ) -> Option<([T; N], T)> {
        let columns = match &ready {
            Some(ready) => ready.columns,
            None => self.columns(best, room),
        };
        let error = self.weighted(&best.twist);
        let mut away = [T::zero(); N];
        for ((away, &q), &start) in away.iter_mut().zip(&best.q).zip(&self.start) {
            *away = q - start;
        }
        let damping = self.settings.damping;
        let mut step = match &ready {
            Some(ready) => ready.step(&error),
            None => damped_step(&columns, &error, &self.effort, &away, damping),
        };
        let mut reach = self.room;
        for (reach, &q) in reach.iter_mut().zip(&best.q) {
            *reach = reach.map(|x| x - q);
        }
        let inside = |(p, [low, high]): (&T, &[T; 2])| p >= low && p <= high;
        if !step.iter().zip(&reach).all(inside) {
            within_box(
                &columns,
                &error,
                &self.effort,
                &away,
                damping,
                &reach,
                &mut step,
            );
        }
        let mut slope = T::zero();
        let efforts = self.effort.iter().zip(&away);
        for ((&p, column), (&g, &d)) in step.iter().zip(&columns).zip(efforts) {
            slope += p * (super::solve::dot(column, &error) - g * d);
        }
        slope *= T::of(2.0);
        let moves = step.iter().zip(self.resolution);
        let resolved = moves.into_iter().any(|(p, &r)| p.abs() * T::of(2.0) > r);
        // NaN fails both.
        (resolved && slope > self.merit(best) * T::EPSILON).then_some((step, slope))
    }

    /// Where the model puts `q`; `None` if nowhere finite.
    #[inline(never)]
    pub(super) fn evaluate(&self, q: [T; N], room: &mut Room<T, N>) -> Option<Point<T, N>> {
        let prediction = self.arm.predict(&q, &mut room.scratch());
        let twist = if prediction.twist == Twist::zero() {
            between(&prediction.rigid, &self.desired)
        } else {
            between(&prediction.pose(), &self.desired)
        };
        let weighted = self.weighted(&twist);
        let square = super::solve::dot(&weighted, &weighted);
        let error = PoseError::of(&twist);
        let finite = square.finite() && error.position.finite() && error.orientation.finite();
        finite.then_some(Point {
            q,
            error,
            twist,
            square,
            tool: prediction.rigid.translation,
        })
    }

    /// `from` plus `scale` times `step`, inside the room.
    pub(super) fn moved(&self, from: &[T; N], step: &[T; N], scale: T) -> [T; N] {
        let mut q = *from;
        for ((q, &p), room) in q.iter_mut().zip(step).zip(&self.room) {
            *q = confined(*q + p * scale, room);
        }
        q
    }

    /// What is minimised: square of the weighted error and effort.
    fn merit(&self, point: &Point<T, N>) -> T {
        let mut merit = point.square;
        for ((&g, &q), &start) in self.effort.iter().zip(&point.q).zip(&self.start) {
            merit += g * ((q - start) * (q - start));
        }
        merit
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
        let (columns, none) = (self.columns(point, room), [T::zero(); N]);
        let twist = self.weighted(twist);
        damped_step(&columns, &twist, &none, &none, self.settings.damping)
    }

    /// Weighted joint Jacobian at `point`, whose frames are in `room`.
    fn columns(&self, point: &Point<T, N>, room: &Room<T, N>) -> Columns<T, N> {
        let mut columns = [[T::zero(); 6]; N];
        let weights = [
            self.settings.position_weight,
            self.settings.orientation_weight,
        ];
        weighted_jacobian(
            self.joints,
            room.frames(),
            &point.tool,
            weights,
            &mut columns,
        );
        columns
    }

    /// Adds to the effort what the nearness of a singular configuration asks for. Returns
    /// what can be used again where there is no effort at all.
    fn add_singular_effort(
        &mut self,
        start: &Point<T, N>,
        room: &Room<T, N>,
    ) -> Option<Ready<T, N>> {
        let columns = self.columns(start, room);
        let weights = [
            self.settings.position_weight,
            self.settings.orientation_weight,
        ];
        let (clear, factor) = clearance(&columns, weights, self.settings.damping);
        let extra = singular_effort(clear, self.settings.singular_value, start.square);
        for effort in &mut self.effort {
            *effort += extra;
        }
        let free = self.effort.iter().all(|g| g.is_zero());
        match factor {
            Some(factor) if free => Some(Ready { columns, factor }),
            _ => None,
        }
    }

    /// Whether both errors are below their tolerances, or below what can be told apart in
    /// this number type.
    pub(super) fn converged(&self, point: &Point<T, N>) -> bool {
        let settings = self.settings;
        let tool = &point.tool;
        let far = tool.x.abs() + tool.y.abs() + tool.z.abs();
        let floor = T::EPSILON * (T::one() + far);
        let below = |x: T, tolerance: T| x <= tolerance || x <= floor;
        below(point.error.position, settings.position_tolerance)
            && below(point.error.orientation, settings.orientation_tolerance)
    }
}

/// Position rows by the first weight, orientation rows by the second.
#[inline]
fn weighted<T: Scalar>(twist: &Twist<T>, [p, o]: [T; 2]) -> [T; 6] {
    let [a, b, c, d, e, f] = twist.rows();
    [a * p, b * p, c * p, d * o, e * o, f * o]
}

/// Columns of the weighted joint Jacobian about `tool`.
#[inline(never)]
fn weighted_jacobian<T: Scalar>(
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
