//! From measured poses to the arm's real geometry.
//!
//! 1. align: where the instrument stands and what the tool is, geometry as drawn ([`mod@align`]);
//! 2. which parameters make a complete model ([`structure`]), and which of them these poses
//!    can tell apart ([`solve::distinguishable`]);
//! 3. fit ([`mod@solve`]), leave gross rows out, fit again; with named effects once more.

pub mod align;
pub mod arm;
pub mod assess;
mod attached;
pub mod bootstrap;
pub mod cross_validated;
pub mod evaluator;
pub mod factor;
mod failure;
pub mod folds;
mod golden;
pub mod gross;
pub mod held;
pub mod kalman;
pub mod linearize;
pub mod method;
pub mod named;
pub mod noise;
mod normal;
pub mod observation;
mod posture;
pub mod predicted;
pub mod prior;
pub mod problem;
pub(crate) mod product;
pub mod readings;
pub mod relation;
pub mod robust;
pub mod solve;
pub mod structure;
pub mod three_targets;
pub(crate) mod uncertainty;
pub mod unknown;
pub(crate) mod unseen;
pub mod view;

use align::{first_guess, turn_tool_to_poses, turn_tool_to_targets};
use arm::ArmModel;
use cross_validated::Sizes;
use factor::Dropped;
pub use failure::{Failure, ROWS_A_SESSION};
use gross::{gross, gross_unseen, may_hide, median, softened};
use kalman::Innovations;
use method::{Fitted, Loss, Method, Task};
use observation::Observation;
use observation::Sigmas;
use prior::Prior;
use problem::Problem;
use robust::Outlier;
pub(crate) use solve::fit;
use solve::{Solved, misfit};
use structure::{Structure, structure_holding};
use truepose::Pose;
use unknown::Unknown;
use unseen::Shown;
use view::quarter_turns;

/// An arm and the fit that made it.
#[derive(Clone, Debug)]
pub struct Stage {
    /// The arm.
    pub arm: ArmModel,
    /// The fit.
    pub fit: Solved,
    /// Noise that the fit was weighted by.
    pub sigmas: Sigmas,
}

/// What became of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// Fitted.
    Identified,
    /// Kept at the drawing's value, with the reason.
    Fixed(String),
    /// Kept at the drawing's value since only a combination shows, with the others' names.
    Merged(String),
}

impl Status {
    fn explained(self, because: &str) -> Self {
        match self {
            Self::Fixed(note) => Self::Fixed(format!("{note}: {because}")),
            Self::Merged(note) => Self::Merged(format!("{note}: {because}")),
            Self::Identified => Self::Identified,
        }
    }
}

/// Result of [`identify`].
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Base, tool, targets and anchor aligned, geometry as drawn.
    pub nominal: Stage,
    /// Geometry identified.
    pub geometric: Stage,
    /// Geometry and effects; the geometric stage where no effect was asked for.
    pub complete: Stage,
    /// The complete model.
    pub structure: Structure,
    /// Every parameter and what became of it, in the order of reports.
    pub statuses: Vec<(Unknown, Status)>,
    /// Data rows left out as gross errors, of the fit and of its verification.
    pub rejected: Vec<usize>,
    /// Rows that a robust loss trusts less than half; those that it does not trust at all
    /// are `rejected` too.
    pub outliers: Vec<Outlier>,
    /// What a Kalman filter saw.
    pub innovations: Option<Innovations>,
    /// How the fits were made, with the tolerance that cross-validation found.
    pub method: Method,
    /// How it was found.
    pub sizes: Option<Sizes>,
}

