//! An arm under conditions that stay: what the control loop evaluates again and again.
//!
//! Direction, payload, temperature and time are the same for all evaluations of a request. So
//! most effects are worked into a few numbers a joint once ([`Arm::prepare`]), and an
//! evaluation ([`Prepared::predict`]) is one pass out along the chain and, where gravity turns
//! the joints, one back. It gives what the effects' contract gives, to rounding
//! (`tests/prepared_is_the_contract.rs`). Effects that truly depend on the posture are left to
//! their contract.
//!
//! - What adds to a reading: a constant, a share of the reading, its curve read in place, and
//!   harmonics of whole order, by Horner's rule from the sine and cosine that the chain needs
//!   anyway.
//! - A link's growth is a vector v, constant in its frame. So is the next axis: the part of v
//!   along an axis belongs to the link before as well, which leaves two numbers a joint.
//! - Gravity's torque: with `w` the first moment of a link about its joint's origin, all that
//!   lies beyond put at the next one's, and again no part along the axis,
//!
//! ```text
//! W_j = W_j+1 + R_j w_j        torque_j = W_j · (g x z_j)
//! ```

mod joint;

use nalgebra::{Matrix3, Vector3};

use self::joint::Motion;
pub use self::joint::PreparedJoint;
use crate::chain::{BakedJoint, Frame};
use crate::effects::{Ambient, Effect, Grows, Place, Reading, Stage, entry};
use crate::model::{Arm, Prediction, Scratch};
use crate::pose::{columns, rotated, seen};
use crate::vector::{add_cross, along, plus, times};
use crate::{Pose, Scalar, Twist};

/// An arm under conditions that stay.
#[derive(Clone, Copy, Debug)]
pub struct Prepared<'p, T: Scalar> {
    arm: Arm<'p, T>,
    direction: &'p [T],
    ambient: &'p Ambient<T>,
    joints: &'p [PreparedJoint<'p, T>],
    whole: Whole<T>,
}

/// What is worked in that is not one a joint.
#[derive(Clone, Copy, Debug)]
pub struct Whole<T: Scalar> {
    /// Displacement whatever the joints do, about the origin of the kinematics' start.
    constant: Twist<T>,
    moves: Moves,
    /// Effects that are left to their contract.
    readings: Kept,
    postures: Kept,
    /// Whether there are any of the ones and of the others.
    adds: bool,
    displaces: bool,
    /// Whether one of these looks at gravity's loads.
    loaded: bool,
}

/// What moves the arm after the kinematics, its contracted effects apart.
#[derive(Clone, Copy, Debug, Default)]
struct Moves {
    /// The base.
    base: bool,
    /// Growing links.
    growth: bool,
    /// Joints that give way.
    gravity: bool,
    /// One of the two that turn.
    turns: bool,
}

/// Some of a list of effects: a bit for each of the first [`TOLD_APART`], and all after them.
#[derive(Clone, Copy, Debug, Default)]
struct Kept(u64);

const TOLD_APART: usize = 64;

impl Kept {
    fn keep(&mut self, place: usize) {
        if place < TOLD_APART {
            self.0 |= 1 << place;
        }
    }

    fn none<T: Scalar>(self, effects: &[Effect<'_, T>]) -> bool {
        self.0 == 0 && effects.len() <= TOLD_APART
    }

    fn of<'e, 'm, T: Scalar>(
        self,
        effects: &'e [Effect<'m, T>],
        stage: Stage,
    ) -> impl Iterator<Item = &'e Effect<'m, T>> {
        let mut left = self.0;
        effects.iter().filter(move |effect| {
            let kept = left & 1 == 1;
            // Those after the first are all kept.
            left = left >> 1 | 1 << (TOLD_APART - 1);
            kept && effect.stage() == stage
        })
    }
}

impl<'m, T: Scalar> Arm<'m, T> {
    /// Works in what stays while the conditions do. `joints`: one place a joint, whatever is
    /// in it.
    pub fn prepare<'p>(
        &self,
        direction: &'p [T],
        ambient: &'p Ambient<T>,
        joints: &'p mut [PreparedJoint<'m, T>],
    ) -> Prepared<'p, T>
    where
        'm: 'p,
    {
        let mut whole = Whole {
            constant: Twist::zero(),
            moves: Moves::default(),
            readings: Kept::default(),
            postures: Kept::default(),
            adds: false,
            displaces: false,
            loaded: false,
        };
        T::work_in(self, direction, ambient, joints, &mut whole);
        Prepared {
            arm: *self,
            direction,
            ambient,
            joints,
            whole,
        }
    }
}

