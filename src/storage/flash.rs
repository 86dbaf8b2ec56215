//! A NOR flash, or a part of one.

use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;

use super::Memory;

/// A NOR flash of any driver that implements `embedded-storage`, or a part of one.
#[derive(Clone, Debug)]
pub struct Flash<F> {
    driver: F,
    /// First byte of the part.
    start: u32,
    /// Bytes of the part.
    size: usize,
}

/// At least so much is written in one call where words are small.
const PAGE: usize = 64;

impl<F: NorFlash> Flash<F> {
    /// All of `driver`'s flash.
    pub fn new(driver: F) -> Self {
        let size = driver.capacity();
        Self {
            driver,
            start: 0,
            size,
        }
    }

    /// The part `range` of it, in bytes from the flash's beginning: what the program does not
    /// need. `None` if it is outside, or not made of whole erase blocks.
    pub fn part(driver: F, range: Range<u32>) -> Option<Self> {
        let block = u32::try_from(F::ERASE_SIZE).ok()?;
        let whole = |x: u32| x.checked_rem(block) == Some(0);
        let size = range.end.checked_sub(range.start)?.try_into().ok()?;
        let inside = usize::try_from(range.end).ok()? <= driver.capacity();
        (inside && whole(range.start) && whole(range.end)).then_some(Self {
            driver,
            start: range.start,
            size,
        })
    }

    /// Where `address` is in the whole flash. Beyond it, where the driver refuses, if it does
    /// not fit.
    fn absolute(&self, address: usize) -> u32 {
        u32::try_from(address).map_or(u32::MAX, |a| self.start.saturating_add(a))
    }
}

impl<F: NorFlash> Memory for Flash<F> {
    type Error = F::Error;

    fn write_once(&self) -> bool {
        true
    }

    fn size(&self) -> usize {
        self.size
    }

    fn word(&self) -> usize {
        F::WRITE_SIZE.max(F::READ_SIZE)
    }

    fn page(&self) -> usize {
        self.word().max(PAGE)
    }

    fn block(&self) -> usize {
        F::ERASE_SIZE
    }

    /// Always: the driver waits itself.
    fn ready(&mut self) -> Result<bool, F::Error> {
        Ok(true)
    }

    fn wait(&mut self) -> Result<(), F::Error> {
        Ok(())
    }

    fn read(&mut self, address: usize, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.driver.read(self.absolute(address), bytes)
    }

    fn write(&mut self, address: usize, bytes: &[u8]) -> Result<(), F::Error> {
        self.driver.write(self.absolute(address), bytes)
    }

    fn erase(&mut self, address: usize) -> Result<(), F::Error> {
        self.driver.erase(
            self.absolute(address),
            self.absolute(address.saturating_add(F::ERASE_SIZE)),
        )
    }
}
