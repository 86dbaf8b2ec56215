//! The whole loop on the built-in robot cell: measure, identify, diagnose,
//! deploy, compensate, verify.
//!
//! The cell's arm is handed over as anyone's would be, as a drawing and measured rows; what is
//! hidden in it is compared with what was found only at the end.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use truepose::effects::Effect;
use truepose::params::Blob;

use crate::cell::{Arm, Cell, Conditions, Files, Hidden, Instrument, Measured, Seen, Visit};
use crate::compensate::{Corrected, Precision, compensate};
use crate::deploy::{Origin, blob};
use crate::description::Robot;
use crate::diagnose::diagnose;
use crate::error::Error;
use crate::identify::assess::{Statistics, errors};
use crate::identify::readings::{Identified, identify_file};
use crate::measurement::{self, Dataset};
use crate::parameters::decode;
use crate::verify::{Verified, verify};

/// What the demonstration does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The arm.
    pub arm: Arm,
    /// Everything random comes from it.
    pub seed: u64,
    /// Measured poses.
    pub poses: usize,
    /// Joint (from 0) whose gear runs out of true once a turn.
    pub joint: usize,
}

/// New targets, and poses that are visited again and again.
const TARGETS: usize = 60;
const REPEATED: usize = 5;
const REPEATS: usize = 10;
/// Smallest singular value (m and rad) of the nominal arm at a target. About four in ten random
/// postures of a PUMA are nearer to a singular one, where corrections are held back on purpose;
/// no one would work there.
const CLEAR: f64 = 0.05;
/// Postures that are drawn for each target.
const DRAWN: usize = 10;
/// A command whose predicted error is below this is corrected completely, m and rad: a tenth of
/// the noise, and above what single precision leaves.
const REACHED: [f64; 2] = [2e-6, 7e-6];
/// The hidden effect raises the error of a geometric fit by this factor.
const SHOWS: f64 = 4.0;
/// Independent series of the same cell: to identify from, and to verify with.
const FIRST: u64 = 0;
const NEW: u64 = 1;

/// Position (m) and orientation (rad) errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// m.
    pub position: Statistics,
    /// rad.
    pub orientation: Statistics,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Demonstration {
    /// Name of the arm.
    pub robot: String,
    /// Rows that were fitted, and held back.
    pub rows: [usize; 2],
    /// Errors of the held-back rows: base and tool aligned, geometry identified, with the
    /// effect.
    pub predicted: [Errors; 3],
    /// How far the arm ends from where the new targets are: nominal commands, compensated
    /// with the geometry alone, compensated with the effect.
    pub executed: [Errors; 3],
    /// New targets, clear of singular postures, and those of them that were left out: too near a
    /// limit to be corrected completely.
    pub targets: [usize; 2],
    /// Verification of the commands compensated with the effect.
    pub verified: Verified,
    /// Amplitude of the hidden effect, rad.
    pub hidden: f64,
    /// What the diagnosis named, in words.
    pub found: Vec<String>,
    /// Amplitude that it found for the hidden effect, rad; `None`: it was not named.
    pub amplitude: Option<f64>,
    /// The instrument's noise, m.
    pub noise: f64,
    /// The parameters that the controller was given.
    pub parameters: Vec<u8>,
    /// What was measured first, as files.
    pub measured: Files,
    /// The measurements of the compensated commands, CSV.
    pub new_data: String,
}