/// [`Arm::prepare`].
pub(crate) fn work_in<'m, T: Scalar>(
    arm: &Arm<'m, T>,
    direction: &[T],
    ambient: &Ambient<T>,
    joints: &mut [PreparedJoint<'m, T>],
    whole: &mut Whole<T>,
) {
    let mut work = Work {
        baked: arm.joints,
        joints,
        base: Twist::zero(),
        moves: Moves::default(),
    };
    for (joint, baked) in work.joints.iter_mut().zip(arm.joints) {
        joint.clear(baked.kind);
    }
    for (place, effect) in arm.effects.iter().enumerate() {
        if place < TOLD_APART && work.take(effect, direction, ambient) {
            continue;
        }
        whole.loaded = whole.loaded || effect.loaded();
        match effect.stage() {
            Stage::Reading => {
                whole.readings.keep(place);
                if let Some(joint) = effect.joint().and_then(|j| work.joints.get_mut(j)) {
                    joint.motion = joint.motion.with_all();
                }
            }
            Stage::Posture => whole.postures.keep(place),
        }
    }
    whole.adds = !whole.readings.none(arm.effects);
    whole.displaces = !whole.postures.none(arm.effects);
    whole.moves = work.moves;
    whole.moves.turns = work.moves.base || work.moves.gravity;
    if work.moves.growth || work.moves.gravity {
        work.move_along_axes(arm.tool, ambient);
    }
    let Pose {
        rotation,
        translation,
    } = arm.base;
    let angular = rotated(rotation, &work.base.angular);
    let linear = rotated(rotation, &work.base.linear);
    whole.constant = Twist::new(add_cross(&linear, translation, &angular), angular);
}

/// A preparation at work.
struct Work<'w, 'p, 'm, T: Scalar> {
    baked: &'w [BakedJoint<T>],
    joints: &'p mut [PreparedJoint<'m, T>],
    /// Displacement of the base, its axes and origin.
    base: Twist<T>,
    moves: Moves,
}

impl<'m, T: Scalar> Work<'_, '_, 'm, T> {
    /// Works `effect` in; false if it has to be left to its contract.
    fn take(&mut self, effect: &Effect<'m, T>, direction: &[T], ambient: &Ambient<T>) -> bool {
        let o = T::zero();
        match effect {
            Effect::JointGain(e) => self.add_to_reading(e.joint, o, e.gain[0]),
            Effect::Backlash(e) => {
                let way = entry(direction, usize::from(e.joint));
                self.add_to_reading(e.joint, way * e.backlash[0], o)
            }
            Effect::ThermalDrift(e) => self.drift(&e.place, e.factor(ambient) * e.drift[0]),
            Effect::TimeDrift(e) => self.drift(&e.place, e.factor(ambient) * e.drift[0]),
            Effect::WarmUp(e) => self.drift(&e.place, e.factor(ambient) * e.drift[0]),
            Effect::StepChange(e) => self.drift(&e.place, e.factor(ambient) * e.drift[0]),
            Effect::GearEccentricity(e) => self.add_harmonic(e.joint, e.order, e.amplitude),
            Effect::GearRipple(e) => self.add_harmonic(e.joint, e.order, e.amplitude),
            Effect::JointCurve(e) => match self.joints.get_mut(usize::from(e.joint)) {
                Some(joint) => joint.add_curve(e.prepared()),
                None => true,
            },
            Effect::JointCompliance(e) => {
                if let Some(joint) = self.joints.get_mut(usize::from(e.joint)) {
                    joint.compliance += e.compliance[0];
                    self.moves.gravity = true;
                }
                true
            }
            Effect::ThermalGrowth(e) => {
                if e.grows == Grows::Travel {
                    return false;
                }
                if let Some(joint) = self.joints.get_mut(usize::from(e.joint)) {
                    joint.growth = along(&joint.growth, &e.link, e.longer(ambient));
                    self.moves.growth = true;
                }
                true
            }
            Effect::JointCoupling(_)
            | Effect::CrossAxisCompliance(_)
            | Effect::LinkBending(_)
            | Effect::BaseFlex(_)
            | Effect::ToolLoad(_)
            | Effect::GravityLever(_)
            | Effect::AxisWobble(_)
            | Effect::PrismaticStraightness(_)
            | Effect::Unnamed(_) => false,
        }
    }

