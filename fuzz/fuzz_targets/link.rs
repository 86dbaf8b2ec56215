//! Any bytes on the wire: what is kept is a sound blob for this robot.

#![no_main]

use std::convert::Infallible;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use libfuzzer_sys::fuzz_target;
use truepose::link::{Event, Link, Tally};
use truepose::params::Blob;
use truepose::storage::{Flash, Store};
use truepose_firmware::ram::Ram;

/// What is left to come; what goes is forgotten.
struct Wire<'a>(&'a [u8]);

impl ErrorType for Wire<'_> {
    type Error = Infallible;
}

impl Read for Wire<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let (now, later) = self.0.split_at(bytes.len().min(self.0.len()));
        bytes[..now.len()].copy_from_slice(now);
        self.0 = later;
        Ok(now.len())
    }
}

impl ReadReady for Wire<'_> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.is_empty())
    }
}

impl Write for Wire<'_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl WriteReady for Wire<'_> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut wire = Wire(bytes);
    let mut store = Store::new(Flash::new(Ram::new())).expect("two slots");
    let mut room = vec![0; 8192];
    assert_eq!(store.load(&mut room), Ok(None));
    let mut link = Link::new("PUMA 560", "fuzz", 6);
    let mut idle = 0;
    while idle < 3 || !wire.0.is_empty() {
        let event = link.poll(&mut wire, &mut store, &mut room, &Tally::default());
        match event {
            Ok(Event::Idle) => idle += 1,
            Ok(Event::Worked) => idle = 0,
            Ok(Event::Saved(active)) => {
                let blob = Blob::decode(&room[..active.length as usize]).expect("sound");
                assert_eq!((blob.joints(), blob.robot.as_str()), (6, "PUMA 560"));
            }
            Err(never) => match never {},
        }
    }
});
