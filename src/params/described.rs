//! The whole of a body, for whoever wants the descriptions too.

use heapless::{String, Vec};
use serde::Deserialize;

use super::baked::{Baked, joint_numbers, pose_numbers};
use super::body::Body;
use super::check::{check, number};
use super::{Blob, BlobError, Description, MAX_JOINTS, NAME, Provenance};
use crate::effects::Effect;
use crate::model::MAX_EFFECTS;

/// How far what is baked may be from what the description bakes to, of 1 and of itself.
const SAME: f64 = 1e-9;

/// What a controller does not look at.
#[derive(Deserialize)]
struct Described {
    provenance: Provenance,
    nominal: Description,
    calibrated: Description,
    gravity: [f64; 3],
}

/// Reads a body for `joints` joints and checks all of it: the descriptions first, which say best
/// what is wrong, then what a controller checks, then that both say the same.
pub(super) fn read(bytes: &[u8], joints: usize) -> Result<Blob<'_>, BlobError> {
    let mut body = Body::new(bytes);
    let robot: String<NAME> = body.take()?;
    skip_chain(&mut body)?;
    skip_chain(&mut body)?;
    let (limits, resolution) = (body.take()?, body.take()?);
    let mut effects = Vec::new();
    for _ in 0..body.count(MAX_EFFECTS)? {
        // Unattached: what it is attached to stands in the description.
        let effect: Effect<'_, f64> = body.take()?;
        effects.push(effect).map_err(|_| BlobError::Body)?;
        let mut attached = effect;
        body.fill(attached.fixed_mut());
    }
    let (settings, taught) = (body.take()?, body.take()?);
    let described = described(body.described()?, joints)?;
    check(bytes, joints)?;
    let blob = Blob {
        robot,
        nominal: described.nominal,
        calibrated: described.calibrated,
        limits,
        resolution,
        gravity: described.gravity,
        effects,
        settings,
        provenance: described.provenance,
        taught,
    };
    compare(bytes, &blob)?;
    Ok(blob)
}

fn skip_chain(body: &mut Body<'_>) -> Result<(), BlobError> {
    body.pose::<f64>();
    for _ in 0..body.count(MAX_JOINTS)? {
        body.joint::<f64>();
    }
    body.pose::<f64>();
    body.fill(&mut [0.0_f64; 3]);
    Ok(())
}

/// What a controller does not look at, checked by itself.
fn described(bytes: &[u8], joints: usize) -> Result<Described, BlobError> {
    let mut body = Body::new(bytes);
    let described: Described = body.take()?;
    let bytes = body.rest();
    if bytes != 0 {
        return Err(BlobError::Trailing { bytes });
    }
    let Described {
        nominal,
        calibrated,
        ..
    } = &described;
    for description in [nominal, calibrated] {
        for found in [description.joints.len(), description.masses.len()] {
            if found != joints {
                let expected = joints;
                return Err(BlobError::Joints { found, expected });
            }
        }
    }
    if body.unsound() {
        return Err(BlobError::Number);
    }
    for description in [nominal, calibrated] {
        for (j, one) in description.joints.iter().enumerate() {
            if (one.axis.norm_squared() - 1.0).abs() > 1e-6 {
                return Err(BlobError::Axis { joint: number(j) });
            }
        }
        for (j, link) in description.masses.iter().enumerate() {
            if link.mass < 0.0 {
                return Err(BlobError::Mass { joint: number(j) });
            }
        }
    }
    let mut pairs = nominal.joints.iter().zip(&calibrated.joints);
    match pairs.position(|(one, other)| one.kind != other.kind) {
        None => Ok(described),
        Some(j) => Err(BlobError::Kind { joint: number(j) }),
    }
}

/// Refuses what is baked where it is not what the descriptions bake to.
fn compare(bytes: &[u8], blob: &Blob<'_>) -> Result<(), BlobError> {
    let mut body = Body::new(bytes);
    body.text(NAME)?;
    let calibrated = Baked::of(&blob.calibrated, blob.gravity);
    compare_chain(&mut body, &Baked::of(&blob.nominal, blob.gravity))?;
    compare_chain(&mut body, &calibrated)?;
    for _ in 0..body.count(MAX_JOINTS)? {
        body.fill(&mut [0.0_f64; 2]);
    }
    for _ in 0..body.count(MAX_JOINTS)? {
        body.number();
    }
    body.count(MAX_EFFECTS)?;
    for k in 0..blob.effects.len() {
        let mut effect: Effect<'_, f64> = body.take()?;
        calibrated.attach(&mut effect);
        let refusal = BlobError::Effect { effect: number(k) };
        compare_numbers(&mut body, effect.fixed_mut(), refusal)?;
    }
    Ok(())
}

fn compare_chain(body: &mut Body<'_>, chain: &Baked<'_>) -> Result<(), BlobError> {
    let ends = BlobError::Baked { joint: 0 };
    compare_numbers(body, &pose_numbers(&chain.base), ends)?;
    body.exactly(chain.joints().len())?;
    for (j, joint) in chain.joints().iter().enumerate() {
        let refusal = BlobError::Baked { joint: number(j) };
        let stored = body.joint::<f64>();
        let (numbers, wanted) = (joint_numbers(&stored), joint_numbers(joint));
        let mut pairs = numbers.into_iter().zip(wanted);
        if stored.kind != joint.kind || !pairs.all(|(stored, baked)| is_same(stored, baked)) {
            return Err(refusal);
        }
    }
    compare_numbers(body, &pose_numbers(&chain.tool), ends)?;
    compare_numbers(body, &chain.gravity, ends)
}

fn compare_numbers(
    body: &mut Body<'_>,
    baked: &[f64],
    refusal: BlobError,
) -> Result<(), BlobError> {
    for &baked in baked {
        if !is_same(body.number(), baked) {
            return Err(refusal);
        }
    }
    Ok(())
}

fn is_same(stored: f64, baked: f64) -> bool {
    (stored - baked).abs() <= SAME * (1.0 + baked.abs())
}
