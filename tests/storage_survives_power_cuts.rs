//! A cut at every byte of every write and erase leaves the old parameters or the new ones.

use crate::blobs::blob;
use crate::memories::{CUTS, Chip, Cut, DEVICE, NoDelay, Serial};
use crate::random::Random;
use truepose::params::BlobError;
use truepose::storage::{
    Eeprom, EepromError, Either, Flash, Geometry, Memory, Progress, StorageError, Store,
};

/// A memory on the board, and the store that a program makes of it when it starts.
trait Rig {
    type Memory: Memory<Error: PartialEq>;
    fn new() -> Self;
    fn twin(&self) -> Self;
    fn store(&self) -> Store<Self::Memory>;
    /// The power lasts for so many bytes.
    fn power(&self, fuel: Option<usize>, cut: Cut);
    fn changed(&self) -> usize;
}

/// Bytes of a memory, a little more than two slots for the blobs here.
const SIZE: usize = 4 * 1024;

impl<const WORD: usize, const BLOCK: usize> Rig for Chip<WORD, BLOCK> {
    /// One of two kinds, as a program with both has it.
    type Memory = Either<Flash<Self>, Eeprom<Serial<2, 64>, NoDelay>>;

    fn new() -> Self {
        Self::new(SIZE + 2 * BLOCK)
    }

    fn twin(&self) -> Self {
        self.twin()
    }

    /// In the middle of the flash: the program has its ends.
    fn store(&self) -> Store<Self::Memory> {
        let (start, end) = (BLOCK as u32, (SIZE + BLOCK) as u32);
        let flash = Flash::part(self.clone(), start..end).unwrap();
        Store::new(Either::First(flash)).unwrap()
    }

    fn power(&self, fuel: Option<usize>, cut: Cut) {
        self.power(fuel, cut);
    }

    fn changed(&self) -> usize {
        self.0.borrow().changed
    }
}

impl<const ADDRESS: usize, const PAGE: usize> Rig for Serial<ADDRESS, PAGE> {
    type Memory = Either<Flash<Chip<4, 64>>, Eeprom<Self, NoDelay>>;

    fn new() -> Self {
        Self(Chip::new(SIZE))
    }

    fn twin(&self) -> Self {
        Self(self.0.twin())
    }

    fn store(&self) -> Store<Self::Memory> {
        let geometry = Geometry {
            device: DEVICE,
            size: SIZE,
            page: PAGE,
            address_bytes: ADDRESS as u8,
        };
        let eeprom = Eeprom::new(self.clone(), NoDelay, geometry);
        Store::new(Either::Second(eeprom)).unwrap()
    }

    fn power(&self, fuel: Option<usize>, cut: Cut) {
        self.0.power(fuel, cut);
    }

    fn changed(&self) -> usize {
        self.0.0.borrow().changed
    }
}

/// Blobs of different lengths.
fn blobs_of(seed: u64) -> [Vec<u8>; 3] {
    let mut random = Random(seed);
    [1, 2, 1].map(|joints| {
        let mut buffer = vec![0; SIZE];
        let blob = blob(&mut random, joints);
        blob.encode(&mut buffer).unwrap().to_vec()
    })
}

/// A program that has started.
fn started<R: Rig>(rig: &R) -> Store<R::Memory> {
    let mut store = rig.store();
    store.load(&mut vec![0; SIZE]).unwrap();
    store
}

/// What a program finds that starts now.
fn found<R: Rig>(rig: &R) -> Option<Vec<u8>> {
    let mut room = vec![0; SIZE];
    let stored = rig.store().load(&mut room).unwrap()?;
    Some(room[..stored.length].to_vec())
}

/// Starts, tries to keep `blob` with power for `fuel` bytes, and says whether it could.
fn try_to_keep<R: Rig>(rig: &R, blob: &[u8], fuel: Option<usize>, cut: Cut) -> bool {
    let mut store = started(rig);
    rig.power(fuel, cut);
    let kept = store.save(blob).is_ok();
    rig.power(None, cut);
    kept
}