/// Placement unknowns that are free and that the data can show at all.
pub(crate) fn placement(problem: &Problem) -> Vec<Unknown> {
    let mut unknowns = Vec::new();
    // Where nothing is placed in the world, the first base is the world.
    let placed = problem.identify.iter().any(Observation::is_placed);
    for session in usize::from(!placed)..problem.sessions.len().max(1) {
        unknowns.extend((0..6).map(|axis| Unknown::Base { session, axis }));
    }
    if problem.identify.iter().any(|o| o.length.is_some()) {
        unknowns.extend((0..3).map(|axis| Unknown::Anchor { axis }));
    }
    for point in 0..problem.points.len() {
        unknowns.extend((0..3).map(|axis| Unknown::Point { point, axis }));
    }
    for plane in 0..problem.planes.len() {
        unknowns.extend((0..3).map(|value| Unknown::Plane { plane, value }));
    }
    for station in 1..problem.stations {
        unknowns.extend((0..6).map(|axis| Unknown::Station { station, axis }));
    }
    // the tool's turn last: further targets that are free show where they are, not it
    unknowns.extend((0..3).map(|axis| Unknown::Tool { axis }));
    let targets = problem.identify.iter().map(|o| o.targets.len()).max();
    let free = targets.filter(|_| !problem.targets_known);
    for target in 0..free.unwrap_or(0) {
        unknowns.extend((0..3).map(|axis| Unknown::Target { target, axis }));
    }
    unknowns.extend((3..6).map(|axis| Unknown::Tool { axis }));
    unknowns.retain(|unknown| !problem.held.contains(unknown));
    unknowns
}

/// Unknowns of geometry and placement, in order of priority.
pub fn geometry(problem: &Problem, calibration: &Calibration) -> Vec<Unknown> {
    let arm = &calibration.nominal.arm;
    let structure = &calibration.structure;
    let never = Shown::by(arm, &problem.identify).never(arm, structure, &problem.held);
    with_joints(problem, structure, &never)
}

fn with_joints(
    problem: &Problem,
    structure: &Structure,
    never: &[(Unknown, String)],
) -> Vec<Unknown> {
    // A tool that is a combination of other parameters, as its height is where all axes are
    // nearly parallel, must not take the place of one of those.
    let told = |unknown: &Unknown| structure.dropped.iter().any(|(u, _)| u == unknown);
    let (last, mut candidates): (Vec<Unknown>, Vec<Unknown>) =
        placement(problem).into_iter().partition(told);
    for unknown in structure.unknowns.iter().chain(&last) {
        let hopeless = never.iter().any(|(u, _)| u == unknown);
        if !hopeless && !candidates.contains(unknown) {
            candidates.push(*unknown);
        }
    }
    candidates
}

/// Aligns base, tool, targets and anchor to the drawn geometry, from several first guesses
/// of the tool where the drawing's is far off.
pub fn align(problem: &Problem) -> Result<Stage, Failure> {
    let observations: Vec<&Observation> = problem.identify.iter().collect();
    let candidates = placement(problem);
    let drawn = problem.drawing.tool;
    let free = |axis: usize| !problem.held.contains(&Unknown::Tool { axis });
    let far = 0.3;
    let mut guesses = vec![drawn];
    // Where fixed points of unknown place are all that is seen, the first guess of where they
    // are hangs on how the instrument is turned, which its drawing seldom says.
    let points = problem.identify.iter().any(Observation::is_view)
        && !problem.identify.iter().any(Observation::is_placed);
    if points && (3..6).all(free) {
        let turned = |turn| Pose::new(drawn.rotation * turn, drawn.translation);
        guesses.extend(quarter_turns().into_iter().map(turned).skip(1));
    }
    for axis in (0..3).filter(|&axis| free(axis)) {
        for sign in [1.0, -1.0] {
            let mut guess = drawn;
            guess.translation[axis] += sign * far;
            guesses.push(guess);
        }
    }
    let mut best: Option<Stage> = None;
    for guess in guesses {
        let mut arm = problem.drawing.clone();
        arm.targets = problem.target_offsets.clone();
        let held = |arm: &mut ArmModel| problem.held.restore(arm, &problem.drawing);
        let sessions = problem.sessions.len();
        first_guess(&mut arm, &observations, guess, sessions, held);
        if problem.targets_known {
            turn_tool_to_poses(&mut arm, &observations);
            held(&mut arm);
        }
        let (fit, _) = fit(
            &mut arm,
            &candidates,
            &observations,
            problem.sigmas,
            Prior::None,
        );
        let better = best.as_ref().is_none_or(|b| fit.cost < b.fit.cost);
        if better && fit.cost.is_finite() {
            let stage = Stage {
                arm,
                fit,
                sigmas: problem.sigmas,
            };
            // A drawing is right to a few millimetres; then no other guess is needed. The
            // cost bounds the distances of tool points without another look at all rows.
            let every = observations.iter().all(|o| o.position.is_some());
            let mean_square = stage.fit.cost / observations.len().max(1) as f64;
            let bound = problem.sigmas.position * mean_square.sqrt();
            let good = every && bound < 0.007 || typical_distance(&stage, &observations) < 0.01;
            best = Some(stage);
            if good {
                break;
            }
        }
    }
    best.ok_or(Failure::NotAligned)
}