/// Runs the demonstration; `tell` is called with the share done and what comes next.
pub fn demonstrate(settings: &Settings, tell: &mut dyn FnMut(f64)) -> Result<Demonstration, Error> {
    let refuse = |why: String| Error::Usage(format!("demo: {why}"));
    let plain = Cell::new(settings.arm, settings.seed);
    let robot = plain.robot();
    let revolute = |joint: &usize| {
        robot
            .joints
            .get(*joint)
            .is_some_and(|j| j.joint.kind == truepose::JointKind::Revolute)
    };
    let joint = Some(settings.joint).filter(revolute).ok_or_else(|| {
        refuse(format!(
            "{} has no revolute joint {}",
            robot.name,
            settings.joint + 1
        ))
    })?;

    // Measure.
    let conditions = Conditions::default();
    let instrument = Instrument::new(Seen::Pose);
    let visits = plain.schedule(&conditions, settings.poses, FIRST);
    let gear = Hidden::GearEccentricity { joint, order: 1 };
    let cell = plain
        .showing(gear, SHOWS, &visits, &instrument)
        .map_err(|why| refuse(why.to_string()))?;
    let measured = cell.measure(&visits, &conditions, &instrument, FIRST);
    let data = measured.dataset();
    tell(0.1);

    // Identify the geometry, and diagnose what it lacks. Nobody says what that is.
    let explain = |failure: crate::identify::Failure| failure.explain(&data.file);
    let geometric = identify_file(&robot, &data, Vec::new()).map_err(explain)?;
    tell(0.2);
    let again = identify_file(&robot, &data, Vec::new()).map_err(explain)?;
    let steps = RefCell::new((0.2, &mut *tell));
    let diagnosis = diagnose(again, &|_| {
        let (share, tell) = &mut *steps.borrow_mut();
        // The number of steps is not known: half of what is left, each time.
        *share += 0.5 * (0.5 - *share);
        tell(*share);
    });
    let diagnosis = diagnosis.map_err(explain)?;
    let complete = diagnosis.identified;
    tell(0.5);
    let predicted = [
        held_back(&geometric, |c| &c.nominal.arm),
        held_back(&geometric, |c| &c.geometric.arm),
        held_back(&complete, |c| &c.complete.arm),
    ];
    let [Some(nominal), Some(with_geometry), Some(with_effect)] = predicted else {
        return Err(refuse(
            "no rows were held back; measure more poses".to_owned(),
        ));
    };

    // Deploy.
    let geometry_alone = deploy(&robot, &geometric, &data, [nominal, with_geometry])?;
    let parameters = deploy(&robot, &complete, &data, [nominal, with_effect])?;
    tell(0.6);

    // Compensate and execute: new targets, five of them again and again.
    let new = Conditions {
        verify_share: 0.0,
        ..conditions
    };
    let file = PathBuf::from("demo.tpb");
    let request = |targets: &[Visit]| cell.measure(targets, &new, &instrument, NEW).dataset();
    let drawn = cell.schedule(&new, DRAWN * TARGETS, NEW).into_iter();
    let mut targets: Vec<Visit> = drawn
        .filter(|visit| smallest_singular_value(&robot, &visit.q) >= CLEAR)
        .take(TARGETS)
        .collect();
    let all = targets.len();
    let reached = [
        commands(&file, &geometry_alone, request(&targets))?,
        commands(&file, &parameters, request(&targets))?,
    ];
    let complete_at = |i: &usize| {
        reached.iter().all(|commands| {
            let remaining = commands.get(*i).and_then(|c| c.remaining);
            remaining.is_some_and(|e| e.position < REACHED[0] && e.orientation < REACHED[1])
        })
    };
    targets = (0..targets.len())
        .filter(complete_at)
        .filter_map(|i| targets.get(i).cloned())
        .collect();
    if targets.len() < REPEATED {
        return Err(refuse(format!(
            "{} cannot correct its tool in all six directions",
            robot.name
        )));
    }
    let left_out = all - targets.len();
    let repeated: Vec<Visit> = targets.iter().take(REPEATED).cloned().collect();
    for _ in 1..REPEATS {
        targets.extend(repeated.iter().cloned());
    }
    let series = |commands: &[Visit]| cell.measure(commands, &new, &instrument, NEW);
    let compensated = |parameters: &[u8]| -> Result<Measured, Error> {
        let commands = commands(&file, parameters, request(&targets))?;
        let visits: Vec<Visit> = (targets.iter().zip(commands))
            .map(|(target, command)| Visit {
                q: command.q,
                ..target.clone()
            })
            .collect();
        Ok(series(&visits))
    };
    let sent_as_they_are = series(&targets);
    let by_geometry = compensated(&geometry_alone)?;
    let by_effect = compensated(&parameters)?;
    tell(0.8);
    let executed = [&sent_as_they_are, &by_geometry, &by_effect]
        .map(|series| attained(&file, &parameters, &targets, series));
    let [before, geometry, after] = executed;

    // Verify.
    let blob: Blob<'_> = decode(&file, &parameters)?;
    let verified = verify(&file, &blob, &by_effect.dataset(), false)?;
    tell(1.0);
    let size = cell.hidden().next().map_or(0.0, |(_, size)| size.abs());
    let found = blob.effects.iter().map(|effect| name(effect)).collect();
    let amplitude = (blob.effects.iter())
        .filter(|effect| is_the_gear(effect, joint))
        .map(|effect| {
            effect
                .model()
                .values()
                .iter()
                .map(|x| x * x)
                .sum::<f64>()
                .sqrt()
        })
        .next();
    drop(blob);
    Ok(Demonstration {
        robot: robot.name.clone(),
        rows: [
            complete.problem.identify.len(),
            complete.problem.verify.len(),
        ],
        predicted: [nominal, with_geometry, with_effect],
        executed: [before?, geometry?, after?],
        targets: [all, left_out],
        verified,
        hidden: size,
        found,
        amplitude,
        noise: instrument.position_sigma,
        measured: cell.files(&measured),
        new_data: by_effect.csv(),
        parameters,
    })
}

