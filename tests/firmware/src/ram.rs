//! A NOR flash that lives in RAM and is forgotten with it.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes of it: two slots of 8 KiB.
pub const SIZE: usize = 16 * 1024;

/// A NOR flash in RAM.
#[derive(Debug)]
pub struct Ram([u8; SIZE]);

impl Ram {
    /// Erased.
    pub const fn new() -> Self {
        Self([0xFF; SIZE])
    }

    fn part(&mut self, offset: u32, length: usize) -> Result<&mut [u8], NorFlashErrorKind> {
        usize::try_from(offset)
            .ok()
            .and_then(|from| self.0.get_mut(from..)?.get_mut(..length))
            .ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl Default for Ram {
    fn default() -> Self {
        Self::new()
    }
}

impl ErrorType for Ram {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Ram {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        bytes.copy_from_slice(self.part(offset, bytes.len())?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for Ram {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let length = usize::try_from(to - from).map_err(|_| NorFlashErrorKind::OutOfBounds)?;
        self.part(from, length)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (to, from) in self.part(offset, bytes.len())?.iter_mut().zip(bytes) {
            *to &= from;
        }
        Ok(())
    }
}
