//! `truepose plan`: which poses to measure.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use nalgebra::Vector3;
use serde_json::json;
use truepose::Pose;
use truepose::params::Blob;
use truepose_host::description::Robot;
use truepose_host::diagnose::UNDECIDED;
use truepose_host::error::{Error, Place};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::observation::{Observation, Sigmas};
use truepose_host::identify::problem::ASSUMED;
use truepose_host::identify::readings::{Task, identify_file_as};
use truepose_host::identify::relation::Plane;
use truepose_host::measurement::{self, Expected, Measured, Purpose};
use truepose_host::observability::Observability;
use truepose_host::output::Output;
use truepose_host::parameters;
use truepose_host::plan::{self, Criterion, MeasuredArm, Plan, Seen, Sensitivity, Settings};

use super::diagnose::diagnosed;
use super::options::{Chosen, Out};
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
    /// A theodolite's station, mm in the robot base frame; again for each further one; for
    /// bearings
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    station_mm: Vec<f64>,
    /// A fixed point that is touched, mm in the robot base frame; again for each further one
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    point_mm: Vec<f64>,
    /// A fixed plane that is touched: a point of it, mm in the robot base frame, and its
    /// normal; again for each further one
    #[arg(
        long,
        value_name = "X,Y,Z,NX,NY,NZ",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    plane_mm: Vec<f64>,
    #[command(flatten)]
    chosen: Chosen,
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
    /// Bearings from theodolites
    Bearing,
    /// Distances between pairs of poses: a plan of pairs
    Distance,
    /// Fixed points and planes that the tool point touches
    Touch,
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
    if let Some(table) = &table {
        refuse_view(table)?;
    }
    let was = table.as_ref().map(|table| match table.measured {
        // refused
        Measured::Board | Measured::Mark | Measured::Sight => Measure::Pose,
        Measured::Pose => Measure::Pose,
        Measured::Length => Measure::Length,
        Measured::Position | Measured::Nothing => Measure::Position,
        Measured::Bearing => Measure::Bearing,
        Measured::Distance => Measure::Distance,
        Measured::Point | Measured::Plane => Measure::Touch,
    });
    let measure = options.measure.or(was).unwrap_or(Measure::Position);
    let seen = match measure {
        Measure::Position => Seen::Position,
        Measure::Pose => Seen::Pose,
        Measure::Length => Seen::Length,
        Measure::Bearing => Seen::Bearing,
        Measure::Distance => Seen::Distance,
        Measure::Touch => Seen::Touch,
    };
    let mut labels = Labels::default();
    let around = matches!(seen, Seen::Bearing | Seen::Distance | Seen::Touch);
    let mut measured: Vec<Observation> = Vec::new();
    match (&options.data, was) {
        // What stands around the arm is where these rows say.
        (Some(file), Some(was)) if around && was == measure => {
            let fit = measurement::read(file, &Expected::of(&robot), Purpose::Fit)?;
            let task = Task {
                wish: options.chosen.wish(),
                ..Task::default()
            };
            let found =
                identify_file_as(&robot, &fit, task).map_err(|failure| failure.explain(file))?;
            labels = Labels {
                points: found.problem.points,
                planes: found.problem.planes,
            };
            let known = found.calibration.complete.arm;
            arm.bases = known.bases.iter().take(1).copied().collect();
            (arm.points, arm.planes, arm.stations) = (known.points, known.planes, known.stations);
            arm.bake();
            measured = found.problem.identify;
            measured.extend(found.problem.verify);
        }
        _ => place(options, seen, &mut arm, &mut labels)?,
    }
    let noise = table.as_ref().map(|table| table.noise).unwrap_or_default();
    let sigmas = sigmas(options, noise)?;
    let mut measured_arm = MeasuredArm::holding(arm, seen, sigmas, limits, &options.chosen.wish())
        .map_err(Error::Usage)?;
    let choice = measured_arm.choice().clone();
    let before: Vec<Vec<f64>> = match &table {
        Some(_) if around => measured.iter().filter_map(|o| choice.of(o)).collect(),
        Some(table) => table.rows.iter().map(|row| row.q.clone()).collect(),
        None => Vec::new(),
    };
    let wanted = match seen {
        Seen::Distance if options.poses % 2 == 1 => {
            return Err(Error::Usage(format!(
                "--poses {}: distances are between pairs of poses; expected an even number",
                options.poses
            )));
        }
        Seen::Distance => options.poses / 2,
        _ => options.poses,
    };
    let settings = Settings {
        criterion: if options.minimax {
            Criterion::Minimax
        } else {
            Criterion::Determinant
        },
        seed: options.seed,
        ..Settings::new(wanted)
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
        (seen, sigmas),
        choice.table(&chosen.poses, &labels.points, &labels.planes),
    ))
}

