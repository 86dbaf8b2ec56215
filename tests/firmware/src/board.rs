//! The emulated board: its console and its end.

use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use cortex_m_semihosting::hio;
use truepose::budget::Clock;

/// The emulator's standard output, a line a call: each call stops the core.
struct Console {
    out: hio::HostStream,
    line: [u8; 256],
    length: usize,
}

impl Console {
    fn flush(&mut self) -> fmt::Result {
        let (line, _) = self.line.split_at(self.length);
        self.out.write_all(line).map_err(|()| fmt::Error)?;
        self.length = 0;
        Ok(())
    }
}

impl Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for &byte in text.as_bytes() {
            if self.length == self.line.len() {
                self.flush()?;
            }
            if let Some(place) = self.line.get_mut(self.length) {
                *place = byte;
                self.length += 1;
            }
        }
        if text.ends_with('\n') {
            self.flush()?;
        }
        Ok(())
    }
}

/// SysTick's period: all of its 24 bits.
const RELOAD: u32 = 0x00FF_FFFF;

/// Counts instructions by the emulator's clock.
///
/// Under `-icount shift=8` an instruction is 256 ns of the machine's time and SysTick runs at
/// 25 MHz: 6.4 ticks an instruction, right to one instruction, 2.6 million of them a period.
#[derive(Debug)]
pub struct Instructions(());

impl Clock for Instructions {
    fn now(&self) -> u32 {
        SYST::get_current()
    }

    fn elapsed(&self, since: u32) -> u32 {
        let ticks = since.wrapping_sub(self.now()) & RELOAD;
        // Up to 2^24 * 10 ticks fit.
        ticks * 10 / 64
    }
}

/// Starts SysTick. The one caller is the program's own start.
pub fn clock() -> Instructions {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(RELOAD);
        core.SYST.clear_current();
        core.SYST.enable_counter();
    }
    Instructions(())
}

fn leave(status: debug::ExitStatus) -> ! {
    loop {
        debug::exit(status);
    }
}

/// Runs a program and ends the emulation: status 0 if all was written, 1 if not.
pub fn run(print: impl FnOnce(&mut dyn Write) -> fmt::Result) -> ! {
    let Ok(out) = hio::hstdout() else {
        leave(EXIT_FAILURE)
    };
    let mut console = Console {
        out,
        line: [0; 256],
        length: 0,
    };
    match print(&mut console).and_then(|()| console.flush()) {
        Ok(()) => leave(EXIT_SUCCESS),
        Err(fmt::Error) => leave(EXIT_FAILURE),
    }
}

/// Says where a panic came from and ends the emulation with status 1.
pub fn panicked(info: &PanicInfo<'_>) -> ! {
    if let Ok(mut out) = hio::hstdout() {
        // If even this fails, the exit status still says it.
        let _ = writeln!(out, "{info}");
    }
    leave(EXIT_FAILURE)
}
