//! From the bytes of a body to the model of the loop, with little room: what is not in the
//! model is there only while it is needed. Baked in `f64`, rounded once.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;

use super::body::Body;
use super::{BlobError, LABEL, NAME, WITHOUT_TABLES};
use crate::chain::{BakedJoint, Gauge, LinkMass, bake};
use crate::effects::{Description, Effect};
use crate::model::{BakedChain, MAX_EFFECTS, Model};
use crate::pose::rotated;
use crate::taught::{Cmac, Polynomial, Taught};
use crate::{Convention, Joint, JointKind, Pose, Scalar, Settings, StoredPose};

/// An arm as it is described and as it is baked, at its bare size. Every slice has one place a
/// joint.
struct Described<'r> {
    joints: &'r mut [Joint<f64>],
    masses: &'r mut [LinkMass<f64>],
    baked: &'r mut [BakedJoint<f64>],
    gauges: &'r mut [Gauge<f64>],
    base: Pose<f64>,
    tool: Pose<f64>,
    baked_base: Pose<f64>,
    baked_tool: Pose<f64>,
}

/// Where the parts of a model go that are baked, and room for what they are made from; every
/// slice has one place a joint.
#[derive(Debug)]
pub struct Parts<'m, 'a, T: Scalar> {
    nominal: ChainParts<'m, T>,
    calibrated: ChainParts<'m, T>,
    effects: &'m mut Vec<Effect<'a, T>, MAX_EFFECTS>,
    limits: &'m mut [[T; 2]],
    resolution: &'m mut [T],
    joints: &'m mut [Joint<f64>],
    masses: &'m mut [LinkMass<f64>],
    baked: &'m mut [BakedJoint<f64>],
    gauges: &'m mut [Gauge<f64>],
}

#[derive(Debug)]
struct ChainParts<'m, T: Scalar> {
    base: &'m mut Pose<T>,
    joints: &'m mut [BakedJoint<T>],
    tool: &'m mut Pose<T>,
    gravity: &'m mut Vector3<T>,
}

/// A number type that models can be loaded in. Behind a trait's functions the loading is in a
/// program once for each type, and compiled with this crate, not with its caller.
pub trait Load: Sized {
    /// Takes what comes before the settings.
    fn arm<'a>(body: &mut Body<'a>, into: Parts<'_, 'a, Self>) -> Result<(), BlobError>
    where
        Self: Scalar;

    /// Takes the rest.
    fn rest<'a>(
        body: &mut Body<'a>,
        layout: u16,
        settings: &mut Settings<Self>,
        taught: &mut Taught<'a, Self>,
    ) -> Result<(), BlobError>
    where
        Self: Scalar;
}

macro_rules! load_in {
    ($($type:ty),+) => {
        $(impl Load for $type {
            #[inline(never)]
            fn arm<'a>(
                body: &mut Body<'a>,
                into: Parts<'_, 'a, Self>,
            ) -> Result<(), BlobError> {
                arm(body, into)
            }

            #[inline(never)]
            fn rest<'a>(
                body: &mut Body<'a>,
                layout: u16,
                settings: &mut Settings<Self>,
                taught: &mut Taught<'a, Self>,
            ) -> Result<(), BlobError> {
                *settings = body.take()?;
                tables(body, layout, taught)
            }
        })+
    };
}

load_in!(f32, f64);

/// Fills `model` from a body of `layout` that [`super::check::check`] has let pass for N joints.
pub(super) fn load<'a, T: Scalar, const N: usize>(
    bytes: &'a [u8],
    layout: u16,
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    let mut body = Body::new(bytes);
    body.text(NAME)?;
    arm_of(&mut body, model)?;
    T::rest(&mut body, layout, &mut model.settings, &mut model.taught)
}

/// The descriptions take most of the room; it is free again when this returns.
#[inline(never)]
fn arm_of<'a, T: Scalar, const N: usize>(
    body: &mut Body<'a>,
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    // All zeros, which is least to set: nothing looks at them before they are read or baked.
    let joint = Joint {
        axis: Vector3::zeros(),
        ..Joint::new(JointKind::Revolute, Convention::Dh)
    };
    let baked = BakedJoint {
        sincos_theta: [0.0; 2],
        cos_alpha: 0.0,
        ..BakedJoint::identity()
    };
    let parts = Parts {
        nominal: ChainParts::of(&mut model.nominal),
        calibrated: ChainParts::of(&mut model.calibrated),
        effects: &mut model.effects,
        limits: &mut model.limits,
        resolution: &mut model.resolution,
        joints: &mut [joint; N],
        masses: &mut [LinkMass::none(); N],
        baked: &mut [baked; N],
        gauges: &mut [nowhere(); N],
    };
    T::arm(body, parts)
}

