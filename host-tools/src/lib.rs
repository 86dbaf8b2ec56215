//! Identify a robot arm's real geometry from measured poses, find what is left, and write it
//! as parameters for the controller.

pub mod cell;
pub mod circle_points;
pub mod closed_chain;
pub mod compensate;
pub mod convert;
pub mod demo;
pub mod deploy;
pub mod description;
pub mod diagnose;
pub mod error;
pub mod identify;
pub mod inspect;
mod joints;
mod keys;
pub mod link;
pub mod measurement;
pub mod observability;
pub mod output;
pub mod parameters;
pub mod plan;
pub mod predict;
pub mod random;
pub mod report;
pub mod teach;
mod units;
pub mod verify;
pub mod warning;
