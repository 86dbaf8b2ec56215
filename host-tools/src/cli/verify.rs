//! `truepose verify`: before and after on new measurements.

use clap::Args;
use serde_json::{Value, json};
use truepose_host::error::Error;
use truepose_host::identify::assess::Statistics;
use truepose_host::measurement::{self, Expected, Measured, Purpose};
use truepose_host::parameters::{self, missing_conditions};
use truepose_host::verify::{Iso9283, Verified, verify};

use super::options::{Data, Params};
use super::{Files, Outcome, warn};

/// Compare new measurements, made with compensated commands, with what the parameters say
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    params: Params,
    #[command(flatten)]
    data: Data,
    /// The instrument stands elsewhere than when the parameters were identified: find its
    /// placement from these rows first
    #[arg(long)]
    realign: bool,
    /// Largest error of any row that is accepted, mm; above it the exit status is 1
    #[arg(long, value_name = "MM", value_parser = positive)]
    accept_mm: Option<f64>,
    /// Likewise of the orientation or the bearing, deg
    #[arg(long, value_name = "DEG", value_parser = positive)]
    accept_deg: Option<f64>,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("give a number above zero".to_owned()),
    }
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    Files {
        inputs: vec![&options.params.params, &options.data.data],
        outputs: Vec::new(),
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let (params, data) = (&options.params.params, &options.data.data);
    let bytes = parameters::read(params)?;
    let blob = parameters::decode(params, &bytes)?;
    let table = measurement::read(data, &Expected::of_blob(&blob), Purpose::Check)?;
    warn(&table.warnings);
    warn(&missing_conditions(&blob, &table));
    let turns = matches!(
        table.measured,
        Measured::Pose | Measured::Bearing | Measured::Board | Measured::Sight
    );
    if options.accept_deg.is_some() && !turns {
        return Err(Error::Usage(format!(
            "--accept-deg: {} has no orientations or bearings; measure full poses or leave the \
             option out",
            data.display()
        )));
    }
    let verified = verify(params, &blob, &table, options.realign)?;
    let accepted = accepted(&verified, options);
    let robot = blob.robot.as_str();
    Ok(Outcome {
        text: text(robot, &verified, options, accepted),
        json: json(robot, &verified, accepted),
        outputs: Vec::new(),
        answer: accepted.unwrap_or(true),
    })
}

/// `None` where nothing was asked for.
fn accepted(verified: &Verified, options: &Options) -> Option<bool> {
    let position = options
        .accept_mm
        .map(|mm| verified.after.position.max * 1e3 <= mm);
    let angles = verified.after.orientation.or(verified.after.bearing);
    let orientation = match (options.accept_deg, angles) {
        (Some(deg), Some(angles)) => Some(angles.max.to_degrees() <= deg),
        _ => None,
    };
    match (position, orientation) {
        (None, None) => None,
        _ => Some(position.unwrap_or(true) && orientation.unwrap_or(true)),
    }
}

/// Table, ISO figures and answer for people.
pub(super) fn text(
    robot: &str,
    verified: &Verified,
    options: &Options,
    accepted: Option<bool>,
) -> String {
    let mut text = format!("{robot}: {} new rows", verified.rows);
    if verified.realigned {
        text += ", the instrument's placement found from them";
    }
    text += "\n";
    text += &comparison(verified);
    if let Some(iso) = &verified.iso9283 {
        text += &repeats(iso);
    }
    if let Some(accepted) = accepted {
        let limit = |x: Option<f64>, unit: &str| x.map(|x| format!("{x} {unit}"));
        let limits = [
            limit(options.accept_mm, "mm"),
            limit(options.accept_deg, "deg"),
        ];
        let limits: Vec<String> = limits.into_iter().flatten().collect();
        let word = if accepted { "accepted" } else { "NOT accepted" };
        text += &format!(
            "{word}: every row within {} was asked for\n",
            limits.join(" and ")
        );
    }
    text
}

