//! `truepose demo`: the whole loop on a built-in robot cell.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use truepose_host::cell::Arm;
use truepose_host::demo::{Demonstration, Errors, Settings, demonstrate};
use truepose_host::error::Error;
use truepose_host::identify::assess::Statistics;
use truepose_host::output::Output;

use super::progress::Progress;
use super::verify::{comparison, repeats, three_digits};
use super::{Files, Outcome};

/// Show the whole loop on a built-in robot cell: nothing has to be prepared
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// The simulated arm
    #[arg(long, value_enum, default_value_t = Robot::Puma560)]
    arm: Robot,
    /// Another number, another arm of the same make
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// How many poses to measure
    #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u32).range(20..=10_000))]
    poses: u32,
    /// Joint whose gear runs out of true
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=7))]
    joint: u8,
    /// Leave robot.toml, data.csv, data.toml, P.tpb and NEW.csv in this folder, to try the
    /// other commands on
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
    #[arg(skip)]
    kept: std::sync::OnceLock<Vec<PathBuf>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Robot {
    Puma560,
    Ur10,
    Irb120,
    Panda,
    Stanford,
}

impl Robot {
    fn arm(self) -> Arm {
        match self {
            Self::Puma560 => Arm::Puma560,
            Self::Ur10 => Arm::Ur10,
            Self::Irb120 => Arm::Irb120,
            Self::Panda => Arm::Panda,
            Self::Stanford => Arm::Stanford,
        }
    }
}

/// Files that `--keep` leaves.
const KEPT: [&str; 5] = ["robot.toml", "data.csv", "data.toml", "P.tpb", "NEW.csv"];

pub(crate) fn files(options: &Options) -> Files<'_> {
    let kept = options.kept.get_or_init(|| match &options.keep {
        Some(folder) => KEPT.iter().map(|name| folder.join(name)).collect(),
        None => Vec::new(),
    });
    Files {
        inputs: Vec::new(),
        outputs: kept.iter().map(PathBuf::as_path).collect(),
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let mut progress = Progress::new("running the cell");
    let shown = demonstrate(
        &Settings {
            arm: options.arm.arm(),
            seed: options.seed,
            poses: options.poses as usize,
            joint: usize::from(options.joint) - 1,
        },
        &mut |share| progress.tell(share),
    )?;
    drop(progress);
    let outputs = match &options.keep {
        Some(folder) => [
            shown.measured.robot.as_bytes(),
            shown.measured.data.as_bytes(),
            shown.measured.sidecar.as_bytes(),
            shown.parameters.as_slice(),
            shown.new_data.as_bytes(),
        ]
        .into_iter()
        .zip(KEPT)
        .map(|(bytes, name)| Output {
            file: folder.join(name),
            bytes: bytes.to_vec(),
        })
        .collect(),
        None => Vec::new(),
    };
    Ok(Outcome {
        text: text(&shown, options),
        json: json(&shown, options),
        outputs,
        answer: true,
    })
}

fn text(shown: &Demonstration, options: &Options) -> String {
    let [identify, verify] = shown.rows;
    let joint = options.joint;
    let degrees = |x: f64| three_digits(x.to_degrees());
    let named = match shown.found.as_slice() {
        [] => "nothing".to_owned(),
        found => found.join("; "),
    };
    let amplitude = shown.amplitude.map(|x| format!(" ({} deg)", degrees(x)));
    let mut text = format!(
        "{}, simulated: every link, base and tool a little off, and joint {joint}'s gear out of \
         true once a turn.\n\
         1. measure: {identify} poses to fit, {verify} held back; noise {} mm\n\
         2. identify and diagnose; rms error of the poses held back:\n",
        shown.robot,
        three_digits(shown.noise * 1e3),
    );
    let names = [
        "base and tool aligned",
        "geometry identified",
        "with what was found",
    ];
    text += &table(&names, &shown.predicted);
    text += &format!(
        "   found: {named}{}; hidden: joint {joint}, once a turn, {} deg\n\
         3. deploy: {} bytes for the controller\n\
         4. compensate, in single precision as the controller does, and execute; rms error of \
         the arm:\n",
        amplitude.unwrap_or_default(),
        degrees(shown.hidden),
        shown.parameters.len(),
    );
    let names = [
        "before, nominal commands",
        "after, geometry",
        "after, with what was found",
    ];
    text += &table(&names, &shown.executed);
    let [targets, left_out] = shown.targets;
    text += &format!("   ({targets} new targets, all clear of singular postures)\n");
    if left_out > 0 {
        text += &format!(
            "   ({left_out} of {targets} targets, too near a limit to be corrected completely, are \
             left out)\n"
        );
    }
    text += "5. verify on the new measurements:\n";
    let mut verified = comparison(&shown.verified);
    if let Some(iso) = &shown.verified.iso9283 {
        verified += &repeats(iso);
    }
    for line in verified.lines() {
        text += &format!("   {line}\n");
    }
    if let Some(folder) = &options.keep {
        text += &format!("files of all this: {}\n", folder.display());
    }
    text
}

fn table(names: &[&str; 3], errors: &[Errors; 3]) -> String {
    let mut text = String::new();
    for (name, e) in names.iter().zip(errors) {
        let mm = three_digits(e.position.rms * 1e3);
        let deg = three_digits(e.orientation.rms.to_degrees());
        text += &format!("   {name:<26} {mm:>8} mm {deg:>9} deg\n");
    }
    text
}

fn json(shown: &Demonstration, options: &Options) -> Value {
    let of = |s: &Statistics, scale: f64| json!({ "rms": s.rms * scale, "mean": s.mean * scale, "max": s.max * scale });
    let both = |[nominal, geometric, with_effect]: &[Errors; 3]| {
        let degrees = 1.0_f64.to_degrees();
        json!({
            "error_mm": {
                "nominal": of(&nominal.position, 1e3),
                "geometric": of(&geometric.position, 1e3),
                "final": of(&with_effect.position, 1e3),
            },
            "error_deg": {
                "nominal": of(&nominal.orientation, degrees),
                "geometric": of(&geometric.orientation, degrees),
                "final": of(&with_effect.orientation, degrees),
            },
        })
    };
    let iso = shown.verified.iso9283.as_ref();
    json!({
        "robot": shown.robot,
        "rows": { "identify": shown.rows[0], "verify": shown.rows[1] },
        "held_back": both(&shown.predicted),
        "executed": both(&shown.executed),
        "targets": { "all": shown.targets[0], "left_out": shown.targets[1] },
        "hidden": { "kind": "gear-eccentricity", "joint": options.joint, "order": 1, "amplitude": shown.hidden },
        "found": { "effects": shown.found, "amplitude": shown.amplitude },
        "verify": {
            "error_mm": {
                "before": of(&shown.verified.before.position, 1e3),
                "after": of(&shown.verified.after.position, 1e3),
            },
            "iso9283": iso.map(|iso| json!({
                "ap_mm": iso.accuracy() * 1e3, "rp_mm": iso.repeatability() * 1e3,
            })),
        },
    })
}
