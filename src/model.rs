//! The forward model: the chain and its effects, one code for host and controller.

use heapless::Vec;
use nalgebra::Vector3;

use crate::chain::{BakedJoint, Frame, forward};
use crate::effects::{Ambient, Conditions, Effect, Posture, gravity_loads};
use crate::prepared::{Prepared, PreparedJoint};
use crate::taught::Taught;
use crate::{Pose, Scalar, Settings, Twist};

/// Effects that one model can hold on the controller.
pub const MAX_EFFECTS: usize = 64;

/// A chain with its effects, borrowed from whoever owns the arrays.
#[derive(Clone, Copy, Debug)]
pub struct Arm<'m, T: Scalar> {
    /// Baked base, seen from the frame that poses are wanted in (the world).
    pub base: &'m Pose<T>,
    /// Baked joints, base to tool.
    pub joints: &'m [BakedJoint<T>],
    /// Baked tool.
    pub tool: &'m Pose<T>,
    /// Acceleration of gravity in the world, m/s^2.
    pub gravity: &'m Vector3<T>,
    /// What the rigid chain lacks.
    pub effects: &'m [Effect<'m, T>],
}

/// Room for one evaluation; every slice has one place a joint.
#[derive(Debug)]
pub struct Scratch<'s, T: Scalar> {
    /// The readings corrected by what works on them, rad or m.
    pub readings: &'s mut [T],
    /// Baked frames after each motion.
    pub frames: &'s mut [Frame<T>],
    /// Gravity's moments, N m; left alone where no effect needs them.
    pub moments: &'s mut [Vector3<T>],
    /// Gravity's forces, N; likewise.
    pub forces: &'s mut [Vector3<T>],
}

/// Result of one evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction<T: Scalar> {
    /// Tool pose of the chain at the corrected readings.
    pub rigid: Pose<T>,
    /// What the effects after the kinematics add to it, world axes at the tool point.
    pub twist: Twist<T>,
}

impl<T: Scalar> Prediction<T> {
    /// Where the tool is.
    pub fn pose(&self) -> Pose<T> {
        self.rigid.displaced(&self.twist)
    }
}

impl<T: Scalar> Arm<'_, T> {
    /// Calls `look` with what posture effects may look at, after [`Prepared::predict`] has filled
    /// `scratch` and returned `rigid` for the same arguments.
    pub fn with_posture(
        &self,
        q: &[T],
        direction: &[T],
        ambient: &Ambient<T>,
        rigid: &Pose<T>,
        scratch: &mut Scratch<'_, T>,
        look: impl FnOnce(&Posture<'_, T>),
    ) {
        self.load(ambient, rigid, scratch);
        look(&self.posture(q, direction, ambient, rigid, scratch));
    }

    /// Sets gravity's moments and forces.
    pub(crate) fn load(&self, ambient: &Ambient<T>, rigid: &Pose<T>, scratch: &mut Scratch<'_, T>) {
        gravity_loads(
            self.joints,
            scratch.frames,
            rigid,
            self.gravity,
            ambient,
            scratch.moments,
            scratch.forces,
        );
    }

    pub(crate) fn posture<'s>(
        &'s self,
        q: &'s [T],
        direction: &'s [T],
        ambient: &'s Ambient<T>,
        rigid: &'s Pose<T>,
        scratch: &'s Scratch<'_, T>,
    ) -> Posture<'s, T> {
        Posture {
            q,
            direction,
            ambient,
            base: self.base,
            joints: self.joints,
            frames: scratch.frames,
            tool: rigid,
            gravity: self.gravity,
            moments: scratch.moments,
            forces: scratch.forces,
        }
    }
}

/// A chain of N joints in baked form, owned.
#[derive(Clone, Debug, PartialEq)]
pub struct BakedChain<T: Scalar, const N: usize> {
    /// World to the first joint.
    pub base: Pose<T>,
    /// Base to tool.
    pub joints: [BakedJoint<T>; N],
    /// Last joint frame to tool.
    pub tool: Pose<T>,
    /// Acceleration of gravity in the world, m/s^2.
    pub gravity: Vector3<T>,
}

