//! Hardware that is not there: drivers that answer with what the compiler cannot know, so that
//! what is above them is linked whole.

use core::convert::Infallible;
use core::hint::black_box;

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{self, I2c, Operation};
use embedded_io::{Read, ReadReady, Write, WriteReady};
use embedded_storage::nor_flash::{self, NorFlash, NorFlashErrorKind, ReadNorFlash};

/// A flash, a bus, a stream and a delay.
#[derive(Clone, Copy, Debug)]
pub struct Absent;

fn anything(bytes: &mut [u8]) {
    for byte in bytes {
        *byte = black_box(0);
    }
}

/// Success or not, who knows.
fn perhaps<E>(error: E) -> Result<(), E> {
    if black_box(true) { Ok(()) } else { Err(error) }
}

impl nor_flash::ErrorType for Absent {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Absent {
    const READ_SIZE: usize = 4;

    fn read(&mut self, _: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        anything(bytes);
        perhaps(NorFlashErrorKind::Other)
    }

    fn capacity(&self) -> usize {
        16 * 1024
    }
}

impl NorFlash for Absent {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        black_box((from, to));
        perhaps(NorFlashErrorKind::Other)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        black_box((offset, bytes));
        perhaps(NorFlashErrorKind::Other)
    }
}

impl i2c::ErrorType for Absent {
    type Error = i2c::ErrorKind;
}

impl I2c for Absent {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        for operation in operations {
            match operation {
                Operation::Read(bytes) => anything(bytes),
                Operation::Write(bytes) => {
                    black_box((address, bytes));
                }
            }
        }
        perhaps(i2c::ErrorKind::Other)
    }
}

impl DelayNs for Absent {
    fn delay_ns(&mut self, ns: u32) {
        black_box(ns);
    }
}

impl embedded_io::ErrorType for Absent {
    type Error = Infallible;
}

impl Read for Absent {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        anything(bytes);
        Ok(black_box(bytes.len()))
    }
}

impl ReadReady for Absent {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(black_box(true))
    }
}

impl Write for Absent {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Ok(black_box(bytes).len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl WriteReady for Absent {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(black_box(true))
    }
}