fn every_cut_leaves_old_or_new<R: Rig>() {
    let [old, new, third] = blobs_of(21);
    let board = R::new();
    assert_eq!(found(&board), None);
    assert!(try_to_keep(&board, &third, None, Cut::Clean));
    assert!(try_to_keep(&board, &old, None, Cut::Clean));
    let whole = board.twin();
    assert!(try_to_keep(&whole, &new, None, Cut::Clean));
    let bytes = whole.changed();
    assert!(bytes > new.len(), "{bytes}");
    let copy = 16_usize.next_multiple_of(board.store().into_memory().word());
    for cut in CUTS {
        let (mut olds, mut news) = (0, 0);
        for fuel in 0..=bytes {
            let rig = board.twin();
            let kept = try_to_keep(&rig, &new, Some(fuel), cut);
            // The copy of the record is a precaution: it may fail.
            let enough = fuel + copy >= bytes;
            assert_eq!(kept, enough, "{cut:?} {fuel}");
            let now = found(&rig).unwrap_or_else(|| panic!("{cut:?} {fuel}: nothing"));
            assert!(now == old || now == new, "{cut:?} {fuel}: something else");
            assert!(!kept || now == new, "{cut:?} {fuel}: kept and gone");
            olds += usize::from(now == old);
            news += usize::from(now == new);
            // The next update finds its way from here.
            assert!(try_to_keep(&rig, &third, None, cut), "{cut:?} {fuel}");
            assert_eq!(found(&rig).as_ref(), Some(&third), "{cut:?} {fuel}");
        }
        // The change comes with the record, near the end.
        assert!(olds >= new.len() && news > 1, "{olds} {news}");
    }
}

fn a_cut_in_the_first_update_leaves_nothing_or_new<R: Rig>() {
    let [new, second, _] = blobs_of(22);
    let whole = R::new();
    assert!(try_to_keep(&whole, &new, None, Cut::Clean));
    for cut in CUTS {
        for fuel in 0..=whole.changed() {
            let rig = R::new();
            try_to_keep(&rig, &new, Some(fuel), cut);
            assert!(found(&rig).is_none_or(|now| now == new), "{cut:?} {fuel}");
            assert!(try_to_keep(&rig, &second, None, cut));
            assert_eq!(found(&rig).as_ref(), Some(&second));
        }
    }
}

/// A second cut in the update that follows the first one. Two cuts that both hit the records
/// of one slot with words that stay unsteady are what the storage does not promise to survive.
fn a_cut_after_a_cut_leaves_one_of_them<R: Rig>() {
    let [old, new, third] = blobs_of(23);
    let board = R::new();
    assert!(try_to_keep(&board, &old, None, Cut::Clean));
    let whole = board.twin();
    assert!(try_to_keep(&whole, &new, None, Cut::Clean));
    let bytes = whole.changed();
    for cut in CUTS {
        // The body, now and then; the records, byte by byte.
        let firsts = (0..bytes).filter(|k| k % 311 == 0 || k + 40 > bytes);
        for first in firsts {
            let rig = board.twin();
            try_to_keep(&rig, &new, Some(first), cut);
            let last = rig.twin();
            assert!(try_to_keep(&last, &third, None, cut));
            let last = last.changed();
            let near = |k: usize| k % 3 == first % 3 && (k < 40 || k + 40 > last);
            for second in (0..last).filter(|&k| k % 59 == first % 59 || near(k)) {
                let rig = rig.twin();
                try_to_keep(&rig, &third, Some(second), cut);
                let now = found(&rig).unwrap_or_else(|| panic!("{cut:?} {first} {second}"));
                assert!(now == old || now == new || now == third);
                assert!(try_to_keep(&rig, &new, None, Cut::Clean));
                assert_eq!(found(&rig).as_ref(), Some(&new));
            }
        }
    }
}

macro_rules! on_every_memory {
    ($($name:ident: $rig:ty),+ $(,)?) => {
        $(mod $name {
            use super::*;

            #[test]
            fn every_cut_leaves_old_or_new() {
                super::every_cut_leaves_old_or_new::<$rig>();
            }

            #[test]
            fn a_cut_in_the_first_update_leaves_nothing_or_new() {
                super::a_cut_in_the_first_update_leaves_nothing_or_new::<$rig>();
            }

            #[test]
            fn a_cut_after_a_cut_leaves_one_of_them() {
                super::a_cut_after_a_cut_leaves_one_of_them::<$rig>();
            }

            #[test]
            fn the_sequence_goes_on_across_its_overflow() {
                super::the_sequence_goes_on_across_its_overflow::<$rig>();
            }
        })+
    };
}

on_every_memory! {
    flash_of_bytes: Chip<1, 512>,
    flash_of_words: Chip<4, 512>,
    flash_of_long_words: Chip<32, 2048>,
    eeprom_of_small_pages: Serial<1, 16>,
    eeprom: Serial<2, 64>,
}