/// Of the joint Jacobian of the nominal arm, m and rad, by differences; that of the largest
/// square part for an arm of fewer than six joints.
fn smallest_singular_value(robot: &Robot, q: &[f64]) -> f64 {
    const STEP: f64 = 1e-6;
    let columns: Vec<_> = (0..q.len())
        .map(|j| {
            let [back, forth] = [-STEP, STEP].map(|step| {
                let mut moved = q.to_vec();
                moved[j] += step;
                robot.forward(&moved)
            });
            nalgebra::DVector::from_row_slice(&back.twist_to(&forth).scaled(0.5 / STEP).rows())
        })
        .collect();
    let jacobian = nalgebra::DMatrix::from_columns(&columns);
    jacobian
        .singular_values()
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min)
}

/// Kind, joint and order, joints counted from 1.
fn name(effect: &Effect<'_, f64>) -> String {
    let model = effect.model();
    let joint = model.joint().map(|j| format!("joint {} ", j + 1));
    let order = model
        .selector()
        .order
        .map(|order| format!(", order {order}"));
    format!(
        "{}{}{}",
        joint.unwrap_or_default(),
        model.kind(),
        order.unwrap_or_default()
    )
}

fn is_the_gear(effect: &Effect<'_, f64>, joint: usize) -> bool {
    let model = effect.model();
    let once = model
        .selector()
        .order
        .is_some_and(|order| (order - 1.0).abs() < 0.1);
    model.kind() == "gear-eccentricity" && model.joint() == Some(joint) && once
}

/// Errors of the rows that no fit has seen.
fn held_back(
    identified: &Identified,
    pick: impl Fn(&crate::identify::Calibration) -> &crate::identify::arm::ArmModel,
) -> Option<Errors> {
    let rows: Vec<_> = identified.problem.verify.iter().collect();
    let all = errors(pick(&identified.calibration), &rows);
    Some(Errors {
        position: Statistics::of(&all.distances)?,
        orientation: Statistics::of(&all.angles)?,
    })
}

fn deploy(
    robot: &Robot,
    identified: &Identified,
    data: &Dataset,
    [before, after]: [Errors; 2],
) -> Result<Vec<u8>, Error> {
    let origin = Origin {
        rows_identify: identified.problem.identify.len(),
        rows_verify: identified.problem.verify.len(),
        rms: [before.position.rms, after.position.rms],
    };
    blob(robot, &identified.calibration, &data.file, &origin)
}

/// What the controller makes of nominal joints, requested alone: the poses that they mean.
fn commands(
    file: &Path,
    parameters: &[u8],
    mut requests: Dataset,
) -> Result<Vec<Corrected>, Error> {
    let blob = decode(file, parameters)?;
    for row in &mut requests.rows {
        (row.position, row.orientation) = (None, None);
    }
    requests.measured = measurement::Measured::Nothing;
    compensate(file, &blob, &requests, None, Precision::F32)
}

/// How far the measured poses of a series are from what the targets nominally mean.
fn attained(
    file: &Path,
    parameters: &[u8],
    targets: &[Visit],
    series: &Measured,
) -> Result<Errors, Error> {
    let blob = decode(file, parameters)?;
    // The controller's own kinematics at the uncorrected joints.
    let mut table = series.dataset();
    for (row, target) in table.rows.iter_mut().zip(targets) {
        row.q.clone_from(&target.q);
    }
    let errors = verify(file, &blob, &table, false)?.before;
    let orientation = errors
        .orientation
        .ok_or_else(|| Error::Usage("demo: the instrument saw no orientation".to_owned()))?;
    Ok(Errors {
        position: errors.position,
        orientation,
    })
}
