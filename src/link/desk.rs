//! Who answers the requests, and what becomes of a blob that comes.

use super::controller::Event;
use super::frame::FrameError;
use super::message::{
    Active, Announcement, Ask, Fault, Identity, PROTOCOL, Refusal, Reply, Report, Request, Stage,
};
use super::tally::Tally;
use crate::params::{LAYOUT, OLDEST_LAYOUT, checksum_onwards, examine, read};
use crate::storage::{Memory, Progress, StorageError, Store, Update};

/// A blob that is coming.
#[derive(Clone, Copy, Debug)]
struct Transfer {
    /// From its announcement.
    transfer: u32,
    length: u32,
    crc: u32,
    /// Bytes that came, and their checksum.
    received: u32,
    sum: u32,
}

/// What is being done.
#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    Receiving(Transfer),
    /// `number`: of the request to commit.
    Checking {
        number: u16,
        transfer: Transfer,
    },
    Saving {
        number: u16,
        update: Update,
    },
}

/// Answers requests.
#[derive(Debug)]
pub(super) struct Desk<'n> {
    robot: &'n str,
    firmware: &'n str,
    joints: u8,
    pub(super) active: Option<Active>,
    state: State,
}

/// What a piece of work came to; `reply` with the number of its request.
pub(super) struct Work<'n> {
    pub(super) event: Event,
    pub(super) reply: Option<(u16, Reply<'n>)>,
}

/// Longest names, bytes.
const ROBOT: usize = 64;
const FIRMWARE: usize = 32;

impl<'n> Desk<'n> {
    pub(super) fn new(robot: &'n str, firmware: &'n str, joints: u8) -> Self {
        let short = |text: &'n str, most| if text.len() > most { "" } else { text };
        Self {
            robot: short(robot, ROBOT),
            firmware: short(firmware, FIRMWARE),
            joints,
            active: None,
            state: State::Idle,
        }
    }

    pub(super) fn stage(&self) -> Stage {
        match self.state {
            State::Idle => Stage::Idle,
            State::Receiving(Transfer {
                received, length, ..
            }) => Stage::Receiving { received, length },
            State::Checking { .. } => Stage::Checking,
            State::Saving { .. } => Stage::Saving,
        }
    }

    /// The answer to a frame, with the number of its request; `None` where it comes later.
    /// `largest`: blob that can be taken, bytes.
    pub(super) fn answer(
        &mut self,
        frame: Result<&[u8], FrameError>,
        largest: usize,
        room: &mut [u8],
        tally: &Tally,
    ) -> Option<(u16, Reply<'n>)> {
        let (number, result) = match frame.map(read::<Request<'_>>) {
            Ok(Ok(Request { number, ask })) => {
                (number, self.reply(number, ask, largest, room, tally))
            }
            Ok(_) => (0, Err(Refusal::NotUnderstood)),
            Err(FrameError::Broken) => (0, Err(Refusal::Broken)),
            Err(FrameError::TooLong) => (0, Err(Refusal::TooLong)),
        };
        let reply = result.unwrap_or_else(|refusal| Some(Reply::Refused(refusal)))?;
        Some((number, reply))
    }

