//! Everything that `docs/BLOB.md` promises a controller of a body, looked at while going through it
//! once. In single precision, in which the limits of what is sound need not be kept to the bit.

use serde::Deserialize;

use super::body::Body;
use super::{BlobError, Load, MAX_JOINTS, NAME, UNLIMITED};
use crate::chain::BakedJoint;
use crate::model::MAX_EFFECTS;
use crate::pose::columns;
use crate::taught::{self, Cmac, Polynomial};
use crate::vector::{cross, dot, less, square};
use crate::{JointKind, Method, Pose, Scalar, Settings};

/// How far baked rotations may be from rotations, and sines and cosines from each other.
const ROTATION: f32 = 1e-4;

/// A body under examination. The refusals rank as `docs/BLOB.md` orders them: what does not
/// follow the layout ends the examination, the others are kept, the first of each rank.
struct Examination<'a> {
    body: Body<'a>,
    /// Joints that the header promises.
    joints: usize,
    /// Lists of another length than that.
    lists: Option<BlobError>,
    /// Values that cannot be meant.
    meaning: Option<BlobError>,
}

/// Refuses a body for `joints` joints that is not what it should be.
#[inline(never)]
pub(super) fn check(body: &[u8], joints: usize) -> Result<(), BlobError> {
    let mut look = Examination {
        body: Body::new(body),
        joints,
        lists: None,
        meaning: None,
    };
    if joints == 0 {
        look.lists = Some(BlobError::Joints {
            found: 0,
            expected: 1,
        });
    }
    look.body.text(NAME)?;
    let nominal = look.chain()?;
    let other = nominal ^ look.chain()?;
    if other != 0 {
        let joint = number(other.trailing_zeros() as usize);
        look.note(false, BlobError::Kind { joint });
    }
    look.commands()?;
    look.effects()?;
    let settings: Settings<f32> = look.take()?;
    look.note(settings.sound(), BlobError::Settings);
    look.taught(settings.method)?;
    look.body.described()?;
    let bytes = look.body.rest();
    if bytes != 0 {
        return Err(BlobError::Trailing { bytes });
    }
    let numbers = look.body.unsound().then_some(BlobError::Number);
    match look.lists.or(numbers).or(look.meaning) {
        None => Ok(()),
        Some(refusal) => Err(refusal),
    }
}

/// What is counted from 0, counted from 1.
pub(super) fn number(j: usize) -> u8 {
    u8::try_from(j).unwrap_or(u8::MAX).saturating_add(1)
}

/// Whether a squared length, or a difference, is that of unit vectors.
fn near(x: f32, wanted: f32) -> bool {
    (x - wanted).abs() <= ROTATION
}

/// Whether the axes are a right-handed frame.
fn is_frame(pose: &Pose<f32>) -> bool {
    let [x, y, z] = columns(&pose.rotation);
    near(square(&x), 1.0)
        && near(square(&y), 1.0)
        && near(dot(&x, &y), 0.0)
        && square(&less(&cross(&x, &y), &z)) <= ROTATION * ROTATION
}

/// Whether sines and cosines are those of angles, and what a joint of its kind does not have is
/// zero.
fn is_baked(joint: &BakedJoint<f32>) -> bool {
    let ([sine, cosine], (s, c)) = (joint.sincos_theta, joint.theta.sincos());
    let square = joint.sin_alpha * joint.sin_alpha + joint.cos_alpha * joint.cos_alpha;
    let still = joint.kind == JointKind::Revolute || (joint.tx.abs() + joint.ty.abs()) <= 0.0;
    joint.theta.abs() <= 1.571 && near(sine, s) && near(cosine, c) && near(square, 1.0) && still
}

impl<'a> Examination<'a> {
    fn take<V: Deserialize<'a>>(&mut self) -> Result<V, BlobError> {
        self.body.take()
    }

    /// Length of a list of joints.
    fn list(&mut self) -> Result<usize, BlobError> {
        let found = self.body.count(MAX_JOINTS)?;
        let expected = self.joints;
        if found != expected {
            self.lists
                .get_or_insert(BlobError::Joints { found, expected });
        }
        Ok(found)
    }

    fn note(&mut self, sound: bool, refusal: BlobError) {
        if !sound {
            self.meaning.get_or_insert(refusal);
        }
    }

    /// A baked chain. Returns its prismatic joints, a bit each.
    #[inline(never)]
    fn chain(&mut self) -> Result<u16, BlobError> {
        self.frame();
        let mut prismatic = 0;
        for j in 0..self.list()? {
            let one: BakedJoint<f32> = self.body.joint();
            prismatic |= u16::from(one.kind == JointKind::Prismatic) << j;
            let joint = number(j);
            self.note(is_baked(&one), BlobError::Baked { joint });
            self.note(one.mass.mass >= 0.0, BlobError::Mass { joint });
        }
        self.frame();
        self.body.fill(&mut [0.0_f32; 3]);
        Ok(prismatic)
    }

    /// Base or tool.
    #[inline(never)]
    fn frame(&mut self) {
        let sound = is_frame(&self.body.pose());
        self.note(sound, BlobError::Baked { joint: 0 });
    }

    /// Limits and resolutions of the joint commands.
    fn commands(&mut self) -> Result<(), BlobError> {
        let [lowest, highest] = UNLIMITED.map(f32::of);
        for j in 0..self.list()? {
            let [low, high] = [f32::taken(&mut self.body), f32::taken(&mut self.body)];
            let sound = low <= high && low >= lowest && high <= highest;
            self.note(sound, BlobError::Limits { joint: number(j) });
        }
        for j in 0..self.list()? {
            let sound = f32::taken(&mut self.body) >= 0.0;
            self.note(sound, BlobError::Resolution { joint: number(j) });
        }
        Ok(())
    }

    fn effects(&mut self) -> Result<(), BlobError> {
        for k in 0..self.body.count(MAX_EFFECTS)? {
            let sound = self.body.effect::<f32>()?.is_sound(self.joints);
            self.note(sound, BlobError::Effect { effect: number(k) });
        }
        Ok(())
    }

    /// Tables, and those that `method` needs. Each is gone before the next is taken.
    fn taught(&mut self, method: Method) -> Result<(), BlobError> {
        let polynomial = self.polynomial()?;
        let cmac = self.cmac()?;
        let there = taught::suffices(method, polynomial, cmac);
        self.note(there, BlobError::NotTaught);
        Ok(())
    }

    /// Whether there are polynomials.
    #[inline(never)]
    fn polynomial(&mut self) -> Result<bool, BlobError> {
        let polynomial: Option<Polynomial<'a, f32>> = self.take()?;
        let sound = polynomial.as_ref().is_none_or(|p| p.is_sound(self.joints));
        self.note(sound, BlobError::Taught);
        Ok(polynomial.is_some())
    }

    /// Whether there are tables of cells.
    #[inline(never)]
    fn cmac(&mut self) -> Result<bool, BlobError> {
        let cmac: Option<Cmac<'a, f32>> = self.take()?;
        let sound = cmac.as_ref().is_none_or(|c| c.is_sound(self.joints));
        self.note(sound, BlobError::Taught);
        Ok(cmac.is_some())
    }
}
