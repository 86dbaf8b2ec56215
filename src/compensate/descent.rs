//! The search that the model-based compensators share: damped steps, each tested against the
//! model before it counts.
//!
//! [`carry_on`] takes what the model says of the last command that was tried, and says what is
//! next. So the search knows neither clock nor number of joints, and is compiled with this crate
//! for size; the evaluation between two calls is compiled with the caller for speed.

use nalgebra::Vector3;

use super::error::{PoseError, below, rest, size, weighted, weighted_jacobian};
use super::inverse_jacobian::singular_effort;
use super::solve::dot;
use super::step::{clearance, damped_step};
use super::{Status, step, task_point, taught};
use crate::budget::Moment;
use crate::model::{Model, Prediction, Room, Scratch};
use crate::taught::Taught;
use crate::vector::square;
use crate::{BakedJoint, Method, Pose, Scalar, Settings, Twist};

/// What the model says of a command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point<T: Scalar> {
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

impl<T: Scalar> Point<T> {
    fn nowhere() -> Self {
        let o = T::zero();
        Self {
            twist: Twist::zero(),
            squares: [o; 2],
            square: o,
            merit: o,
            tool: Vector3::zeros(),
        }
    }
}

/// Room for a search, kept from one request to the next to save filling it with zeros.
#[derive(Clone, Debug)]
pub(super) struct Work<T: Scalar, const N: usize> {
    room: Room<T, N>,
    columns: [[T; 6]; N],
    reach: [[T; 2]; N],
    rows: [[T; N]; 7],
    course: Course<T>,
}

impl<T: Scalar, const N: usize> Default for Work<T, N> {
    fn default() -> Self {
        Self {
            room: Room::default(),
            columns: [[T::zero(); 6]; N],
            reach: [[T::zero(); 2]; N],
            rows: [[T::zero(); N]; 7],
            course: Course {
                initial: Point::nowhere(),
                best: Point::nowhere(),
                trial: Point::nowhere(),
                tried: Tried::Start,
                begin: Begin::Columns,
                free: false,
                slope: T::zero(),
                scale: T::zero(),
                shortenings: 0,
                iterations: 0,
                asked: Pose::identity(),
                best_asked: Pose::identity(),
            },
        }
    }
}

impl<T: Scalar, const N: usize> Work<T, N> {
    /// A search for the pose `desired`. `through`: whether the caller has inverse kinematics of
    /// its own; `cost`: what an iteration may take, cycles.
    pub(super) fn search<'s>(
        &'s mut self,
        model: &'s Model<'_, T, N>,
        settings: &'s Settings<T>,
        desired: &'s Pose<T>,
        through: bool,
        cost: u32,
    ) -> Search<'s, T> {
        let [start, best, trial, effort, correction, step, inverse] = &mut self.rows;
        Search {
            joints: &model.calibrated.joints,
            limits: &model.limits,
            resolution: &model.resolution,
            taught: &model.taught,
            settings,
            desired,
            through,
            cost,
            start,
            reach: &mut self.reach,
            effort,
            correction,
            scratch: self.room.scratch(),
            columns: &mut self.columns,
            step,
            inverse,
            best,
            trial,
            course: &mut self.course,
        }
    }
}

/// One problem: to reach `desired` from `start` without leaving `reach`. Every slice has one
/// place a joint.
#[derive(Debug)]
pub struct Search<'s, T: Scalar> {
    joints: &'s [BakedJoint<T>],
    limits: &'s [[T; 2]],
    resolution: &'s [T],
    pub(super) taught: &'s Taught<'s, T>,
    pub(super) settings: &'s Settings<T>,
    pub(super) desired: &'s Pose<T>,
    through: bool,
    pub(super) cost: u32,
    /// The command that came in, inside the limits.
    pub(super) start: &'s mut [T],
    /// Where each joint may go.
    pub(super) reach: &'s mut [[T; 2]],
    /// What a correction costs, per square of rad or m.
    pub(super) effort: &'s mut [T],
    /// What came of the last request: the search begins with the same.
    correction: &'s mut [T],
    /// Of the last evaluation.
    pub(super) scratch: Scratch<'s, T>,
    /// Weighted joint Jacobian.
    pub(super) columns: &'s mut [[T; 6]],
    pub(super) step: &'s mut [T],
    /// Room for [`step::within_box`].
    inverse: &'s mut [T],
    /// The best so far, and what is tried.
    pub(super) best: &'s mut [T],
    pub(super) trial: &'s mut [T],
    pub(super) course: &'s mut Course<T>,
}

