//! The two slots, and which of them counts.

use super::record::{RECORD, Record};
use super::{LONGEST_WORD, Memory, StorageError};
use crate::params::{BlobError, checksum, examine};

/// A slot that counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Current {
    /// 0 or 1.
    pub(super) slot: usize,
    pub(super) record: Record,
}

/// What [`Store::load`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Stored {
    /// Bytes of the blob, at the beginning of the room.
    pub length: usize,
    /// Checksum of the blob, as [`crate::params::checksum`] has it.
    pub crc: u32,
    /// Number of the update that brought it; wraps around.
    pub sequence: u32,
    /// Why a newer one is passed over, if so: its contents decayed, or this version does not
    /// read them.
    pub passed_over: Option<BlobError>,
}

/// Two slots in a memory.
#[derive(Debug)]
pub struct Store<M> {
    pub(super) memory: M,
    /// Bytes of a slot, a multiple of the memory's block.
    slot: usize,
    pub(super) current: Option<Current>,
    /// Whether it is known what the memory holds, and the newest number in it.
    pub(super) loaded: bool,
    pub(super) newest: Option<u32>,
}

impl<M: Memory> Store<M> {
    /// Cuts `memory` into two slots. What it holds is found by [`Store::load`].
    pub fn new(memory: M) -> Result<Self, StorageError<M::Error>> {
        let (word, page, block) = (memory.word(), memory.page(), memory.block());
        let whole = |large: usize, small: usize| large.checked_rem(small) == Some(0);
        let half = memory.size() / 2;
        let slot = half.checked_rem(block).map_or(0, |rest| half - rest);
        let sound = word <= LONGEST_WORD
            && page >= RECORD
            && whole(page, word)
            && whole(block, page)
            && slot / 3 >= page;
        if !sound {
            return Err(StorageError::Geometry);
        }
        Ok(Self {
            memory,
            slot,
            current: None,
            loaded: false,
            newest: None,
        })
    }

    /// The largest blob that can be kept, bytes.
    pub fn room(&self) -> usize {
        self.slot - 2 * self.memory.page()
    }

    /// The memory back, to do something else with it.
    pub fn into_memory(self) -> M {
        self.memory
    }

    /// Finds the newest blob that is whole and sound and reads it to the beginning of `room`.
    /// `None`: there is none.
    ///
    /// Call it once, at the start: before, nothing can be kept. It waits for the memory. The
    /// blob is checked as [`examine`] does.
    #[inline(never)]
    pub fn load(&mut self, room: &mut [u8]) -> Result<Option<Stored>, StorageError<M::Error>> {
        let (first, second) = (self.record_of(0)?, self.record_of(1)?);
        let swapped = match (&first, &second) {
            (Some(first), Some(second)) => second.is_newer_than(first),
            _ => false,
        };
        let newest_first = if swapped {
            [(1, second), (0, first)]
        } else {
            [(0, first), (1, second)]
        };
        self.newest = newest_first
            .iter()
            .find_map(|(_, record)| record.map(|record| record.sequence));
        let mut passed_over = None;
        for (slot, record) in newest_first {
            let Some(record) = record else { continue };
            let length = record.length as usize;
            if length > self.room() {
                continue;
            }
            let blob = room
                .get_mut(..length)
                .ok_or(StorageError::RoomTooSmall { length })?;
            self.read(self.blob_address(slot), blob)?;
            let refusal = if checksum(blob) == record.crc {
                examine(blob).err()
            } else {
                Some(BlobError::Checksum)
            };
            if refusal.is_none() {
                self.current = Some(Current { slot, record });
                self.loaded = true;
                return Ok(Some(Stored {
                    length,
                    crc: record.crc,
                    sequence: record.sequence,
                    passed_over,
                }));
            }
            passed_over = passed_over.or(refusal);
        }
        self.current = None;
        self.loaded = true;
        Ok(None)
    }

    /// The record of a slot, from whichever of its two places holds one.
    #[inline(never)]
    fn record_of(&mut self, slot: usize) -> Result<Option<Record>, StorageError<M::Error>> {
        for copy in 0..2 {
            let mut bytes = [0; RECORD];
            self.read(self.record_address(slot, copy), &mut bytes)?;
            if let Some(record) = Record::from_bytes(&bytes) {
                return Ok(Some(record));
            }
        }
        Ok(None)
    }

    pub(super) fn slot_address(&self, slot: usize) -> usize {
        slot * self.slot
    }

    pub(super) fn slot_size(&self) -> usize {
        self.slot
    }

    pub(super) fn record_address(&self, slot: usize, copy: usize) -> usize {
        self.slot_address(slot) + copy * self.memory.page()
    }

    pub(super) fn blob_address(&self, slot: usize) -> usize {
        self.record_address(slot, 2)
    }

    /// Reads any number of bytes from the beginning of a word on.
    #[inline(never)]
    pub(super) fn read(
        &mut self,
        address: usize,
        bytes: &mut [u8],
    ) -> Result<(), StorageError<M::Error>> {
        let whole = bytes.len() - bytes.len() % self.memory.word().max(1);
        let (words, rest) = bytes.split_at_mut_checked(whole).unwrap_or_default();
        if !words.is_empty() {
            self.memory
                .read(address, words)
                .map_err(StorageError::Memory)?;
        }
        if !rest.is_empty() {
            let mut last = [0; LONGEST_WORD];
            let last = last.get_mut(..self.memory.word()).unwrap_or_default();
            self.memory
                .read(address + whole, last)
                .map_err(StorageError::Memory)?;
            for (to, from) in rest.iter_mut().zip(last) {
                *to = *from;
            }
        }
        Ok(())
    }

    /// Writes at most a page from the beginning of a word on; the last word is filled up.
    #[inline(never)]
    pub(super) fn write(
        &mut self,
        address: usize,
        bytes: &[u8],
    ) -> Result<(), StorageError<M::Error>> {
        let whole = bytes.len() - bytes.len() % self.memory.word().max(1);
        let (words, rest) = bytes.split_at_checked(whole).unwrap_or_default();
        if !words.is_empty() {
            self.memory
                .write(address, words)
                .map_err(StorageError::Memory)?;
        }
        if !rest.is_empty() {
            let mut last = [0xFF; LONGEST_WORD];
            for (to, from) in last.iter_mut().zip(rest) {
                *to = *from;
            }
            let last = last.get(..self.memory.word()).unwrap_or_default();
            self.memory
                .write(address + whole, last)
                .map_err(StorageError::Memory)?;
        }
        Ok(())
    }
}
