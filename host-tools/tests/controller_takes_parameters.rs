//! `truepose send` and `truepose monitor` against the emulated controller, whose loop never
//! misses a cycle meanwhile.

use std::error::Error;
use std::fs;
use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use truepose::params::{Blob, checksum};
use truepose_firmware::parameters::{RIGID, ROOM, WITH_EFFECTS};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The emulated controller; ended when it is dropped.
struct Board {
    run: Child,
    process: PathBuf,
    port: String,
}

impl Board {
    fn start(folder: &Path) -> Outcome<Self> {
        // A port that nobody has.
        let address = TcpListener::bind("127.0.0.1:0")?.local_addr()?;
        let process = folder.join("emulator.pid");
        let _ = fs::remove_file(&process);
        let run = Command::new("tools/cargo-thumb")
            .args(["run", "--quiet", "--release"])
            .args(["--package", "truepose-firmware", "--bin", "link", "--"])
            .args(["-serial", &format!("tcp:{address},server=on,wait=off")])
            .arg("-pidfile")
            .arg(&process)
            .current_dir(root())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()?;
        let mut board = Self {
            run,
            process,
            port: format!("tcp:{address}"),
        };
        // The program may have to be compiled first.
        let began = Instant::now();
        while TcpStream::connect(address).is_err() {
            if let Some(status) = board.run.try_wait()? {
                return Err(format!("the emulator ended: {status}").into());
            }
            if began.elapsed() > Duration::from_secs(900) {
                return Err("the emulator does not listen".into());
            }
            sleep(Duration::from_millis(100));
        }
        Ok(board)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        if let Ok(process) = fs::read_to_string(&self.process) {
            let _ = Command::new("kill").arg(process.trim()).status();
        }
        let _ = self.run.wait();
    }
}

/// The command's exit status, text and JSON.
fn truepose(folder: &Path, arguments: &[&str]) -> Outcome<(Option<i32>, String, Value)> {
    let json = folder.join("said.json");
    let _ = fs::remove_file(&json);
    let run = Command::new(env!("CARGO_BIN_EXE_truepose"))
        .args(arguments)
        // The emulator hands over byte by byte, slowly where the machine is busy.
        .args(["--patience", "20"])
        .arg("--json")
        .arg(&json)
        .output()?;
    let talk = String::from_utf8_lossy(&run.stderr);
    let value = fs::read_to_string(&json).map_err(|e| format!("{e}: {talk}"))?;
    let text = String::from_utf8(run.stdout)?;
    Ok((run.status.code(), text, serde_json::from_str(&value)?))
}

/// The last of two looks at the controller, half a second apart.
fn look(folder: &Path, port: &str) -> Outcome<Value> {
    let more = ["--samples", "2", "--every", "0.5"];
    let monitor = [&["monitor", "--port", port], &more[..]].concat();
    let (status, text, json) = truepose(folder, &monitor)?;
    let samples = &json["samples"];
    assert_eq!(status, Some(0), "{text}");
    assert!(
        samples[1]["answered"].as_u64() > samples[0]["answered"].as_u64(),
        "the loop stands still: {text}"
    );
    println!("{text}");
    Ok(samples[1].clone())
}

fn in_use(bytes: &[u8]) -> String {
    format!("{:08x}", checksum(bytes))
}

#[test]
fn parameters_come_and_go_and_no_cycle_is_missed() -> Outcome {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("link");
    fs::create_dir_all(&folder)?;
    let board = Board::start(&folder)?;
    let port = board.port.as_str();
    let file = |name: &str, bytes: &[u8]| -> Outcome<String> {
        let file = folder.join(name);
        fs::write(&file, bytes)?;
        Ok(file.display().to_string())
    };
    let (rigid, effects) = (
        file("rigid.tpb", RIGID)?,
        file("effects.tpb", WITH_EFFECTS)?,
    );
    let mut other = Blob::decode(RIGID)?;
    other.robot = "another".try_into().unwrap_or_default();
    let mut buffer = [0; ROOM];
    let other = file("other.tpb", other.encode(&mut buffer)?)?;
    let send = |file: &str| truepose(&folder, &["send", "--params", file, "--port", port]);

    let seen = look(&folder, port)?;
    assert_eq!(seen["active"]["checksum"], in_use(RIGID));
    assert_eq!(seen["active"]["update"], 0);

    for (update, file, bytes) in [(1, &effects, WITH_EFFECTS), (2, &rigid, RIGID)] {
        let (status, text, json) = send(file)?;
        assert_eq!(status, Some(0), "{text}");
        assert_eq!(json["result"], "in-use", "{text}");
        assert_eq!(json["update"], update);
        let seen = look(&folder, port)?;
        assert_eq!(seen["active"]["checksum"], in_use(bytes));
        assert_eq!(seen["missed"], 0);
        assert_eq!(seen["statuses"]["converged"], seen["answered"]);
        assert_eq!(seen["last"]["status"], "converged");
        let left = seen["largest_error"]["m"].as_f64();
        assert!(left.is_some_and(|m| m > 0.0 && m < 1e-6), "{left:?}");
        let cycles = seen["most_cycles"].as_u64();
        assert!(cycles.is_some_and(|c| c > 1000 && c < 60_000), "{cycles:?}");
    }

    let (status, text, json) = send(&other)?;
    assert_eq!((status, &json["result"]), (Some(1), &"refused".into()));
    assert!(text.contains("for another robot"), "{text}");
    // Noise, and a connection that ends in the middle of a frame.
    let address = port.trim_start_matches("tcp:");
    let mut wire = TcpStream::connect(address)?;
    let noise: Vec<u8> = (0..5000_u32).map(|k| (k * k / 7) as u8).collect();
    wire.write_all(&noise)?;
    drop(wire);
    let seen = look(&folder, port)?;
    assert_eq!(seen["active"]["update"], 2);
    assert_eq!(seen["missed"], 0);
    Ok(())
}
