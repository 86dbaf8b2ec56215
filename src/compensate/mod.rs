//! Corrected joint commands within a cycle budget.
//!
//! Every compensator takes a [`Request`] and gives an [`Outcome`], whose joints are always
//! safe to send:
//! - never worse than the command that came in (clamped to the limits), by the model's own
//!   prediction of the weighted pose error;
//! - inside the joint limits, within the correction bound, finite;
//! - in time: an iteration starts only if its worst case still fits into the budget;
//! - continuous along a continuous path, through singularities and along limits: how it is
//!   done stands in [`inverse_jacobian`];
//! - the same bits for the same input, state and number type on every core.

pub(crate) mod damped;
pub(crate) mod descent;
mod direct;
pub(crate) mod error;
pub mod inverse_jacobian;
pub mod lqr;
pub mod minimum_move;
pub(crate) mod rigid;
mod solve;
pub mod spherical_wrist;
pub(crate) mod step;
pub(crate) mod swift;
pub mod task_point;
mod taught;
mod wrist_jacobian;

use crate::budget::{Budget, Clock, Cost};
use crate::effects::{Ambient, Conditions};
use crate::model::Model;
use crate::{Method, Pose, PreparedJoint, Scalar, Settings};

use descent::Next;
pub use error::PoseError;
use task_point::Inverse;

/// What to correct.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request<T: Scalar, const N: usize> {
    /// Nominal joint command, rad or m: what the controller's own kinematics came up with.
    pub q: [T; N],
    /// Tool pose to reach in the world. `None`: the pose that `q` nominally means (MRD 5.23
    /// to 5.26).
    pub pose: Option<Pose<T>>,
    /// What is known besides.
    pub conditions: Conditions<T, N>,
}

impl<T: Scalar, const N: usize> Request<T, N> {
    /// The pose that the joint command `q` (rad or m) nominally means.
    pub fn joints(q: [T; N]) -> Self {
        Self {
            q,
            pose: None,
            conditions: Conditions::default(),
        }
    }

    /// `pose` in the world, and the joint command `q` (rad or m) that nominally reaches it.
    pub fn pose(pose: Pose<T>, q: [T; N]) -> Self {
        Self {
            pose: Some(pose),
            ..Self::joints(q)
        }
    }

    /// Reprogramming by endpoint sensing: the arm was sent to `q`, was seen at `measured` and
    /// should have been at `desired`, both in the world. MRD 5.141: the error is the measured
    /// one, wherever `model` would have put the arm, so that a nominal model will do; what is
    /// left after the answer is of the order of the error squared, so measure again.
    pub fn sensed(
        model: &Model<'_, T, N>,
        q: [T; N],
        measured: &Pose<T>,
        desired: &Pose<T>,
        conditions: Conditions<T, N>,
    ) -> Self {
        let error = measured.twist_to(desired);
        let pose = model.predict(&q, &conditions).displaced(&error);
        Self::pose(pose, q).conditions(conditions)
    }

    /// Under these conditions.
    #[must_use]
    pub fn conditions(mut self, conditions: Conditions<T, N>) -> Self {
        self.conditions = conditions;
        self
    }
}

/// Why a compensation ended as it did. The joints are safe to send in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status {
    /// The predicted pose error is below both tolerances.
    Converged,
    /// Nothing more to gain: held by limits, by the correction bound, by a singularity, or the
    /// next step would be below the joints' resolution.
    Settled,
    /// The iterations allowed are used up.
    IterationLimit,
    /// Another iteration does not fit into the budget.
    OutOfBudget,
    /// Refused, the nominal command goes out: NaN or infinity in directions or payload.
    ConditionsNotFinite,
    /// Refused, the nominal command goes out: the requested pose is not finite or its rotation
    /// is not one.
    NotAPose,
    /// Refused, the nominal command goes out: the model gives no finite pose for it under
    /// these conditions.
    PredictionNotFinite,
    /// Refused, the last command goes out again (before the first: zero, moved into the
    /// limits): NaN or infinity in the nominal joints.
    JointsNotFinite,
    /// Refused, the nominal command goes out: it is outside the region that the method was
    /// taught on.
    OutsideRegion,
    /// Refused, the nominal command goes out: the blob has no tables for this method.
    NotTaught,
}