    fn reply(
        &mut self,
        number: u16,
        ask: Ask<'_>,
        largest: usize,
        room: &mut [u8],
        tally: &Tally,
    ) -> Result<Option<Reply<'n>>, Refusal> {
        let largest = u32::try_from(largest).unwrap_or(u32::MAX);
        let busy = matches!(self.state, State::Checking { .. } | State::Saving { .. });
        Ok(Some(match ask {
            Ask::Identify => Reply::Identity(Identity {
                protocol: PROTOCOL,
                layout: LAYOUT,
                joints: self.joints,
                room: largest,
                robot: self.robot,
                firmware: self.firmware,
                active: self.active,
            }),
            Ask::Status => Reply::Status(Report {
                active: self.active,
                stage: self.stage(),
                tally: *tally,
            }),
            _ if busy => return Err(Refusal::Busy),
            Ask::Begin(announced) => {
                self.fits(&announced, largest)?;
                self.state = State::Receiving(Transfer {
                    transfer: announced.transfer,
                    length: announced.length,
                    crc: announced.crc,
                    received: 0,
                    sum: 0,
                });
                Reply::Accepted { received: 0 }
            }
            Ask::Chunk {
                transfer,
                offset,
                bytes,
            } => {
                let coming = self.receiving(transfer)?;
                coming.take(offset, bytes, room)?;
                Reply::Accepted {
                    received: coming.received,
                }
            }
            Ask::Commit { transfer } => {
                let transfer = *self.receiving(transfer)?;
                if transfer.received < transfer.length {
                    return Err(Refusal::Incomplete {
                        received: transfer.received,
                    });
                }
                if transfer.sum != transfer.crc {
                    self.state = State::Idle;
                    return Err(Refusal::Checksum);
                }
                self.state = State::Checking { number, transfer };
                return Ok(None);
            }
        }))
    }

    /// Whether what is announced can be taken; `room`: bytes.
    fn fits(&self, announced: &Announcement<'_>, room: u32) -> Result<(), Refusal> {
        if !(OLDEST_LAYOUT..=LAYOUT).contains(&announced.layout) {
            return Err(Refusal::Layout { expected: LAYOUT });
        }
        if announced.joints != self.joints {
            return Err(Refusal::Joints {
                expected: self.joints,
            });
        }
        if announced.robot != self.robot {
            return Err(Refusal::Robot);
        }
        if announced.length == 0 || announced.length > room {
            return Err(Refusal::Size { room });
        }
        Ok(())
    }

    /// The transfer under way, if it is number `transfer`.
    fn receiving(&mut self, transfer: u32) -> Result<&mut Transfer, Refusal> {
        match &mut self.state {
            State::Receiving(coming) if coming.transfer == transfer => Ok(coming),
            _ => Err(Refusal::NotBegun),
        }
    }

    /// The next piece of checking and keeping. `None`: there is nothing to do.
    pub(super) fn work<M: Memory>(
        &mut self,
        store: &mut Store<M>,
        room: &[u8],
    ) -> Option<Work<'n>> {
        let mut event = Event::Worked;
        let (number, reply) = match self.state {
            State::Idle | State::Receiving(_) => return None,
            State::Checking { number, transfer } => match self.accept(&transfer, store, room) {
                Ok(update) => {
                    self.state = State::Saving { number, update };
                    return Some(Work { event, reply: None });
                }
                Err(refusal) => (number, Reply::Refused(refusal)),
            },
            State::Saving { number, mut update } => {
                let blob = room.get(..update.length()).unwrap_or_default();
                match store.step(&mut update, blob) {
                    Ok(Progress::Done) => {
                        let active = Active {
                            length: u32::try_from(update.length()).unwrap_or(u32::MAX),
                            crc: update.crc(),
                            sequence: update.sequence(),
                        };
                        event = Event::Saved(active);
                        (number, Reply::Committed(active))
                    }
                    Ok(progress) => {
                        if progress == Progress::Waiting {
                            event = Event::Idle;
                        }
                        self.state = State::Saving { number, update };
                        return Some(Work { event, reply: None });
                    }
                    Err(error) => (number, Reply::Refused(Refusal::Storage(fault(&error)))),
                }
            }
        };
        self.state = State::Idle;
        Some(Work {
            event,
            reply: Some((number, reply)),
        })
    }

    /// Checks what has come: whole, sound, for this robot, and as it was announced.
    fn accept<M: Memory>(
        &self,
        transfer: &Transfer,
        store: &Store<M>,
        room: &[u8],
    ) -> Result<Update, Refusal> {
        let bytes = usize::try_from(transfer.length)
            .ok()
            .and_then(|length| room.get(..length))
            .ok_or(Refusal::Checksum)?;
        let (robot, joints) = examine(bytes).map_err(Refusal::Blob)?;
        if joints != usize::from(self.joints) {
            return Err(Refusal::Joints {
                expected: self.joints,
            });
        }
        if robot != self.robot {
            return Err(Refusal::Robot);
        }
        store
            .begin_checked(bytes, transfer.crc)
            .map_err(|error| Refusal::Storage(fault(&error)))
    }
}

impl Transfer {
    /// Puts the next bytes into `room`.
    fn take(&mut self, offset: u32, bytes: &[u8], room: &mut [u8]) -> Result<(), Refusal> {
        if offset != self.received {
            return Err(Refusal::OutOfOrder {
                expected: self.received,
            });
        }
        let left = self.length - self.received;
        let count = u32::try_from(bytes.len()).map_err(|_| Refusal::ChunkSize)?;
        if count == 0 || count > left {
            return Err(Refusal::ChunkSize);
        }
        let place = usize::try_from(offset)
            .ok()
            .and_then(|start| room.get_mut(start..)?.get_mut(..bytes.len()))
            .ok_or(Refusal::ChunkSize)?;
        for (to, from) in place.iter_mut().zip(bytes) {
            *to = *from;
        }
        self.received += count;
        self.sum = checksum_onwards(self.sum, bytes);
        Ok(())
    }
}

/// What the host has to know of an error of the storage.
fn fault<E>(error: &StorageError<E>) -> Fault {
    match error {
        StorageError::Memory(_) | StorageError::NotLoaded => Fault::Memory,
        StorageError::Stale => Fault::Interrupted,
        _ => Fault::NotAsWritten,
    }
}
