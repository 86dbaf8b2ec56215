//! `truepose monitor`: how a running controller is.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use truepose::link::{Report, Stage, Tally};
use truepose_host::error::Error;
use truepose_host::link::Controller;

use super::options::{Wire, seconds};
use super::send::{checksum_text, controller_json};
use super::{Files, Outcome};

/// Say how a running controller compensates; the answer is no where it has no parameters in
/// use, missed cycles or refused requests
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    wire: Wire,
    /// How often to look; 0: until interrupted
    #[arg(long, default_value_t = 1)]
    samples: u32,
    /// Seconds from one look to the next
    #[arg(long, default_value_t = 1.0, value_name = "S", value_parser = seconds)]
    every: f64,
}

pub(crate) fn files(_: &Options) -> Files<'_> {
    Files {
        inputs: Vec::new(),
        outputs: Vec::new(),
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let wire = &options.wire;
    let (mut client, controller) = wire.connect()?;
    let mut status = || client.status().map_err(|cause| wire.error(cause));
    let mut samples: Vec<Report> = Vec::new();
    let began = Instant::now();
    let mut last = status()?;
    samples.push(last);
    let many = options.samples != 1;
    if many {
        say(HEAD);
        say(&row(&last));
    }
    while options.samples == 0 || samples.len() < options.samples as usize {
        let next = Duration::from_secs_f64(options.every * samples.len() as f64);
        sleep(next.saturating_sub(began.elapsed()));
        last = status()?;
        say(&row(&last));
        // Without an end nobody will ask for them.
        if options.samples != 0 {
            samples.push(last);
        }
    }
    Ok(Outcome {
        text: text(&controller, &last),
        json: json!({
            "controller": controller_json(&controller),
            "every_s": options.every,
            "samples": samples.iter().map(sample).collect::<Vec<_>>(),
        }),
        outputs: Vec::new(),
        answer: healthy(&last),
    })
}

/// A line as it comes. A reader that has gone away wants no more.
fn say(line: &str) {
    let _ = writeln!(io::stdout(), "{line}");
}

/// In the order of [`Tally::statuses`].
const STATUSES: [&str; 8] = [
    "converged",
    "settled",
    "iteration limit",
    "out of budget",
    "conditions not finite",
    "not a pose",
    "prediction not finite",
    "joints not finite",
];
/// From here on a status is a refusal.
const REFUSALS: usize = 4;

fn healthy(report: &Report) -> bool {
    let tally = &report.tally;
    let refused = tally.statuses.iter().skip(REFUSALS).any(|&count| count > 0);
    report.active.is_some() && tally.missed == 0 && !refused
}

const HEAD: &str =
    "  answered   missed   update  last                  left_um  left_urad   cycles";

fn row(report: &Report) -> String {
    let Tally {
        answered,
        missed,
        last,
        ..
    } = &report.tally;
    let update = match report.active {
        Some(active) => active.sequence.to_string(),
        None => "none".to_owned(),
    };
    let [position, orientation] = match last.error {
        Some(error) => error.map(|x| format!("{:.3}", f64::from(x) * 1e6)),
        None => ["-".to_owned(), "-".to_owned()],
    };
    let status = status(last.status);
    format!(
        "{answered:10} {missed:8} {update:>8}  {status:20} {position:>8} {orientation:>10} {:8}",
        last.cycles
    )
}

fn status(place: u8) -> &'static str {
    STATUSES
        .get(usize::from(place))
        .copied()
        .unwrap_or("unknown")
}

fn stage(stage: &Stage) -> String {
    match stage {
        Stage::Idle => "none under way".to_owned(),
        Stage::Receiving { received, length } => format!("{received} of {length} bytes are there"),
        Stage::Checking => "checking what came".to_owned(),
        Stage::Saving => "keeping what came".to_owned(),
    }
}

/// Joints by number, from 1.
fn joints(mask: u16) -> Vec<u32> {
    (0..16)
        .filter(|k| mask >> k & 1 == 1)
        .map(|k| k + 1)
        .collect()
}

fn text(controller: &Controller, report: &Report) -> String {
    let mut text = String::new();
    let tally = &report.tally;
    let mut line = |words: String| {
        let _ = writeln!(text, "{words}");
    };
    line(format!(
        "{}: {}, {} joints",
        controller.robot, controller.firmware, controller.joints
    ));
    line(match report.active {
        Some(active) => format!(
            "parameters in use: update {}, {} bytes, checksum {}",
            active.sequence,
            active.length,
            checksum_text(&active)
        ),
        None => "no parameters in use".to_owned(),
    });
    line(format!("transfer: {}", stage(&report.stage)));
    line(format!(
        "since they came into use: {} requests answered, {} cycles missed",
        tally.answered, tally.missed
    ));
    for (name, count) in STATUSES.iter().zip(tally.statuses) {
        if count > 0 {
            line(format!("  {name}: {count}"));
        }
    }
    if tally.answered > 0 {
        let micro = |[m, rad]: [f32; 2]| {
            let micro = |x: f32| f64::from(x) * 1e6;
            format!("{:.3} um, {:.3} urad", micro(m), micro(rad))
        };
        line(format!(
            "largest error left, by the model: {}; most cycles: {}; {} commands at a limit or bound",
            micro(tally.largest_error),
            tally.most_cycles,
            tally.clamped
        ));
        let last = &tally.last;
        let left = last.error.map_or("not computed".to_owned(), micro);
        line(format!(
            "last: {}, {} iterations, error left {left}, {} cycles, joints at a limit or bound: {}",
            status(last.status),
            last.iterations,
            last.cycles,
            match joints(last.clamped).as_slice() {
                [] => "none".to_owned(),
                some => some
                    .iter()
                    .map(u32::to_string)
                    .collect::<Vec<_>>()
                    .join(", "),
            }
        ));
    }
    text
}

fn sample(report: &Report) -> Value {
    let tally = &report.tally;
    let error = |[m, rad]: [f32; 2]| json!({ "m": m, "rad": rad });
    let statuses = STATUSES.iter().zip(tally.statuses);
    let statuses: serde_json::Map<String, Value> = statuses
        .map(|(name, count)| (name.replace(' ', "-"), count.into()))
        .collect();
    json!({
        "active": report.active.map(|active| json!({
            "update": active.sequence,
            "bytes": active.length,
            "checksum": checksum_text(&active),
        })),
        "transfer": stage(&report.stage),
        "answered": tally.answered,
        "missed": tally.missed,
        "statuses": statuses,
        "clamped": tally.clamped,
        "largest_error": error(tally.largest_error),
        "most_cycles": tally.most_cycles,
        "last": {
            "status": status(tally.last.status),
            "iterations": tally.last.iterations,
            "clamped": joints(tally.last.clamped),
            "error": tally.last.error.map(error),
            "cycles": tally.last.cycles,
        },
    })
}