/// Diagnoses the data and chooses the poses that decide what it leaves open.
fn discriminating(options: &Options, robot: &Robot, limits: &[[f64; 2]]) -> Result<Outcome, Error> {
    let Some(file) = &options.data else {
        return Err(Error::Usage("--discriminate needs --data".to_owned()));
    };
    let data = measurement::read(file, &Expected::of(robot), Purpose::Fit)?;
    refuse_view(&data)?;
    let (diagnosis, _) = diagnosed(robot, file, &data, options.chosen.wish())?;
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
    let problem = &diagnosis.identified.problem;
    let csv = decision
        .choice
        .table(&decision.poses, &problem.points, &problem.planes);
    let planned = csv.lines().count() - 1;
    let mut text = format!(
        "{}: {planned} poses chosen to tell {} pairs of explanations apart, written to {}, the most \
         telling first\nexpected difference in BIC, by {} and with these poses:\n",
        robot.name,
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
            "poses": planned,
            "disputes": disputes,
            "out": out,
        }),
        outputs: vec![Output {
            file: out.clone(),
            bytes: csv.into_bytes(),
        }],
        answer: true,
    })
}

/// Which poses an instrument on the tool sees anything from is not known here.
fn refuse_view(table: &measurement::Dataset) -> Result<(), Error> {
    let view = matches!(
        table.measured,
        Measured::Board | Measured::Mark | Measured::Sight
    );
    match view {
        true => Err(Place::file(&table.file).bad(
            "what an instrument on the tool sees",
            "measurements by one beside the arm: from which poses the other sees its target is \
             not known here",
            "spread the poses over all that see it, turned as far as it stays in view",
        )),
        false => Ok(()),
    }
}

/// Numbers in the columns `point` and `plane`.
#[derive(Default)]
struct Labels {
    points: Vec<i64>,
    planes: Vec<i64>,
}

