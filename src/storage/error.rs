//! Why parameters could not be kept or found.

use core::fmt;

use crate::params::BlobError;

/// Why parameters could not be kept or found. `E`: of the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StorageError<E> {
    /// The memory failed.
    Memory(E),
    /// The memory cannot be cut into two slots: a page below 16 bytes, a word that does not
    /// divide the page or is longer than [`super::LONGEST_WORD`], or no place for two slots.
    Geometry,
    /// Nobody has looked yet which slot is current: [`super::Store::load`] goes first.
    NotLoaded,
    /// What is to be kept is no blob.
    Blob(BlobError),
    /// The blob is larger than a slot.
    TooLarge {
        /// Bytes of the blob.
        length: usize,
        /// Bytes that a slot holds.
        room: usize,
    },
    /// The room to read the stored blob into is too small.
    RoomTooSmall {
        /// Bytes of the blob.
        length: usize,
    },
    /// The memory does not hold what was written: worn out, or protected from writing.
    NotAsWritten,
    /// The update does not fit this store: begun before another one ended.
    Stale,
}

impl<E: fmt::Debug> fmt::Display for StorageError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Memory(cause) => write!(f, "the memory failed: {cause:?}"),
            Self::Geometry => f.write_str("the memory cannot be cut into two slots"),
            Self::NotLoaded => f.write_str("nobody has looked yet what the memory holds"),
            Self::Blob(cause) => write!(f, "{cause}"),
            Self::TooLarge { length, room } => {
                write!(f, "{length} bytes do not fit into a slot of {room}")
            }
            Self::RoomTooSmall { length } => {
                write!(f, "the stored blob has {length} bytes, more than the room")
            }
            Self::NotAsWritten => f.write_str("the memory does not hold what was written"),
            Self::Stale => f.write_str("another update has ended since this one began"),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for StorageError<E> {}

impl<E> From<BlobError> for StorageError<E> {
    fn from(cause: BlobError) -> Self {
        Self::Blob(cause)
    }
}
