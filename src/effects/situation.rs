//! What an effect may look at: readings, conditions, and where the arm stands.

use nalgebra::Vector3;

use crate::chain::{BakedJoint, Frame};
use crate::pose::{rotated, seen};
use crate::vector::{along, cross, plus, times};
use crate::{Pose, Scalar};

/// What is known of a pose besides its joints. What was not measured stays at its default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions<T: Scalar, const N: usize> {
    /// Sign of the last move of each joint: -1, 0 (unknown) or +1.
    pub direction: [T; N],
    /// What does not depend on the number of joints.
    pub ambient: Ambient<T>,
}

/// Conditions that are one a pose, not one a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient<T: Scalar> {
    /// kg beyond the flange, the tool's own mass excluded.
    pub payload: T,
    /// Its centre of mass in the tool frame, m.
    pub payload_com: Vector3<T>,
    /// degC, one a sensor; NaN where it is not known, which switches its effects off.
    pub temperature: [T; MAX_SENSORS],
    /// s since the start of the measurements; NaN where it is not known, likewise.
    pub time: T,
}

/// Temperature sensors that a pose can carry.
pub const MAX_SENSORS: usize = 8;

impl<T: Scalar> Default for Ambient<T> {
    fn default() -> Self {
        Self {
            payload: T::zero(),
            payload_com: Vector3::zeros(),
            temperature: [T::of(f64::NAN); MAX_SENSORS],
            time: T::of(f64::NAN),
        }
    }
}

impl<T: Scalar, const N: usize> Default for Conditions<T, N> {
    fn default() -> Self {
        Self {
            direction: [T::zero(); N],
            ambient: Ambient::default(),
        }
    }
}

/// What an effect of [`super::Stage::Reading`] may look at.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'s, T: Scalar> {
    /// Readings, rad or m.
    pub q: &'s [T],
    /// Sign of the last move of each joint.
    pub direction: &'s [T],
    /// Payload, temperatures, time.
    pub ambient: &'s Ambient<T>,
}

/// What an effect of [`super::Stage::Posture`] may look at, in the axes of the frame that the
/// kinematics started in.
#[derive(Clone, Copy, Debug)]
pub struct Posture<'s, T: Scalar> {
    /// Readings, rad or m.
    pub q: &'s [T],
    /// Sign of the last move of each joint.
    pub direction: &'s [T],
    /// Payload, temperatures, time.
    pub ambient: &'s Ambient<T>,
    /// Baked base, seen from the same frame.
    pub base: &'s Pose<T>,
    /// Baked joints.
    pub joints: &'s [BakedJoint<T>],
    /// Frames of all joints.
    pub frames: &'s [Frame<T>],
    /// Tool pose of the chain alone.
    pub tool: &'s Pose<T>,
    /// Acceleration of gravity, m/s^2.
    pub gravity: &'s Vector3<T>,
    /// Gravity's moment about each joint's origin of all that lies beyond it, payload
    /// included, N m.
    pub moments: &'s [Vector3<T>],
    /// Gravity's force on all that lies beyond each joint, N.
    pub forces: &'s [Vector3<T>],
}

/// Gravity's forces and moments on the joints.
///
/// `moments[j]`: about the origin of frame `j`, of every mass beyond joint `j` and of the
/// payload, N m; `forces[j]` in N. One pass from the tool to the base.
#[inline(never)]
pub fn gravity_loads<T: Scalar>(
    joints: &[BakedJoint<T>],
    frames: &[Frame<T>],
    tool: &Pose<T>,
    gravity: &Vector3<T>,
    ambient: &Ambient<T>,
    moments: &mut [Vector3<T>],
    forces: &mut [Vector3<T>],
) {
    let mut mass = ambient.payload;
    let mut first_moment = times(&seen(tool, &ambient.payload_com), mass);
    for (((joint, frame), moment), force) in joints
        .iter()
        .zip(frames)
        .zip(moments.iter_mut())
        .zip(forces.iter_mut())
        .rev()
    {
        let link = &joint.mass;
        if !link.mass.is_zero() {
            mass += link.mass;
            let com = plus(&frame.origin, &rotated(&frame.rotation, &link.com));
            first_moment = along(&first_moment, &com, link.mass);
        }
        *force = times(gravity, mass);
        *moment = cross(&along(&first_moment, &frame.origin, -mass), gravity);
    }
}

/// `value - reference` where the value is known, zero where it is not (NaN or infinite).
#[inline]
pub(super) fn since<T: Scalar>(value: T, reference: T) -> T {
    if value.finite() {
        value - reference
    } else {
        T::zero()
    }
}

impl<T: Scalar> Ambient<T> {
    /// Temperature of sensor `sensor` above `reference`, K; zero where it is not known.
    #[inline]
    pub fn warming(&self, sensor: u8, reference: T) -> T {
        self.temperature
            .get(usize::from(sensor))
            .map_or_else(T::zero, |&t| since(t, reference))
    }
}