/// Puts what stands around the arm where the options say.
fn place(
    options: &Options,
    seen: Seen,
    arm: &mut ArmModel,
    labels: &mut Labels,
) -> Result<(), Error> {
    let mm = |v: &[f64]| Vector3::new(v[0], v[1], v[2]) * 1e-3;
    let all = |name: &str, given: &[f64], size: usize, kinds: &[Seen], of: &str| {
        if !given.is_empty() && !kinds.contains(&seen) {
            return Err(Error::Usage(format!("{name} is for --measure {of}")));
        }
        if !given.len().is_multiple_of(size) || given.iter().any(|x| !x.is_finite()) {
            return Err(Error::Usage(format!(
                "{name}: expected {size} numbers each"
            )));
        }
        Ok(())
    };
    let anchor = options.anchor_mm.as_deref().unwrap_or(&[]);
    all("--anchor-mm", anchor, 3, &[Seen::Length], "length")?;
    all(
        "--station-mm",
        &options.station_mm,
        3,
        &[Seen::Bearing],
        "bearing",
    )?;
    all("--point-mm", &options.point_mm, 3, &[Seen::Touch], "touch")?;
    all("--plane-mm", &options.plane_mm, 6, &[Seen::Touch], "touch")?;
    let missing = |what: &str| Err(Error::Usage(what.to_owned()));
    match seen {
        Seen::Length if anchor.len() != 3 => {
            return missing(
                "lengths need --anchor-mm X,Y,Z: about where the wire's fixed end will be",
            );
        }
        Seen::Bearing if options.station_mm.is_empty() => {
            return missing(
                "bearings need --station-mm X,Y,Z for every theodolite: about where it will stand",
            );
        }
        Seen::Touch if options.point_mm.is_empty() && options.plane_mm.is_empty() => {
            return missing(
                "touches need --point-mm X,Y,Z or --plane-mm X,Y,Z,NX,NY,NZ: about where they \
                 will be",
            );
        }
        _ => {}
    }
    if !anchor.is_empty() {
        arm.anchor = mm(anchor);
    }
    let stations = options.station_mm.chunks(3);
    let at = |v: &[f64]| Pose::new(Pose::<f64>::identity().rotation, mm(v));
    if !options.station_mm.is_empty() {
        arm.stations = stations.map(at).collect();
    }
    arm.points = options.point_mm.chunks(3).map(mm).collect();
    for v in options.plane_mm.chunks(6) {
        let normal = Vector3::new(v[3], v[4], v[5]);
        if normal.norm() <= 0.0 {
            return missing("--plane-mm: a normal that is zero has no direction");
        }
        arm.planes.push(Plane::new(&mm(v), &normal));
    }
    labels.points = (1..).take(arm.points.len()).collect();
    labels.planes = (1..).take(arm.planes.len()).collect();
    Ok(())
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
        distance: position.or(noise.distance).unwrap_or(ASSUMED.distance),
        contact: position.or(noise.contact).unwrap_or(ASSUMED.contact),
        bearing: noise.bearing.unwrap_or(ASSUMED.bearing),
    })
}

fn outcome(
    options: &Options,
    robot: &Robot,
    arm: &MeasuredArm,
    chosen: &Plan,
    before: usize,
    (seen, sigmas): (Seen, Sigmas),
    csv: String,
) -> Outcome {
    let out = &options.out.out;
    let noise = match seen {
        Seen::Length => sigmas.length,
        Seen::Distance => sigmas.distance,
        Seen::Touch => sigmas.contact,
        Seen::Bearing => sigmas.bearing,
        Seen::Position | Seen::Pose => sigmas.position,
    };
    let noise = match seen {
        Seen::Bearing => format!("{} deg", three_digits(noise.to_degrees())),
        _ => format!("{} mm", three_digits(noise * 1e3)),
    };
    let each = if seen == Seen::Distance { 2 } else { 1 };
    let planned = each * chosen.poses.len();
    let o = &chosen.observability;
    let mut text = format!(
        "{}: {planned} poses chosen for {} parameters, written to {}, the most telling first\n",
        robot.name,
        arm.parameters(),
        out.display(),
    );
    if before > 0 {
        let before = each * before;
        text += &format!("{before} poses measured already count with them\n");
    }
    text += &format!(
        "O1 {:.4e}; no {planned} poses within the limits can have more than {:.4e}",
        o.o1(),
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
        "predicted tool point after the fit, by the instrument's noise of {noise} alone:\n  \
         poses      rms      max over the workspace\n",
    );
    for forecast in &chosen.forecast {
        let [rms, max] = [forecast.rms, forecast.max].map(|x| three_digits(x * 1e3));
        text += &format!("  {:>5} {rms:>8} {max:>8} mm\n", each * forecast.poses);
    }
    let forecast: Vec<_> = chosen
        .forecast
        .iter()
        .map(|f| json!({ "poses": each * f.poses, "rms_mm": f.rms * 1e3, "max_mm": f.max * 1e3 }))
        .collect();
    Outcome {
        text,
        json: json!({
            "robot": robot.name,
            "poses": planned,
            "measured_before": each * before,
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
