//! From the residual to what the model lacks: is the input right, is something missing, and
//! if so, what.

pub mod curve;
pub mod hypothesis;
pub mod input;
pub mod model;
pub mod noise;
pub mod periodogram;
mod refine;
mod run;
pub mod search;
pub mod significance;
pub mod space;
pub mod validate;
pub mod whiteness;

pub use run::{Diagnosis, Named, Rival, diagnose};
