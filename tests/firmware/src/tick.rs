//! A task that a timer starts, above everything else that runs.

use core::cell::RefCell;

use cortex_m::interrupt::{self, Mutex};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;

type Task = &'static mut (dyn FnMut() + Send);

static TASK: Mutex<RefCell<Option<Task>>> = Mutex::new(RefCell::new(None));

#[exception]
fn SysTick() {
    interrupt::free(|token| {
        // Nobody else borrows it with interrupts on.
        if let Ok(mut task) = TASK.borrow(token).try_borrow_mut()
            && let Some(task) = task.as_mut()
        {
            task();
        }
    });
}

/// From now on it is time for a task every `period` ticks of 25 MHz; the first one waits for
/// [`above`].
pub fn every(timer: &mut SYST, period: u32) {
    interrupt::disable();
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(period - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
}

/// Does `work`, and `task` whenever it is time, above it. Between two calls a task is late,
/// not lost.
#[expect(unsafe_code, reason = "a task that borrows, run by an interrupt")]
pub fn above<R>(task: &mut (dyn FnMut() + Send), work: impl FnOnce() -> R) -> R {
    // SAFETY: the task is taken away again before this returns, and a panic ends the program.
    let task = unsafe { core::mem::transmute::<&mut (dyn FnMut() + Send), Task>(task) };
    interrupt::free(|token| TASK.borrow(token).replace(Some(task)));
    // SAFETY: called outside of any critical section.
    unsafe { interrupt::enable() };
    let result = work();
    interrupt::disable();
    interrupt::free(|token| TASK.borrow(token).replace(None));
    result
}
