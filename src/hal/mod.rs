//! What stands between the controller's hardware and the loop, over the traits of
//! embedded-hal: temperatures into a request's conditions, a pin that shows on an oscilloscope
//! how long a correction takes. Nothing of it is in the numerics.

mod strobe;
mod temperature;

pub use strobe::strobed;
pub use temperature::{CONVERSION_MS, Thermometer, Thermometers};
