//! Sensors and pins do what the loop expects of them, and their failures stay outside it.

use crate::blobs;
use crate::random::Random;
use embedded_hal::i2c::ErrorKind;
use embedded_hal_mock::eh1::MockError;
use embedded_hal_mock::eh1::delay;
use embedded_hal_mock::eh1::digital::{self, State};
use embedded_hal_mock::eh1::i2c;
use lm75::{Address, Lm75};
use truepose::Model;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request, Status};
use truepose::effects::{Ambient, Effect, Place, ThermalDrift};
use truepose::hal::{CONVERSION_MS, Thermometers, strobed};

const TEMPERATURE: u8 = 0;
const CONFIGURATION: u8 = 1;
const FIRST: u8 = 0x48;
const SECOND: u8 = 0x49;

fn conversion() -> delay::CheckedDelay {
    delay::CheckedDelay::new(&[delay::Transaction::delay_ms(CONVERSION_MS)])
}

#[test]
fn temperatures_come_from_the_bus_in_the_order_of_the_sensors() {
    let start = |address| i2c::Transaction::write(address, vec![CONFIGURATION, 0]);
    let read = |address, bytes: [u8; 2]| {
        i2c::Transaction::write_read(address, vec![TEMPERATURE], bytes.to_vec())
    };
    let mut first = i2c::Mock::new(&[start(FIRST), read(FIRST, [25, 0x80])]);
    let mut second = i2c::Mock::new(&[start(SECOND), read(SECOND, [0xF6, 0x00])]);
    let sensors = [
        Lm75::new(first.clone(), Address::from(FIRST)),
        Lm75::new(second.clone(), Address::from(SECOND)),
    ];
    let mut delay = conversion();
    let mut thermometers = Thermometers::start(sensors, &mut delay).unwrap();
    let mut ambient = Ambient::<f32>::default();
    thermometers.read(&mut ambient).unwrap();
    assert_eq!(ambient.temperature[..2], [25.5, -10.0]);
    assert!(ambient.temperature[2..].iter().all(|t| t.is_nan()));
    delay.done();
    first.done();
    second.done();
}

#[test]
fn a_sensor_that_fails_is_not_known_and_the_others_are() {
    let fault = || MockError::Io(std::io::ErrorKind::TimedOut);
    let mut first = i2c::Mock::new(&[
        i2c::Transaction::write(FIRST, vec![CONFIGURATION, 0]),
        i2c::Transaction::write_read(FIRST, vec![TEMPERATURE], vec![0, 0])
            .with_error(ErrorKind::Bus),
    ]);
    let mut second = i2c::Mock::new(&[
        i2c::Transaction::write(SECOND, vec![CONFIGURATION, 0]),
        i2c::Transaction::write_read(SECOND, vec![TEMPERATURE], vec![30, 0x20]),
    ]);
    // 0.125 K a step.
    let sensors = [
        Lm75::new_pct2075(first.clone(), Address::from(FIRST)),
        Lm75::new_pct2075(second.clone(), Address::from(SECOND)),
    ];
    let mut delay = conversion();
    let mut thermometers = Thermometers::start(sensors, &mut delay).unwrap();
    let mut ambient = Ambient::<f64>::default();
    ambient.temperature.fill(20.0);
    assert!(thermometers.read(&mut ambient).is_err());
    assert!(ambient.temperature[0].is_nan());
    assert_eq!(ambient.temperature[1].to_bits(), 30.125_f64.to_bits());
    let mut pin = digital::Mock::new(&[
        digital::Transaction::set(State::High).with_error(fault()),
        digital::Transaction::set(State::Low),
    ]);
    // A strobe that fails keeps nothing from running.
    let (answer, pin_result) = strobed(&mut pin, || 7);
    assert_eq!(answer, 7);
    assert!(pin_result.is_err());
    pin.done();
    delay.done();
    first.done();
    second.done();
}

/// An arm whose first joint drifts with the temperature of the first sensor.
fn drifting() -> Vec<u8> {
    let mut blob = blobs::blob(&mut Random(21), 6);
    blob.effects.clear();
    let mut drift = ThermalDrift::new(Place::Joint(0), 0);
    drift.drift = [1e-4];
    blob.effects.push(Effect::ThermalDrift(drift)).unwrap();
    let mut buffer = vec![0; 16_384];
    blob.encode(&mut buffer).unwrap().to_vec()
}

#[test]
fn the_temperature_moves_the_command_and_the_pin_frames_it() {
    let bytes = drifting();
    let mut model = Model::<f64, 6>::empty();
    truepose::params::decode_into(&bytes, &mut model).unwrap();
    let mut bus = i2c::Mock::new(&[
        i2c::Transaction::write(FIRST, vec![CONFIGURATION, 0]),
        i2c::Transaction::write_read(FIRST, vec![TEMPERATURE], vec![30, 0]),
    ]);
    let mut delay = conversion();
    let sensor = Lm75::new(bus.clone(), Address::from(FIRST));
    let mut thermometers = Thermometers::start([sensor], &mut delay).unwrap();
    let mut pin = digital::Mock::new(&[
        digital::Transaction::set(State::High),
        digital::Transaction::set(State::Low),
    ]);
    let q = [0.3, -0.4, 0.25, 0.2, 0.5, -0.1];
    let mut request = Request::joints(q);
    let cold = Compensator::new(&model).correct(&request, &mut Budget::unlimited());
    thermometers.read(&mut request.conditions.ambient).unwrap();
    let mut compensator = Compensator::new(&model);
    let (warm, strobe) = strobed(&mut pin, || {
        compensator.correct(&request, &mut Budget::unlimited())
    });
    strobe.unwrap();
    assert!(matches!(warm.status, Status::Converged | Status::Settled));
    // 10 K at 1e-4 a kelvin, taken out of the first joint.
    let moved = warm.q[0] - cold.q[0];
    assert!((moved + 1e-3).abs() < 2e-5, "{moved}");
    pin.done();
    bus.done();
    delay.done();
}
