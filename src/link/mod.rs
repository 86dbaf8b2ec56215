//! Parameters and status over any byte stream.
//!
//! `docs/LINK.md` is the standard; this follows it. The controller calls [`Link::poll`] where
//! it has time: beside the loop, or below it. A poll does one bounded piece of work and never
//! waits. Until a blob has come whole, was decoded and is kept in the [`crate::storage`],
//! nothing changes; then the controller puts it to use when it sees fit.
//!
//! ```
//! # use truepose::link::{Event, Link, Tally};
//! # use truepose::storage::{Memory, Store};
//! # fn f<S, M>(uart: &mut S, store: &mut Store<M>, tally: &Tally) -> Result<(), S::Error>
//! # where S: embedded_io::Read + embedded_io::Write + embedded_io::ReadReady
//! #     + embedded_io::WriteReady, M: Memory {
//! let mut room = [0; 8192];
//! let mut link = Link::new("arm-0042", "press line 1.4", 6);
//! loop {
//!     if let Event::Saved(active) = link.poll(uart, store, &mut room, tally)? {
//!         // decode the first `active.length` bytes of `room`, hand them to the loop, then
//!         link.put_to_use(active);
//!     }
//! #   return Ok(());
//! }
//! # }
//! ```

mod controller;
mod desk;
mod frame;
mod message;
mod tally;
mod wire;

pub use controller::{Event, Link};
pub use frame::{Decoder, FRAME, Frame, FrameError, PAYLOAD};
pub use message::{
    Active, Announcement, Answer, Ask, CHUNK, Fault, Identity, PROTOCOL, Refusal, Reply, Report,
    Request, Stage,
};
pub use tally::{Last, Tally};
