//! `truepose identify`: the arm's geometry, and effects named beforehand.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use truepose_host::description::Robot;
use truepose_host::diagnose::input;
use truepose_host::error::Error;
use truepose_host::identify::bootstrap::bootstrap;
use truepose_host::identify::method::{Estimator, Loss, Method};
use truepose_host::identify::named::effects;
use truepose_host::identify::readings::{Task, identify_file_as};
use truepose_host::measurement::{self, Expected, Purpose};
use truepose_host::report::Report;

use super::deliver::deliver;
use super::options::{Chosen, Data, Out, Page, RobotFile};
use super::{Files, Outcome, warn};

/// Identify the arm's geometry, and effects named beforehand, from measured poses
#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    robot: RobotFile,
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    out: Out,
    #[command(flatten)]
    page: Page,
    #[command(flatten)]
    chosen: Chosen,
    /// An effect to identify with the geometry, e.g. joint-compliance, joint-gain:3 or
    /// gear-eccentricity:2:1; without a joint: of all
    #[arg(long = "effect", value_name = "KIND[:JOINT[:ORDER]]")]
    effects: Vec<String>,
    /// How the parameters are looked for: least-squares, weighted-least-squares,
    /// levenberg-marquardt, minimum-variance, kalman or golden-section
    #[arg(long, value_name = "NAME", default_value = "levenberg-marquardt")]
    estimator: String,
    /// What large residuals cost: square, huber or tukey
    #[arg(long, value_name = "NAME", default_value = "square")]
    loss: String,
    /// Where the size of the prior comes from: given, by the next two options, or
    /// cross-validated: the size with which rows left out of the fit are predicted best
    /// (minimum-variance and kalman)
    #[arg(long, value_enum, value_name = "SIZE")]
    prior: Option<Size>,
    /// How far a length may be from the drawing, one standard deviation, mm
    /// (minimum-variance and kalman; cross-validated, only its proportion to the next counts)
    /// [default: 5]
    #[arg(long, value_name = "MM")]
    prior_mm: Option<f64>,
    /// How far an angle may be from the drawing, one standard deviation, deg
    /// (minimum-variance and kalman) [default: 0.5]
    #[arg(long, value_name = "DEG")]
    prior_deg: Option<f64>,
    /// How far joint parameters wander from row to row, one standard deviation, um and urad
    /// (kalman) [default: 0]
    #[arg(long, value_name = "UM")]
    process_noise_um: Option<f64>,
    /// Draw the rows anew N times, for standard errors that do not trust the declared noise
    #[arg(long, value_name = "N")]
    bootstrap: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Size {
    /// As far as --prior-mm and --prior-deg say
    Given,
    /// As far as predicts rows that are left out best
    CrossValidated,
}

/// The method that the options ask for.
fn method(options: &Options) -> Result<Method, Error> {
    let named = |option: &str, name: &str, expected: String| {
        Error::Usage(format!("--{option} {name}: not known; expected {expected}"))
    };
    let estimator = Estimator::from_str(&options.estimator)
        .map_err(|e| named("estimator", &options.estimator, e))?;
    let loss = Loss::from_str(&options.loss).map_err(|e| named("loss", &options.loss, e))?;
    let prior = [Estimator::MinimumVariance, Estimator::Kalman];
    let used = |option: &str, value: Option<f64>, by: &[Estimator], zero: bool| match value {
        Some(x) if !(x.is_finite() && (x > 0.0 || zero && x >= 0.0)) => Err(Error::Usage(format!(
            "--{option} {x}: expected a standard deviation above zero"
        ))),
        Some(_) if !by.contains(&estimator) => {
            let names: Vec<&str> = by.iter().map(|e| e.name()).collect();
            Err(Error::Usage(format!(
                "--{option}: the estimator {} does not use it; expected --estimator {}",
                estimator.name(),
                names.join(" or ")
            )))
        }
        other => Ok(other),
    };
    let default = Method::default();
    let length = used("prior-mm", options.prior_mm, &prior, false)?;
    let angle = used("prior-deg", options.prior_deg, &prior, false)?;
    if options.prior.is_some() && !estimator.uses_prior() {
        return Err(Error::Usage(format!(
            "--prior: the estimator {} does not use one; expected --estimator minimum-variance or \
             kalman",
            estimator.name()
        )));
    }
    let kalman = [Estimator::Kalman];
    let wander = used("process-noise-um", options.process_noise_um, &kalman, true)?;
    if options.bootstrap.is_some_and(|n| n < 2) {
        return Err(Error::Usage(
            "--bootstrap: expected at least 2 draws; 200 give a standard error to 5 %".to_owned(),
        ));
    }
    Ok(Method {
        estimator,
        loss,
        tolerance: [
            length.map_or(default.tolerance[0], |mm| mm * 1e-3),
            angle.map_or(default.tolerance[1], f64::to_radians),
        ],
        cross_validated: options.prior == Some(Size::CrossValidated),
        process_noise: wander.map_or(default.process_noise, |um| um * 1e-6),
    })
}

pub(crate) fn files(options: &Options) -> Files<'_> {
    let mut outputs = vec![options.out.out.as_path()];
    outputs.extend(options.page.report.as_deref());
    Files {
        inputs: vec![&options.robot.robot, &options.data.data],
        outputs,
    }
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Error> {
    let data_file = &options.data.data;
    let method = method(options)?;
    let robot = Robot::read(&options.robot.robot)?;
    let data = measurement::read(data_file, &Expected::of(&robot), Purpose::Fit)?;
    warn(&data.warnings);
    let effects = effects(&options.effects, &robot, &data)?;
    let explain = |failure: truepose_host::identify::Failure| failure.explain(data_file);
    let task = Task {
        effects,
        wish: options.chosen.wish(),
        method,
    };
    let identified = identify_file_as(&robot, &data, task)
        .map_err(|failure| input::explain(&failure, &robot, &data, data_file))?;
    let mut report = Report::new(&robot.name, &data, &identified).map_err(explain)?;
    if let Some(draws) = options.bootstrap {
        let calibration = &identified.calibration;
        let scatter = bootstrap(&identified.problem, calibration, draws);
        report.add_bootstrap(calibration, &scatter);
    }
    deliver(
        &robot,
        data_file,
        &identified.calibration,
        &report,
        &options.out,
        &options.page,
    )
}