/// No pose yet.
fn nowhere() -> Pose<f64> {
    Pose::new(Matrix3::zeros(), Vector3::zeros())
}

/// Both chains, and the effects attached to the calibrated one.
#[inline(never)]
fn arm<'a, T: Scalar + Deserialize<'a>>(
    body: &mut Body<'a>,
    mut into: Parts<'_, 'a, T>,
) -> Result<(), BlobError> {
    let mut arm = Described {
        joints: into.joints,
        masses: into.masses,
        baked: into.baked,
        gauges: into.gauges,
        base: nowhere(),
        tool: nowhere(),
        baked_base: nowhere(),
        baked_tool: nowhere(),
    };
    arm.read(body)?;
    into.nominal.round(&arm);
    let nominal = arm.base.rotation;
    arm.read(body)?;
    into.calibrated.round(&arm);
    body.exactly(into.limits.len())?;
    for limits in into.limits {
        *limits = body.take::<[f64; 2]>()?.map(T::of);
    }
    body.exactly(into.resolution.len())?;
    for resolution in into.resolution {
        *resolution = T::of(body.take()?);
    }
    let gravity = Vector3::from(body.take::<[f64; 3]>()?);
    *into.nominal.gravity = rotated(&nominal, &gravity).map(T::of);
    *into.calibrated.gravity = rotated(&arm.base.rotation, &gravity).map(T::of);
    // From here on the described base as it is seen from the baked one, which effects want.
    arm.base = arm.baked_base.inverse().then(&arm.base);
    into.effects.clear();
    for _ in 0..body.count(MAX_EFFECTS)? {
        let effect = arm.effect(body)?;
        into.effects.push(effect).map_err(|_| BlobError::Body)?;
    }
    Ok(())
}

/// Tables, which stand behind the provenance, each gone before the next is taken.
fn tables<'a, T: Scalar>(
    body: &mut Body<'a>,
    layout: u16,
    into: &mut Taught<'a, T>,
) -> Result<(), BlobError> {
    *into = Taught::default();
    if layout == WITHOUT_TABLES {
        return Ok(());
    }
    body.text(LABEL)?;
    body.text(NAME)?;
    body.text(LABEL)?;
    body.take::<[u32; 2]>()?;
    body.take::<[f64; 2]>()?;
    polynomial(body, into)?;
    cmac(body, into)
}

#[inline(never)]
fn polynomial<'a, T: Scalar>(
    body: &mut Body<'a>,
    into: &mut Taught<'a, T>,
) -> Result<(), BlobError> {
    let polynomial: Option<Polynomial<'a, f64>> = body.take()?;
    into.polynomial = polynomial.as_ref().map(Polynomial::cast);
    Ok(())
}

#[inline(never)]
fn cmac<'a, T: Scalar>(body: &mut Body<'a>, into: &mut Taught<'a, T>) -> Result<(), BlobError> {
    let cmac: Option<Cmac<'a, f64>> = body.take()?;
    into.cmac = cmac.as_ref().map(Cmac::cast);
    Ok(())
}

impl<'m, T: Scalar> ChainParts<'m, T> {
    fn of<const N: usize>(chain: &'m mut BakedChain<T, N>) -> Self {
        Self {
            base: &mut chain.base,
            joints: &mut chain.joints,
            tool: &mut chain.tool,
            gravity: &mut chain.gravity,
        }
    }

    /// Sets all but gravity, rounded once.
    fn round(&mut self, arm: &Described<'_>) {
        for (to, from) in self.joints.iter_mut().zip(arm.baked.iter()) {
            *to = from.cast();
        }
        *self.base = arm.baked_base.cast();
        *self.tool = arm.baked_tool.cast();
    }
}

impl Described<'_> {
    /// Reads a description and bakes it.
    #[inline(never)]
    fn read(&mut self, body: &mut Body<'_>) -> Result<(), BlobError> {
        self.base = Pose::from(&body.take::<StoredPose>()?);
        body.list(self.joints)?;
        body.list(self.masses)?;
        self.tool = Pose::from(&body.take::<StoredPose>()?);
        (self.baked_base, self.baked_tool) = bake(
            &self.base,
            self.joints,
            self.masses,
            &self.tool,
            self.baked,
            self.gauges,
        );
        Ok(())
    }

    /// The next effect, attached to the arm.
    #[inline(never)]
    fn effect<'a, T: Scalar + Deserialize<'a>>(
        &self,
        body: &mut Body<'a>,
    ) -> Result<Effect<'a, T>, BlobError> {
        let mut effect: Effect<'a, T> = body.take()?;
        effect.attach(&Description {
            base: &self.base,
            joints: self.joints,
            gauges: self.gauges,
            tool: &self.tool,
        });
        Ok(effect)
    }
}
