//! A body, written piece by piece.

use serde::Serialize;

use super::baked::{Baked, joint_numbers, pose_numbers};
use super::{Blob, BlobError};
use crate::Scalar;

/// What is written so far.
struct Writer<'b> {
    buffer: &'b mut [u8],
    used: usize,
}

impl Writer<'_> {
    /// The next piece.
    fn put<V: Serialize>(&mut self, piece: &V) -> Result<(), BlobError> {
        self.used += self.try_on(piece)?;
        Ok(())
    }

    /// Writes the next piece, to be overwritten. Returns its length.
    fn try_on<V: Serialize>(&mut self, piece: &V) -> Result<usize, BlobError> {
        let rest = self.buffer.get_mut(self.used..);
        let piece = postcard::to_slice(piece, rest.ok_or(BlobError::BufferTooSmall)?);
        Ok(piece.map_err(|_| BlobError::BufferTooSmall)?.len())
    }

    fn chain(&mut self, chain: &Baked<'_>) -> Result<(), BlobError> {
        self.put(&pose_numbers(&chain.base))?;
        self.put(&chain.joints().len())?;
        for joint in chain.joints() {
            self.put(&(joint.kind, joint_numbers(joint)))?;
        }
        self.put(&pose_numbers(&chain.tool))?;
        self.put(&chain.gravity)
    }
}

/// Writes the body of `blob` and returns its length.
pub(super) fn write(blob: &Blob<'_>, buffer: &mut [u8]) -> Result<usize, BlobError> {
    let mut body = Writer { buffer, used: 0 };
    body.put(&blob.robot)?;
    let calibrated = Baked::of(&blob.calibrated, blob.gravity);
    body.chain(&Baked::of(&blob.nominal, blob.gravity))?;
    body.chain(&calibrated)?;
    body.put(&blob.limits)?;
    body.put(&blob.resolution)?;
    body.put(&blob.effects.len())?;
    for effect in &blob.effects {
        let mut effect = *effect;
        calibrated.attach(&mut effect);
        body.put(&effect)?;
        for number in effect.fixed_mut() {
            body.put(&number.widen())?;
        }
    }
    body.put(&blob.settings)?;
    body.put(&blob.taught)?;
    let described = (
        &blob.provenance,
        &blob.nominal,
        &blob.calibrated,
        &blob.gravity,
    );
    // Its length stands in front of it.
    let length = body.try_on(&described)?;
    body.put(&length)?;
    body.put(&described)?;
    Ok(body.used)
}
