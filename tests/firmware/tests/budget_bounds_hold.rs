//! The worst case that the budget counts on, against adversarial requests on the emulated core.

use std::error::Error;
use std::path::Path;
use std::process::Command;

/// What program `name` prints on the emulated core.
fn emulated(name: &str) -> Result<String, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let run = Command::new("tools/cargo-thumb")
        .args([
            "run",
            "--quiet",
            "--release",
            "--package",
            "truepose-firmware",
        ])
        .args(["--bin", name])
        .current_dir(root)
        .output()?;
    let text = String::from_utf8(run.stdout)?;
    if run.status.success() {
        return Ok(text);
    }
    let said = String::from_utf8_lossy(&run.stderr);
    Err(format!("{name}: {}\n{text}{said}", run.status).into())
}

#[test]
fn no_request_costs_more_than_its_bound() -> Result<(), Box<dyn Error>> {
    let text = emulated("worst")?;
    println!("{text}");
    assert!(!text.contains("exceeded"), "{text}");
    let mut requests = 0;
    let mut tightest = 0;
    let (mut lookups, mut polynomials) = (0, 0);
    for line in text.lines() {
        let number = |before: &str| -> Option<u32> {
            let end = line.find(before)?;
            line.get(..end)?.rsplit([' ', '(']).next()?.parse().ok()
        };
        if let Some(looked_up) = number(" look-ups") {
            lookups += looked_up;
            polynomials = polynomials.max(number(" % of their bound").ok_or(line)?);
            continue;
        }
        requests += number(" requests").ok_or(line)?;
        tightest = tightest.max(number(" % of its bound").ok_or(line)?);
    }
    assert!(requests >= 10_000, "{requests} requests");
    // A bound far above everything would hold as well.
    assert!(tightest >= 80, "{tightest} %");
    assert!(lookups >= 1000, "{lookups} look-ups");
    assert!(polynomials >= 80, "{polynomials} %");
    Ok(())
}
