//! The diagnosis on simulated cells that hide an effect it is not told of, and on measured
//! robots.

use crate::robots;
use truepose::params::Blob;
use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};
use truepose_host::deploy::{Origin, blob};
use truepose_host::description::Robot;
use truepose_host::diagnose::{Answer, Diagnosis, Named};
use truepose_host::identify::assess::{Statistics, errors};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::readings::identify_file;
use truepose_host::measurement::{Expected, Purpose, read};

use crate::diagnosed::{diagnosed, rms};

const ARMS: [Arm; 4] = [Arm::Puma560, Arm::Ur10, Arm::Irb120, Arm::Panda];

/// What a cell hides, its diagnosis, and the verify rms of geometry on the same rows without
/// the effect, m. `None`: these poses cannot show it.
fn of_cell(kind: Option<&str>, seed: u64) -> Option<(Option<Hidden>, Diagnosis, f64)> {
    of_rows(kind, seed, 150)
}

fn of_rows(kind: Option<&str>, seed: u64, rows: usize) -> Option<(Option<Hidden>, Diagnosis, f64)> {
    let arm = ARMS[(seed % 4) as usize];
    let seen = if seed.is_multiple_of(2) {
        Seen::Position
    } else {
        Seen::Pose
    };
    let mut conditions = Conditions::rich();
    conditions.approached = kind != Some("early-reading");
    let instrument = Instrument::new(seen);
    let empty = Cell::new(arm, seed);
    let visits = empty.schedule(&conditions, rows, 0);
    let hidden = kind.map(|kind| Hidden::draw(kind, arm, seed).unwrap());
    let mut cell = empty.clone();
    if let Some(hidden) = hidden {
        cell = cell.showing(hidden, 2.0, &visits, &instrument).ok()?;
    }
    let data = |cell: &Cell| cell.measure(&visits, &conditions, &instrument, 0).dataset();
    let floor = identify_file(&empty.robot(), &data(&empty), Vec::new()).unwrap();
    let verify: Vec<&Observation> = floor.problem.verify.iter().collect();
    let floor = errors(&floor.calibration.geometric.arm, &verify);
    let floor = Statistics::of(&floor.distances).unwrap().rms;
    Some((hidden, diagnosed(&cell.robot(), &data(&cell)), floor))
}

#[test]
fn nothing_is_named_where_nothing_is_hidden() {
    for seed in 100..112 {
        let (_, diagnosis, _) = of_cell(None, seed).unwrap();
        let named: Vec<String> = diagnosis
            .named
            .iter()
            .map(|n| n.step.hypothesis.label())
            .collect();
        assert!(named.is_empty(), "seed {seed}: {named:?}");
    }
}

/// 30 poses show too little of an irregular curve: what looks like it on them may be worse than nothing.
#[test]
fn what_makes_held_back_rows_worse_is_taken_back() {
    let mut withdrawn = 0;
    for seed in 0..24 {
        let Some((_, diagnosis, _)) = of_rows(Some("joint-curve"), seed, 45) else {
            continue;
        };
        let [geometric, complete] = rms(&diagnosis);
        assert!(complete <= geometric, "seed {seed}: {complete} {geometric}");
        if diagnosis.withdrawn {
            withdrawn += 1;
            assert_eq!(diagnosis.answer(), Answer::StructureRemains, "seed {seed}");
        }
    }
    assert!(withdrawn > 0);
}

#[test]
fn a_hidden_effect_is_named_and_taken_out() {
    let kinds = [
        "joint-gain",
        "gear-eccentricity",
        "gear-ripple",
        "joint-compliance",
        "cross-axis-compliance",
        "tool-load",
        "backlash",
        "warm-up",
        "step-change",
        "joint-coupling",
        "early-reading",
    ];
    let (mut runs, mut missed) = (0, Vec::new());
    for kind in kinds {
        for seed in 0..4 {
            let Some((Some(hidden), diagnosis, _)) = of_cell(Some(kind), seed) else {
                continue;
            };
            runs += 1;
            let first = diagnosis.named.first().map(|n| &n.step.hypothesis);
            let [geometric, complete] = rms(&diagnosis);
            // The effect doubles the error; the half of it that noise makes stays.
            if first.is_none_or(|h| h.kind != kind) || complete > 0.75 * geometric {
                let named = first.map(|h| h.label());
                missed.push(format!("{hidden:?} (seed {seed}): {named:?}"));
            }
        }
    }
    // Near-equal rivals exist: the rate is what is promised, not every run.
    assert!(runs > 35, "{runs}");
    assert!(10 * missed.len() <= runs, "{missed:#?} of {runs}");
}

