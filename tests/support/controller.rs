//! A controller at the other end of a wire, without its loop.

use std::collections::VecDeque;
use std::convert::Infallible;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use serde::Serialize;
use truepose::link::{Answer, Ask, Decoder, Event, Frame, Link, Reply, Request, Tally};
use truepose::storage::{Flash, Store};

use crate::memories::Chip;

/// A wire that never blocks and notices who would have.
#[derive(Debug, Default)]
pub(crate) struct Wire {
    pub(crate) coming: VecDeque<u8>,
    pub(crate) going: Vec<u8>,
    /// Bytes read or written since it was last asked.
    pub(crate) moved: usize,
    /// Takes nothing for so many questions.
    pub(crate) full: usize,
}

impl ErrorType for Wire {
    type Error = Infallible;
}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        assert!(!self.coming.is_empty(), "would wait for a byte");
        let count = bytes.len().min(self.coming.len());
        for (to, from) in bytes.iter_mut().zip(self.coming.drain(..count)) {
            *to = from;
        }
        self.moved += count;
        Ok(count)
    }
}

impl ReadReady for Wire {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.coming.is_empty())
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        assert!(self.full == 0, "would wait for room");
        // A UART takes what its buffer has room for.
        let count = bytes.len().min(7);
        self.going.extend_from_slice(&bytes[..count]);
        self.moved += count;
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        panic!("would wait")
    }
}

impl WriteReady for Wire {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        let ready = self.full == 0;
        self.full = self.full.saturating_sub(1);
        Ok(ready)
    }
}

pub(crate) type Memory = Chip<4, 512>;

/// Calls that find nothing to do, after which nothing will come.
const QUIET: usize = 60;

/// Bytes of a slot.
pub(crate) const SLOT: usize = 4096;

/// A controller.
pub(crate) struct Controller {
    pub(crate) wire: Wire,
    pub(crate) link: Link<'static>,
    pub(crate) chip: Memory,
    pub(crate) store: Store<Flash<Memory>>,
    pub(crate) room: Vec<u8>,
    pub(crate) tally: Tally,
    pub(crate) saved: Vec<Vec<u8>>,
    number: u16,
}

impl Controller {
    pub(crate) fn new(robot: &'static str, joints: u8) -> Self {
        let chip = Memory::new(2 * SLOT);
        let mut store = Store::new(Flash::new(chip.clone())).unwrap();
        let mut room = vec![0; SLOT];
        assert_eq!(store.load(&mut room), Ok(None));
        Self {
            wire: Wire::default(),
            link: Link::new(robot, "tests", joints),
            store,
            chip,
            room,
            tally: Tally::default(),
            saved: Vec::new(),
            number: 0,
        }
    }

    /// One call of `poll`, held to its promises.
    pub(crate) fn poll(&mut self) -> Event {
        self.wire.moved = 0;
        let changed = self.chip.0.borrow().changed;
        let event = self
            .link
            .poll(&mut self.wire, &mut self.store, &mut self.room, &self.tally)
            .unwrap();
        assert!(self.wire.moved <= 64);
        assert!(self.chip.0.borrow().changed - changed <= 512);
        if let Event::Saved(active) = event {
            self.saved
                .push(self.room[..active.length as usize].to_vec());
            self.link.put_to_use(active);
        }
        event
    }

    /// Polls until nothing is left to do.
    pub(crate) fn settle(&mut self) {
        let mut idle = 0;
        for _ in 0..1_000_000 {
            idle = if self.poll() == Event::Idle {
                idle + 1
            } else {
                0
            };
            if idle > QUIET {
                return;
            }
        }
        panic!("never at rest");
    }

    /// The answers that have come, each with its number.
    pub(crate) fn answers(&mut self) -> Vec<(u16, Reply<'static>)> {
        self.settle();
        let mut decoder = Decoder::new();
        let mut answers = Vec::new();
        for byte in self.wire.going.drain(..) {
            if let Some(frame) = decoder.feed(byte) {
                let payload: &'static [u8] = frame.unwrap().to_vec().leak();
                let answer: Answer<'static> = postcard::from_bytes(payload).unwrap();
                answers.push((answer.number, answer.reply));
            }
        }
        answers
    }

    /// Asks and hears the one answer.
    pub(crate) fn ask(&mut self, ask: Ask<'_>) -> Reply<'static> {
        self.number = self.number % u16::MAX + 1;
        let number = self.number;
        self.wire.coming.extend(frame(&Request { number, ask }));
        let answers = self.answers();
        assert_eq!(answers.len(), 1, "{answers:?}");
        assert_eq!(answers[0].0, number);
        answers[0].1
    }

    /// What a start would find.
    pub(crate) fn stored(&self) -> Option<Vec<u8>> {
        let mut room = vec![0; SLOT];
        let mut store = Store::new(Flash::new(self.chip.clone())).unwrap();
        let stored = store.load(&mut room).unwrap()?;
        Some(room[..stored.length].to_vec())
    }
}

/// The bytes of a frame.
pub(crate) fn frame(message: &impl Serialize) -> Vec<u8> {
    Frame::of(message).unwrap().bytes().to_vec()
}
