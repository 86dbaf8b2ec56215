//! An I2C EEPROM of the 24C family.

use core::fmt;

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{Error as _, ErrorKind, I2c, Operation};

use super::Memory;

/// How an EEPROM is made, from its data sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Its I2C address, 7 bits, those bits zero that it takes for the memory's upper address.
    pub device: u8,
    /// Bytes there are.
    pub size: usize,
    /// Bytes of a page: a write wraps around within it.
    pub page: usize,
    /// Bytes of the address that is sent: 1 (up to 24C16) or 2. What does not fit goes into
    /// the lowest bits of the I2C address.
    pub address_bytes: u8,
}

/// An EEPROM on an I2C bus. After a write it does not answer for some milliseconds; that is
/// how its readiness is asked for.
#[derive(Clone, Debug)]
pub struct Eeprom<I, D> {
    bus: I,
    delay: D,
    geometry: Geometry,
    /// How often in a row it did not answer.
    unanswered: u16,
}

/// What can go wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EepromError {
    /// The bus failed.
    Bus(#[cfg_attr(feature = "defmt", defmt(Debug2Format))] ErrorKind),
    /// It does not answer, and a write is long over.
    Silent,
}

impl fmt::Display for EepromError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(kind) => write!(f, "the bus failed: {kind:?}"),
            Self::Silent => f.write_str("the EEPROM does not answer"),
        }
    }
}

impl core::error::Error for EepromError {}

/// Pause between two questions, us.
const PAUSE: u32 = 200;
/// Questions of [`Memory::wait`]: 25 ms, five times what data sheets allow a write.
const QUESTIONS: u16 = 125;

impl<I: I2c, D: DelayNs> Eeprom<I, D> {
    /// An EEPROM on `bus`; `delay` is for the waits.
    pub fn new(bus: I, delay: D, geometry: Geometry) -> Self {
        Self {
            bus,
            delay,
            geometry,
            unanswered: 0,
        }
    }

    /// Its address on the bus and the address to send, in the last `address_bytes` bytes.
    fn addresses(&self, address: usize) -> (u8, [u8; 2]) {
        let [.., upper, high, low] = address.to_be_bytes();
        let block = if self.geometry.address_bytes == 1 {
            high
        } else {
            upper
        };
        (self.geometry.device | block, [high, low])
    }

    /// The operations that set the address and then do `operation`.
    #[inline(never)]
    fn transfer(&mut self, address: usize, operation: Operation<'_>) -> Result<(), I::Error> {
        let (device, bytes) = self.addresses(address);
        let [_, low] = bytes;
        let (one, two) = ([low], bytes);
        let sent: &[u8] = if self.geometry.address_bytes == 1 {
            &one
        } else {
            &two
        };
        self.bus
            .transaction(device, &mut [Operation::Write(sent), operation])
    }
}

impl<I: I2c, D: DelayNs> Memory for Eeprom<I, D> {
    type Error = EepromError;

    fn write_once(&self) -> bool {
        false
    }

    fn size(&self) -> usize {
        self.geometry.size
    }

    fn word(&self) -> usize {
        1
    }

    fn page(&self) -> usize {
        self.geometry.page
    }

    fn block(&self) -> usize {
        self.geometry.page
    }

    fn ready(&mut self) -> Result<bool, EepromError> {
        // Setting the address alone changes nothing.
        match self.transfer(0, Operation::Write(&[])) {
            Ok(()) => {
                self.unanswered = 0;
                Ok(true)
            }
            Err(error) => match error.kind() {
                ErrorKind::NoAcknowledge(_) if self.unanswered < u16::MAX => {
                    self.unanswered += 1;
                    Ok(false)
                }
                ErrorKind::NoAcknowledge(_) => Err(EepromError::Silent),
                kind => Err(EepromError::Bus(kind)),
            },
        }
    }

    fn wait(&mut self) -> Result<(), EepromError> {
        for _ in 0..QUESTIONS {
            if self.ready()? {
                return Ok(());
            }
            self.delay.delay_us(PAUSE);
        }
        Err(EepromError::Silent)
    }

    fn read(&mut self, address: usize, bytes: &mut [u8]) -> Result<(), EepromError> {
        self.wait()?;
        // A read does not go on beyond what the address sent can name.
        let named = 1 << (8 * u32::from(self.geometry.address_bytes.clamp(1, 2)));
        let (mut address, mut rest) = (address, bytes);
        while !rest.is_empty() {
            let here = (named - address % named).min(rest.len());
            let (now, later) = rest.split_at_mut_checked(here).unwrap_or_default();
            self.transfer(address, Operation::Read(now))
                .map_err(|error| EepromError::Bus(error.kind()))?;
            address += here;
            rest = later;
        }
        Ok(())
    }

    fn write(&mut self, address: usize, bytes: &[u8]) -> Result<(), EepromError> {
        self.wait()?;
        self.transfer(address, Operation::Write(bytes))
            .map_err(|error| EepromError::Bus(error.kind()))
    }

    /// Nothing: a byte is written over as it is.
    fn erase(&mut self, _: usize) -> Result<(), EepromError> {
        Ok(())
    }
}
