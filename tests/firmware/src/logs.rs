//! What a controller meets, logged with defmt.

use core::convert::Infallible;
use core::fmt;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request as Wanted};
use truepose::link::{
    Announcement, Answer, Ask, CHUNK, Decoder, Event, FRAME, Frame, Link, Reply, Request, Tally,
};
use truepose::params::{OLDEST_LAYOUT, checksum, decode_into};
use truepose::storage::{Flash, Store};
use truepose::{Model, params};

use crate::arm::{CLEAR_OF_SINGULAR, JOINTS};
use crate::parameters::{RIGID, ROOM};
use crate::ram::Ram;

/// The robot that the controller is on.
const ROBOT: &str = "PUMA 560";

/// Runs it. The console stays unused: the frames have its stream to themselves.
pub fn run(_: &mut dyn fmt::Write) -> fmt::Result {
    let mut model = Model::empty();
    decode_into(RIGID, &mut model).map_err(|_| fmt::Error)?;
    defmt::info!("parameters in use, {=usize} bytes", RIGID.len());
    outcomes(&model);
    blobs();
    memory()?;
    link()
}

fn outcomes(model: &Model<'_, f32, JOINTS>) {
    let mut compensator = Compensator::new(model);
    let mut answer = |q| compensator.correct(&Wanted::joints(q), &mut Budget::unlimited());
    defmt::info!("{}", answer(CLEAR_OF_SINGULAR));
    defmt::warn!("{}", answer([f32::NAN; JOINTS]).status);
}

fn blobs() {
    let mut broken = [0; ROOM];
    for (to, from) in broken.iter_mut().zip(RIGID) {
        *to = *from;
    }
    let refusal = |bytes: &[u8]| params::decode::<f32, JOINTS>(bytes).err();
    defmt::error!("{}", refusal(&RIGID[..3]));
    if let Some(byte) = broken.get_mut(100) {
        *byte ^= 1;
    }
    defmt::error!("{}", refusal(&broken[..RIGID.len()]));
}

fn memory() -> fmt::Result {
    let mut room = [0; ROOM];
    let mut store = Store::new(Flash::new(Ram::new())).map_err(|_| fmt::Error)?;
    defmt::error!("{}", store.save(RIGID).err());
    defmt::info!("{}", store.load(&mut room).ok());
    defmt::info!("{}", store.save(RIGID).ok());
    defmt::info!("{}", store.load(&mut room).ok());
    defmt::error!("{}", store.load(&mut room[..8]).err());
    Ok(())
}

/// A stream that brings one frame and takes the answer.
struct Wire {
    coming: Frame,
    read: usize,
    going: [u8; FRAME],
    written: usize,
}

impl ErrorType for Wire {
    type Error = Infallible;
}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let rest = self.coming.bytes().get(self.read..).unwrap_or_default();
        let count = rest.len().min(bytes.len());
        for (to, from) in bytes.iter_mut().zip(rest) {
            *to = *from;
        }
        self.read += count;
        Ok(count)
    }
}

impl ReadReady for Wire {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.read < self.coming.bytes().len())
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        for (to, from) in self.going.iter_mut().skip(self.written).zip(bytes) {
            *to = *from;
        }
        self.written += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl WriteReady for Wire {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

/// A blob for another robot, then one that comes whole.
fn link() -> fmt::Result {
    let mut room = [0; ROOM];
    let mut store = Store::new(Flash::new(Ram::new())).map_err(|_| fmt::Error)?;
    store.load(&mut room).map_err(|_| fmt::Error)?;
    let mut link = Link::new(ROBOT, "truepose-firmware", JOINTS as u8);
    let mut ask = |ask| {
        let request = Request { number: 1, ask };
        let mut wire = Wire {
            coming: Frame::of(&request).ok_or(fmt::Error)?,
            read: 0,
            going: [0; FRAME],
            written: 0,
        };
        let mut stage = link.stage();
        while wire.written == 0 || !wire.going[..wire.written].ends_with(&[0]) {
            let polled = link.poll(&mut wire, &mut store, &mut room, &Tally::default());
            if let Ok(event @ Event::Saved(_)) = polled {
                defmt::info!("{}", event);
            }
            if core::mem::discriminant(&stage) != core::mem::discriminant(&link.stage()) {
                stage = link.stage();
                defmt::debug!("{}", stage);
            }
        }
        let mut decoder = Decoder::new();
        for &byte in &wire.going[..wire.written] {
            if let Some(Ok(message)) = decoder.feed(byte)
                && let Ok(Answer {
                    reply: Reply::Refused(refusal),
                    ..
                }) = postcard::from_bytes(message)
            {
                defmt::warn!("{}", refusal);
            }
        }
        Ok(())
    };
    let announced = Announcement {
        transfer: 7,
        length: u32::try_from(RIGID.len()).map_err(|_| fmt::Error)?,
        crc: checksum(RIGID),
        layout: OLDEST_LAYOUT,
        joints: JOINTS as u8,
        robot: ROBOT,
    };
    ask(Ask::Begin(Announcement {
        robot: "another",
        ..announced
    }))?;
    ask(Ask::Begin(announced))?;
    for (piece, place) in RIGID.chunks(CHUNK).zip(0u32..) {
        ask(Ask::Chunk {
            transfer: 7,
            offset: place * CHUNK as u32,
            bytes: piece,
        })?;
    }
    ask(Ask::Commit { transfer: 7 })
}
