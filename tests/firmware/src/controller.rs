//! All that a controller calls, once: in its loop every method and every effect, beside it the
//! link and both kinds of memory, whatever the compiler could leave out hidden from it.

use core::hint::black_box;

use nalgebra::Vector3;
use truepose::budget::{Budget, Clock};
use truepose::compensate::task_point::Inverse;
use truepose::compensate::{Compensator, Request, minimum_move, task_point};
use truepose::effects::{Ambient, Conditions};
use truepose::link::{Event, Link, Tally};
use truepose::storage::{Eeprom, Either, Flash, Geometry, Progress, Store};
use truepose::{Method, Model, Settings};

use crate::absent::Absent;
use crate::arm::JOINTS;

/// Runs the loop. True if every answer was a compensation. `inverse`: nominal inverse kinematics.
pub fn run(
    model: &Model<'_, f32, JOINTS>,
    clock: &impl Clock,
    inverse: Option<Inverse<'_, f32, JOINTS>>,
) -> bool {
    let q = black_box([0.1, -0.9, 0.8, 0.3, -0.6, 0.2]);
    let mut conditions = Conditions {
        direction: [1.0; JOINTS],
        ambient: Ambient {
            payload: 2.0,
            payload_com: Vector3::new(0.0, 0.02, 0.05),
            time: 60.0,
            ..Ambient::default()
        },
    };
    conditions.ambient.temperature.fill(30.0);
    let request = black_box(Request::pose(model.nominal_pose(&q), q).conditions(conditions));
    let mut answered = true;
    for method in Method::ALL {
        let settings = Settings {
            method: black_box(method),
            ..model.settings
        };
        let mut compensator = Compensator::new(model).with_settings(settings);
        let mut budget = Budget::cycles(clock, black_box(u32::MAX));
        let outcome = compensator.correct(&request, &mut budget);
        answered &= outcome.status.compensated();
        let outcome = compensator.correct_through(&request, inverse, &mut budget);
        answered &= outcome.status.compensated();
        let pose = request.pose.unwrap_or_else(|| model.nominal_pose(&q));
        black_box(minimum_move::nearest(model, &pose, &outcome.q, &conditions));
    }
    black_box(task_point::first(model, &request));
    let seen = model.predict(&q, &conditions);
    let wanted = model.nominal_pose(&q);
    black_box(Request::sensed(model, q, &seen, &wanted, conditions));
    answered
}

/// Blobs from and into a flash and an EEPROM, without a link. `room`: for one blob.
#[inline(never)]
pub fn store(room: &mut [u8]) -> bool {
    both().into_iter().all(|memory| store_in(memory, room))
}

/// Either memory, which the compiler does not know apart.
type EitherMemory = Either<Flash<Absent>, Eeprom<Absent, Absent>>;

fn both() -> [EitherMemory; 2] {
    black_box([
        Either::First(Flash::new(Absent)),
        Either::Second(Eeprom::new(Absent, Absent, geometry())),
    ])
}

/// The same with one memory.
#[inline(never)]
fn store_in(memory: EitherMemory, room: &mut [u8]) -> bool {
    let Ok(mut store) = Store::new(memory) else {
        return false;
    };
    let nothing_there = !matches!(store.load(room), Ok(Some(_)));
    let Ok(mut update) = store.begin(room) else {
        return nothing_there;
    };
    while let Ok(Progress::Waiting | Progress::Working) = store.step(&mut update, room) {}
    nothing_there
}

/// Of a device whose size the compiler does not know.
fn geometry() -> Geometry {
    black_box(Geometry {
        device: 0x50,
        size: 32 * 1024,
        page: 64,
        address_bytes: 2,
    })
}

/// Blobs over a link into a flash and into an EEPROM. `room`: for one blob. Hardware that is
/// not there sends nothing that makes sense, so nothing may be taken in.
#[inline(never)]
pub fn keep(room: &mut [u8]) -> bool {
    both().into_iter().all(|memory| keep_in(memory, room))
}

/// The same with one memory.
#[inline(never)]
fn keep_in(memory: EitherMemory, room: &mut [u8]) -> bool {
    let Ok(mut store) = Store::new(memory) else {
        return false;
    };
    let mut link = Link::new("PUMA 560", "truepose-firmware", JOINTS as u8);
    let mut nothing_kept = !matches!(store.load(room), Ok(Some(_)));
    for _ in 0..black_box(8) {
        match link.poll(&mut Absent, &mut store, room, &Tally::default()) {
            Ok(Event::Saved(active)) => {
                link.put_to_use(active);
                nothing_kept = false;
            }
            Ok(Event::Idle | Event::Worked) => {}
            Err(never) => match never {},
        }
    }
    nothing_kept
}