/// How far a search is.
#[derive(Clone, Debug)]
pub(super) struct Course<T: Scalar> {
    pub(super) initial: Point<T>,
    pub(super) best: Point<T>,
    pub(super) trial: Point<T>,
    pub(super) tried: Tried,
    begin: Begin<T>,
    /// No effort, and joints enough for six equations.
    free: bool,
    /// Twice what the merit falls along the step at first.
    slope: T,
    /// How much of the step is tried, and how often it was shortened.
    scale: T,
    shortenings: u8,
    pub(super) iterations: u8,
    /// What the caller's inverse kinematics are asked for, and what led to the best.
    pub(super) asked: Pose<T>,
    pub(super) best_asked: Pose<T>,
}

/// Where a command came from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Tried {
    /// It came in.
    Start,
    /// With what is remembered.
    Remembered,
    /// A step.
    Step,
    /// The caller's inverse kinematics.
    Answer,
    /// Tables.
    Taught,
    /// A part of what they say.
    Part,
}

/// Where a step begins.
#[derive(Clone, Copy, Debug)]
enum Begin<T> {
    /// With the frames of the last evaluation.
    Frames,
    /// With its Jacobian.
    Columns,
    /// And with the solution `y` of its equations, which is of use without effort.
    Solved([T; 6]),
}

/// What a search wants.
#[derive(Clone, Copy, Debug)]
pub enum Next {
    /// What the model says of the command that is tried.
    Evaluate,
    /// The same, after the caller's inverse kinematics have given that command.
    Ask,
    /// Nothing more.
    Done(Status),
}

/// Steps that bring less than a quarter of what the linear model promises are shortened, at
/// most this often.
const SHORTENINGS: u8 = 3;

/// Sets out from the command `q`. `asked` and `found`: the last one that was compensated, and
/// what came of it.
pub(crate) fn set_out<T: Scalar>(search: &mut Search<'_, T>, q: &[T], asked: &[T], found: &[T]) {
    let settings = search.settings;
    step::copy(search.start, q);
    step::confine(search.start, search.limits);
    step::copy(search.trial, search.start);
    step::copy(search.reach, search.limits);
    step::keep_near(
        search.reach,
        search.joints,
        search.start,
        &settings.correction_bound,
    );
    for effort in search.effort.iter_mut() {
        *effort = T::zero();
    }
    if settings.method == Method::Lqr {
        T::prices(
            settings.effort,
            search.start,
            search.joints,
            search.limits,
            search.effort,
        );
    }
    for (correction, (&found, &asked)) in search.correction.iter_mut().zip(found.iter().zip(asked))
    {
        *correction = found - asked;
    }
    let course = &mut *search.course;
    course.tried = Tried::Start;
    course.free = false;
    course.iterations = 0;
    // Number by number: for all the compiler knows these overlap, and what copies blocks that do
    // would be 800 bytes of a program.
    course.asked = search.desired.cast();
    course.best_asked = course.asked;
}

/// Goes on with what the model predicts for the command that was tried. `FEW`: fewer than six
/// joints.
pub(crate) fn carry_on<T: Scalar, const FEW: bool>(
    search: &mut Search<'_, T>,
    prediction: &Prediction<T>,
    now: &Moment,
) -> Next {
    let finite = search.judge(prediction);
    let better = finite && search.course.trial.square < search.course.best.square;
    match search.course.tried {
        Tried::Start => {
            search.accept();
            search.course.initial = search.course.best;
            if !finite {
                return Next::Done(Status::PredictionNotFinite);
            }
            match search.settings.method {
                _ if search.converged() => Next::Done(Status::Converged),
                Method::Polynomial | Method::Cmac => taught::begin::<T, FEW>(search, now),
                Method::TaskPoint if search.through() => {
                    search.cost = search.cost.saturating_mul(task_point::SHARE);
                    task_point::ask(search, now)
                }
                Method::InverseJacobian | Method::Lqr | Method::TaskPoint => {
                    search.begin::<FEW>(now)
                }
            }
        }
        Tried::Remembered => {
            if finite && search.course.trial.merit < search.course.initial.square {
                search.accept();
                search.course.begin = Begin::Frames;
            }
            search.next_step::<FEW>(now)
        }
        Tried::Step => search.measure::<FEW>(finite, now),
        Tried::Answer => {
            search.course.iterations += 1;
            if !better {
                return Next::Done(Status::Settled);
            }
            search.accept();
            search.course.best_asked = search.course.asked;
            task_point::ask(search, now)
        }
        Tried::Taught | Tried::Part => {
            if finite && matches!(search.course.tried, Tried::Taught) && taught::shorten(search) {
                return Next::Evaluate;
            }
            search.course.iterations = 1;
            if better {
                search.accept();
            }
            Next::Done(match search.converged() {
                true => Status::Converged,
                false => Status::Settled,
            })
        }
    }
}

