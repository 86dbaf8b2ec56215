//! Memories whose power can be cut: a NOR flash and an I2C EEPROM.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource, Operation, SevenBitAddress};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// What a cut leaves in the words, the block or the page that was being changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// New up to the cut, old behind it.
    Clean,
    /// Anything.
    Garbage,
    /// What was to stand there, or anything: a new throw of the dice at every reading.
    Unsteady,
}

pub(crate) const CUTS: [Cut; 3] = [Cut::Clean, Cut::Garbage, Cut::Unsteady];

/// A memory as it lies on the board.
#[derive(Clone, Debug)]
pub(crate) struct Board {
    pub(crate) bytes: Vec<u8>,
    /// Bytes written or erased.
    pub(crate) changed: usize,
    /// Bytes that may still be written or erased; `None`: the power stays.
    pub(crate) fuel: Option<usize>,
    pub(crate) cut: Cut,
    off: bool,
    unsteady: Vec<Range<usize>>,
    /// Which bytes were written since their erase.
    written: Vec<bool>,
    /// Bits of the byte there that stay zero.
    pub(crate) stuck: Option<(usize, u8)>,
    /// Writes are acknowledged and not done.
    pub(crate) protected: bool,
    noise: u64,
    /// EEPROM: questions that it still does not answer.
    busy: u32,
    /// Erases of each block, or writes of each page.
    pub(crate) wear: Vec<u32>,
}

impl Board {
    fn new(size: usize, block: usize) -> Self {
        Self {
            bytes: vec![0xFF; size],
            changed: 0,
            fuel: None,
            cut: Cut::Clean,
            off: false,
            unsteady: Vec::new(),
            written: vec![false; size],
            stuck: None,
            protected: false,
            noise: 1,
            busy: 0,
            wear: vec![0; size / block],
        }
    }

    fn noise(&mut self) -> u8 {
        self.noise = self
            .noise
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.noise >> 56) as u8
    }

    /// How many of `length` bytes are changed before the power goes.
    fn spend(&mut self, length: usize) -> usize {
        let done = self.fuel.map_or(length, |fuel| fuel.min(length));
        self.changed += done;
        if let Some(fuel) = &mut self.fuel {
            *fuel -= done;
        }
        self.off = done < length;
        done
    }

    /// What the cut does to the bytes from `at` on, which were to become `intended`.
    fn spoil(&mut self, at: usize, intended: &[u8]) {
        for (k, byte) in (at..).zip(intended) {
            match self.cut {
                Cut::Clean => {}
                Cut::Garbage => self.bytes[k] = self.noise(),
                Cut::Unsteady => self.bytes[k] = *byte,
            }
        }
        if self.cut == Cut::Unsteady {
            self.unsteady.push(at..at + intended.len());
        }
    }

    fn read(&mut self, from: usize, to: &mut [u8]) {
        let end = from + to.len();
        to.copy_from_slice(&self.bytes[from..end]);
        for range in self.unsteady.clone() {
            if self.noise() < 128 {
                continue;
            }
            for k in range.start.max(from)..range.end.min(end) {
                to[k - from] ^= self.noise();
            }
        }
    }

    /// `range` holds what it is told to again.
    fn steady(&mut self, range: &Range<usize>) {
        self.unsteady
            .retain(|r| r.end <= range.start || r.start >= range.end);
    }
}

/// A handle on a memory; the memory stays when the program that used it is gone.
#[derive(Clone, Debug)]
pub(crate) struct Chip<const WORD: usize, const BLOCK: usize>(pub(crate) Rc<RefCell<Board>>);

impl<const WORD: usize, const BLOCK: usize> Chip<WORD, BLOCK> {
    pub(crate) fn new(size: usize) -> Self {
        Self(Rc::new(RefCell::new(Board::new(size, BLOCK))))
    }

    /// Another one with the same contents, its changes counted from here.
    pub(crate) fn twin(&self) -> Self {
        let board = Board {
            changed: 0,
            ..self.0.borrow().clone()
        };
        Self(Rc::new(RefCell::new(board)))
    }

    /// From now on the power lasts for so many changed bytes.
    pub(crate) fn power(&self, fuel: Option<usize>, cut: Cut) {
        let mut board = self.0.borrow_mut();
        (board.fuel, board.cut, board.off) = (fuel, cut, false);
    }
}

/// The power is gone, or the program did what the chip forbids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChipError {
    Off,
    Forbidden(NorFlashErrorKind),
    /// A word was written a second time.
    Twice,
}

impl NorFlashError for ChipError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const WORD: usize, const BLOCK: usize> ErrorType for Chip<WORD, BLOCK> {
    type Error = ChipError;
}

impl<const WORD: usize, const BLOCK: usize> ReadNorFlash for Chip<WORD, BLOCK> {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), ChipError> {
        check_read(self, offset, bytes.len()).map_err(ChipError::Forbidden)?;
        let mut board = self.0.borrow_mut();
        if board.off {
            return Err(ChipError::Off);
        }
        board.read(offset as usize, bytes);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.borrow().bytes.len()
    }
}

