//! Identify a robot arm's real geometry from measured poses, find what is left, and write it
//! as parameters for the controller.

pub mod cell;
pub mod description;
pub mod error;
pub mod identify;
mod keys;
pub mod measurement;
pub mod output;
mod units;
pub mod warning;