    fn add_to_reading(&mut self, joint: u8, zero: T, gain: T) -> bool {
        if let Some(joint) = self.joints.get_mut(usize::from(joint)) {
            joint.add_to_reading(zero, gain);
        }
        true
    }

    fn add_harmonic(&mut self, joint: u8, order: T, amplitude: [T; 2]) -> bool {
        let j = usize::from(joint);
        match (self.joints.get_mut(j), self.baked.get(j)) {
            (Some(joint), Some(baked)) => joint.add_harmonic(order, amplitude, baked.sincos_theta),
            _ => true,
        }
    }

    fn drift(&mut self, place: &Place<T>, amount: T) -> bool {
        match place {
            Place::Joint(joint) => self.add_to_reading(*joint, amount, T::zero()),
            Place::Base { unit, .. } => {
                self.base = self.base.plus(&Twist::from_rows(*unit).scaled(amount));
                self.moves.base = true;
                true
            }
        }
    }

    /// Sets the moments and masses, and moves what lies along an axis to the link before. What
    /// arrives at the base is constant there.
    fn move_along_axes(&mut self, tool: &Pose<T>, ambient: &Ambient<T>) {
        let mut mass = ambient.payload;
        let mut beyond = times(&seen(tool, &ambient.payload_com), mass);
        let (mut growth_along, mut moment_along) = (T::zero(), T::zero());
        for (joint, baked) in self.joints.iter_mut().zip(self.baked).rev() {
            let (s, c) = (baked.sin_alpha, baked.cos_alpha);
            let growth = &mut joint.growth;
            growth.y -= growth_along * s;
            growth_along = growth.z + growth_along * c;
            growth.z = T::zero();
            let link = &baked.mass;
            let offset = Vector3::new(
                baked.tx * mass,
                baked.ty * mass - moment_along * s,
                moment_along * c,
            );
            let moment = plus(&plus(&times(&link.com, link.mass), &offset), &beyond);
            beyond = Vector3::zeros();
            joint.moment = [moment.x, moment.y];
            moment_along = moment.z;
            mass += link.mass;
            joint.mass = mass;
        }
        self.base.linear.z += growth_along;
    }
}

