//! What the rigid chain lacks.
//!
//! An effect either adds to the reading of its joint, as a function of readings and
//! conditions ([`Stage::Reading`]), or displaces everything beyond its joint, as a function
//! of where the arm then stands ([`Stage::Posture`]). It is linear in its parameters and zero
//! when they are zero. Host and controller evaluate the same code.
//!
//! To add one: a file here with a struct that implements [`EffectModel`], a variant at the
//! *end* of [`Effect`], its arm in the three places of the `effects!` list.

mod gear_eccentricity;
mod joint_compliance;
mod joint_gain;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::chain::{BakedJoint, Frame};
use crate::{JointKind, Pose, Scalar, Twist};

pub use gear_eccentricity::GearEccentricity;
pub use joint_compliance::JointCompliance;
pub use joint_gain::JointGain;

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
    /// degC, one a sensor; 0 where there is none.
    pub temperature: [T; MAX_SENSORS],
    /// s since the start of the measurements.
    pub time: T,
}

/// Temperature sensors that a pose can carry.
pub const MAX_SENSORS: usize = 8;

impl<T: Scalar> Default for Ambient<T> {
    fn default() -> Self {
        Self {
            payload: T::zero(),
            payload_com: Vector3::zeros(),
            temperature: [T::zero(); MAX_SENSORS],
            time: T::zero(),
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

/// When an effect is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Before the kinematics: it adds to a joint's reading.
    Reading,
    /// After them: it displaces what lies beyond a joint.
    Posture,
}

/// What an effect of [`Stage::Reading`] may look at.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'s, T: Scalar> {
    /// Readings, rad or m.
    pub q: &'s [T],
    /// Sign of the last move of each joint.
    pub direction: &'s [T],
    /// Payload, temperatures, time.
    pub ambient: &'s Ambient<T>,
}

/// What an effect of [`Stage::Posture`] may look at, in the axes of the frame that the
/// kinematics started in.
#[derive(Clone, Copy, Debug)]
pub struct Posture<'s, T: Scalar> {
    /// Readings, rad or m.
    pub q: &'s [T],
    /// Sign of the last move of each joint.
    pub direction: &'s [T],
    /// Payload, temperatures, time.
    pub ambient: &'s Ambient<T>,
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

/// A displacement of everything beyond a joint, about `origin`.
#[derive(Clone, Copy, Debug)]
pub struct Displacement<T: Scalar> {
    /// Axes of the kinematics' start frame.
    pub twist: Twist<T>,
    /// Reference point of the twist, m.
    pub origin: Vector3<T>,
}

/// What every non-geometric effect can do.
pub trait EffectModel<T: Scalar> {
    /// Kind as it stands in reports, e.g. `"joint-gain"`.
    fn kind(&self) -> &'static str;

    /// The joint that it acts on or through, counted from 0.
    fn joint(&self) -> usize;

    /// Parameters in order, with SI units: `[("compliance", "rad/(N m)")]`.
    fn parameters(&self) -> &'static [(&'static str, &'static str)];

    /// Values in the order of [`Self::parameters`].
    fn values(&self) -> &[T];

    /// The same, for the solver to set.
    fn values_mut(&mut self) -> &mut [T];

    /// When it is evaluated.
    fn stage(&self) -> Stage;

    /// [`Stage::Reading`]: d (addition to the reading of [`Self::joint`]) / d `values()[k]`,
    /// rad or m per unit.
    fn reading_partial(&self, _k: usize, _at: &Reading<'_, T>) -> T {
        T::zero()
    }