/// CRC-32 by its definition, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

/// A record as the module's page draws it.
fn record(sequence: u32, blob: &[u8]) -> Vec<u8> {
    let fields = [sequence, blob.len() as u32, crc32(blob)];
    let mut bytes: Vec<u8> = fields.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend(crc32(&bytes).to_le_bytes());
    bytes
}

fn the_sequence_goes_on_across_its_overflow<R: Rig>() {
    let [first, second, third] = blobs_of(24);
    let rig = R::new();
    let mut memory = rig.store().into_memory();
    let (size, block, page) = (memory.size(), memory.block(), memory.page());
    let word = memory.word();
    let slot = (size / 2) / block * block;
    let mut put = |address: usize, bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(word), 0xFF);
        for (k, piece) in bytes.chunks(page).enumerate() {
            memory.write(address + k * page, piece).unwrap();
        }
    };
    for (slot, sequence, blob) in [(0, u32::MAX - 1, &first), (slot, u32::MAX, &second)] {
        put(slot, &record(sequence, blob));
        put(slot + 2 * page, blob);
    }
    assert_eq!(found(&rig).as_ref(), Some(&second));
    for (turn, blob) in [&third, &first, &second, &third].into_iter().enumerate() {
        let mut store = started(&rig);
        assert_eq!(store.save(blob).unwrap() as usize, turn);
        assert_eq!(found(&rig).as_ref(), Some(blob), "{turn}");
    }
}

type Plain = Chip<4, 512>;

#[test]
fn slots_take_turns_in_being_worn() {
    let [blob, ..] = blobs_of(25);
    let rig = <Plain as Rig>::new();
    let mut store = started(&rig);
    for sequence in 1..=10 {
        assert_eq!(store.save(&blob), Ok(sequence));
    }
    let wear = &rig.0.borrow().wear;
    assert_eq!(wear, &[0, 5, 5, 5, 5, 5, 5, 5, 5, 0]);
}

#[test]
fn each_step_touches_the_memory_once() {
    let [blob, ..] = blobs_of(26);
    let rig = <Serial<2, 64> as Rig>::new();
    let mut store = started(&rig);
    let mut update = store.begin(&blob).unwrap();
    let (mut waits, mut before) = (0, 0);
    loop {
        let progress = store.step(&mut update, &blob).unwrap();
        let now = rig.changed();
        assert!(now - before <= 64);
        before = now;
        match progress {
            Progress::Waiting => waits += 1,
            Progress::Working => {}
            Progress::Done => break,
        }
    }
    assert!(waits > 10, "{waits}");
    assert_eq!(store.step(&mut update, &blob), Ok(Progress::Done));
}

#[test]
fn what_is_no_blob_is_not_kept() {
    let [mut blob, other, _] = blobs_of(27);
    let rig = <Plain as Rig>::new();
    let mut store = rig.store();
    assert_eq!(store.save(&other), Err(StorageError::NotLoaded));
    assert_eq!(store.load(&mut vec![0; SIZE]), Ok(None));
    blob[40] ^= 1;
    let refusal = StorageError::Blob(BlobError::Checksum);
    assert_eq!(store.save(&blob), Err(refusal));
    assert_eq!(rig.changed(), 0);
    // A buffer that changes under way is written, and not made current.
    let mut update = store.begin(&other).unwrap();
    let mut changed = other.clone();
    changed[50] ^= 0x10;
    let outcome = loop {
        match store.step(&mut update, &changed) {
            Ok(Progress::Done) => break Ok(()),
            Ok(_) => {}
            Err(error) => break Err(error),
        }
    };
    assert_eq!(outcome, Err(StorageError::NotAsWritten));
    assert_eq!(found(&rig), None);
    let mut one = store.begin(&other).unwrap();
    assert!(store.save(&other).is_ok());
    assert_eq!(store.step(&mut one, &other), Err(StorageError::Stale));
}

#[test]
fn a_worn_and_a_protected_memory_are_noticed() {
    let [old, new, _] = blobs_of(28);
    let rig = <Plain as Rig>::new();
    let mut store = started(&rig);
    assert!(store.save(&old).is_ok());
    // In the second slot, in its record and in its body.
    for at in [512 + 2048 + 12, 512 + 2048 + 2 * 64 + 100] {
        rig.0.borrow_mut().stuck = Some((at, 0xFF));
        assert_eq!(store.save(&new), Err(StorageError::NotAsWritten));
        assert_eq!(found(&rig).as_ref(), Some(&old));
    }
    rig.0.borrow_mut().stuck = None;
    assert!(store.save(&new).is_ok());

    let rig = <Serial<2, 64> as Rig>::new();
    let mut store = started(&rig);
    assert!(store.save(&old).is_ok());
    rig.0.0.borrow_mut().protected = true;
    assert_eq!(store.save(&new), Err(StorageError::NotAsWritten));
    assert_eq!(found(&rig).as_ref(), Some(&old));
}