impl<T: Scalar, const N: usize> BakedChain<T, N> {
    /// The chain with effects.
    pub fn arm<'m>(&'m self, effects: &'m [Effect<'m, T>]) -> Arm<'m, T> {
        Arm {
            base: &self.base,
            joints: &self.joints,
            tool: &self.tool,
            gravity: &self.gravity,
            effects,
        }
    }

    /// No arm at all: every joint turns about the world's z.
    #[inline(never)]
    pub fn identity() -> Self {
        Self {
            base: Pose::identity(),
            joints: [BakedJoint::identity(); N],
            tool: Pose::identity(),
            gravity: Vector3::zeros(),
        }
    }

    /// The same in another number type, rounded once.
    pub fn cast<U: Scalar>(&self) -> BakedChain<U, N> {
        BakedChain {
            base: self.base.cast(),
            joints: core::array::from_fn(|j| {
                self.joints
                    .get(j)
                    .map_or_else(BakedJoint::identity, BakedJoint::cast)
            }),
            tool: self.tool.cast(),
            gravity: self.gravity.map(|x| U::of(x.widen())),
        }
    }
}

/// Everything that the controller knows of its arm. `'a`: the blob, which tables are read
/// from in place.
#[derive(Clone, Debug, PartialEq)]
pub struct Model<'a, T: Scalar, const N: usize> {
    /// What the controller's own kinematics believe, base and tool aligned.
    pub nominal: BakedChain<T, N>,
    /// The arm as it was identified.
    pub calibrated: BakedChain<T, N>,
    /// What the rigid chain lacks.
    pub effects: Vec<Effect<'a, T>, MAX_EFFECTS>,
    /// Lower and upper limit of each joint command, rad or m.
    pub limits: [[T; 2]; N],
    /// Smallest step of each joint command, rad or m.
    pub resolution: [T; N],
    /// How to compensate.
    pub settings: Settings<T>,
    /// Corrections from tables, where the blob has any.
    pub taught: Taught<'a, T>,
}

/// Room for one evaluation of an arm with N joints.
#[derive(Clone, Debug)]
pub struct Room<T: Scalar, const N: usize> {
    readings: [T; N],
    frames: [Frame<T>; N],
    moments: [Vector3<T>; N],
    forces: [Vector3<T>; N],
}

impl<T: Scalar, const N: usize> Default for Room<T, N> {
    #[inline(never)]
    fn default() -> Self {
        Self {
            readings: [T::zero(); N],
            frames: [Frame::identity(); N],
            moments: [Vector3::zeros(); N],
            forces: [Vector3::zeros(); N],
        }
    }
}

impl<T: Scalar, const N: usize> Room<T, N> {
    /// Frames of the last evaluation.
    pub fn frames(&self) -> &[Frame<T>; N] {
        &self.frames
    }

    /// As slices.
    pub fn scratch(&mut self) -> Scratch<'_, T> {
        Scratch {
            readings: &mut self.readings,
            frames: &mut self.frames,
            moments: &mut self.moments,
            forces: &mut self.forces,
        }
    }
}

impl<T: Scalar, const N: usize> Model<'_, T, N> {
    /// The place of a model that [`crate::params::decode_into`] is to fill: an arm without
    /// length that cannot move.
    #[inline(never)]
    pub fn empty() -> Self {
        Self {
            nominal: BakedChain::identity(),
            calibrated: BakedChain::identity(),
            effects: Vec::new(),
            limits: [[T::zero(); 2]; N],
            resolution: [T::zero(); N],
            settings: Settings::default(),
            taught: Taught::default(),
        }
    }

    /// Where the calibrated arm's tool is in the world.
    pub fn predict(&self, q: &[T; N], conditions: &Conditions<T, N>) -> Pose<T> {
        self.evaluate(q, conditions, &mut Room::default()).pose()
    }

    /// The same before what the effects add is added, and the frames.
    #[inline(never)]
    pub(crate) fn evaluate(
        &self,
        q: &[T; N],
        conditions: &Conditions<T, N>,
        room: &mut Room<T, N>,
    ) -> Prediction<T> {
        let mut joints = core::array::from_fn(|_| PreparedJoint::empty());
        let prepared = self.prepare(conditions, &mut joints);
        prepared.predict(q, &mut room.scratch())
    }

    /// The calibrated arm with its effects under `conditions`.
    pub fn prepare<'s: 'p, 'p>(
        &'s self,
        conditions: &'p Conditions<T, N>,
        joints: &'p mut [PreparedJoint<'s, T>; N],
    ) -> Prepared<'p, T> {
        let arm = self.calibrated.arm(&self.effects);
        arm.prepare(&conditions.direction, &conditions.ambient, joints)
    }

    /// Where the controller's own kinematics put the tool in the world.
    #[inline(never)]
    pub fn nominal_pose(&self, q: &[T; N]) -> Pose<T> {
        let mut frames = [Frame::identity(); N];
        let nominal = &self.nominal;
        forward(&nominal.base, &nominal.joints, q, &mut frames).then(&nominal.tool)
    }
}