impl<const WORD: usize, const BLOCK: usize> NorFlash for Chip<WORD, BLOCK> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = BLOCK;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), ChipError> {
        check_erase(self, from, to).map_err(ChipError::Forbidden)?;
        let mut board = self.0.borrow_mut();
        if board.off {
            return Err(ChipError::Off);
        }
        for block in (from as usize..to as usize).step_by(BLOCK) {
            let done = board.spend(BLOCK);
            board.wear[block / BLOCK] += 1;
            board.bytes[block..block + done].fill(0xFF);
            if done < BLOCK {
                board.spoil(block, &[0xFF; BLOCK]);
                return Err(ChipError::Off);
            }
            board.steady(&(block..block + BLOCK));
            board.written[block..block + BLOCK].fill(false);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), ChipError> {
        check_write(self, offset, bytes.len()).map_err(ChipError::Forbidden)?;
        let mut board = self.0.borrow_mut();
        if board.off {
            return Err(ChipError::Off);
        }
        for (word, bytes) in (offset as usize..).step_by(WORD).zip(bytes.chunks(WORD)) {
            if board.written[word..word + WORD].contains(&true) {
                return Err(ChipError::Twice);
            }
            let done = board.spend(WORD);
            board.written[word..word + WORD].fill(true);
            for (k, byte) in (word..).zip(bytes).take(done) {
                board.bytes[k] &= byte;
                if let Some((at, bits)) = board.stuck
                    && at == k
                {
                    board.bytes[k] &= !bits;
                }
            }
            if done < WORD {
                board.spoil(word, bytes);
                return Err(ChipError::Off);
            }
        }
        Ok(())
    }
}

/// An EEPROM with `PAGE` bytes a page that takes `ADDRESS` bytes of address.
#[derive(Clone, Debug)]
pub(crate) struct Serial<const ADDRESS: usize, const PAGE: usize>(pub(crate) Chip<1, PAGE>);

pub(crate) const DEVICE: u8 = 0x50;

/// How often it does not answer after a write.
const WRITE_TIME: u32 = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SerialError {
    Silent,
    Off,
    WrongUse,
}

impl i2c::Error for SerialError {
    fn kind(&self) -> i2c::ErrorKind {
        match self {
            Self::Silent => i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            Self::Off => i2c::ErrorKind::Bus,
            Self::WrongUse => i2c::ErrorKind::Other,
        }
    }
}

impl<const ADDRESS: usize, const PAGE: usize> i2c::ErrorType for Serial<ADDRESS, PAGE> {
    type Error = SerialError;
}

impl<const ADDRESS: usize, const PAGE: usize> I2c for Serial<ADDRESS, PAGE> {
    fn transaction(
        &mut self,
        device: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), SerialError> {
        let mut board = self.0.0.borrow_mut();
        if board.off {
            return Err(SerialError::Off);
        }
        if board.busy > 0 {
            board.busy -= 1;
            return Err(SerialError::Silent);
        }
        let size = board.bytes.len();
        let high = usize::from(device - DEVICE);
        // Writes that follow each other are one on the bus.
        let mut sent = Vec::new();
        let mut read = false;
        let mut address = None;
        for operation in operations {
            match operation {
                Operation::Write(_) if read => return Err(SerialError::WrongUse),
                Operation::Write(bytes) => sent.extend_from_slice(bytes),
                Operation::Read(bytes) => {
                    read = true;
                    let named = sent.get(..ADDRESS).ok_or(SerialError::WrongUse)?;
                    let low = named.iter().fold(0, |a, &b| (a << 8) | usize::from(b));
                    let from = (high << (8 * ADDRESS)) | low;
                    if from + bytes.len() > size || low + bytes.len() > 1 << (8 * ADDRESS) {
                        return Err(SerialError::WrongUse);
                    }
                    board.read(from, bytes);
                    address = Some(from);
                }
            }
        }
        if read {
            return address.map(|_| ()).ok_or(SerialError::WrongUse);
        }
        let (named, data) = sent
            .split_at_checked(ADDRESS)
            .ok_or(SerialError::WrongUse)?;
        let low = named.iter().fold(0, |a, &b| (a << 8) | usize::from(b));
        let from = (high << (8 * ADDRESS)) | low;
        if data.is_empty() {
            return Ok(());
        }
        if from >= size || data.len() > PAGE {
            return Err(SerialError::WrongUse);
        }
        board.busy = WRITE_TIME;
        if board.protected {
            return Ok(());
        }
        let page = from - from % PAGE;
        let done = board.spend(data.len());
        board.wear[page / PAGE] += 1;
        for (k, byte) in data.iter().enumerate().take(done) {
            // Beyond its end a page goes on at its beginning.
            board.bytes[page + (from - page + k) % PAGE] = *byte;
        }
        if done < data.len() {
            let mut intended = board.bytes[page..page + PAGE].to_vec();
            for (k, byte) in data.iter().enumerate() {
                intended[(from - page + k) % PAGE] = *byte;
            }
            board.spoil(page, &intended);
            return Err(SerialError::Off);
        }
        // The chip writes the page anew as a whole.
        board.steady(&(page..page + PAGE));
        Ok(())
    }
}

/// A delay that takes no time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}