fn typical_distance(stage: &Stage, observations: &[&Observation]) -> f64 {
    let mut distances = assess::errors(&stage.arm, observations).distances;
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or(0.0)
}

/// What no fit can make up for.
fn check(problem: &Problem) -> Result<(), Failure> {
    let moves = |o: &Observation, first: &Observation| {
        o.q.iter().zip(&first.q).any(|(a, b)| (a - b).abs() > 1e-6)
    };
    let Some(first) = problem.identify.first() else {
        return Err(Failure::TooFewEquations(0, 6));
    };
    if !problem.identify.iter().any(|o| moves(o, first)) {
        return Err(Failure::OnePose);
    }
    for (session, &number) in problem.sessions.iter().enumerate() {
        let rows = problem.identify.iter().filter(|o| o.session == session);
        let rows = rows.count();
        if rows < ROWS_A_SESSION {
            return Err(Failure::ThinSession(number, rows));
        }
    }
    Ok(())
}

/// Where the targets are free, they do not show the tool's turn; the drawing of theirs does.
fn turn_tool(arm: &mut ArmModel, problem: &Problem) {
    let held = |u: &Unknown| problem.held.contains(u);
    let tool = (3..6).any(|axis| held(&Unknown::Tool { axis }));
    let targets = (0..problem.target_offsets.len())
        .flat_map(|target| (0..3).map(move |axis| Unknown::Target { target, axis }));
    if !problem.targets_known && !tool && !targets.into_iter().any(|u| held(&u)) {
        turn_tool_to_targets(arm, &problem.target_offsets);
    }
}

/// How the stages of an identification are fitted.
struct Fits<'a> {
    method: Method,
    drawing: &'a ArmModel,
    sigmas: Sigmas,
}

impl Fits<'_> {
    fn fit(&self, arm: &mut ArmModel, candidates: &[Unknown], rows: &[&Observation]) -> Fitted {
        self.method
            .fit(arm, self.drawing, candidates, rows, self.sigmas)
    }
}

/// Fits with weights before gross rows are looked for, at most.
const SOFT_FITS: usize = 20;

/// The weights have settled where the median row's misfit falls by no more than this.
const SETTLED: f64 = 0.95;

