//! Why a blob is refused.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Why a blob was refused, read or written. Joints and effects count from 1. Over the link a
/// variant goes by its position: append, never reorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BlobError {
    /// Not even a header.
    TooShort {
        /// Bytes there are.
        bytes: usize,
    },
    /// Does not begin as a blob does.
    Magic,
    /// Written by a newer version than this.
    LayoutNewer {
        /// Its layout.
        found: u16,
    },
    /// Written in a layout that is no longer read.
    LayoutOlder {
        /// Its layout.
        found: u16,
    },
    /// The header's reserved byte is in use.
    Reserved,
    /// Truncated, or something follows.
    Length {
        /// Bytes after the header.
        found: usize,
        /// Bytes that the header promises.
        expected: u32,
    },
    /// The body is not what was written.
    Checksum,
    /// For an arm with another number of joints, or the body disagrees with itself.
    Joints {
        /// Joints there are.
        found: usize,
        /// Joints there should be.
        expected: usize,
    },
    /// The body is not what the layout says, or (writing) has no stored form.
    Body,
    /// The body goes on after its end.
    Trailing {
        /// Bytes too many.
        bytes: usize,
    },
    /// A number is NaN, infinite or beyond [`super::LARGEST`].
    Number,
    /// Nominal and calibrated joint are not of the same kind.
    Kind {
        /// Which.
        joint: u8,
    },
    /// A joint's axis is not a unit vector.
    Axis {
        /// Which.
        joint: u8,
    },
    /// A link's mass is negative.
    Mass {
        /// Which.
        joint: u8,
    },
    /// Limits reversed, or beyond [`super::UNLIMITED`].
    Limits {
        /// Of which joint.
        joint: u8,
    },
    /// A joint's resolution is negative.
    Resolution {
        /// Which.
        joint: u8,
    },
    /// An effect is not sound, or acts on a joint that the arm does not have.
    Effect {
        /// Which effect.
        effect: u8,
    },
    /// Settings that no compensator can work with, see [`crate::Settings::sound`].
    Settings,
    /// Tables of corrections are not of the size that they say, hold something that is no
    /// number, or are for another number of joints.
    Taught,
    /// The settings name a method whose tables are not there.
    NotTaught,
    /// Writing: the buffer is too small.
    BufferTooSmall,
    /// What is baked is not sound, or not what the description bakes to.
    Baked {
        /// Of which joint; 0 of base, tool or gravity.
        joint: u8,
    },
}

impl fmt::Display for BlobError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { bytes } => write!(f, "{bytes} bytes are too few for a blob"),
            Self::Magic => f.write_str("not a truepose blob"),
            Self::LayoutNewer { found } => write!(
                f,
                "blob layout {found} is newer than the {} that this version reads",
                super::LAYOUT
            ),
            Self::LayoutOlder { found } => {
                write!(f, "blob layout {found} is no longer read: write it again")
            }
            Self::Reserved => f.write_str("the header's reserved byte is not zero"),
            Self::Length { found, expected } => {
                write!(f, "{found} bytes follow the header, which says {expected}")
            }
            Self::Checksum => f.write_str("the checksum is wrong: the blob has been altered"),
            Self::Joints { found, expected } => {
                write!(f, "{found} joints where there should be {expected}")
            }
            Self::Body => f.write_str("the body does not follow the layout"),
            Self::Trailing { bytes } => write!(f, "{bytes} bytes follow the end of the body"),
            Self::Number => f.write_str("a number is NaN, infinite or absurdly large"),
            Self::Kind { joint } => write!(
                f,
                "joint {joint} is revolute in one description, prismatic in the other"
            ),
            Self::Axis { joint } => write!(f, "the axis of joint {joint} is not a unit vector"),
            Self::Mass { joint } => write!(f, "the mass of link {joint} is negative"),
            Self::Limits { joint } => {
                write!(f, "the limits of joint {joint} are reversed or too wide")
            }
            Self::Resolution { joint } => {
                write!(f, "the resolution of joint {joint} is negative")
            }
            Self::Effect { effect } => {
                write!(
                    f,
                    "effect {effect} is not sound, or acts on a joint that is not there"
                )
            }
            Self::Settings => f.write_str("the settings are outside their ranges"),
            Self::Taught => f.write_str("the taught corrections are not sound"),
            Self::NotTaught => f.write_str("the settings name a method that was not taught"),
            Self::Baked { joint: 0 } => {
                f.write_str("base, tool or gravity as baked are not sound or not as described")
            }
            Self::Baked { joint } => {
                write!(f, "joint {joint} as baked is not sound or not as described")
            }
            Self::BufferTooSmall => f.write_str("the blob does not fit into the buffer"),
        }
    }
}

impl core::error::Error for BlobError {}
