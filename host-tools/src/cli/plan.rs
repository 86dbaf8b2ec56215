//! `truepose plan`: which poses to measure.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;
use truepose::Pose;
use truepose::params::Blob;
use truepose_host::description::Robot;
use truepose_host::diagnose::UNDECIDED;
use truepose_host::error::Error;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::observation::Sigmas;
use truepose_host::identify::problem::ASSUMED;
use truepose_host::measurement::{self, Expected, Measured, Purpose};
use truepose_host::observability::Observability;
use truepose_host::output::Output;
use truepose_host::parameters;
use truepose_host::plan::{self, Criterion, MeasuredArm, Plan, Seen, Sensitivity, Settings};

use super::diagnose::diagnosed;
use super::options::Out;
use super::progress::Progress;
use super::verify::three_digits;
use super::{Files, Outcome, warn};

/// Choose the poses whose measurement tells most about the arm
#[derive(Debug, Args)]
pub(crate) struct Options {
    /// The nominal robot, TOML or URDF
    #[arg(long, value_name = "R")]
    robot: PathBuf,
    /// Parameters identified before: the arm as it is known so far, its effects included
    #[arg(long, value_name = "P.tpb")]
    params: Option<PathBuf>,
    /// How many poses to choose
    #[arg(long, value_name = "K")]
    poses: usize,
    #[command(flatten)]
    out: Out,
    /// Poses measured already; they count, and say what is measured and how well
    #[arg(long, value_name = "D.csv")]
    data: Option<PathBuf>,
    /// Choose the poses that tell explanations apart which --data leaves open: it is diagnosed
    /// first
    #[arg(long, requires = "data", conflicts_with_all = ["params", "measure", "minimax"])]
    discriminate: bool,
    /// What will be measured; with --data, what was
    #[arg(long, value_enum)]
    measure: Option<Measure>,
    /// Make the largest error of the predicted tool small, not the parameters' confidence
    /// region
    #[arg(long)]
    minimax: bool,
    /// The instrument's noise, mm, one standard deviation per axis
    #[arg(long, value_name = "MM")]
    position_sigma_mm: Option<f64>,
    /// Likewise of its orientations, deg
    #[arg(long, value_name = "DEG")]
    orientation_sigma_deg: Option<f64>,
    /// Fixed end of the wire, mm in the robot base frame; for lengths
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    anchor_mm: Option<Vec<f64>>,
    /// Another number, another plan of the same worth
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Measure {
    /// The tool point
    Position,
    /// Position and orientation of the tool
    Pose,
    /// The length of a wire from a fixed point to the tool point
    Length,
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let optional = [&options.params, &options.data].into_iter().flatten();
    let inputs = std::iter::once(&options.robot).chain(optional);
    Files {
        inputs: inputs.map(PathBuf::as_path).collect(),
        outputs: vec![&options.out.out],
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let robot = Robot::read(&options.robot)?;
    let limits = plan::limits(&robot).map_err(|joint| {
        Error::Usage(format!(
            "{}: joint {joint} slides without limits; give it limits_mm",
            options.robot.display()
        ))
    })?;
    if options.discriminate {
        return discriminating(options, &robot, &limits);
    }
    let mut arm = known(options, &robot)?;
    let table = match &options.data {
        Some(file) => Some(measurement::read(
            file,
            &Expected::of(&robot),
            Purpose::Check,
        )?),
        None => None,
    };
    if let Some(table) = &table {
        warn(&table.warnings);
    }
    let was = match table.as_ref().map(|table| table.measured) {
        Some(Measured::Pose) => Some(Measure::Pose),
        Some(Measured::Length) => Some(Measure::Length),
        Some(Measured::Position | Measured::Nothing) => Some(Measure::Position),
        None => None,
        Some(Measured::Bearing | Measured::Distance | Measured::Point | Measured::Plane)
            if options.measure.is_none() =>
        {
            return Err(Error::Usage(
                "--data holds bearings, distances or touches, which plan does not choose poses \
                 for; --measure says what the new poses will be measured by"
                    .to_owned(),
            ));
        }
        Some(_) => None,
    };
    let measure = options.measure.or(was).unwrap_or(Measure::Position);
    let seen = match measure {
        Measure::Position => Seen::Position,
        Measure::Pose => Seen::Pose,
        Measure::Length => Seen::Length,
    };
    match (seen, options.anchor_mm.as_deref()) {
        (Seen::Length, Some(&[x, y, z])) => arm.anchor = [x * 1e-3, y * 1e-3, z * 1e-3].into(),
        (Seen::Length, _) => {
            return Err(Error::Usage(
                "lengths need --anchor-mm X,Y,Z: about where the wire's fixed end will be"
                    .to_owned(),
            ));
        }
        (_, Some(_)) => {
            return Err(Error::Usage(
                "--anchor-mm is for --measure length".to_owned(),
            ));
        }
        (_, None) => {}
    }
    let noise = table.as_ref().map(|table| table.noise).unwrap_or_default();
    let sigmas = sigmas(options, noise)?;
    let mut measured_arm = MeasuredArm::new(arm, seen, sigmas, limits);
    let before: Vec<Vec<f64>> = match &table {
        Some(table) => table.rows.iter().map(|row| row.q.clone()).collect(),
        None => Vec::new(),
    };
    let settings = Settings {
        criterion: if options.minimax {
            Criterion::Minimax
        } else {
            Criterion::Determinant
        },
        seed: options.seed,
        ..Settings::new(options.poses)
    };
    let mut progress = Progress::new("choosing poses");
    let chosen = plan::plan(&mut measured_arm, &settings, &before, &mut |share| {
        progress.tell(share);
    })
    .map_err(|refused| Error::Usage(format!("{}: {refused}", options.robot.display())))?;
    drop(progress);
    Ok(outcome(
        options,
        &robot,
        &measured_arm,
        &chosen,
        before.len(),
        seen,
        sigmas,
    ))
}

/// Diagnoses the data and chooses the poses that decide what it leaves open.
fn discriminating(options: &Options, robot: &Robot, limits: &[[f64; 2]]) -> Result<Outcome, Error> {
    let Some(file) = &options.data else {
        return Err(Error::Usage("--discriminate needs --data".to_owned()));
    };
    let data = measurement::read(file, &Expected::of(robot), Purpose::Fit)?;
    let (diagnosis, _) = diagnosed(robot, file, &data)?;
    let decision = plan::discriminate(&diagnosis, limits, options.poses, options.seed);
    let Some(decision) = decision else {
        return Ok(Outcome {
            text: format!(
                "{}: nothing to tell apart, {} leaves no two explanations open\n",
                robot.name,
                file.display()
            ),
            json: json!({ "robot": robot.name, "disputes": [], "poses": 0 }),
            outputs: Vec::new(),
            answer: false,
        });
    };
    let out = &options.out.out;
    let mut text = format!(
        "{}: {} poses chosen to tell {} pairs of explanations apart, written to {}, the most \
         telling first\nexpected difference in BIC, by {} and with these poses:\n",
        robot.name,
        decision.poses.len(),
        decision.disputes.len(),
        out.display(),
        file.display()
    );
    for dispute in &decision.disputes {
        text += &format!(
            "  {:>9}{:>9}  {} or {}\n",
            three_digits(dispute.measured),
            three_digits(dispute.planned),
            dispute.found,
            dispute.rival
        );
    }
    let undecided = decision.disputes.iter().filter(|d| d.planned < UNDECIDED);
    let undecided = undecided.count();
    if undecided > 0 {
        text += &format!(
            "{undecided} of them stay open: more poses, or other loads, directions and \
             temperatures, might decide\n"
        );
    }
    let disputes: Vec<_> = decision
        .disputes
        .iter()
        .map(|d| {
            json!({ "found": d.found, "rival": d.rival, "bic_measured": d.measured,
                    "bic_planned": d.planned })
        })
        .collect();
    Ok(Outcome {
        text,
        json: json!({
            "robot": robot.name,
            "poses": decision.poses.len(),
            "disputes": disputes,
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: table_of(&decision.poses, robot.joints.len()).into_bytes(),
        }],
        answer: true,
    })
}

/// Joint values, rad or m, as CSV.
fn table_of(poses: &[Vec<f64>], joints: usize) -> String {
    let names: Vec<String> = (1..=joints).map(|j| format!("q{j}")).collect();
    let mut csv = names.join(",") + "\n";
    for q in poses {
        let cells: Vec<String> = q.iter().map(|x| format!("{x:.9}")).collect();
        csv += &(cells.join(",") + "\n");
    }
    csv
}

/// The arm as far as it is known, its base in the world frame's origin.
fn known(options: &Options, robot: &Robot) -> Result<ArmModel, Error> {
    let Some(file) = &options.params else {
        let mut arm = ArmModel::drawn(robot);
        arm.bases = vec![Pose::identity()];
        arm.bake();
        return Ok(arm);
    };
    // Tables of effects are read in place: the bytes live as long as the program.
    let bytes: &'static [u8] = parameters::read(file)?.leak();
    let blob: Blob<'static> = parameters::decode(file, bytes)?;
    if blob.joints() != robot.joints.len() {
        return Err(Error::Usage(format!(
            "{} has {} joints, {} has {}; give the parameters of this robot",
            file.display(),
            blob.joints(),
            options.robot.display(),
            robot.joints.len()
        )));
    }
    let mut arm = ArmModel::new(
        Pose::identity(),
        blob.calibrated.joints.to_vec(),
        blob.calibrated.masses.to_vec(),
        Pose::from(&blob.calibrated.tool),
        blob.gravity.into(),
    );
    arm.effects = blob.effects.to_vec();
    arm.bake();
    Ok(arm)
}

fn sigmas(options: &Options, noise: measurement::Noise) -> Result<Sigmas, Error> {
    let given = [
        ("--position-sigma-mm", options.position_sigma_mm),
        ("--orientation-sigma-deg", options.orientation_sigma_deg),
    ];
    for (name, sigma) in given {
        if sigma.is_some_and(|s| s.is_nan() || s <= 0.0 || s.is_infinite()) {
            return Err(Error::Usage(format!("{name}: give a number above zero")));
        }
    }
    let position = options.position_sigma_mm.map(|mm| mm * 1e-3);
    Ok(Sigmas {
        position: position.or(noise.position).unwrap_or(ASSUMED.position),
        orientation: options
            .orientation_sigma_deg
            .map(f64::to_radians)
            .or(noise.orientation)
            .unwrap_or(ASSUMED.orientation),
        length: position.or(noise.length).unwrap_or(ASSUMED.length),
    })
}

fn outcome(
    options: &Options,
    robot: &Robot,
    arm: &MeasuredArm,
    chosen: &Plan,
    before: usize,
    seen: Seen,
    sigmas: Sigmas,
) -> Outcome {
    let out = &options.out.out;
    let csv = table_of(&chosen.poses, robot.joints.len());
    let noise = match seen {
        Seen::Length => sigmas.length,
        _ => sigmas.position,
    };
    let o = &chosen.observability;
    let mut text = format!(
        "{}: {} poses chosen for {} parameters, written to {}, the most telling first\n",
        robot.name,
        chosen.poses.len(),
        arm.parameters(),
        out.display(),
    );
    if before > 0 {
        text += &format!("{before} poses measured already count with them\n");
    }
    text += &format!(
        "O1 {:.4e}; no {} poses within the limits can have more than {:.4e}",
        o.o1(),
        chosen.poses.len(),
        chosen.o1_bound
    );
    if let Some(random) = &chosen.random {
        text += &format!(", random ones have {:.4e}", random.o1());
    }
    text += &format!(
        "\ncondition number of the Jacobian {:.3e}, of its columns at unit length {:.3e}\n",
        o.cond_j(),
        chosen.of_unit_columns.cond_j()
    );
    text += &format!(
        "predicted tool point after the fit, by the instrument's noise of {} mm alone:\n  \
         poses      rms      max over the workspace\n",
        three_digits(noise * 1e3)
    );
    for forecast in &chosen.forecast {
        let [rms, max] = [forecast.rms, forecast.max].map(|x| three_digits(x * 1e3));
        text += &format!("  {:>5} {rms:>8} {max:>8} mm\n", forecast.poses);
    }
    let forecast: Vec<_> = chosen
        .forecast
        .iter()
        .map(|f| json!({ "poses": f.poses, "rms_mm": f.rms * 1e3, "max_mm": f.max * 1e3 }))
        .collect();
    Outcome {
        text,
        json: json!({
            "robot": robot.name,
            "poses": chosen.poses.len(),
            "measured_before": before,
            "parameters": arm.names(),
            "o1": o.o1(), "o2": o.o2(), "o3": o.o3(), "o4": o.o4(), "o5": o.o5(),
            "cond_j": o.cond_j(),
            "a": o.a(), "d": o.d(), "e": o.e(),
            "g_mm2": chosen.forecast.last().map(|f| (f.max * 1e3).powi(2)),
            "unit_columns": indices(&chosen.of_unit_columns),
            "o1_bound": chosen.o1_bound,
            "o1_random": chosen.random.as_ref().map(|r| r.o1()),
            "forecast": forecast,
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: csv.into_bytes(),
        }],
        answer: true,
    }
}

fn indices(o: &Observability) -> serde_json::Value {
    json!({
        "o1": o.o1(), "o2": o.o2(), "o3": o.o3(), "o4": o.o4(), "o5": o.o5(),
        "cond_j": o.cond_j(), "a": o.a(), "d": o.d(), "e": o.e(),
    })
}