impl<T: Scalar> Search<'_, T> {
    /// Takes what was tried for the best.
    fn accept(&mut self) {
        self.course.best = self.course.trial;
        core::mem::swap(&mut self.best, &mut self.trial);
    }

    /// From the start, or from the start with the remembered correction where that is better.
    fn begin<const FEW: bool>(&mut self, now: &Moment) -> Next {
        if self.settings.max_iterations == 0 {
            return Next::Done(Status::IterationLimit);
        }
        // From the start's own configuration, wherever the search begins: so that the problem,
        // and with it the answer, does not depend on what is remembered.
        self.add_singular_effort::<FEW>();
        if self.correction.iter().all(|d| d.is_zero()) {
            return self.next_step::<FEW>(now);
        }
        step::advance(
            self.start,
            self.correction,
            T::one(),
            self.reach,
            self.trial,
        );
        self.course.tried = Tried::Remembered;
        Next::Evaluate
    }

    /// A step from the best, if there is one.
    fn next_step<const FEW: bool>(&mut self, now: &Moment) -> Next {
        if self.converged() {
            return Next::Done(Status::Converged);
        }
        if let Some(status) = self.halt(now) {
            return Next::Done(status);
        }
        if matches!(self.course.begin, Begin::Frames) {
            self.set_columns();
        }
        let Some(slope) = self.solve::<FEW>() else {
            return Next::Done(Status::Settled);
        };
        let course = &mut *self.course;
        course.tried = Tried::Step;
        course.begin = Begin::Frames;
        course.slope = slope;
        course.scale = T::one();
        course.shortenings = 0;
        self.try_step()
    }

    fn try_step(&mut self) -> Next {
        step::advance(
            self.best,
            self.step,
            self.course.scale,
            self.reach,
            self.trial,
        );
        Next::Evaluate
    }

    /// Takes the step that was tried, or shortens it.
    fn measure<const FEW: bool>(&mut self, finite: bool, now: &Moment) -> Next {
        let course = &mut *self.course;
        course.iterations += 1;
        let gain = if finite {
            (course.best.merit - course.trial.merit) / (course.slope * course.scale)
        } else {
            -T::one() / T::EPSILON
        };
        if gain >= T::of(0.25) {
            self.accept();
            return self.next_step::<FEW>(now);
        }
        let stop = if course.shortenings == SHORTENINGS {
            Some(Status::Settled)
        } else {
            self.halt(now)
        };
        if let Some(status) = stop {
            // No time to shorten it: it still may be better than nothing.
            if gain > T::zero() {
                self.accept();
            }
            return Next::Done(status);
        }
        // Half as far again as the parabola through value, slope and new value has its minimum:
        // the full step for a gain of one quarter, and less without a jump below.
        self.course.scale *= T::of(0.75) / (T::one() - gain);
        self.course.shortenings += 1;
        self.try_step()
    }

    /// Why not to go on, if so.
    pub(super) fn halt(&self, now: &Moment) -> Option<Status> {
        if self.course.iterations >= self.settings.max_iterations {
            Some(Status::IterationLimit)
        } else if !now.fits(self.cost) {
            Some(Status::OutOfBudget)
        } else {
            None
        }
    }

    /// Sets the step from the best, whose Jacobian is in the columns. Returns twice what the
    /// merit falls along it at first; `None` where there is nothing to gain.
    fn solve<const FEW: bool>(&mut self) -> Option<T> {
        let best = &self.course.best;
        let error = self.weighted(&best.twist);
        let damping = self.settings.damping;
        let mut half_slope = None;
        if self.course.free {
            let y = match self.course.begin {
                Begin::Solved(y) => y,
                _ => {
                    for one in self.step.iter_mut() {
                        *one = T::one();
                    }
                    T::shared_multipliers(self.columns, self.step, damping, &error, false).0
                }
            };
            step::projected(self.columns, &y, self.step);
            // (W J p) · W e, since W J p = W e - λ² y.
            half_slope = Some(dot(&error, &error) - damping * dot(&y, &error));
        } else {
            damped_step::<T, FEW>(
                self.columns,
                &error,
                self.effort,
                [self.best, self.start],
                damping,
                self.step,
            );
        }
        let (inside, mut resolved) = self.moves();
        if !inside {
            step::within_box(
                self.columns,
                &error,
                self.effort,
                [self.best, self.start],
                damping,
                self.reach,
                self.inverse,
                self.step,
            );
            (_, resolved) = self.moves();
            half_slope = None;
        }
        let half_slope = half_slope.unwrap_or_else(|| {
            step::half_slope(
                &error,
                self.columns,
                self.effort,
                [self.best, self.start],
                self.step,
            )
        });
        let slope = half_slope * T::of(2.0);
        // NaN fails both.
        (resolved && slope > self.course.best.merit * T::EPSILON).then_some(slope)
    }

    /// Whether the step stays inside the reach, and whether it moves a joint by half its
    /// resolution.
    fn moves(&self) -> (bool, bool) {
        let (mut inside, mut resolved) = (true, false);
        let joints = self.step.iter().zip(self.resolution);
        for ((&p, &r), (&q, &[low, high])) in joints.zip(self.best.iter().zip(&*self.reach)) {
            inside &= p >= low - q && p <= high - q;
            resolved |= p.abs() * T::of(2.0) > r;
        }
        (inside, resolved)
    }

    /// Takes what the model says of the command that is tried; false if it is not finite.
    fn judge(&mut self, prediction: &Prediction<T>) -> bool {
        let twist = rest(prediction, self.desired);
        let weighted = self.weighted(&twist);
        let whole = dot(&weighted, &weighted);
        let squares = [square(&twist.linear), square(&twist.angular)];
        let mut merit = whole;
        if !self.course.free {
            let ends = self.trial.iter().zip(&*self.start);
            for (&g, (&q, &start)) in self.effort.iter().zip(ends) {
                merit += g * ((q - start) * (q - start));
            }
        }
        self.course.trial = Point {
            twist,
            squares,
            square: whole,
            merit,
            tool: prediction.rigid.translation,
        };
        whole.finite() && squares.iter().all(|x| x.finite())
    }

    fn weights(&self) -> [T; 2] {
        [
            self.settings.position_weight,
            self.settings.orientation_weight,
        ]
    }

    pub(super) fn weighted(&self, twist: &Twist<T>) -> [T; 6] {
        weighted(twist, self.weights())
    }

    /// Sets the weighted joint Jacobian at the best, whose frames are those of the last
    /// evaluation.
    pub(super) fn set_columns(&mut self) {
        weighted_jacobian(
            self.joints,
            self.scratch.frames,
            &self.course.best.tool,
            self.weights(),
            self.columns,
        );
    }

    /// Adds to the effort what the nearness of a singular configuration asks for. Sets the
    /// columns, and solves for the first step where there is no effort at all.
    fn add_singular_effort<const FEW: bool>(&mut self) {
        self.set_columns();
        let start = &self.course.best;
        let error = self.weighted(&start.twist);
        let damping = self.settings.damping;
        let (clear, y) =
            clearance::<T, FEW>(self.columns, self.weights(), damping, &error, self.step);
        let extra = singular_effort(clear, self.settings.singular_value, start.square);
        for effort in self.effort.iter_mut() {
            *effort += extra;
        }
        self.course.free = !FEW && self.effort.iter().all(|g| g.is_zero());
        self.course.begin = y.map_or(Begin::Columns, Begin::Solved);
    }

    /// Whether both errors of the best are below their tolerances, or below what can be told
    /// apart in this number type.
    pub(super) fn converged(&self) -> bool {
        let best = &self.course.best;
        below(self.settings, &best.squares, &best.tool)
    }

    /// Whether it goes through the caller's inverse kinematics.
    pub(super) fn through(&self) -> bool {
        self.through && self.settings.method == Method::TaskPoint
    }
}

/// Sets `q` to the best that was found, and says which joints stand at an end of where they may
/// go. Returns the error at the start, and the one that is left.
pub(crate) fn arrive<T: Scalar>(
    search: &Search<'_, T>,
    q: &mut [T],
    clamped: &mut [bool],
) -> [PoseError<T>; 2] {
    let Course { initial, best, .. } = &*search.course;
    // Never worse: the merit only falls, so this guards against rounding alone.
    let (found, best) = if best.square > initial.square {
        (&search.start, initial)
    } else {
        (&search.best, best)
    };
    step::copy(q, found);
    step::bounded(q, search.reach, clamped);
    [initial, best].map(|point| size(point.squares))
}
