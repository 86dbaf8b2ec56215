//! What is said over the link. Every type is encoded by postcard as `docs/LINK.md` draws it.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::Tally;
use crate::params::BlobError;

/// The version of the link that is spoken here.
pub const PROTOCOL: u8 = 1;

/// Bytes of the blob that a chunk carries at most.
pub const CHUNK: usize = 192;

/// From the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request<'a> {
    /// Comes back with the answer; not 0.
    pub number: u16,
    /// What is asked.
    #[serde(borrow)]
    pub ask: Ask<'a>,
}

/// What the host can ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Ask<'a> {
    /// Who is there?
    Identify,
    /// A blob is going to come. Ends a transfer that was not committed.
    Begin(#[serde(borrow)] Announcement<'a>),
    /// The next bytes of the blob.
    Chunk {
        /// Of its announcement.
        transfer: u32,
        /// Where in the blob they stand.
        offset: u32,
        /// At least 1, at most [`CHUNK`].
        bytes: &'a [u8],
    },
    /// Check what came, keep it, make it current.
    Commit {
        /// Of its announcement.
        transfer: u32,
    },
    /// How is the loop?
    Status,
}

/// What is going to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Announcement<'a> {
    /// A number that the host makes up, so that chunks of another transfer are known.
    pub transfer: u32,
    /// Bytes of the blob.
    pub length: u32,
    /// Its checksum, as [`crate::params::checksum`] has it.
    pub crc: u32,
    /// Its layout.
    pub layout: u16,
    /// Its number of joints.
    pub joints: u8,
    /// Its robot.
    pub robot: &'a str,
}

/// From the controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer<'a> {
    /// That of the request; 0 if it could not be read.
    pub number: u16,
    /// What is answered.
    #[serde(borrow)]
    pub reply: Reply<'a>,
}

/// What the controller answers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply<'a> {
    /// To identify.
    Identity(#[serde(borrow)] Identity<'a>),
    /// To begin and chunk: so many bytes of the blob are there.
    Accepted {
        /// Bytes.
        received: u32,
    },
    /// To commit: the blob is kept and will be found at the next start.
    Committed(Active),
    /// To status.
    Status(Report),
    /// No, and nothing has changed for the loop.
    Refused(Refusal),
}

/// Who is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity<'a> {
    /// [`PROTOCOL`].
    pub protocol: u8,
    /// The newest blob layout that it reads.
    pub layout: u16,
    /// Joints that it is built for.
    pub joints: u8,
    /// The largest blob that it can take, bytes.
    pub room: u32,
    /// The robot whose parameters it takes.
    pub robot: &'a str,
    /// What runs on it, in its maker's words.
    pub firmware: &'a str,
    /// The parameters in use.
    pub active: Option<Active>,
}

/// A blob, by what tells it from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Active {
    /// Bytes.
    pub length: u32,
    /// Checksum, as [`crate::params::checksum`] has it.
    pub crc: u32,
    /// Number of the update that brought it, 0 if it came with the firmware.
    pub sequence: u32,
}

/// How the controller is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// The parameters in use.
    pub active: Option<Active>,
    /// How far a transfer is.
    pub stage: Stage,
    /// What the loop did since they came into use.
    pub tally: Tally,
}

/// How far a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// None is under way.
    Idle,
    /// Chunks are coming.
    Receiving {
        /// Bytes that are there.
        received: u32,
        /// Bytes announced.
        length: u32,
    },
    /// The blob is there and will be checked in the next call: the longest piece of work, see
    /// `poll_that_checks` in `docs/COST.md`.
    Checking,
    /// The blob is being kept.
    Saving,
}

/// Why a request was refused. The parameters in use stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// A frame came damaged.
    Broken,
    /// A frame is longer than any can be.
    TooLong,
    /// A whole frame that says nothing known here.
    NotUnderstood,
    /// For another robot.
    Robot,
    /// For an arm with another number of joints.
    Joints {
        /// That of this one.
        expected: u8,
    },
    /// In a blob layout that is not read here.
    Layout {
        /// The newest that is.
        expected: u16,
    },
    /// No blob, or one that is too large.
    Size {
        /// The largest that fits, bytes.
        room: u32,
    },
    /// That transfer was not begun, or has ended.
    NotBegun,
    /// Not the next bytes: repeated, reordered, or one before was lost.
    OutOfOrder {
        /// The offset of the next.
        expected: u32,
    },
    /// A chunk of no bytes, or beyond the end that was announced.
    ChunkSize,
    /// Committed before all was there.
    Incomplete {
        /// Bytes that are.
        received: u32,
    },
    /// What came is not what was announced.
    Checksum,
    /// What came is no sound blob.
    Blob(BlobError),
    /// A blob is being checked or kept.
    Busy,
    /// It cannot be kept.
    Storage(Fault),
}

/// Why a blob could not be kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// The memory failed.
    Memory,
    /// The memory does not hold what was written: worn out, or protected.
    NotAsWritten,
    /// Another update came in between.
    Interrupted,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Broken => f.write_str("a frame came damaged"),
            Self::TooLong => f.write_str("a frame was too long"),
            Self::NotUnderstood => f.write_str("a request was not understood"),
            Self::Robot => f.write_str("the parameters are for another robot"),
            Self::Joints { expected } => write!(
                f,
                "the parameters are for another number of joints: it has {expected}"
            ),
            Self::Layout { expected } => write!(
                f,
                "the parameters are in a layout that it does not read: the newest it reads is {expected}"
            ),
            Self::Size { room } => write!(f, "the parameters do not fit into {room} bytes"),
            Self::NotBegun => f.write_str("the transfer was not begun or has ended"),
            Self::OutOfOrder { expected } => write!(
                f,
                "a piece was repeated, lost or out of order: byte {expected} is next"
            ),
            Self::ChunkSize => f.write_str("a piece is empty or goes beyond the end"),
            Self::Incomplete { received } => {
                write!(f, "only {received} bytes have come")
            }
            Self::Checksum => f.write_str("what came is not what was announced"),
            Self::Blob(cause) => write!(f, "{cause}"),
            Self::Busy => f.write_str("other parameters are being kept"),
            Self::Storage(Fault::Memory) => f.write_str("its memory failed"),
            Self::Storage(Fault::NotAsWritten) => {
                f.write_str("its memory does not hold what was written")
            }
            Self::Storage(Fault::Interrupted) => f.write_str("another update came in between"),
        }
    }
}

impl core::error::Error for Refusal {}
