//! A blob sent over the link within one program: a stream that holds one frame at a time.

use core::convert::Infallible;
use core::fmt;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use truepose::link::{Announcement, Ask, CHUNK, Event, Frame, Link, Request, Stage, Tally};
use truepose::params::{LAYOUT, checksum};
use truepose::storage::{Flash, Store};

use crate::arm::JOINTS;
use crate::parameters::{RIGID, ROOM};
use crate::ram::Ram;

/// What the link works on.
#[derive(Debug)]
pub struct Desk {
    /// The controller's end.
    pub link: Link<'static>,
    /// The other end.
    pub line: Line,
    /// Where blobs are kept.
    pub store: Store<Flash<Ram>>,
    /// Where blobs come in.
    pub room: [u8; ROOM],
}

/// The host's end of a stream.
#[derive(Debug)]
pub struct Line {
    frame: Frame,
    taken: usize,
    answered: bool,
}

impl ErrorType for Line {
    type Error = Infallible;
}

impl ReadReady for Line {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.taken < self.frame.bytes().len())
    }
}

impl Read for Line {
    fn read(&mut self, into: &mut [u8]) -> Result<usize, Infallible> {
        let rest = self.frame.bytes().get(self.taken..).unwrap_or_default();
        let length = rest.len().min(into.len());
        for (to, from) in into.iter_mut().zip(rest) {
            *to = *from;
        }
        self.taken += length;
        Ok(length)
    }
}

impl WriteReady for Line {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        // The end of an answer.
        self.answered |= bytes.contains(&0);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl Desk {
    /// Nothing kept, nothing coming.
    pub fn new() -> Result<Self, fmt::Error> {
        let mut room = [0; ROOM];
        let mut store = Store::new(Flash::new(Ram::new())).map_err(|_| fmt::Error)?;
        store.load(&mut room).map_err(|_| fmt::Error)?;
        Ok(Self {
            link: Link::new("PUMA 560", "truepose-firmware", JOINTS as u8),
            line: Line {
                frame: Frame::empty(),
                taken: 0,
                answered: true,
            },
            store,
            room,
        })
    }

    /// One piece of work.
    pub fn poll(&mut self) -> Event {
        let Self {
            link,
            line,
            store,
            room,
        } = self;
        match link.poll(line, store, room, &Tally::default()) {
            Ok(event) => event,
            Err(never) => match never {},
        }
    }

    /// Sends the rigid arm's blob; `poll` calls [`Desk::poll`], for the work of a stage. An error
    /// if it is not kept.
    pub fn send(&mut self, poll: impl Fn(&mut Self, Stage) -> Event) -> fmt::Result {
        const TRANSFER: u32 = 7;
        let announcement = Announcement {
            transfer: TRANSFER,
            length: RIGID.len() as u32,
            crc: checksum(RIGID),
            layout: LAYOUT,
            joints: JOINTS as u8,
            robot: "PUMA 560",
        };
        let mut saved = false;
        let mut offset = 0;
        let chunks = RIGID.chunks(CHUNK).map(|bytes| {
            let chunk = Ask::Chunk {
                transfer: TRANSFER,
                offset,
                bytes,
            };
            offset += bytes.len() as u32;
            chunk
        });
        let asks = [Ask::Identify, Ask::Begin(announcement)]
            .into_iter()
            .chain(chunks)
            .chain([Ask::Commit { transfer: TRANSFER }, Ask::Status]);
        for (number, ask) in (1..).zip(asks) {
            self.line.frame = Frame::of(&Request { number, ask }).ok_or(fmt::Error)?;
            self.line.taken = 0;
            self.line.answered = false;
            while !self.line.answered {
                let stage = self.link.stage();
                saved |= matches!(poll(self, stage), Event::Saved(_));
            }
        }
        if saved { Ok(()) } else { Err(fmt::Error) }
    }
}
