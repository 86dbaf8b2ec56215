//! The host's end of the link to a controller; `docs/LINK.md` is its standard.

mod client;
mod port;
mod transfer;

use std::fmt;
use std::io;
use std::time::Duration;

use truepose::link::{PROTOCOL, Refusal};

pub use client::{Client, Controller};
pub use port::Port;
pub use transfer::{Sent, send};

/// Why nothing could be said or heard.
#[derive(Debug)]
pub enum LinkError {
    /// The port cannot be opened.
    Open(io::Error),
    /// Reading or writing failed.
    Stream(io::Error),
    /// No answer, whatever was tried.
    Silent {
        /// How often it was asked.
        tries: u32,
        /// How long was waited each time.
        patience: Duration,
    },
    /// The other end speaks another version of the link.
    Protocol {
        /// Which.
        found: u8,
    },
    /// An answer that does not belong to the request.
    Unexpected {
        /// To what.
        request: &'static str,
    },
    /// Something so simple was refused that nothing else makes sense.
    Refused(Refusal),
    /// The answer to the last step was lost: the parameters may be kept or not.
    Unsure,
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open(cause) => write!(f, "cannot be opened: {cause}"),
            Self::Stream(cause) => write!(f, "the connection broke: {cause}"),
            Self::Silent { tries, patience } => write!(
                f,
                "no answer to {tries} requests of {:.1} s each; is a truepose controller there, \
                 and the speed right?",
                patience.as_secs_f64()
            ),
            Self::Protocol { found } => write!(
                f,
                "the controller speaks version {found} of the link, this is version {PROTOCOL}"
            ),
            Self::Unexpected { request } => {
                write!(f, "an answer that does not belong to '{request}'")
            }
            Self::Refused(refusal) => write!(f, "the controller refused: {refusal}"),
            Self::Unsure => f.write_str(
                "the answer to the last step was lost: the parameters may be kept or not; \
                 'truepose monitor' shows which are in use, or send them again",
            ),
        }
    }
}

impl std::error::Error for LinkError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Open(cause) | Self::Stream(cause) => Some(cause),
            _ => None,
        }
    }
}
