//! What goes in and comes out, as C sees it.
#![expect(non_camel_case_types, reason = "the names that C sees")]

use core::ffi::c_void;
use core::ptr;

use nalgebra::{Matrix3, Vector3};
use truepose::Pose;
use truepose::compensate::{Outcome, PoseError, Request, Status};
use truepose::effects::{Ambient, Conditions};

use crate::{JOINTS, TRUEPOSE_MAX_JOINTS, TRUEPOSE_MAX_SENSORS};

/// A pose in the world.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct truepose_pose {
    /// Rotation by rows: columns are the tool's axes.
    pub rotation: [[f32; 3]; 3],
    /// m.
    pub translation: [f32; 3],
}

/// What is known besides the joints.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct truepose_conditions {
    /// Sign of the last move of each joint: -1, 0 (not known) or 1.
    pub direction: [f32; TRUEPOSE_MAX_JOINTS],
    /// kg beyond the flange, the tool's own mass excluded.
    pub payload: f32,
    /// Its centre of mass in the tool frame, m.
    pub payload_com: [f32; 3],
    /// degC, one a sensor; NaN where it is not known, which switches its effects off.
    pub temperature: [f32; TRUEPOSE_MAX_SENSORS],
    /// s since the start of the measurements; NaN where it is not known, likewise.
    pub time: f32,
}

/// What to correct. Start from `truepose_request_default`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct truepose_request {
    /// Nominal joint command, rad or m, in the first `truepose_joints()` places.
    pub q: [f32; TRUEPOSE_MAX_JOINTS],
    /// Whether `pose` is to be reached. If not: the pose that `q` nominally means.
    pub has_pose: bool,
    /// Tool pose to reach in the world.
    pub pose: truepose_pose,
    /// What is known besides.
    pub conditions: truepose_conditions,
}

/// How long a correction may take.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct truepose_budget {
    /// Reads a counter that counts up and wraps at 32 bits, such as DWT_CYCCNT. Null: a clock
    /// that stands still.
    pub now: Option<extern "C" fn(context: *mut c_void) -> u32>,
    /// Handed to `now`; may be null.
    pub context: *mut c_void,
    /// Counts that may pass.
    pub cycles: u32,
}

/// Why a correction ended as it did. The joints are safe to send in every case.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum truepose_status {
    /// The predicted pose error is below both tolerances.
    TRUEPOSE_CONVERGED = 0,
    /// Nothing more to gain: held by limits, by the correction bound, by a singularity, or the
    /// next step would be below the joints' resolution.
    TRUEPOSE_SETTLED = 1,
    /// The iterations allowed are used up.
    TRUEPOSE_ITERATION_LIMIT = 2,
    /// Another iteration does not fit into the budget.
    TRUEPOSE_OUT_OF_BUDGET = 3,
    /// Refused, the nominal command goes out: NaN or infinity in directions or payload.
    TRUEPOSE_CONDITIONS_NOT_FINITE = 4,
    /// Refused, the nominal command goes out: the pose is not finite or its rotation not one.
    TRUEPOSE_NOT_A_POSE = 5,
    /// Refused, the nominal command goes out: the model gives no finite pose for it.
    TRUEPOSE_PREDICTION_NOT_FINITE = 6,
    /// Refused, the last command goes out again: NaN or infinity in the nominal joints.
    TRUEPOSE_JOINTS_NOT_FINITE = 7,
    /// Refused, the nominal command goes out: it is outside the region that the method was
    /// taught on.
    TRUEPOSE_OUTSIDE_REGION = 8,
    /// Refused, the nominal command goes out: the blob has no tables for this method.
    TRUEPOSE_NOT_TAUGHT = 9,
}

/// What goes out.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct truepose_outcome {
    /// Joint command to send, rad or m, in the first `truepose_joints()` places; the rest zero.
    pub q: [f32; TRUEPOSE_MAX_JOINTS],
    /// Why it is as it is.
    pub status: truepose_status,
    /// Steps that were evaluated.
    pub iterations: u8,
    /// Whether a task point came out: from the task-point method only.
    pub has_task_point: bool,
    /// The pose to ask of the nominal inverse kinematics in place of the desired one.
    pub task_point: truepose_pose,
    /// Predicted error of the nominal command: m, rad. NaN where it was not computed.
    pub initial: [f32; 2],
    /// Predicted error of `q`: m, rad. NaN where it was not computed.
    pub remaining: [f32; 2],
    /// Joints that stand at a limit or at the correction bound.
    pub clamped: [bool; TRUEPOSE_MAX_JOINTS],
    /// Counts spent, by the budget's clock.
    pub cycles: u32,
}