/// Identifies the arm's geometry, and the problem's effects with it.
pub fn identify(problem: &Problem) -> Result<Calibration, Failure> {
    let equations: usize = problem.identify.iter().map(Observation::equations).sum();
    let all: Vec<&Observation> = problem.identify.iter().collect();
    check(problem)?;
    let mut nominal = align(problem)?;
    turn_tool(&mut nominal.arm, problem);

    let structure = structure_holding(&nominal.arm, problem.sigmas, &problem.held);
    let shown = Shown::by(&nominal.arm, &problem.identify);
    let never = shown.never(&nominal.arm, &structure, &problem.held);
    let mut candidates = with_joints(problem, &structure, &never);
    if candidates.is_empty() && problem.effects.is_empty() {
        return Err(Failure::NothingFree);
    }
    if equations < candidates.len() {
        return Err(Failure::TooFewEquations(equations, candidates.len()));
    }

    // Gross rows first spoil the fit that shows them: leave out, fit, look at all rows again.
    // A robust loss does that by itself.
    let mut kept_rows = all.clone();
    let mut left_out: Vec<usize> = Vec::new();
    let mut geometric = nominal.arm.clone();
    let mut fits = Fits {
        method: problem.method,
        drawing: &nominal.arm,
        sigmas: problem.sigmas,
    };
    let sized = fits.method.cross_validated && fits.method.estimator.uses_prior();
    if sized {
        // gross rows are found without a prior: how far it may go is not known yet
        fits.method.tolerance = [f64::INFINITY; 2];
    }
    let mut fitted = fits.fit(&mut geometric, &candidates, &kept_rows);
    if fits.method.loss == Loss::Square {
        let mut shows = geometric.clone();
        let mut misfits = misfit(&shows, &all, problem.sigmas);
        if may_hide(&misfits) {
            for _ in 0..SOFT_FITS {
                let soft = softened(&shows, &all, problem.sigmas);
                let soft: Vec<&Observation> = soft.iter().collect();
                fits.fit(&mut shows, &candidates, &soft);
                let before = median(&misfits);
                misfits = misfit(&shows, &all, problem.sigmas);
                if median(&misfits) > SETTLED * before {
                    break;
                }
            }
        }
        for _ in 0..5 {
            let worst = gross(&shows, &all, problem.sigmas, &misfits);
            if worst == left_out {
                break;
            }
            kept_rows = (0..all.len())
                .filter(|i| !worst.contains(i))
                .map(|i| all[i])
                .collect();
            left_out = worst;
            fitted = fits.fit(&mut geometric, &candidates, &kept_rows);
            shows = geometric.clone();
            misfits = misfit(&shows, &all, problem.sigmas);
        }
    }
    let mut sizes = None;
    if sized {
        let trusted = |o: &&Observation| !fitted.outliers.iter().any(|out| out.row == o.row);
        let rows: Vec<&Observation> = kept_rows.iter().copied().filter(trusted).collect();
        let task = Task {
            drawing: &nominal.arm,
            candidates: &candidates,
            sigmas: problem.sigmas,
        };
        sizes = cross_validated::sizes(&task, problem.method.tolerance, &rows);
        let found = sizes.as_ref().and_then(Sizes::tolerance);
        fits.method.tolerance = found.ok_or(Failure::NoSize)?;
        fitted = fits.fit(&mut geometric, &candidates, &kept_rows);
    }
    turn_tool(&mut geometric, problem);
    let settled = |fitted: &Fitted| match fitted.solved.converged {
        true => Ok(()),
        false => Err(Failure::NotConverged(fitted.solved.variance().sqrt())),
    };
    settled(&fitted)?;
    let geometric = Stage {
        arm: geometric,
        fit: fitted.solved.clone(),
        sigmas: problem.sigmas,
    };
    let complete = if problem.effects.is_empty() {
        geometric.clone()
    } else {
        let mut arm = geometric.arm.clone();
        arm.effects = problem.effects.clone();
        // fixes them in the links
        arm.bake();
        let mut with_effects = candidates.clone();
        for (effect, e) in problem.effects.iter().enumerate() {
            with_effects.extend(
                (0..e.model().values().len()).map(|value| Unknown::Effect { effect, value }),
            );
        }
        fitted = fits.fit(&mut arm, &with_effects, &kept_rows);
        settled(&fitted)?;
        turn_tool(&mut arm, problem);
        candidates = with_effects;
        Stage {
            arm,
            fit: fitted.solved.clone(),
            sigmas: problem.sigmas,
        }
    };
    let mut statuses = statuses(&complete, &structure, &candidates, &fitted.dropped, &shown);
    for (unknown, why) in never {
        statuses.retain(|(u, _)| *u != unknown);
        statuses.push((unknown, Status::Fixed(why)));
    }
    let offered = |u: &Unknown| structure.offers(u);
    for (unknown, why) in problem.held.told(offered) {
        statuses.retain(|(u, _)| *u != unknown);
        statuses.push((unknown, Status::Fixed(why.to_owned())));
    }
    statuses.sort_by_key(|(u, _)| order(u));
    let distrusted = fitted.outliers.iter().filter(|o| o.weight <= 0.0);
    let mut rejected: Vec<usize> = distrusted.map(|o| o.row).collect();
    rejected.extend(left_out.iter().map(|&i| all[i].row));
    let verify: Vec<&Observation> = problem.verify.iter().collect();
    rejected.extend(gross_unseen(
        &geometric.arm,
        &complete.arm,
        &kept_rows,
        &verify,
        problem.sigmas,
    ));
    rejected.sort_unstable();
    let method = fits.method;
    Ok(Calibration {
        nominal,
        geometric,
        complete,
        structure,
        statuses,
        rejected,
        outliers: fitted.outliers,
        innovations: fitted.innovations,
        method,
        sizes,
    })
}

