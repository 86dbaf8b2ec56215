#![no_std]
#![forbid(unsafe_code)]
//! Takes the geometric and non-geometric errors of a robot arm out of its joint commands, in
//! the control loop.

mod aside;
pub mod budget;
mod chain;
pub mod compensate;
pub mod effects;
#[cfg(feature = "hal")]
pub mod hal;
pub mod jacobian;
mod joint;
#[cfg(feature = "link")]
pub mod link;
pub mod model;
pub mod params;
mod pose;
mod prepared;
mod scalar;
mod settings;
#[cfg(feature = "storage")]
pub mod storage;
pub mod taught;
mod vector;

pub use chain::{BakedJoint, Frame, Gauge, LinkMass, bake, forward};
pub use joint::{Convention, Joint, JointKind, Parameter, ParameterTwist};
pub use model::{Arm, BakedChain, Model, Room, Scratch};
pub use pose::{Pose, StoredPose, Twist};
pub use prepared::{Prepared, PreparedJoint};
pub use scalar::Scalar;
pub use settings::{Method, Settings};
