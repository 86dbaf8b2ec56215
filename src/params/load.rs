//! From the bytes of a body to the model of the loop: every number is rounded once, straight into
//! its place.

use heapless::Vec;
use nalgebra::Vector3;
use serde::Deserialize;

use super::body::Body;
use super::{BlobError, NAME};
use crate::chain::BakedJoint;
use crate::effects::Effect;
use crate::model::{BakedChain, MAX_EFFECTS, Model};
use crate::taught::Taught;
use crate::{Pose, Scalar, Settings};

/// Where the parts of a model go; every slice has one place a joint.
#[derive(Debug)]
pub struct Parts<'m, 'a, T: Scalar> {
    chains: [ChainParts<'m, T>; 2],
    limits: &'m mut [[T; 2]],
    resolution: &'m mut [T],
    effects: &'m mut Vec<Effect<'a, T>, MAX_EFFECTS>,
    settings: &'m mut Settings<T>,
    taught: &'m mut Taught<'a, T>,
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
    /// The next real number, rounded once.
    fn taken(body: &mut Body<'_>) -> Self;

    /// Takes all that a controller needs but the robot's name.
    fn load<'a>(body: &mut Body<'a>, into: Parts<'_, 'a, Self>) -> Result<(), BlobError>
    where
        Self: Scalar;
}

macro_rules! load_in {
    ($($type:ty: $real:ident),+) => {
        $(impl Load for $type {
            #[inline]
            fn taken(body: &mut Body<'_>) -> Self {
                body.$real()
            }

            #[inline(never)]
            fn load<'a>(
                body: &mut Body<'a>,
                into: Parts<'_, 'a, Self>,
            ) -> Result<(), BlobError> {
                parts(body, into)
            }
        })+
    };
}

load_in!(f32: rounded, f64: number);

/// Fills `model` from a body that [`super::check::check`] has let pass for N joints.
pub(super) fn load<'a, T: Scalar, const N: usize>(
    bytes: &'a [u8],
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    let mut body = Body::new(bytes);
    body.text(NAME)?;
    let parts = Parts {
        chains: [
            ChainParts::of(&mut model.nominal),
            ChainParts::of(&mut model.calibrated),
        ],
        limits: &mut model.limits,
        resolution: &mut model.resolution,
        effects: &mut model.effects,
        settings: &mut model.settings,
        taught: &mut model.taught,
    };
    T::load(&mut body, parts)
}

fn parts<'a, T: Scalar + Deserialize<'a>>(
    body: &mut Body<'a>,
    into: Parts<'_, 'a, T>,
) -> Result<(), BlobError> {
    for chain in into.chains {
        *chain.base = body.pose();
        body.exactly(chain.joints.len())?;
        for joint in chain.joints {
            *joint = body.joint();
        }
        *chain.tool = body.pose();
        body.fill(chain.gravity.as_mut_slice());
    }
    body.exactly(into.limits.len())?;
    body.fill(into.limits.as_flattened_mut());
    body.exactly(into.resolution.len())?;
    body.fill(into.resolution);
    into.effects.clear();
    for _ in 0..body.count(MAX_EFFECTS)? {
        let effect = body.effect()?;
        into.effects.push(effect).map_err(|_| BlobError::Body)?;
    }
    *into.settings = body.take()?;
    into.taught.polynomial = body.take()?;
    into.taught.cmac = body.take()?;
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
}
