//! `send` and `monitor` against a controller behind a socket, on good and on bad wires.

use std::convert::Infallible;
use std::fs;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::support::{folder, robot, said, truepose, write_blob};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::link::{Event, Link, Tally};
use truepose::params::decode;
use truepose::storage::{Flash, Store};
use truepose_firmware::ram::Ram;

/// A socket as a UART. Of every `harm` bytes in either direction one is altered, one lost.
struct Wire {
    socket: TcpStream,
    coming: Vec<u8>,
    harm: usize,
    passed: usize,
}

impl Wire {
    /// `byte` as it arrives.
    fn pass(&mut self, byte: u8) -> Option<u8> {
        self.passed += 1;
        match self.passed.checked_rem(self.harm) {
            Some(17) => Some(byte ^ 0x20),
            Some(1) => None,
            _ => Some(byte),
        }
    }
}

impl ErrorType for Wire {
    type Error = Infallible;
}

impl ReadReady for Wire {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        let mut bytes = [0; 64];
        match self.socket.read(&mut bytes) {
            Ok(count) => {
                for byte in &bytes[..count] {
                    let passed = self.pass(*byte);
                    self.coming.extend(passed);
                }
            }
            Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
        }
        Ok(!self.coming.is_empty())
    }
}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let count = bytes.len().min(self.coming.len());
        for (to, from) in bytes.iter_mut().zip(self.coming.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

impl WriteReady for Wire {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let passed: Vec<u8> = bytes.iter().filter_map(|b| self.pass(*b)).collect();
        // The host may have hung up.
        let _ = self.socket.write_all(&passed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A controller behind a socket, until it is dropped.
struct Controller {
    port: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Of the robot `name`. It puts parameters to use at once where `prompt`.
    fn start(name: &'static str, harm: usize, prompt: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp:{}", listener.local_addr().unwrap());
        let stop = Arc::new(AtomicBool::new(false));
        let thread = thread::spawn({
            let stop = Arc::clone(&stop);
            move || serve(&listener, &stop, name, harm, prompt)
        });
        Self {
            port,
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let result = self.thread.take().map(JoinHandle::join);
        assert!(matches!(result, Some(Ok(()))), "the controller fell over");
    }
}

/// Takes one connection after the other; a request to the loop in every turn.
fn serve(listener: &TcpListener, stop: &AtomicBool, name: &str, harm: usize, prompt: bool) {
    listener.set_nonblocking(true).unwrap();
    let mut store = Store::new(Flash::new(Ram::new())).unwrap();
    let (mut room, mut used) = (vec![0; 8192], Vec::new());
    assert_eq!(store.load(&mut room), Ok(None));
    let mut link = Link::new(name, "simulated", 6);
    let mut tally = Tally::default();
    let mut wire: Option<Wire> = None;
    while !stop.load(Ordering::Relaxed) {
        if let Ok((socket, _)) = listener.accept() {
            socket.set_nonblocking(true).unwrap();
            wire = Some(Wire {
                socket,
                coming: Vec::new(),
                harm,
                passed: 100,
            });
        }
        if let Some(wire) = &mut wire {
            match link.poll(wire, &mut store, &mut room, &tally).unwrap() {
                Event::Saved(active) if prompt => {
                    used = room[..active.length as usize].to_vec();
                    tally = Tally::default();
                    link.put_to_use(active);
                }
                Event::Idle => thread::sleep(Duration::from_micros(100)),
                _ => {}
            }
        }
        if tally.answered < 1000
            && let Ok(model) = decode::<f32, 6>(&used)
        {
            let request = Request::joints([0.3; 6]);
            let outcome = Compensator::new(&model).correct(&request, &mut Budget::unlimited());
            tally.count(&outcome);
        }
    }
}

fn send(folder: &Path, controller: &Controller, more: &[&str]) -> (i32, String, String) {
    let arguments = ["send", "--params", "P.tpb", "--port", &controller.port];
    said(&truepose(folder, &[&arguments[..], more].concat()))
}

fn json(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(folder.join(name)).unwrap()).unwrap()
}

#[test]
fn parameters_are_sent_used_and_watched() {
    let folder = folder("send");
    write_blob(&folder);
    let controller = Controller::start("six", 0, true);
    let arguments = ["monitor", "--port", &controller.port];
    let (status, text, talk) = said(&truepose(&folder, &arguments));
    assert_eq!((status, talk.as_str()), (1, ""), "{text}");
    assert!(text.contains("no parameters in use"), "{text}");

    let (status, text, talk) = send(&folder, &controller, &["--json", "S.json"]);
    assert_eq!((status, talk.as_str()), (0, ""), "{text}");
    let size = fs::metadata(folder.join("P.tpb")).unwrap().len();
    assert_eq!(
        text,
        format!("six: P.tpb is in use, {size} bytes, update 1\n")
    );
    let sent = json(&folder, "S.json");
    assert_eq!(sent["result"], "in-use");
    assert_eq!(sent["controller"]["firmware"], "simulated");

    let (status, text, _) = send(&folder, &controller, &[]);
    assert_eq!(
        (status, text.as_str()),
        (0, "six: P.tpb is in use already, nothing was sent\n")
    );

    let more = ["--samples", "3", "--every", "0.05", "--json", "M.json"];
    let (status, text, talk) = said(&truepose(&folder, &[&arguments[..], &more].concat()));
    assert_eq!((status, talk.as_str()), (0, ""), "{text}");
    assert!(text.contains("six: simulated, 6 joints\n"), "{text}");
    assert!(text.contains("parameters in use: update 1, "), "{text}");
    assert!(text.contains("  converged: "), "{text}");
    let seen = json(&folder, "M.json");
    let samples = seen["samples"].as_array().unwrap();
    assert_eq!(samples.len(), 3);
    assert_eq!(samples[2]["active"]["checksum"], sent["checksum"]);
    assert_eq!(samples[2]["missed"], 0);
    let left = samples[2]["last"]["error"]["m"].as_f64().unwrap();
    assert!(left > 0.0 && left < 1e-6, "{left}");
}

#[test]
fn another_robots_parameters_are_refused() {
    let folder = folder("send_refused");
    write_blob(&folder);
    let controller = Controller::start("seven", 0, true);
    let (status, text, talk) = send(&folder, &controller, &["--json", "S.json"]);
    assert_eq!((status, talk.as_str()), (1, ""));
    let first = "seven: P.tpb was refused: the parameters are for another robot\n";
    assert!(text.starts_with(first), "{text}");
    let sent = json(&folder, "S.json");
    assert_eq!(sent["result"], "refused");
    assert_eq!(sent["refusal"], "the parameters are for another robot");
    assert_eq!(sent["update"], serde_json::Value::Null);
}

#[test]
fn a_controller_may_wait_before_it_uses_what_it_keeps() {
    let folder = folder("send_kept");
    write_blob(&folder);
    let controller = Controller::start("six", 0, false);
    let (status, text, _) = send(&folder, &controller, &[]);
    assert_eq!(status, 0);
    assert!(text.contains("has not put it to use yet"), "{text}");
}

#[test]
fn a_bad_wire_makes_it_slower_and_nothing_else() {
    let folder = folder("send_noise");
    write_blob(&folder);
    let controller = Controller::start("six", 900, true);
    let (status, text, talk) = send(&folder, &controller, &[]);
    assert_eq!((status, talk.as_str()), (0, ""), "{text}");
    assert!(text.contains("P.tpb is in use"), "{text}");
}

#[test]
fn where_nobody_answers_it_says_so() {
    let folder = folder("send_nobody");
    write_blob(&folder);
    // Takes the connection and says nothing.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let silent = format!("tcp:{}", listener.local_addr().unwrap());
    let gone = {
        let other = TcpListener::bind("127.0.0.1:0").unwrap();
        format!("tcp:{}", other.local_addr().unwrap())
    };
    for (port, words) in [
        (silent.as_str(), "no answer to 5 requests of 0.2 s each"),
        (&gone, "cannot be opened"),
        ("/dev/no-such-port", "cannot be opened"),
        ("tcp:nonsense", "cannot be opened"),
    ] {
        for command in [
            &["send", "--params", "P.tpb", "--port"][..],
            &["monitor", "--port"],
        ] {
            let more = [port, "--json", "X.json", "--patience", "0.2"];
            let arguments = [command, &more].concat();
            let (status, text, talk) = said(&truepose(&folder, &arguments));
            assert_eq!((status, text.as_str()), (2, ""), "{talk}");
            assert!(talk.starts_with(&format!("error: {port}: ")), "{talk}");
            assert!(talk.contains(words), "{talk}");
        }
    }
    assert!(!folder.join("X.json").exists());
    assert_eq!(robot(&folder).name, "six");
}
