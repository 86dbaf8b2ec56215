//! Parameters that survive the power: two slots, of which one is current.
//!
//! A new blob goes to the other slot, piece by piece; what the memory then holds is read back
//! and its checksum compared; one small write of a record makes it current. Cut the power at
//! any byte of any write or erase, and [`Store::load`] finds the old blob or the new one.
//!
//! ```text
//! slot    +--------+--------+----------------------+
//!         | record | record | blob                 |
//!         +--------+--------+----------------------+
//!         page 0   page 1   page 2 ..
//!
//! record  0          4        8            12            16
//!         +----------+--------+------------+-------------+
//!         | sequence | length | CRC (blob) | CRC (0..12) |    u32 each, little-endian
//!         +----------+--------+------------+-------------+
//! ```
//!
//! The slot with the newer sequence is current; the comparison wraps around, so the counter
//! may overflow. The second record is a copy of the first, written after it: a word that was
//! being written when the power went may read now so, now so, and a slot may only be counted
//! on once a record stands in it that was written in peace. Before the other slot is erased,
//! the current one gets its copy if it lacks it.
//!
//! Wear: an update erases or overwrites one slot, once; slots take turns. So a memory that
//! stands E erases takes 2 E updates: 20 000 with 10 000 erases (flash), 2 000 000 with
//! 1 000 000 write cycles (EEPROM). [`Stored::sequence`] counts them.
//!
//! Not covered: two cuts that both hit the records of the same slot, the first leaving a word
//! that reads now so, now so, in a flash whose words cannot be written again.

mod eeprom;
mod either;
mod error;
mod flash;
mod record;
mod slots;
mod update;

use core::fmt::Debug;

pub use eeprom::{Eeprom, EepromError, Geometry};
pub use either::Either;
pub use error::StorageError;
pub use flash::Flash;
pub use slots::{Store, Stored};
pub use update::{Progress, Update};

/// The longest [`Memory::word`], bytes.
pub const LONGEST_WORD: usize = 256;

/// A memory that keeps its contents, as two slots need it: [`Flash`] or [`Eeprom`], or [`Either`]. Addresses
/// count from 0 in bytes.
pub trait Memory {
    /// What can go wrong.
    type Error: Debug;

    /// Whether a word has to be erased before it is written again.
    fn write_once(&self) -> bool;

    /// Bytes there are.
    fn size(&self) -> usize;

    /// Reads and writes begin and end on a multiple of this; at most [`LONGEST_WORD`], and a
    /// divisor of [`Memory::page`].
    fn word(&self) -> usize;

    /// A write holds at most this and does not cross a multiple of it; a cut in it leaves any
    /// contents in the words (flash) or the page (EEPROM) that it was for.
    fn page(&self) -> usize;

    /// An erase takes this much; a multiple of [`Memory::page`].
    fn block(&self) -> usize;

    /// Whether the next call would not wait for the last one to end.
    fn ready(&mut self) -> Result<bool, Self::Error>;

    /// Waits until [`Memory::ready`].
    fn wait(&mut self) -> Result<(), Self::Error>;

    /// Reads from `address` on.
    fn read(&mut self, address: usize, bytes: &mut [u8]) -> Result<(), Self::Error>;

    /// Writes within one page.
    fn write(&mut self, address: usize, bytes: &[u8]) -> Result<(), Self::Error>;

    /// Prepares the block that begins at `address` for new contents.
    fn erase(&mut self, address: usize) -> Result<(), Self::Error>;
}
