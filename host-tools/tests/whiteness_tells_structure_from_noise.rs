//! The tests of a residual stay silent on noise of any size and tails, and speak where the
//! arm does more than its model.

use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};
use truepose_host::diagnose::whiteness::{Subject, Whiteness, whiteness};
use truepose_host::identify::identify;
use truepose_host::identify::observation::Observation;
use truepose_host::identify::problem::{Joints, Problem};

/// Geometry identified from what the cell measured, and its residual tested.
fn tested(
    cell: &Cell,
    instrument: &Instrument,
    conditions: &Conditions,
    poses: usize,
    seed: u64,
) -> Option<Whiteness> {
    let visits = cell.schedule(conditions, poses, 0);
    let data = cell
        .measure(&visits, conditions, instrument, seed)
        .dataset();
    let problem = Problem::new(&cell.robot(), &data, Joints::Readings, Vec::new());
    let found = identify(&problem).ok()?;
    let kept: Vec<&Observation> = problem
        .identify
        .iter()
        .filter(|o| !found.rejected.contains(&o.row))
        .collect();
    let stage = &found.geometric;
    whiteness(&stage.arm, &stage.fit.unknowns, &kept, problem.sigmas, seed)
}

/// Runs that are called structure, among `seeds` cells with nothing hidden.
fn cries(seeds: u64, poses: usize, change: impl Fn(&mut Instrument)) -> (usize, usize) {
    let (mut cries, mut runs) = (0, 0);
    for seed in 0..seeds {
        let arm = Arm::ALL[seed as usize % Arm::ALL.len()];
        let seen = match seed % 3 {
            0 => Seen::Pose,
            1 => Seen::Position,
            _ => Seen::Targets(vec![[0.1, 0.0, 0.05], [0.0, 0.1, 0.08]]),
        };
        let mut instrument = Instrument::new(seen);
        change(&mut instrument);
        let conditions = if seed % 2 == 0 {
            Conditions::default()
        } else {
            Conditions::rich()
        };
        let cell = Cell::new(arm, seed);
        if let Some(w) = tested(&cell, &instrument, &conditions, poses, seed) {
            runs += 1;
            cries += usize::from(w.structure);
            if w.structure {
                eprintln!("{arm:?} {seed}: {:?}", w.tests.first());
            }
        }
    }
    (cries, runs)
}

fn plain(_: &mut Instrument) {}

fn heavy(instrument: &mut Instrument) {
    instrument.student = Some(4);
}

fn declared_half(instrument: &mut Instrument) {
    instrument.declared = Some([0.5; 2]);
}

/// At most so many of `runs` at a level of 1 %: binomial, exceeded with a chance below 1e-3.
fn allowed(runs: usize) -> usize {
    let mean = 0.01 * runs as f64;
    (mean + 3.3 * mean.sqrt() + 1.0) as usize
}

#[test]
fn noise_is_not_called_structure() {
    for change in [plain, heavy, declared_half] {
        let (cries, runs) = cries(24, 100, change);
        assert!(runs == 24 && cries <= allowed(runs), "{cries} of {runs}");
    }
}

/// Share of cells with an effect that raises the error `ratio` times in which structure is
/// seen.
fn power(kind: &str, ratio: f64, seeds: u64) -> (usize, usize) {
    let (mut seen, mut runs) = (0, 0);
    for seed in 0..seeds {
        let arm = Arm::ALL[seed as usize % Arm::ALL.len()];
        let Some(hidden) = Hidden::draw(kind, arm, seed) else {
            continue;
        };
        // a second placement would take up what drifts
        let conditions = Conditions {
            sessions: 1,
            ..Conditions::rich()
        };
        let instrument = Instrument::new(if seed % 2 == 0 {
            Seen::Pose
        } else {
            Seen::Position
        });
        let cell = Cell::new(arm, seed);
        let visits = cell.schedule(&conditions, 120, 0);
        let Ok(cell) = cell.showing(hidden, ratio, &visits, &instrument) else {
            continue;
        };
        if let Some(w) = tested(&cell, &instrument, &conditions, 120, seed) {
            runs += 1;
            seen += usize::from(w.structure);
            if !w.structure {
                eprintln!("{hidden:?} {seed}: {:?}", w.tests.first());
            }
        }
    }
    (seen, runs)
}

