#![cfg_attr(target_os = "none", no_std)]
//! Programs that run on an emulated Cortex-M4F and, the same source, on the host.
//!
//! Each program in `src/bin` prints what it computed, every number as its bits. On the target
//! it prints through the emulator's console; on the host to standard output.
//! `tests/emulator_agrees_with_host.rs` runs both and compares.

#[cfg(target_os = "none")]
pub mod above_link;
pub mod absent;
pub mod arm;
#[cfg(target_os = "none")]
pub mod board;
pub mod compensation;
pub mod controller;
pub mod cost;
pub mod double;
pub mod draws;
pub mod kinematics;
#[cfg(all(target_os = "none", feature = "defmt"))]
pub mod logs;
pub mod methods;
pub mod parameters;
pub mod ram;
#[cfg(target_os = "none")]
pub mod tick;
pub mod transfer;
#[cfg(target_os = "none")]
pub mod uart;
pub mod worst;

#[cfg(target_os = "none")]
#[doc(hidden)]
pub use cortex_m_rt;

#[cfg(target_os = "none")]
pub use board::clock;

/// A clock for programs: on the target it counts instructions, here it stands still.
#[cfg(not(target_os = "none"))]
pub fn clock() -> impl truepose::budget::Clock {
    truepose::budget::NoClock
}

/// The entry point of a program: a function that writes what it computed.
#[macro_export]
macro_rules! program {
    ($print:path) => {
        #[cfg(target_os = "none")]
        #[$crate::cortex_m_rt::entry]
        fn start() -> ! {
            $crate::board::run($print)
        }

        #[cfg(target_os = "none")]
        #[panic_handler]
        fn panicked(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::board::panicked(info)
        }

        #[cfg(not(target_os = "none"))]
        fn main() -> Result<(), std::fmt::Error> {
            let mut text = String::new();
            $print(&mut text)?;
            print!("{text}");
            Ok(())
        }
    };
}
