//! The body of a blob, read piece by piece: nothing of it is kept but what the caller keeps.

use postcard::Deserializer;
use postcard::de_flavors::Slice;
use serde::Deserialize;

use super::BlobError;

/// A place in the body. Pieces are taken in the order of the layout.
pub(super) struct Body<'a>(Deserializer<'a, Slice<'a>>);

impl<'a> Body<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(Deserializer::from_bytes(bytes))
    }

    /// The next piece. Once in the program for each type, whoever takes it.
    #[inline(never)]
    pub(super) fn take<V: Deserialize<'a>>(&mut self) -> Result<V, BlobError> {
        V::deserialize(&mut self.0).map_err(|_| BlobError::Body)
    }

    /// A string of at most `room` bytes.
    pub(super) fn text(&mut self, room: usize) -> Result<&'a str, BlobError> {
        let text: &str = self.take()?;
        if text.len() > room {
            return Err(BlobError::Body);
        }
        Ok(text)
    }

    /// Length of the list whose items come next, at most `room`.
    pub(super) fn count(&mut self, room: usize) -> Result<usize, BlobError> {
        let count: u32 = self.take()?;
        usize::try_from(count)
            .ok()
            .filter(|&count| count <= room)
            .ok_or(BlobError::Body)
    }

    /// A list of as many items as there are places.
    pub(super) fn list<V: Deserialize<'a>>(&mut self, places: &mut [V]) -> Result<(), BlobError> {
        let expected = places.len();
        let found = self.count(expected)?;
        if found != expected {
            return Err(BlobError::Joints { found, expected });
        }
        for place in places {
            *place = self.take()?;
        }
        Ok(())
    }

    /// Bytes that are left over.
    pub(super) fn rest(self) -> Result<usize, BlobError> {
        Ok(self.0.finalize().map_err(|_| BlobError::Body)?.len())
    }
}