#[test]
fn an_effect_outside_the_catalogue_is_taken_out_without_a_name() {
    let mut removed = Vec::new();
    let mut passed_for_known = Vec::new();
    for kind in [
        "stick-slip",
        "cable-pull",
        "rocking-base",
        "saturation",
        "loaded-backlash",
    ] {
        for seed in 0..3 {
            let Some((_, diagnosis, floor)) = of_cell(Some(kind), seed) else {
                continue;
            };
            let [geometric, complete] = rms(&diagnosis);
            assert!(
                complete <= geometric,
                "{kind}, seed {seed}: {geometric} to {complete}"
            );
            let square = |x: f64| x * x;
            let excess = square(geometric) - square(floor);
            removed.push((square(geometric) - square(complete)) / excess);
            let names = diagnosis.named.iter().map(|n| n.step.hypothesis.label());
            let names: Vec<String> = names.collect();
            if !names.is_empty() && diagnosis.answer() != Answer::StructureRemains {
                passed_for_known.push(format!("{kind}, seed {seed}: {names:?}"));
            }
        }
    }
    removed.sort_by(f64::total_cmp);
    let median = removed[removed.len() / 2];
    assert!(removed.len() > 10 && median > 0.85, "{removed:?}");
    // friction below what a wrist carries looks like compliance alone (docs/DIAGNOSIS.md)
    assert!(passed_for_known.len() <= 1, "{passed_for_known:#?}");
}

#[test]
fn friction_is_told_from_compliance() {
    let sticks = |diagnosis: &Diagnosis| diagnosis.friction.is_some_and(|f| f.likelier);
    let (mut yielding, mut sticking, mut passed_for_yielding) = (0, 0, Vec::new());
    for seed in 2000..2010 {
        if let Some((_, diagnosis, _)) = of_cell(Some("joint-compliance"), seed) {
            yielding += 1;
            assert!(!sticks(&diagnosis), "{seed}: {:?}", diagnosis.friction);
        }
        if let Some((_, diagnosis, _)) = of_cell(Some("stick-slip"), seed) {
            sticking += 1;
            if diagnosis.answer() != Answer::StructureRemains {
                passed_for_yielding.push((seed, diagnosis.friction));
            } else if sticks(&diagnosis) {
                let doubt = |n: &Named| n.doubt.as_ref().is_some_and(|d| d.contains("friction"));
                let bent = diagnosis.disproportion.as_ref().is_some_and(|d| d.bent);
                assert!(bent || diagnosis.named.iter().any(doubt), "{seed}");
            }
        }
    }
    assert!(yielding > 4 && sticking > 4, "{yielding}, {sticking}");
    // what friction holds may be far below what the joint carries
    assert!(passed_for_yielding.len() <= 1, "{passed_for_yielding:#?}");
}

#[test]
fn what_depends_on_a_covariate_beats_its_shuffled_self() {
    for kind in ["backlash", "joint-compliance", "warm-up", "early-reading"] {
        let (_, diagnosis, _) = (0..8).find_map(|seed| of_cell(Some(kind), seed)).unwrap();
        let named = diagnosis.named.first().unwrap();
        let control = named.control.unwrap();
        assert!(control.own > 3.0 * control.largest, "{kind}: {control:?}");
        assert!(control.shuffled <= control.largest);
        let early = kind == "early-reading";
        assert_eq!(control.move_before.is_some(), early, "{kind}");
        let before = control.move_before.unwrap_or(0.0);
        assert!(control.own > 3.0 * before, "{kind}: {control:?}");
    }
}

