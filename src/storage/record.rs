//! The record that makes a slot count.

use crate::params::checksum;

/// Bytes of a record.
pub(super) const RECORD: usize = 16;

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Record {
    /// Number of the update, wrapping.
    pub(super) sequence: u32,
    /// Length of the blob, bytes.
    pub(super) length: u32,
    /// Checksum of the blob, all of it.
    pub(super) crc: u32,
}

impl Record {
    #[inline(never)]
    pub(super) fn bytes(&self) -> [u8; RECORD] {
        let mut bytes = [0; RECORD];
        let fields = self.sequence.to_le_bytes().into_iter();
        let fields = fields
            .chain(self.length.to_le_bytes())
            .chain(self.crc.to_le_bytes());
        for (byte, field) in bytes.iter_mut().zip(fields) {
            *byte = field;
        }
        let sum = bytes.first_chunk::<12>().map_or(0, |head| checksum(head));
        for (byte, field) in bytes.iter_mut().skip(12).zip(sum.to_le_bytes()) {
            *byte = field;
        }
        bytes
    }

    /// `None` if `bytes` are not a whole record.
    #[inline(never)]
    pub(super) fn from_bytes(bytes: &[u8; RECORD]) -> Option<Self> {
        let [a, b, c, d, e, f, g, h, i, j, k, l, ..] = *bytes;
        let record = Self {
            sequence: u32::from_le_bytes([a, b, c, d]),
            length: u32::from_le_bytes([e, f, g, h]),
            crc: u32::from_le_bytes([i, j, k, l]),
        };
        (record.bytes() == *bytes).then_some(record)
    }

    /// Whether this one was written after `other`, at most 2^31 updates later.
    pub(super) fn is_newer_than(&self, other: &Self) -> bool {
        let ahead = self.sequence.wrapping_sub(other.sequence);
        ahead != 0 && ahead < 1 << 31
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(sequence: u32) -> Record {
        Record {
            sequence,
            length: 700,
            crc: 0x1234_5678,
        }
    }

    #[test]
    fn a_record_comes_back_and_no_changed_one_does() {
        for sequence in [0, 1, 0xFF, u32::MAX] {
            let bytes = numbered(sequence).bytes();
            assert_eq!(Record::from_bytes(&bytes), Some(numbered(sequence)));
            for position in 0..RECORD {
                for bit in 0..8 {
                    let mut changed = bytes;
                    changed[position] ^= 1 << bit;
                    assert_eq!(Record::from_bytes(&changed), None);
                }
            }
        }
        assert_eq!(Record::from_bytes(&[0; RECORD]), None);
        assert_eq!(Record::from_bytes(&[0xFF; RECORD]), None);
    }

    #[test]
    fn the_next_is_newer_across_the_overflow_too() {
        for sequence in [0, 1, 1 << 31, u32::MAX - 1, u32::MAX] {
            let next = numbered(sequence.wrapping_add(1));
            assert!(next.is_newer_than(&numbered(sequence)));
            assert!(!numbered(sequence).is_newer_than(&next));
            assert!(!next.is_newer_than(&next));
        }
    }
}
