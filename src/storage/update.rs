//! A new blob, brought into the other slot step by step.

use super::record::{RECORD, Record};
use super::slots::{Current, Store};
use super::{LONGEST_WORD, Memory, StorageError};
use crate::params::{checksum, checksum_onwards, examine};

/// An update under way: [`Store::begin`] makes it, [`Store::step`] carries it on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Update {
    /// The slot that it goes to.
    slot: usize,
    /// What will make the slot count.
    record: Record,
    /// What was current when it began.
    before: Option<Current>,
    phase: Phase,
}

/// How far an update is. `done`: bytes of the slot or of the blob.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The current slot gets its second record, if it lacks it.
    Settle,
    Erase {
        done: usize,
    },
    Write {
        done: usize,
    },
    /// What the memory holds is read back.
    Compare {
        done: usize,
        crc: u32,
    },
    /// The one small write.
    Commit,
    /// The record is read back and, if it stands, copied.
    Copy,
    Done,
}

/// How an update comes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Progress {
    /// The memory is still busy with the last step.
    Waiting,
    /// There is more to do.
    Working,
    /// The new blob is the current one.
    Done,
}

impl<M: Memory> Store<M> {
    /// Begins to bring `blob` into the slot that is not current. Writes nothing yet; refuses
    /// what [`examine`] refuses. [`Store::load`] goes before.
    pub fn begin(&self, blob: &[u8]) -> Result<Update, StorageError<M::Error>> {
        examine(blob)?;
        self.begin_checked(blob, checksum(blob))
    }

    /// The same for a blob that [`examine`] has accepted, and its checksum.
    pub(crate) fn begin_checked(
        &self,
        blob: &[u8],
        crc: u32,
    ) -> Result<Update, StorageError<M::Error>> {
        let too_large = StorageError::TooLarge {
            length: blob.len(),
            room: self.room(),
        };
        if !self.loaded {
            return Err(StorageError::NotLoaded);
        }
        if blob.len() > self.room() {
            return Err(too_large);
        }
        let length = u32::try_from(blob.len()).map_err(|_| too_large)?;
        let before = self.current;
        Ok(Update {
            slot: before.map_or(0, |current| 1 - current.slot),
            record: Record {
                sequence: self.newest.map_or(1, |newest| newest.wrapping_add(1)),
                length,
                crc,
            },
            before,
            phase: Phase::Settle,
        })
    }

    /// Does the next piece of `update`: erases one block, writes one page, reads one page back
    /// or writes one record. `blob`: the bytes that it was begun with; others are written, but
    /// never made current. After an error the old blob is still the current one, and another
    /// update may be begun.
    #[inline(never)]
    pub fn step(
        &mut self,
        update: &mut Update,
        blob: &[u8],
    ) -> Result<Progress, StorageError<M::Error>> {
        if update.phase == Phase::Done {
            return Ok(Progress::Done);
        }
        if update.before != self.current && update.phase != Phase::Copy {
            return Err(StorageError::Stale);
        }
        if !self.memory.ready().map_err(StorageError::Memory)? {
            return Ok(Progress::Waiting);
        }
        let first = self.blob_address(update.slot);
        let page = self.memory.page();
        update.phase = match update.phase {
            Phase::Settle => {
                if let Some(Current { slot, record }) = update.before {
                    self.write_copy(slot, &record);
                }
                Phase::Erase { done: 0 }
            }
            Phase::Erase { done } if self.memory.write_once() && done < self.slot_size() => {
                self.memory
                    .erase(self.slot_address(update.slot) + done)
                    .map_err(StorageError::Memory)?;
                Phase::Erase {
                    done: done + self.memory.block(),
                }
            }
            Phase::Erase { .. } => Phase::Write { done: 0 },
            Phase::Write { done } => match blob.get(done..).unwrap_or_default() {
                [] => Phase::Compare { done: 0, crc: 0 },
                rest => {
                    let piece = rest.get(..page).unwrap_or(rest);
                    self.write(first + done, piece)?;
                    Phase::Write { done: done + page }
                }
            },
            Phase::Compare { done, crc } => {
                let length = update.record.length as usize;
                let mut buffer = [0; LONGEST_WORD];
                let size = page.min(LONGEST_WORD);
                let piece = buffer
                    .get_mut(..length.saturating_sub(done).min(size))
                    .unwrap_or_default();
                self.read(first + done, piece)?;
                let crc = checksum_onwards(crc, piece);
                if done + piece.len() < length {
                    Phase::Compare {
                        done: done + size,
                        crc,
                    }
                } else if crc == update.record.crc {
                    Phase::Commit
                } else {
                    return Err(StorageError::NotAsWritten);
                }
            }
            Phase::Commit => {
                let address = self.record_address(update.slot, 0);
                self.write(address, &update.record.bytes())?;
                Phase::Copy
            }
            Phase::Copy => {
                let mut written = [0; RECORD];
                self.read(self.record_address(update.slot, 0), &mut written)?;
                if written != update.record.bytes() {
                    return Err(StorageError::NotAsWritten);
                }
                self.current = Some(Current {
                    slot: update.slot,
                    record: update.record,
                });
                self.newest = Some(update.record.sequence);
                self.write_copy(update.slot, &update.record);
                Phase::Done
            }
            Phase::Done => Phase::Done,
        };
        Ok(match update.phase {
            Phase::Done => Progress::Done,
            _ => Progress::Working,
        })
    }

    /// Keeps `blob`: all steps of an update, with waits. Returns its sequence number.
    pub fn save(&mut self, blob: &[u8]) -> Result<u32, StorageError<M::Error>> {
        let mut update = self.begin(blob)?;
        while self.step(&mut update, blob)? != Progress::Done {
            self.memory.wait().map_err(StorageError::Memory)?;
        }
        Ok(update.record.sequence)
    }

    /// Writes the second record of a slot if it lacks it and can take it. A precaution: where
    /// it fails, as in a word that a cut left blank and used up, the first record stands alone.
    #[inline(never)]
    fn write_copy(&mut self, slot: usize, record: &Record) {
        let address = self.record_address(slot, 1);
        let mut there = [0; RECORD];
        let read = self.read(address, &mut there).is_ok();
        let blank = !self.memory.write_once() || there == [0xFF; RECORD];
        if read && blank && there != record.bytes() {
            let _ = self.write(address, &record.bytes());
        }
    }
}

impl Update {
    /// Number of the update.
    pub fn sequence(&self) -> u32 {
        self.record.sequence
    }

    /// Checksum of its blob, as [`crate::params::checksum`] has it.
    pub fn crc(&self) -> u32 {
        self.record.crc
    }

    /// Bytes of its blob.
    pub fn length(&self) -> usize {
        self.record.length as usize
    }
}