#[test]
fn decayed_contents_are_passed_over_and_said() {
    let [old, new, _] = blobs_of(29);
    let rig = <Plain as Rig>::new();
    let mut store = started(&rig);
    assert!(store.save(&old).is_ok() && store.save(&new).is_ok());
    rig.0.borrow_mut().bytes[512 + 2048 + 2 * 64 + 100] ^= 4;
    let mut room = vec![0; SIZE];
    let stored = rig.store().load(&mut room).unwrap().unwrap();
    assert_eq!(&room[..stored.length], &old[..]);
    assert_eq!(stored.passed_over, Some(BlobError::Checksum));
    assert_eq!(stored.sequence, 1);
    assert_eq!(stored.crc, crc32(&old));
    // The next goes over the decayed one, with a number newer than its.
    assert_eq!(started(&rig).save(&new), Ok(3));
    assert_eq!(found(&rig).as_ref(), Some(&new));
}

#[test]
fn too_little_room_is_an_error_and_never_the_older_blob() {
    let [small, large, _] = blobs_of(30);
    let rig = <Plain as Rig>::new();
    let mut store = started(&rig);
    assert!(store.save(&small).is_ok() && store.save(&large).is_ok());
    let length = large.len();
    let mut room = vec![0; length - 1];
    let refusal = Err(StorageError::RoomTooSmall { length });
    assert_eq!(rig.store().load(&mut room), refusal);
    assert_eq!(store.room(), 2048 - 2 * 64);
    let long = {
        let mut buffer = vec![0; 2 * SIZE];
        blob(&mut Random(5), 9)
            .encode(&mut buffer)
            .unwrap()
            .to_vec()
    };
    let (length, room) = (long.len(), store.room());
    assert_eq!(
        store.save(&long),
        Err(StorageError::TooLarge { length, room })
    );
}

#[test]
fn an_eeprom_that_is_not_there_is_an_error() {
    /// Never answers.
    struct Nobody;

    impl embedded_hal::i2c::ErrorType for Nobody {
        type Error = embedded_hal::i2c::ErrorKind;
    }

    impl embedded_hal::i2c::I2c for Nobody {
        fn transaction(
            &mut self,
            _: u8,
            _: &mut [embedded_hal::i2c::Operation<'_>],
        ) -> Result<(), Self::Error> {
            let source = embedded_hal::i2c::NoAcknowledgeSource::Unknown;
            Err(embedded_hal::i2c::ErrorKind::NoAcknowledge(source))
        }
    }

    let geometry = Geometry {
        device: DEVICE,
        size: SIZE,
        page: 32,
        address_bytes: 2,
    };
    let mut store = Store::new(Eeprom::new(Nobody, NoDelay, geometry)).unwrap();
    let silent = StorageError::Memory(EepromError::Silent);
    assert_eq!(store.load(&mut vec![0; SIZE]), Err(silent));
    let [blob, ..] = blobs_of(31);
    assert_eq!(store.save(&blob), Err(StorageError::NotLoaded));
}

#[test]
fn memories_that_cannot_be_cut_in_two_are_refused() {
    let refused = |size, page| {
        let geometry = Geometry {
            device: DEVICE,
            size,
            page,
            address_bytes: 2,
        };
        let rig = <Serial<2, 64> as Rig>::new();
        let store = Store::new(Eeprom::new(rig, NoDelay, geometry));
        store.err() == Some(StorageError::Geometry)
    };
    assert!(refused(4096, 8) && refused(4096, 0) && refused(0, 64) && refused(256, 64));
    assert!(!refused(4096, 64) && !refused(384, 64));
    assert!(Store::new(Flash::new(Chip::<512, 4096>::new(16_384))).is_err());
    assert!(Store::new(Flash::new(Chip::<4, 4096>::new(4096))).is_err());
    assert!(Flash::part(Chip::<4, 512>::new(4096), 100..1124).is_none());
    assert!(Flash::part(Chip::<4, 512>::new(4096), 512..8192).is_none());
}
