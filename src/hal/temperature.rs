//! Temperatures from I2C sensors into the conditions of a request.

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::I2c;
use lm75::{Lm75, ic};

use crate::Scalar;
use crate::effects::{Ambient, MAX_SENSORS};

/// Longest first conversion of the sensors supported, ms (LM75A of NXP and of TI: 100 to 300).
pub const CONVERSION_MS: u32 = 300;

/// A temperature sensor.
pub trait Thermometer {
    /// What may go wrong on the way to it.
    type Error;

    /// Starts it to convert continuously.
    fn start(&mut self) -> Result<(), Self::Error>;

    /// Its last temperature, degC.
    fn celsius(&mut self) -> Result<f32, Self::Error>;
}

/// LM75 and its kin, 0.5 K.
impl<I2C: I2c> Thermometer for Lm75<I2C, ic::Lm75> {
    type Error = lm75::Error<I2C::Error>;

    fn start(&mut self) -> Result<(), Self::Error> {
        self.enable()
    }

    fn celsius(&mut self) -> Result<f32, Self::Error> {
        self.read_temperature()
    }
}

/// PCT2075, 0.125 K.
impl<I2C: I2c> Thermometer for Lm75<I2C, ic::Pct2075> {
    type Error = lm75::Error<I2C::Error>;

    fn start(&mut self) -> Result<(), Self::Error> {
        self.enable()
    }

    fn celsius(&mut self) -> Result<f32, Self::Error> {
        self.read_temperature()
    }
}

/// Up to [`MAX_SENSORS`] sensors, in the order of the numbers that effects know them by.
///
/// Reading one takes some hundred microseconds on a bus of 400 kHz: read them in a slow task
/// and keep the conditions, not in the control loop. An arm warms up in minutes.
#[derive(Debug)]
pub struct Thermometers<S, const K: usize> {
    sensors: [S; K],
}

impl<S: Thermometer, const K: usize> Thermometers<S, K> {
    /// Starts the sensors and waits until each has converted once.
    pub fn start(mut sensors: [S; K], delay: &mut impl DelayNs) -> Result<Self, S::Error> {
        const { assert!(K <= MAX_SENSORS, "more sensors than conditions can carry") };
        for sensor in &mut sensors {
            sensor.start()?;
        }
        delay.delay_ms(CONVERSION_MS);
        Ok(Self { sensors })
    }

    /// Reads every sensor into `ambient`. One that does not answer becomes NaN there, which
    /// switches its effects off, and the others are read all the same; the first error is
    /// returned.
    pub fn read<T: Scalar>(&mut self, ambient: &mut Ambient<T>) -> Result<(), S::Error> {
        let mut result = Ok(());
        for (sensor, temperature) in self.sensors.iter_mut().zip(&mut ambient.temperature) {
            let celsius = sensor.celsius();
            *temperature = T::of(celsius.as_ref().map_or(f64::NAN, |&x| f64::from(x)));
            result = result.and(celsius.map(|_| ()));
        }
        result
    }
}
