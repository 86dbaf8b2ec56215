//! A control loop above a link: parameters come in, and it never misses a cycle.

use core::cell::Cell;
use core::convert::Infallible;
use core::fmt;

use cortex_m::interrupt::{self, Mutex};
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::link::{Active, Event, Link, Tally};
use truepose::params::{checksum, decode};
use truepose::storage::{Flash, Store};
use truepose::{Model, params};

use crate::arm::{CLEAR_OF_SINGULAR, JOINTS, TRAVEL};
use crate::parameters::{RIGID, ROOM};
use crate::ram::Ram;
use crate::tick;
use crate::uart::{Timer, Uart};

/// Ticks of 25 MHz from one command to the next: 40 ms, or 156 000 instructions here, as many as
/// a millisecond has at 156 MHz.
const PERIOD: u32 = 1_000_000;

/// Instructions that an answer may take.
const LIMIT: u32 = 120_000;

/// Cycles between two questions to a UART that has nothing.
const PAUSE: u32 = 2000;

/// Commands from one end of the path to the other.
const PATH: u32 = 500;

/// Where the path is, and when the next command is due.
struct Course {
    timer: Timer,
    command: u32,
    due: u32,
}

impl Course {
    /// The next nominal command, and how many should have gone out since the last.
    fn next(&mut self) -> ([f32; JOINTS], u32) {
        let late = self.timer.ticks().wrapping_sub(self.due);
        let missed = if late > u32::MAX / 2 {
            0
        } else {
            late / PERIOD
        };
        self.due = self.due.wrapping_add(PERIOD.wrapping_mul(missed + 1));
        self.command = (self.command + 1) % (2 * PATH);
        let way = self.command.abs_diff(PATH) as f32 / PATH as f32 - 0.5;
        let mut q = CLEAR_OF_SINGULAR;
        for (q, travel) in q.iter_mut().zip(TRAVEL) {
            *q += 0.4 * travel * way;
        }
        (q, missed)
    }
}

/// All but the loop.
struct Below<'n> {
    link: Link<'n>,
    uart: Uart,
    store: Store<Flash<Ram>>,
}

impl Below<'_> {
    /// Polls the link until new parameters have been kept, decodes them and hands them out,
    /// while the loop goes on with `model`.
    fn until_new<'b>(
        &mut self,
        model: &Model<'_, f32, JOINTS>,
        room: &'b mut [u8],
        course: &mut Course,
    ) -> Result<Model<'b, f32, JOINTS>, params::BlobError> {
        let shared = Mutex::new(Cell::new(Tally::default()));
        let mut tally = Tally::default();
        let mut compensator = Compensator::new(model);
        let mut task = || {
            let (q, missed) = course.next();
            for _ in 0..missed {
                tally.miss();
            }
            let mut budget = Budget::cycles(&course.timer, LIMIT);
            let outcome = compensator.correct(&Request::joints(q), &mut budget);
            tally.count(&outcome);
            interrupt::free(|token| shared.borrow(token).set(tally));
        };
        tick::above(&mut task, || {
            let active = loop {
                let tally = interrupt::free(|token| shared.borrow(token).get());
                let result = self
                    .link
                    .poll(&mut self.uart, &mut self.store, room, &tally);
                match result {
                    Ok(Event::Saved(active)) => break active,
                    Ok(Event::Worked) => {}
                    // Whoever asks the UART all the time keeps the emulator from filling it.
                    Ok(Event::Idle) => cortex_m::asm::delay(PAUSE),
                    Err(error) => match error {},
                }
            };
            let length = active.length as usize;
            let model = decode(room.get(..length).unwrap_or_default())?;
            self.link.put_to_use(active);
            Ok(model)
        })
    }
}

/// Runs the loop with the firmware's own parameters and then with those that come.
pub fn run(_: &mut dyn fmt::Write) -> fmt::Result {
    match start() {
        Ok(never) => match never {},
        Err(_) => Err(fmt::Error),
    }
}

fn start() -> Result<Infallible, fmt::Error> {
    let mut core = cortex_m::Peripherals::take().ok_or(fmt::Error)?;
    // One holds the parameters in use, the other takes new ones in.
    let (mut one, mut other) = ([0; ROOM], [0; ROOM]);
    let mut store = Store::new(Flash::new(Ram::new())).map_err(|_| fmt::Error)?;
    // Nothing yet, in this memory: the firmware's own are used.
    store.load(&mut other).map_err(|_| fmt::Error)?;
    let mut below = Below {
        link: Link::new("PUMA 560", "truepose-firmware", JOINTS as u8),
        uart: Uart::start(),
        store,
    };
    below.link.put_to_use(Active {
        length: RIGID.len() as u32,
        crc: checksum(RIGID),
        sequence: 0,
    });
    let mut model = decode(RIGID).map_err(|_| fmt::Error)?;
    let timer = Timer::start();
    tick::every(&mut core.SYST, PERIOD);
    let mut course = Course {
        timer,
        command: 0,
        due: timer.ticks().wrapping_add(PERIOD),
    };
    loop {
        let next = below
            .until_new(&model, &mut other, &mut course)
            .map_err(|_| fmt::Error)?;
        drop(model);
        model = below
            .until_new(&next, &mut one, &mut course)
            .map_err(|_| fmt::Error)?;
    }
}