impl Status {
    /// Whether a compensation took place, complete or not.
    pub fn compensated(self) -> bool {
        matches!(
            self,
            Self::Converged | Self::Settled | Self::IterationLimit | Self::OutOfBudget
        )
    }
}

/// What goes out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome<T: Scalar, const N: usize> {
    /// Joint command to send, rad or m.
    pub q: [T; N],
    /// Why it is as it is.
    pub status: Status,
    /// The pose to ask of the nominal inverse kinematics in place of the desired one, in the
    /// world; from the task-point method only.
    pub task_point: Option<Pose<T>>,
    /// Steps that were evaluated.
    pub iterations: u8,
    /// Predicted pose error of the nominal command (clamped to the limits); `None` where it
    /// was not computed.
    pub initial: Option<PoseError<T>>,
    /// Predicted pose error of `q`, or a bound of it where that will do; `None` where it was
    /// not computed.
    pub remaining: Option<PoseError<T>>,
    /// Joints that stand at a limit or at the correction bound.
    pub clamped: [bool; N],
    /// Cycles spent, by the budget's clock.
    pub cycles: u32,
}

/// Without the task point, whose numbers a log has no use for.
#[cfg(feature = "defmt")]
impl<T: Scalar + defmt::Format, const N: usize> defmt::Format for Outcome<T, N> {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(
            f,
            "{}: {} after {=u8} iterations, {=u32} cycles, error {} to {}, clamped {}",
            self.status,
            self.q,
            self.iterations,
            self.cycles,
            self.initial,
            self.remaining,
            self.clamped,
        );
    }
}

/// What a compensator remembers from one cycle to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T: Scalar, const N: usize> {
    /// Last command that was compensated, rad or m,
    asked: [T; N],
    /// and what came of it: the next search starts with the same correction.
    found: [T; N],
    /// Last command sent.
    last: [T; N],
    /// Longest iteration seen, cycles.
    longest: u32,
}

/// A model at work.
#[derive(Clone, Debug)]
pub struct Compensator<'m, T: Scalar, const N: usize> {
    model: &'m Model<'m, T, N>,
    settings: Settings<T>,
    /// For the plain case.
    constants: Option<swift::Constants<T>>,
    work: swift::Work<T, N>,
    /// For all others.
    search: descent::Work<T, N>,
    prepared: [PreparedJoint<'m, T>; N],
    /// What a compensation costs at worst, and in the plain case.
    costs: [Cost; 2],
    state: State<T, N>,
}

impl<'m, T: Scalar, const N: usize> Compensator<'m, T, N> {
    /// With the settings that came with the model.
    #[inline(never)]
    pub fn new(model: &'m Model<'m, T, N>) -> Self {
        let mut compensator = Self {
            model,
            settings: model.settings,
            constants: None,
            work: swift::Work::default(),
            search: descent::Work::default(),
            prepared: core::array::from_fn(|_| PreparedJoint::empty()),
            costs: [Cost::NOTHING; 2],
            state: State {
                asked: [T::zero(); N],
                found: [T::zero(); N],
                last: [T::zero(); N],
                longest: 0,
            },
        };
        compensator.tune();
        compensator.reset();
        compensator
    }

    /// With other settings. Unsound ones (see [`Settings::sound`]) are not taken.
    #[inline(never)]
    #[must_use]
    pub fn with_settings(mut self, settings: Settings<T>) -> Self {
        if settings.sound() {
            self.settings = settings;
            self.tune();
        }
        self
    }

