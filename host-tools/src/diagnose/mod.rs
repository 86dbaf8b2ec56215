//! From the residual to what the model lacks: is the input right, is something missing, and
//! if so, what.

mod addition;
pub(crate) mod chance;
pub(crate) mod clock;
mod confirmed;
pub mod control;
pub mod curve;
mod doubt;
mod exchange;
pub mod freed;
pub mod friction;
mod groups;
pub mod hypothesis;
pub mod input;
mod likelier;
pub mod model;
mod naming;
pub mod noise;
pub mod opponent;
mod ordered;
mod pairs;
pub mod periodogram;
pub mod proportion;
mod refine;
mod rivals;
mod run;
pub mod search;
mod sensible;
mod several;
mod smoothness;
pub mod space;
pub mod unnamed;
pub mod unseen;
pub mod validate;
pub mod whiteness;

pub use likelier::likelier;
pub use rivals::Rival;
pub use run::{Answer, Diagnosis, Named, UNDECIDED, diagnose};
