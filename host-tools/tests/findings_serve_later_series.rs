//! What a diagnosis finds on one series of poses serves another series of the same arm: other
//! poses, a wider range of the joints, the instrument somewhere else.

use crate::robots;
use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};
use truepose_host::description::Robot;
use truepose_host::diagnose::diagnose;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::assess::{Statistics, errors};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::prior::Prior;
use truepose_host::identify::readings::identify_file;
use truepose_host::identify::solve::fit;
use truepose_host::identify::unknown::Unknown;
use truepose_host::measurement::{Expected, Purpose, Row, read};

/// Rms of `arm` on `rows` after base and tool are placed anew, all else as it is, m.
fn realigned(arm: &ArmModel, rows: &[&Observation]) -> f64 {
    let mut arm = arm.clone();
    let base = (0..6).map(|axis| Unknown::Base { session: 0, axis });
    let unknowns: Vec<Unknown> = base
        .chain((0..6).map(|axis| Unknown::Tool { axis }))
        .collect();
    let sigmas = truepose_host::identify::observation::Sigmas {
        position: 2e-5,
        orientation: 7e-5,
        ..truepose_host::identify::problem::ASSUMED
    };
    fit(&mut arm, &unknowns, rows, sigmas, Prior::None);
    Statistics::of(&errors(&arm, rows).distances).map_or(f64::NAN, |s| s.rms)
}

#[test]
fn a_later_series_is_predicted_better_than_by_geometry() {
    let mut worse = Vec::new();
    let (mut runs, mut sum) = (0, 0.0);
    for kind in [
        "gear-eccentricity",
        "joint-curve",
        "joint-compliance",
        "backlash",
        "cable-pull",
        "rocking-base",
    ] {
        for seed in [1, 3] {
            let arm = [Arm::Puma560, Arm::Ur10, Arm::Irb120, Arm::Panda][seed as usize % 4];
            let instrument = Instrument::new(Seen::Pose);
            // one placement a series
            let conditions = Conditions {
                range: 0.6,
                sessions: 1,
                ..Conditions::rich()
            };
            let later = Conditions {
                range: 0.9,
                ..conditions.clone()
            };
            let cell = Cell::new(arm, seed);
            let visits = cell.schedule(&conditions, 150, 0);
            let Some(hidden) = Hidden::draw(kind, arm, seed) else {
                continue;
            };
            let Ok(cell) = cell.showing(hidden, 2.0, &visits, &instrument) else {
                continue;
            };
            let first = cell.measure(&visits, &conditions, &instrument, 0).dataset();
            let identified = identify_file(&cell.robot(), &first, Vec::new()).unwrap();
            let found = diagnose(identified, &|_| {}).unwrap();
            let calibration = &found.identified.calibration;

            let mut visits = cell.schedule(&later, 150, 1);
            for visit in &mut visits {
                visit.session = 1;
            }
            let moved = cell.clone().with(Hidden::InstrumentMoved, 5e-3);
            let second = moved.measure(&visits, &later, &instrument, 1).dataset();
            let second = identify_file(&cell.robot(), &second, Vec::new()).unwrap();
            let rows: Vec<&Observation> = second.problem.identify.iter().collect();
            let [geometric, complete] = [&calibration.geometric, &calibration.complete]
                .map(|stage| realigned(&stage.arm, &rows));
            runs += 1;
            sum += (complete / geometric).ln();
            if complete > geometric {
                worse.push(format!("{kind} {seed}: {geometric} to {complete}"));
            }
        }
    }
    let typical = (sum / f64::from(runs)).exp();
    assert!(runs > 8 && worse.is_empty(), "{runs} runs, {worse:#?}");
    assert!(typical < 0.8, "{typical}");
}

#[test]
fn the_first_days_of_a_measured_arm_serve_its_last() {
    let Some(folder) = robots::measured() else {
        return;
    };
    let robot = Robot::read(&folder.join("ur10_grid_robot.toml")).unwrap();
    let file = folder.join("ur10_grid.csv");
    let all = read(&file, &Expected::of(&robot), Purpose::Fit).unwrap();
    // 100 hours with pauses: the first third, and the last
    let last = all
        .rows
        .iter()
        .filter_map(|row| row.time)
        .fold(0.0, f64::max);
    let part = |from: f64, to: f64, every: usize| {
        let mut part = all.clone();
        let within = |row: &Row| row.time.is_some_and(|t| (from..to).contains(&(t / last)));
        part.rows.retain(within);
        part.rows = part.rows.into_iter().step_by(every).collect();
        part
    };
    let identified = identify_file(&robot, &part(0.0, 0.35, 9), Vec::new()).unwrap();
    let found = diagnose(identified, &|_| {}).unwrap();
    let calibration = &found.identified.calibration;
    let later = identify_file(&robot, &part(0.6, 2.0, 9), Vec::new()).unwrap();
    let rows: Vec<&Observation> = later.problem.identify.iter().collect();
    let [geometric, complete] =
        [&calibration.geometric, &calibration.complete].map(|stage| realigned(&stage.arm, &rows));
    assert!(rows.len() > 200, "{}", rows.len());
    assert!(complete < 0.6 * geometric, "{geometric} to {complete}");
}
