//! The controller's end of the link: bytes in, bytes out.

use embedded_io::{Read, ReadReady, Write, WriteReady};

use super::desk::Desk;
use super::frame::{Decoder, Frame};
use super::message::{Active, Answer, Reply, Stage};
use super::tally::Tally;
use crate::storage::{Memory, Store};

/// Bytes that a call of [`Link::poll`] reads or writes at most.
const PIECE: usize = 64;

/// What a call of [`Link::poll`] came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event {
    /// There was nothing to do.
    Idle,
    /// Something was done.
    Worked,
    /// A new blob is kept. It stands at the beginning of the room, decoded once and found to
    /// be for this robot; what comes next over the link overwrites it. Put it to use and say
    /// so with [`Link::put_to_use`].
    Saved(Active),
}

/// The controller's end of the link.
#[derive(Debug)]
pub struct Link<'n> {
    desk: Desk<'n>,
    decoder: Decoder,
    /// Read, and not yet looked at: `inbox[next..end]`.
    inbox: [u8; PIECE],
    next: usize,
    end: usize,
    /// Going out, and how much of it has gone.
    out: Frame,
    sent: usize,
}

impl<'n> Link<'n> {
    /// `robot`: the name that blobs must bear, at most 64 bytes; `firmware`: for people, at
    /// most 32 bytes; longer names count as empty. `joints`: N of the compensator.
    pub fn new(robot: &'n str, firmware: &'n str, joints: u8) -> Self {
        Self {
            desk: Desk::new(robot, firmware, joints),
            decoder: Decoder::new(),
            inbox: [0; PIECE],
            next: 0,
            end: 0,
            out: Frame::empty(),
            sent: 0,
        }
    }

    /// `active` are the parameters in use from now on.
    pub fn put_to_use(&mut self, active: Active) {
        self.desk.active = Some(active);
    }

    /// How far a transfer is: what the next call of [`Link::poll`] may do.
    pub fn stage(&self) -> Stage {
        self.desk.stage()
    }

    /// One piece of work: sends at most 64 bytes of an answer, or takes in at most 64 bytes and
    /// answers at most one request, or checks a blob that has come, or does one step of keeping
    /// it. Never waits for `stream`; for the memory only as [`Store::step`] does.
    ///
    /// `room`: where blobs are received, the same at every call; not where the parameters in
    /// use are. `tally`: what the loop did.
    ///
    /// An error of `stream` loses at most the frame that was coming: go on polling.
    pub fn poll<S, M>(
        &mut self,
        stream: &mut S,
        store: &mut Store<M>,
        room: &mut [u8],
        tally: &Tally,
    ) -> Result<Event, S::Error>
    where
        S: Read + ReadReady + Write + WriteReady,
        M: Memory,
    {
        let largest = store.room().min(room.len());
        let event = match self.exchange(stream, largest, room, tally)? {
            Exchange::Done(event) => return Ok(event),
            Exchange::More(event) => event,
        };
        let Some(work) = self.desk.work(store, room) else {
            return Ok(event);
        };
        if let Some((number, reply)) = work.reply {
            self.send(number, reply);
        }
        Ok(work.event)
    }

    /// What has to do with the stream, whatever the memory is. `largest`: blob that can be
    /// taken, bytes.
    #[inline(never)]
    fn exchange<S>(
        &mut self,
        stream: &mut S,
        largest: usize,
        room: &mut [u8],
        tally: &Tally,
    ) -> Result<Exchange, S::Error>
    where
        S: Read + ReadReady + Write + WriteReady,
    {
        if let Some(rest @ [_, ..]) = self.out.bytes().get(self.sent..) {
            if !stream.write_ready()? {
                return Ok(Exchange::Done(Event::Idle));
            }
            let piece = rest.get(..PIECE).unwrap_or(rest);
            self.sent += stream.write(piece)?;
            return Ok(Exchange::Done(Event::Worked));
        }
        if self.next >= self.end && stream.read_ready()? {
            (self.next, self.end) = (0, 0);
            self.end = stream.read(&mut self.inbox)?;
        }
        let mut event = Event::Idle;
        while let Some(&byte) = self.inbox.get(self.next..self.end).and_then(<[u8]>::first) {
            self.next += 1;
            event = Event::Worked;
            if let Some(frame) = self.decoder.feed(byte) {
                if let Some((number, reply)) = self.desk.answer(frame, largest, room, tally) {
                    self.send(number, reply);
                }
                return Ok(Exchange::Done(event));
            }
        }
        Ok(Exchange::More(event))
    }

    /// Makes an answer ready to go out.
    #[inline(never)]
    fn send(&mut self, number: u16, reply: Reply<'_>) {
        // No answer is longer than a frame: its names are short.
        self.out = Frame::of(&Answer { number, reply }).unwrap_or(Frame::empty());
        self.sent = 0;
    }
}

/// What came of looking at the stream.
enum Exchange {
    /// That was the piece of work.
    Done(Event),
    /// Nothing was answered: there is time for other work.
    More(Event),
}