impl Default for truepose_budget {
    fn default() -> Self {
        Self {
            now: None,
            context: ptr::null_mut(),
            cycles: u32::MAX,
        }
    }
}

/// The values in use of an array that has room for more.
fn first<V: Copy + Default>(all: &[V; TRUEPOSE_MAX_JOINTS]) -> [V; JOINTS] {
    let mut used = [V::default(); JOINTS];
    for (used, value) in used.iter_mut().zip(all) {
        *used = *value;
    }
    used
}

/// The other way.
fn padded<V: Copy + Default>(used: &[V; JOINTS]) -> [V; TRUEPOSE_MAX_JOINTS] {
    let mut all = [V::default(); TRUEPOSE_MAX_JOINTS];
    for (all, value) in all.iter_mut().zip(used) {
        *all = *value;
    }
    all
}

impl From<&Pose<f32>> for truepose_pose {
    fn from(pose: &Pose<f32>) -> Self {
        Self {
            // By columns, turned over.
            rotation: pose.rotation.transpose().into(),
            translation: pose.translation.into(),
        }
    }
}

impl truepose_pose {
    fn read(&self) -> Pose<f32> {
        Pose::new(
            Matrix3::from(self.rotation).transpose(),
            Vector3::from(self.translation),
        )
    }
}

impl truepose_conditions {
    fn unknown() -> Self {
        let ambient = Ambient::<f32>::default();
        Self {
            direction: [0.0; TRUEPOSE_MAX_JOINTS],
            payload: ambient.payload,
            payload_com: ambient.payload_com.into(),
            temperature: ambient.temperature,
            time: ambient.time,
        }
    }

    pub(crate) fn read(&self) -> Conditions<f32, JOINTS> {
        Conditions {
            direction: first(&self.direction),
            ambient: Ambient {
                payload: self.payload,
                payload_com: Vector3::from(self.payload_com),
                temperature: self.temperature,
                time: self.time,
            },
        }
    }
}

impl truepose_request {
    pub(crate) fn unknown() -> Self {
        Self {
            q: [0.0; TRUEPOSE_MAX_JOINTS],
            has_pose: false,
            pose: truepose_pose::default(),
            conditions: truepose_conditions::unknown(),
        }
    }

    pub(crate) fn read(&self) -> Request<f32, JOINTS> {
        Request {
            q: first(&self.q),
            pose: self.has_pose.then(|| self.pose.read()),
            conditions: self.conditions.read(),
        }
    }
}

impl From<Status> for truepose_status {
    fn from(status: Status) -> Self {
        match status {
            Status::Converged => Self::TRUEPOSE_CONVERGED,
            Status::Settled => Self::TRUEPOSE_SETTLED,
            Status::IterationLimit => Self::TRUEPOSE_ITERATION_LIMIT,
            Status::OutOfBudget => Self::TRUEPOSE_OUT_OF_BUDGET,
            Status::ConditionsNotFinite => Self::TRUEPOSE_CONDITIONS_NOT_FINITE,
            Status::NotAPose => Self::TRUEPOSE_NOT_A_POSE,
            Status::PredictionNotFinite => Self::TRUEPOSE_PREDICTION_NOT_FINITE,
            Status::JointsNotFinite => Self::TRUEPOSE_JOINTS_NOT_FINITE,
            Status::OutsideRegion => Self::TRUEPOSE_OUTSIDE_REGION,
            Status::NotTaught => Self::TRUEPOSE_NOT_TAUGHT,
        }
    }
}

/// m and rad; NaN if there is none.
fn both(error: Option<PoseError<f32>>) -> [f32; 2] {
    error.map_or([f32::NAN; 2], |error| [error.position, error.orientation])
}

impl From<&Outcome<f32, JOINTS>> for truepose_outcome {
    fn from(outcome: &Outcome<f32, JOINTS>) -> Self {
        Self {
            q: padded(&outcome.q),
            status: outcome.status.into(),
            iterations: outcome.iterations,
            has_task_point: outcome.task_point.is_some(),
            task_point: outcome
                .task_point
                .as_ref()
                .map_or_else(truepose_pose::default, truepose_pose::from),
            initial: both(outcome.initial),
            remaining: both(outcome.remaining),
            clamped: padded(&outcome.clamped),
            cycles: outcome.cycles,
        }
    }
}
