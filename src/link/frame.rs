//! Frames: postcard, CRC-32, COBS, zero.

use core::fmt;

use cobs::{CobsEncoder, DecodeResult, DecoderState};
use heapless::Vec;
use serde::Serialize;

use super::wire::Writer;
use crate::params::checksum;

/// The longest message, bytes.
pub const PAYLOAD: usize = 240;

/// Bytes of a checksum.
const CRC: usize = 4;

/// The longest frame, bytes: COBS adds one byte to less than 255, a zero ends it.
pub const FRAME: usize = PAYLOAD + CRC + 2;

/// A frame that is going out.
#[derive(Clone, Debug)]
pub struct Frame {
    bytes: [u8; FRAME],
    length: usize,
}

impl Frame {
    /// Nothing.
    pub const fn empty() -> Self {
        Self {
            bytes: [0; FRAME],
            length: 0,
        }
    }

    /// The frame of `message`; `None` if it is longer than [`PAYLOAD`].
    pub fn of(message: &impl Serialize) -> Option<Self> {
        let mut payload = [0; PAYLOAD];
        let mut writer = Writer::new(&mut payload);
        message.serialize(&mut writer).ok()?;
        let payload = writer.written();
        let mut frame = Self::empty();
        let mut encoder = CobsEncoder::new(&mut frame.bytes);
        encoder.push(payload).ok()?;
        encoder.push(&checksum(payload).to_le_bytes()).ok()?;
        // What is behind is zero already: the end of the frame.
        frame.length = encoder.finalize() + 1;
        (frame.length <= FRAME).then_some(frame)
    }

    /// Its bytes, with the zero that ends it.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

/// What is wrong with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// Cut, or not what was sent.
    Broken,
    /// Longer than [`FRAME`].
    TooLong,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Broken => "a frame came damaged",
            Self::TooLong => "a frame was too long",
        })
    }
}

impl core::error::Error for FrameError {}

/// Takes frames out of a stream of bytes.
#[derive(Debug)]
pub struct Decoder {
    state: DecoderState,
    payload: Vec<u8, { PAYLOAD + CRC }>,
    too_long: bool,
    /// The payload has been handed out.
    ended: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Before the first byte.
    pub const fn new() -> Self {
        Self {
            state: DecoderState::Idle,
            payload: Vec::new(),
            too_long: false,
            ended: false,
        }
    }

    /// Takes the next byte; if it ends a frame, what the frame holds.
    pub fn feed(&mut self, byte: u8) -> Option<Result<&[u8], FrameError>> {
        if self.ended {
            *self = Self::new();
        }
        match self.state.feed(byte) {
            Ok(DecodeResult::NoData) => None,
            Ok(DecodeResult::DataContinue(data)) => {
                self.too_long |= self.payload.push(data).is_err();
                None
            }
            Ok(DecodeResult::DataComplete) if self.too_long => {
                self.ended = true;
                Some(Err(FrameError::TooLong))
            }
            Ok(DecodeResult::DataComplete) => {
                self.ended = true;
                Some(match self.payload.split_last_chunk::<CRC>() {
                    Some((payload, crc)) if u32::from_le_bytes(*crc) == checksum(payload) => {
                        Ok(payload)
                    }
                    _ => Err(FrameError::Broken),
                })
            }
            Err(_) => {
                self.ended = true;
                Some(Err(FrameError::Broken))
            }
        }
    }
}