    /// [`Stage::Posture`]: d displacement / d `values()[k]`.
    fn posture_partial(&self, _k: usize, _at: &Posture<'_, T>) -> Displacement<T> {
        Displacement {
            twist: Twist::zero(),
            origin: Vector3::zeros(),
        }
    }
}

/// The list: variant, its order is its number in stored blobs.
macro_rules! effects {
    ($($(#[$doc:meta])* $name:ident),+ $(,)?) => {
        /// One effect of any kind.
        ///
        /// The variant's position is its number in stored blobs: append, never reorder, never
        /// remove. Exhaustive on purpose: whoever matches on it must notice a new one.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Effect<T: Scalar> {
            $($(#[$doc])* $name($name<T>)),+
        }

        impl<T: Scalar> Effect<T> {
            /// As its contract.
            #[inline]
            pub fn model(&self) -> &dyn EffectModel<T> {
                match self { $(Self::$name(e) => e),+ }
            }

            /// As its contract, to change its values.
            #[inline]
            pub fn model_mut(&mut self) -> &mut dyn EffectModel<T> {
                match self { $(Self::$name(e) => e),+ }
            }

            /// The same in another number type, rounded once.
            pub fn cast<U: Scalar>(&self) -> Effect<U> {
                match self { $(Self::$name(e) => Effect::$name(e.cast())),+ }
            }

            /// When it is evaluated.
            #[inline]
            pub fn stage(&self) -> Stage {
                match self { $(Self::$name(e) => e.stage()),+ }
            }

            /// The joint and what this effect adds to its reading, rad or m.
            #[inline]
            pub fn addition(&self, at: &Reading<'_, T>) -> (usize, T) {
                match self { $(Self::$name(e) => (e.joint(), addition(e, at))),+ }
            }

            /// Displacement of the tool point, axes of the kinematics' start frame.
            #[inline]
            pub fn displacement(&self, at: &Posture<'_, T>) -> Twist<T> {
                match self { $(Self::$name(e) => displacement(e, at)),+ }
            }
        }
    };
}

effects! {
    /// See [`JointGain`].
    JointGain,
    /// See [`GearEccentricity`].
    GearEccentricity,
    /// See [`JointCompliance`].
    JointCompliance,
}

#[inline]
fn addition<T: Scalar, E: EffectModel<T>>(effect: &E, at: &Reading<'_, T>) -> T {
    let mut sum = T::zero();
    for (k, &value) in effect.values().iter().enumerate() {
        sum += effect.reading_partial(k, at) * value;
    }
    sum
}

#[inline]
fn displacement<T: Scalar, E: EffectModel<T>>(effect: &E, at: &Posture<'_, T>) -> Twist<T> {
    let mut sum = Twist::zero();
    for (k, &value) in effect.values().iter().enumerate() {
        let d = effect.posture_partial(k, at);
        sum = sum.plus(&d.twist.at(&(at.tool.translation - d.origin)).scaled(value));
    }
    sum
}

/// Gravity's forces and moments on the joints.
///
/// `moments[j]`: about the origin of frame `j`, of every mass beyond joint `j` and of the
/// payload, N m; `forces[j]` in N. One pass from the tool to the base.
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
    let mut first_moment = tool.point(&ambient.payload_com) * ambient.payload;
    for (((joint, frame), moment), force) in joints
        .iter()
        .zip(frames)
        .zip(moments.iter_mut())
        .zip(forces.iter_mut())
        .rev()
    {
        let link = &joint.mass;
        mass += link.mass;
        first_moment += (frame.origin + frame.rotation * link.com) * link.mass;
        *moment = (first_moment - frame.origin * mass).cross(gravity);
        *force = gravity * mass;
    }
}

/// The turn of everything beyond joint `j` about (or, prismatic, the slide along) its own
/// axis, per rad or m.
#[inline]
pub(crate) fn about_joint<T: Scalar>(at: &Posture<'_, T>, j: usize) -> Displacement<T> {
    match (at.joints.get(j), at.frames.get(j)) {
        (Some(joint), Some(frame)) => Displacement {
            twist: match joint.kind {
                JointKind::Revolute => Twist::new(Vector3::zeros(), frame.axis()),
                JointKind::Prismatic => Twist::new(frame.axis(), Vector3::zeros()),
            },
            origin: frame.origin,
        },
        _ => Displacement {
            twist: Twist::zero(),
            origin: at.tool.translation,
        },
    }
}

/// Entry `j` of a slice, zero beyond its end.
#[inline]
pub(crate) fn entry<T: Scalar>(slice: &[T], j: usize) -> T {
    slice.get(j).copied().unwrap_or_else(T::zero)
}