impl<T: Scalar> Prepared<'_, T> {
    /// Where the tool is at the readings `q` (rad or m): effects on the readings, the chain,
    /// what moves it then.
    #[inline(never)]
    pub fn predict(&self, q: &[T], scratch: &mut Scratch<'_, T>) -> Prediction<T> {
        let arm = &self.arm;
        let contracted = self.whole.adds;
        if contracted {
            T::set_contracted(self, q, scratch.readings);
        }
        self.correct(q, contracted, scratch.readings);
        let (end, growth) = self.pass(q, scratch);
        let rigid = end.then(arm.tool);
        let mut twist = self.whole.constant;
        twist.linear += growth;
        if self.whole.moves.gravity {
            self.give_way(scratch, &mut twist);
        }
        if self.whole.moves.turns {
            twist = twist.at(&rigid.translation);
        }
        if self.whole.displaces {
            // A copy: what is pointed at is in memory all along.
            let before = twist;
            twist = T::displaced_by_contract(self, q, &rigid, scratch, &before);
        }
        Prediction { rigid, twist }
    }

    /// Corrects the readings, up to the harmonics. `readings`: where they are `contracted`, what
    /// is left to the contract adds; set to the corrected readings, or to the correction alone
    /// where harmonics of the reading itself are left to be added.
    #[inline(never)]
    fn correct(&self, q: &[T], contracted: bool, readings: &mut [T]) {
        for ((own, &q), reading) in self.joints.iter().zip(q).zip(readings) {
            let line = || own.zero + own.gain * q;
            *reading = match own.motion {
                Motion::Exact | Motion::Wave => q,
                Motion::Curve => q + own.curve.of_measured(q),
                Motion::Line => q + line(),
                motion => {
                    let mut all = line();
                    if own.curved {
                        all += own.curve.at(q);
                    }
                    if contracted {
                        all += *reading;
                    }
                    if motion == Motion::All { all } else { q + all }
                }
            };
        }
    }

    /// [`crate::forward`] from the corrected readings, and the links' growth.
    #[inline(never)]
    fn pass(&self, q: &[T], scratch: &mut Scratch<'_, T>) -> (Pose<T>, Vector3<T>) {
        let start = self.arm.base;
        let [mut x, mut y, mut z] = columns(&start.rotation);
        let mut p = start.translation;
        let mut growth = Vector3::zeros();
        let joints = self.arm.joints.iter().zip(self.joints);
        let places = scratch.readings.iter().zip(scratch.frames.iter_mut());
        for (((joint, own), &q), (&reading, frame)) in joints.zip(q).zip(places) {
            let (s, c) = if own.motion == Motion::Slide {
                p += z * reading;
                (joint.sincos_theta[0], joint.sincos_theta[1])
            } else {
                let all = own.motion == Motion::All;
                let angle = if all { q } else { reading };
                let (s, c) = angle.sincos_beside(joint.theta);
                if own.motion == Motion::Wave {
                    T::turned_a_little(s, c, own.zero + own.harmonics(s, c))
                } else if all {
                    T::turned(s, c, reading + own.harmonics(s, c))
                } else {
                    (s, c)
                }
            };
            let x1 = x * c + y * s;
            let y1 = y * c - x * s;
            *frame = Frame {
                rotation: Matrix3::from_columns(&[x1, y1, z]),
                origin: p,
            };
            p = p + x1 * joint.tx + y1 * joint.ty;
            if self.whole.moves.growth {
                growth = growth + x1 * own.growth.x + y1 * own.growth.y;
            }
            x = x1;
            y = y1 * joint.cos_alpha + z * joint.sin_alpha;
            z = z * joint.cos_alpha - y1 * joint.sin_alpha;
        }
        (Pose::new(Matrix3::from_columns(&[x, y, z]), p), growth)
    }

    /// Adds the turns and slides of all joints under gravity to a displacement about the
    /// origin.
    #[inline(always)]
    fn give_way(&self, scratch: &Scratch<'_, T>, twist: &mut Twist<T>) {
        let g = *self.arm.gravity;
        let mut beyond = Vector3::<T>::zeros();
        let (mut v, mut w) = (twist.linear, twist.angular);
        let joints = self.joints.iter().zip(scratch.frames.iter());
        for ((own, frame), &reading) in joints.zip(scratch.readings.iter()).rev() {
            let [x, y, z] = columns(&frame.rotation);
            beyond = beyond + x * own.moment[0] + y * own.moment[1];
            if own.motion == Motion::Slide {
                v += z * (own.compliance * own.mass * g.dot(&z));
                beyond += z * (own.mass * reading);
            } else {
                let torque = beyond.x * (g.y * z.z - g.z * z.y)
                    + beyond.y * (g.z * z.x - g.x * z.z)
                    + beyond.z * (g.x * z.y - g.y * z.x);
                let turn = z * (own.compliance * torque);
                w += turn;
                let o = &frame.origin;
                v.x = v.x + o.y * turn.z - o.z * turn.y;
                v.y = v.y + o.z * turn.x - o.x * turn.z;
                v.z = v.z + o.x * turn.y - o.y * turn.x;
            }
        }
        *twist = Twist::new(v, w);
    }
}

/// `before` with what is left to the contract after the kinematics.
pub(crate) fn displaced_by_contract<T: Scalar>(
    prepared: &Prepared<'_, T>,
    q: &[T],
    rigid: &Pose<T>,
    scratch: &mut Scratch<'_, T>,
    before: &Twist<T>,
) -> Twist<T> {
    let (arm, ambient) = (&prepared.arm, prepared.ambient);
    if prepared.whole.loaded {
        arm.load(ambient, rigid, scratch);
    }
    let posture = arm.posture(q, prepared.direction, ambient, rigid, scratch);
    let mut twist = *before;
    for effect in prepared.whole.postures.of(arm.effects, Stage::Posture) {
        twist = twist.plus(&effect.displacement(&posture));
    }
    twist
}

/// What is left to the contract adds to the readings.
pub(crate) fn set_contracted<T: Scalar>(prepared: &Prepared<'_, T>, q: &[T], additions: &mut [T]) {
    for addition in additions.iter_mut() {
        *addition = T::zero();
    }
    let reading = Reading {
        q,
        direction: prepared.direction,
        ambient: prepared.ambient,
    };
    for effect in prepared
        .whole
        .readings
        .of(prepared.arm.effects, Stage::Reading)
    {
        let (j, more) = effect.addition(&reading);
        if let Some(addition) = additions.get_mut(j) {
            *addition += more;
        }
    }
}