    /// Works the settings in.
    #[inline(never)]
    fn tune(&mut self) {
        let (model, settings) = (self.model, &self.settings);
        let swift::Work { travel, inner, .. } = &mut self.work;
        self.constants = None;
        if model.effects.is_empty() {
            let plan = swift::Plan {
                joints: &model.calibrated.joints,
                tool: &model.calibrated.tool.translation,
                limits: &model.limits,
                resolution: &model.resolution,
                settings,
            };
            self.constants = T::constants(&plan, travel, inner);
        }
        self.costs = T::costs(N, &model.effects, settings.iteration_cycles);
    }

    /// The settings in use.
    pub fn settings(&self) -> &Settings<T> {
        &self.settings
    }

    /// Forgets what was remembered: the next request is answered as the first.
    pub fn reset(&mut self) {
        let zero = [T::zero(); N];
        self.state = State {
            asked: zero,
            found: zero,
            last: self.within_limits(&zero),
            longest: 0,
        };
    }

    /// The corrected command for `request` within `budget`.
    pub fn correct<C: Clock>(
        &mut self,
        request: &Request<T, N>,
        budget: &mut Budget<'_, C>,
    ) -> Outcome<T, N> {
        self.correct_through(request, None, budget)
    }

    /// As [`Compensator::correct`], with the caller's own nominal inverse kinematics for
    /// [`task_point`]. The other methods do not need it.
    pub fn correct_through<C: Clock>(
        &mut self,
        request: &Request<T, N>,
        inverse: Option<Inverse<'_, T, N>>,
        budget: &mut Budget<'_, C>,
    ) -> Outcome<T, N> {
        let [_, plain] = self.costs;
        // The plain case checks the joints and the pose as it goes.
        if matches!(self.settings.method, Method::InverseJacobian | Method::Lqr)
            && ordinary(&request.conditions)
            && budget.fits(plain.start)
        {
            let nominal;
            let desired = match &request.pose {
                Some(desired) => desired,
                None => {
                    nominal = self.model.nominal_pose(&request.q);
                    &nominal
                }
            };
            if let Some(plain) = self.swift(request, desired, budget, plain.iteration) {
                return plain.outcome(&self.state.found, budget.spent());
            }
        }
        self.in_general(request, inverse, budget)
    }

    /// The same of any case.
    #[inline(never)]
    fn in_general<C: Clock>(
        &mut self,
        request: &Request<T, N>,
        inverse: Option<Inverse<'_, T, N>>,
        budget: &Budget<'_, C>,
    ) -> Outcome<T, N> {
        let Conditions { direction, ambient } = &request.conditions;
        let outcome = match T::refusal(&request.q, direction, ambient, request.pose.as_ref()) {
            Some(Status::JointsNotFinite) => {
                self.unchanged(self.state.last, Status::JointsNotFinite, budget)
            }
            Some(status) => self.unchanged(self.within_limits(&request.q), status, budget),
            None => self.descend(request, inverse, budget),
        };
        if outcome.status.compensated() {
            self.state.asked = request.q;
            self.state.found = outcome.q;
        }
        self.state.last = outcome.q;
        outcome
    }