#[test]
fn hidden_effects_are_seen() {
    for kind in ["joint-gain", "joint-compliance", "backlash", "time-drift"] {
        let (seen, runs) = power(kind, 1.8, 12);
        assert!(
            runs > 4 && 10 * seen >= 9 * runs,
            "{kind}: {seen} of {runs}"
        );
    }
}

#[test]
fn the_noise_is_estimated_whatever_was_declared() {
    let conditions = Conditions::default();
    let mut instrument = Instrument::new(Seen::Pose);
    instrument.declared = Some([3.0, 0.4]);
    let cell = Cell::new(Arm::Ur10, 5);
    let noise = tested(&cell, &instrument, &conditions, 150, 1)
        .unwrap()
        .noise;
    // 100 poses, 300 numbers of each kind: 4 % standard error; the median's is 7 %.
    let near = |found: f64, wanted: f64, off: f64| (found / wanted - 1.0).abs() < off;
    let position = noise.position.unwrap();
    assert!(near(position.estimated, 2e-5, 0.15), "{position:?}");
    assert!(near(position.robust, 2e-5, 0.25), "{position:?}");
    assert!(position.axes.iter().all(|a| near(*a, 2e-5, 0.3)));
    assert!(position.p_value > 0.999 && position.pure.is_none());
    let orientation = noise.orientation.unwrap();
    assert!(near(orientation.estimated, 7e-5, 0.15), "{orientation:?}");
    assert!(orientation.p_value < 1e-6);
    assert!(noise.length.is_none());
}

#[test]
fn the_test_that_sees_an_effect_names_what_it_follows() {
    let conditions = Conditions::rich();
    let instrument = Instrument::new(Seen::Pose);
    let wanted = [
        (
            Hidden::GearEccentricity { joint: 2, order: 2 },
            Subject::Joint(2),
        ),
        (Hidden::Backlash { joint: 1 }, Subject::Direction),
        (Hidden::TimeDrift { joint: Some(0) }, Subject::Time),
    ];
    for (hidden, subject) in wanted {
        let cell = Cell::new(Arm::Irb120, 11);
        let visits = cell.schedule(&conditions, 120, 0);
        let cell = cell.showing(hidden, 2.5, &visits, &instrument).unwrap();
        let w = tested(&cell, &instrument, &conditions, 120, 3).unwrap();
        let test = w.tests.iter().find(|t| t.subject == subject).unwrap();
        assert!(w.structure && test.p_value < 1e-3, "{:?}", &w.tests[..4]);
    }
}

#[test]
fn the_same_seed_gives_the_same_result() {
    let cell = Cell::new(Arm::Scara, 2);
    let run = || {
        let instrument = Instrument::new(Seen::Position);
        tested(&cell, &instrument, &Conditions::rich(), 90, 4)
    };
    assert_eq!(run(), run());
}

#[test]
fn repeated_poses_show_the_noise_alone() {
    // Every pose twice; a curve that the model lacks is the same both times.
    let conditions = Conditions::default();
    let instrument = Instrument::new(Seen::Position);
    let cell = Cell::new(Arm::Ur10, 8);
    let mut visits = cell.schedule(&conditions, 60, 0);
    visits.extend(visits.clone());
    let cell = cell.with(Hidden::JointCurve { joint: 1 }, 4e-4);
    let data = cell.measure(&visits, &conditions, &instrument, 0).dataset();
    let problem = Problem::new(&cell.robot(), &data, Joints::Readings, Vec::new());
    let found = identify(&problem).unwrap().geometric;
    let rows: Vec<&Observation> = problem.identify.iter().collect();
    let w = whiteness(&found.arm, &found.fit.unknowns, &rows, problem.sigmas, 0).unwrap();
    let position = w.noise.position.unwrap();
    assert!(w.structure && position.estimated > 2.0 * 2e-5);
    // 40 poses, 120 degrees of freedom: 6 % standard error
    assert!((position.pure.unwrap() / 2e-5 - 1.0).abs() < 0.2);
    let repeats = w
        .tests
        .iter()
        .find(|t| t.subject == Subject::Repeats)
        .unwrap();
    assert!(repeats.p_value < 1e-4, "{repeats:?}");
}