#[test]
fn the_errors_told_step_by_step_end_at_the_final_one() {
    let mut chains = 0;
    for kind in ["joint-compliance", "cable-pull", "loaded-backlash"] {
        let Some((_, diagnosis, _)) = (0..8).find_map(|seed| of_cell(Some(kind), seed)) else {
            continue;
        };
        let [mut before, last] = rms(&diagnosis);
        for named in &diagnosis.named {
            assert!((named.rms[0] - before).abs() < 1e-9, "{kind}: {before}");
            before = named.rms[1];
        }
        assert!((before - last).abs() < 1e-9, "{kind}: {before} and {last}");
        chains += 1;
    }
    assert_eq!(chains, 3);
}

#[test]
fn a_name_beside_a_nameless_term_of_the_same_joint_is_in_doubt() {
    let mut seen = 0;
    for seed in 0..8 {
        let Some((_, diagnosis, _)) = of_cell(Some("loaded-backlash"), seed) else {
            continue;
        };
        let is_unnamed = |named: &&Named| named.step.hypothesis.kind == "unnamed";
        let joints: Vec<Option<usize>> = (diagnosis.named.iter().filter(is_unnamed))
            .map(|named| named.step.hypothesis.joint)
            .collect();
        for named in diagnosis.named.iter().filter(|n| !is_unnamed(n)) {
            if joints.contains(&named.step.hypothesis.joint) {
                assert!(named.doubt.is_some(), "{}", named.step.hypothesis.label());
                seen += 1;
            }
        }
    }
    assert!(seen > 0);
}

#[test]
fn rows_stand_for_the_time_where_there_is_none_and_their_drift_is_not_deployed() {
    let (hidden, arm) = (
        Hidden::WarmUp {
            joint: 1,
            constant: 600.0,
        },
        Arm::Irb120,
    );
    let conditions = Conditions {
        sessions: 1,
        ..Conditions::rich()
    };
    let instrument = Instrument::new(Seen::Pose);
    let cell = Cell::new(arm, 2);
    let visits = cell.schedule(&conditions, 150, 0);
    let cell = cell.showing(hidden, 2.5, &visits, &instrument).unwrap();
    let mut data = cell.measure(&visits, &conditions, &instrument, 0).dataset();
    for row in &mut data.rows {
        row.time = None;
    }
    data.available.time = false;
    let robot = cell.robot();
    let diagnosis = diagnosed(&robot, &data);
    let first = &diagnosis.named[0].step.hypothesis;
    assert!(
        ["warm-up", "time-drift"].contains(&first.kind),
        "{}",
        first.label()
    );
    let [geometric, complete] = rms(&diagnosis);
    assert!(complete < 0.7 * geometric, "{geometric} to {complete}");

    let origin = Origin {
        rows_identify: 100,
        rows_verify: 50,
        rms: [geometric, complete],
    };
    let calibration = &diagnosis.identified.calibration;
    let bytes = blob(&robot, calibration, &data.file, &origin).unwrap();
    let blob = Blob::decode(&bytes).unwrap();
    let kinds: Vec<&str> = blob.effects.iter().map(|e| e.model().kind()).collect();
    assert!(!kinds.contains(&first.kind), "{kinds:?}");
}

#[test]
fn measured_robots_lose_half_of_what_geometry_leaves() {
    let Some(folder) = robots::measured() else {
        return;
    };
    for (name, limit, first) in [
        ("iiwa7", 0.30e-3, "joint-compliance"),
        ("irb120_tracker", 0.30e-3, "early-reading"),
        ("irb120_tracker_cmd", 0.075e-3, "joint-compliance"),
    ] {
        let robot = Robot::read(&folder.join(format!("{name}_robot.toml"))).unwrap();
        let file = folder.join(format!("{name}.csv"));
        let data = read(&file, &Expected::of(&robot), Purpose::Fit).unwrap();
        let diagnosis = diagnosed(&robot, &data);
        let [_, complete] = rms(&diagnosis);
        assert!(complete < limit, "{name}: {complete}");
        assert_eq!(diagnosis.named[0].step.hypothesis.kind, first, "{name}");
    }
}