fn names(arm: &ArmModel, parts: &[(usize, f64)], of: &[Unknown]) -> String {
    // Weights are sorted; below a fiftieth of the largest they are the frames' small tilts.
    let largest = parts.first().map_or(0.0, |p| p.1.abs());
    let named: Vec<String> = parts
        .iter()
        .filter(|(_, weight)| weight.abs() >= 0.02 * largest)
        .filter_map(|&(k, _)| of.get(k))
        .map(|u| u.name(arm))
        .collect();
    named.join(", ")
}

/// What became of every parameter that the description has.
pub(crate) fn statuses(
    stage: &Stage,
    structure: &Structure,
    candidates: &[Unknown],
    dropped: &[(Unknown, Dropped)],
    shown: &Shown,
) -> Vec<(Unknown, Status)> {
    let arm = &stage.arm;
    let mut statuses: Vec<(Unknown, Status)> = Vec::new();
    let reason = |why: &Dropped, of: &[Unknown], when: &str| match why {
        Dropped::Invisible => Status::Fixed(format!("does not show in {when}")),
        Dropped::Dependent(parts) => Status::Merged(format!(
            "in {when} only its combination with {} shows; they carry it",
            names(arm, parts, of)
        )),
    };
    for unknown in candidates {
        let status = match dropped.iter().find(|(u, _)| u == unknown) {
            Some((_, why)) => {
                let status = reason(why, candidates, "these measurements");
                match shown.because(unknown) {
                    Some(because) => status.explained(&because),
                    None => status,
                }
            }
            None => Status::Identified,
        };
        statuses.push((*unknown, status));
    }
    // The placement is a candidate even where the drawing says that it cannot show. Beta is
    // offered to every joint and missed by none that did well without it.
    let elsewhere = |unknown: &Unknown| !candidates.contains(unknown);
    let missed = |unknown: &Unknown| match unknown {
        Unknown::Joint(j, truepose::Parameter::Beta) => arm
            .joints
            .get(*j)
            .is_some_and(|joint| joint.beta.abs() > 0.0),
        _ => true,
    };
    let told = structure.dropped.iter();
    for (unknown, why) in told.filter(|(u, _)| elsewhere(u) && missed(u)) {
        statuses.push((
            *unknown,
            reason(why, &structure.candidates, "any measurement"),
        ));
    }
    for pair in &structure.parallel {
        let unknown = Unknown::Joint(pair.joint, truepose::Parameter::D);
        statuses.push((
            unknown,
            Status::Fixed(format!(
                "axes {} and {} are {:.3} deg from parallel: beta in its place (Hayati)",
                pair.first + 1,
                pair.first + 2,
                pair.angle.to_degrees()
            )),
        ));
    }
    statuses.sort_by_key(|(u, _)| order(u));
    statuses
}

/// Place of an unknown in reports.
fn order(u: &Unknown) -> (usize, usize, usize) {
    match *u {
        Unknown::Base { session, axis } => (0, session, axis),
        Unknown::Joint(j, p) => (1, j, p as usize),
        Unknown::Tool { axis } => (2, 0, axis),
        Unknown::Target { target, axis } => (3, target, axis),
        Unknown::Anchor { axis } => (4, 0, axis),
        Unknown::Point { point, axis } => (5, point, axis),
        Unknown::Plane { plane, value } => (6, plane, value),
        Unknown::Station { station, axis } => (7, station, axis),
        Unknown::Effect { effect, value } => (8, effect, value),
        Unknown::EarlyReading => (9, 0, 0),
    }
}