    /// The same of a sound request.
    #[inline(never)]
    fn descend<C: Clock>(
        &mut self,
        request: &Request<T, N>,
        inverse: Option<Inverse<'_, T, N>>,
        budget: &Budget<'_, C>,
    ) -> Outcome<T, N> {
        let [cost, _] = self.costs;
        let iteration = cost.iteration.max(self.state.longest);
        let start = self.within_limits(&request.q);
        if !budget.fits(cost.start) {
            return self.unchanged(start, Status::OutOfBudget, budget);
        }
        let nominal;
        let desired = match &request.pose {
            Some(pose) => pose,
            None => {
                nominal = self.model.nominal_pose(&request.q);
                &nominal
            }
        };
        let (model, settings) = (self.model, &self.settings);
        let prepared = model.prepare(&request.conditions, &mut self.prepared);
        let mut search = self
            .search
            .search(model, settings, desired, inverse.is_some(), iteration);
        let State { asked, found, .. } = &self.state;
        T::set_out(&mut search, &request.q, asked, found);
        let mut begun = None;
        let status = loop {
            let prediction = prepared.predict(search.trial, &mut search.scratch);
            let now = &budget.moment();
            let next = match N < 6 {
                true => T::carry_on_few(&mut search, &prediction, now),
                false => T::carry_on(&mut search, &prediction, now),
            };
            // From one evaluation to the next; the first has the start before it.
            let spent = budget.spent();
            if let Some(begun) = begun {
                let share = if search.through() {
                    task_point::SHARE
                } else {
                    1
                };
                let iteration = spent.wrapping_sub(begun) / share;
                self.state.longest = self.state.longest.max(iteration);
            }
            begun = Some(spent);
            match next {
                Next::Evaluate => {}
                Next::Ask => {
                    let near = search.best.first_chunk();
                    let ask = inverse.zip(near);
                    match ask.and_then(|(inverse, near)| inverse(&search.course.asked, near)) {
                        Some(q) => T::answer(&mut search, &q),
                        None => {
                            search.course.iterations += 1;
                            break Status::Settled;
                        }
                    }
                }
                Next::Done(status) => break status,
            }
        };
        if status == Status::PredictionNotFinite {
            return self.unchanged(start, status, budget);
        }
        let mut q = start;
        let mut clamped = [false; N];
        let [initial, remaining] = T::arrive(&search, &mut q, &mut clamped);
        let task_point = match settings.method {
            Method::TaskPoint if inverse.is_some() => Some(search.course.best_asked),
            Method::TaskPoint => Some(model.nominal_pose(&q)),
            _ => None,
        };
        Outcome {
            q,
            status,
            task_point,
            iterations: search.course.iterations,
            initial: Some(initial),
            remaining: Some(remaining),
            clamped,
            cycles: budget.spent(),
        }
    }

    fn within_limits(&self, q: &[T; N]) -> [T; N] {
        let mut inside = *q;
        T::confine(&mut inside, &self.model.limits);
        inside
    }

    /// The command `q` as it is.
    #[inline(never)]
    fn unchanged<C: Clock>(
        &self,
        q: [T; N],
        status: Status,
        budget: &Budget<'_, C>,
    ) -> Outcome<T, N> {
        let mut clamped = [false; N];
        T::bounded(&q, &self.model.limits, &mut clamped);
        Outcome {
            q,
            status,
            task_point: None,
            iterations: 0,
            initial: None,
            remaining: None,
            clamped,
            cycles: budget.spent(),
        }
    }
}

/// Nothing times a number is nothing, unless the number is not finite.
fn all_finite<T: Scalar>(numbers: &[T]) -> bool {
    numbers
        .iter()
        .fold(T::zero(), |sum, &x| sum + x * T::zero())
        .finite()
}

/// Why a request cannot be compensated, if so. Temperatures and time that are not finite are not
/// known: their effects stay out.
pub(crate) fn refusal<T: Scalar>(
    q: &[T],
    direction: &[T],
    ambient: &Ambient<T>,
    pose: Option<&Pose<T>>,
) -> Option<Status> {
    let com = &ambient.payload_com;
    if !all_finite(q) {
        return Some(Status::JointsNotFinite);
    }
    if !all_finite(direction) || !all_finite(&[ambient.payload, com.x, com.y, com.z]) {
        return Some(Status::ConditionsNotFinite);
    }
    match pose {
        Some(pose) if !error::is_pose(pose) => Some(Status::NotAPose),
        _ => None,
    }
}

/// Whether directions and payload are finite at a glance: also false where they are so large
/// that their sum is not.
#[inline(always)]
fn ordinary<T: Scalar, const N: usize>(conditions: &Conditions<T, N>) -> bool {
    let ambient = &conditions.ambient;
    let com = &ambient.payload_com;
    let sum = ambient.payload + com.x + com.y + com.z;
    let sum = conditions.direction.iter().fold(sum, |sum, &x| sum + x);
    sum.finite()
}
