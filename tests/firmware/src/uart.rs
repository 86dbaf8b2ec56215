//! The board's second UART and first timer (Arm CMSDK), as the emulator has them.

use core::convert::Infallible;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use truepose::budget::Clock;

const UART1: usize = 0x4000_5000;
const TIMER0: usize = 0x4000_0000;

/// A register of the board.
#[derive(Clone, Copy, Debug)]
struct Register(usize);

impl Register {
    #[expect(unsafe_code, reason = "a register of the board")]
    fn get(self) -> u32 {
        // SAFETY: a word-aligned register of the emulated board; reading is allowed.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    #[expect(unsafe_code, reason = "a register of the board")]
    fn set(self, value: u32) {
        // SAFETY: a word-aligned register of the emulated board that no memory overlaps.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}

const DATA: Register = Register(UART1);
const STATE: Register = Register(UART1 + 4);
const CONTROL: Register = Register(UART1 + 8);
const DIVIDER: Register = Register(UART1 + 16);
const SEND_FULL: u32 = 1;
const RECEIVED: u32 = 2;

/// The UART.
#[derive(Debug)]
pub struct Uart(());

impl Uart {
    /// Switches it on.
    pub fn start() -> Self {
        DIVIDER.set(16);
        CONTROL.set(3);
        Self(())
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(STATE.get() & RECEIVED != 0)
    }
}

impl Read for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let Some(byte) = bytes.first_mut() else {
            return Ok(0);
        };
        while !self.read_ready()? {}
        *byte = DATA.get() as u8;
        Ok(1)
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(STATE.get() & SEND_FULL == 0)
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(byte) = bytes.first() else {
            return Ok(0);
        };
        while !self.write_ready()? {}
        DATA.set(u32::from(*byte));
        Ok(1)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

const TIMER_CONTROL: Register = Register(TIMER0);
const TIMER_VALUE: Register = Register(TIMER0 + 4);
const TIMER_RELOAD: Register = Register(TIMER0 + 8);

/// Counts up at 25 MHz: 6.4 ticks an instruction of the emulated core.
#[derive(Clone, Copy, Debug)]
pub struct Timer(());

impl Timer {
    /// Switches it on.
    pub fn start() -> Self {
        TIMER_RELOAD.set(u32::MAX);
        TIMER_VALUE.set(u32::MAX);
        TIMER_CONTROL.set(1);
        Self(())
    }

    /// Ticks since some time, wrapping.
    pub fn ticks(self) -> u32 {
        !TIMER_VALUE.get()
    }
}

impl Clock for Timer {
    fn now(&self) -> u32 {
        self.ticks()
    }

    fn elapsed(&self, since: u32) -> u32 {
        let ticks = self.ticks().wrapping_sub(since);
        // An answer takes less than 2^28 ticks.
        ticks.saturating_mul(10) / 64
    }
}