/// The table before / after.
pub(crate) fn comparison(verified: &Verified) -> String {
    let of = match verified.measured {
        Measured::Length => "length error",
        Measured::Distance => "distance error",
        Measured::Point | Measured::Plane => "touch error",
        Measured::Bearing | Measured::Sight => "error across the sight",
        Measured::Board | Measured::Mark => "error of what is seen",
        Measured::Position | Measured::Pose | Measured::Nothing => "position error",
    };
    let mut text = format!("{of:<22}      rms     mean      max\n");
    let mut line = |name: &str, s: &Statistics, scale: f64, unit: &str| {
        let [rms, mean, max] = [s.rms, s.mean, s.max].map(|x| three_digits(x * scale));
        text += &format!("  {name:<20} {rms:>8} {mean:>8} {max:>8} {unit}\n");
    };
    line("before", &verified.before.position, 1e3, "mm");
    line("after", &verified.after.position, 1e3, "mm");
    if let (Some(before), Some(after)) = (verified.before.orientation, verified.after.orientation) {
        let degrees = 1.0_f64.to_degrees();
        line("before, orientation", &before, degrees, "deg");
        line("after, orientation", &after, degrees, "deg");
    }
    if let (Some(before), Some(after)) = (verified.before.bearing, verified.after.bearing) {
        let degrees = 1.0_f64.to_degrees();
        line("before, bearing", &before, degrees, "deg");
        line("after, bearing", &after, degrees, "deg");
    }
    if let (Some(before), Some(after)) = (verified.before.tool_point, verified.after.tool_point) {
        let [before, after] = [before, after].map(|x| three_digits(x * 1e3));
        text += &format!(
            "tool point, if no direction errs more than another: {before} mm rms before, \
             {after} mm after\n"
        );
    }
    text
}

/// ISO 9283 figures, worst and pose by pose.
pub(crate) fn repeats(iso: &Iso9283) -> String {
    let mut text = format!(
        "ISO 9283, worst of {} repeated poses: accuracy AP {} mm, repeatability RP {} mm\n",
        iso.poses.len(),
        three_digits(iso.accuracy() * 1e3),
        three_digits(iso.repeatability() * 1e3),
    );
    for pose in &iso.poses {
        let [ap, rp] = [pose.accuracy, pose.repeatability].map(|x| three_digits(x * 1e3));
        text += &format!(
            "  row {}, {} times: AP {ap} mm, RP {rp} mm",
            pose.row, pose.repeats
        );
        if let Some(angles) = pose.orientation {
            let [ap, rp] = angles.map(|x| three_digits(x.to_degrees()));
            text += &format!(", AP {ap} deg, RP {rp} deg");
        }
        text += "\n";
    }
    text
}

/// Three significant digits, no exponent.
pub(crate) fn three_digits(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let places = (2 - x.abs().log10().floor() as i32).clamp(0, 9);
    format!("{x:.*}", usize::try_from(places).unwrap_or(0))
}

fn json(robot: &str, verified: &Verified, accepted: Option<bool>) -> Value {
    let of = |s: &Statistics, scale: f64| {
        json!({
            "rms": s.rms * scale, "mean": s.mean * scale, "max": s.max * scale,
            "rms_interval95": s.rms_interval95.map(|x| x * scale),
        })
    };
    let degrees = 1.0_f64.to_degrees();
    let mut value = json!({
        "robot": robot,
        "measured": match verified.measured {
            Measured::Pose => "pose",
            Measured::Length => "length",
            Measured::Distance => "distance",
            Measured::Point => "point",
            Measured::Plane => "plane",
            Measured::Bearing => "bearing",
            Measured::Board => "board",
            Measured::Mark => "mark",
            Measured::Sight => "sight",
            Measured::Position | Measured::Nothing => "position",
        },
        "rows": verified.rows,
        "realigned": verified.realigned,
        "error_mm": {
            "before": of(&verified.before.position, 1e3),
            "after": of(&verified.after.position, 1e3),
        },
        "accepted": accepted,
    });
    if let (Some(before), Some(after)) = (verified.before.orientation, verified.after.orientation) {
        value["error_deg"] =
            json!({ "before": of(&before, degrees), "after": of(&after, degrees) });
    }
    if let (Some(before), Some(after)) = (verified.before.bearing, verified.after.bearing) {
        value["error_deg"] =
            json!({ "before": of(&before, degrees), "after": of(&after, degrees) });
    }
    if let (Some(before), Some(after)) = (verified.before.tool_point, verified.after.tool_point) {
        value["tool_point_mm"] = json!({ "before": before * 1e3, "after": after * 1e3 });
    }
    if let Some(iso) = &verified.iso9283 {
        let poses: Vec<Value> = iso
            .poses
            .iter()
            .map(|pose| {
                let [ap_deg, rp_deg] = match pose.orientation {
                    Some(angles) => angles.map(|x| json!(x.to_degrees())),
                    None => [Value::Null, Value::Null],
                };
                json!({
                    "row": pose.row, "repeats": pose.repeats,
                    "ap_mm": pose.accuracy * 1e3, "rp_mm": pose.repeatability * 1e3,
                    "ap_deg": ap_deg, "rp_deg": rp_deg,
                })
            })
            .collect();
        value["iso9283"] = json!({
            "ap_mm": iso.accuracy() * 1e3, "rp_mm": iso.repeatability() * 1e3, "poses": poses,
        });
    }
    value
}
