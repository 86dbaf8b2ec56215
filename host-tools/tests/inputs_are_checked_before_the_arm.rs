//! Faults of the input are found and named, and right input is left alone.

use crate::robots;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};
use truepose_host::description::Robot;
use truepose_host::diagnose::input::{Finding, Kind, check};
use truepose_host::identify::identify;
use truepose_host::identify::problem::{Joints, Problem};
use truepose_host::measurement::{Dataset, Expected, Purpose, read};

/// What the check says of a table, behind a geometric fit where there is one.
fn findings(robot: &Robot, data: &Dataset) -> Vec<Finding> {
    let problem = Problem::new(robot, data, Joints::Readings, Vec::new());
    let fitted = identify(&problem).ok();
    let stage = fitted.as_ref().map(|f| &f.geometric);
    check(&problem, data, robot, stage)
}

fn kinds(findings: &[Finding]) -> Vec<Kind> {
    findings.iter().map(|f| f.kind).collect()
}

/// A cell's table with a fault, and what the check says of it.
fn with_fault(arm: Arm, seen: Seen, seed: u64, fault: impl Fn(&mut Dataset)) -> Vec<Finding> {
    let conditions = Conditions::default();
    let cell = Cell::new(arm, seed);
    let visits = cell.schedule(&conditions, 100, 0);
    let mut data = cell
        .measure(&visits, &conditions, &Instrument::new(seen), 0)
        .dataset();
    fault(&mut data);
    findings(&cell.robot(), &data)
}

const SIX_AXES: [Arm; 3] = [Arm::Puma560, Arm::Ur10, Arm::Irb120];

/// Exactly one finding, of this kind and these columns, in every arm and with positions and
/// poses.
fn is_found(kind: Kind, columns: &[&str], fault: impl Fn(&mut Dataset)) {
    for (seed, arm) in (0..).zip(SIX_AXES) {
        for seen in [Seen::Position, Seen::Pose] {
            let found = with_fault(arm, seen.clone(), seed, &fault);
            assert_eq!(kinds(&found), [kind], "{arm:?} {seen:?}: {found:#?}");
            assert_eq!(found[0].columns, columns, "{arm:?} {seen:?}: {found:#?}");
            assert!(found[0].misfit[0] > 4.0 * found[0].misfit[1]);
        }
    }
}

fn each_q(data: &mut Dataset, change: impl Fn(&mut Vec<f64>)) {
    for row in &mut data.rows {
        change(&mut row.q);
    }
}

/// Nothing is said of cells in which nothing is wrong with the input, whatever the arm does.
fn quiet(seeds: std::ops::Range<u64>, hide: bool) {
    let kinds: Vec<&str> = Hidden::CATALOGUE
        .into_iter()
        .chain(Hidden::OUTSIDE)
        .filter(|k| !matches!(*k, "early-reading" | "instrument-moved"))
        .collect();
    let mut loud = Vec::new();
    let count = seeds.end - seeds.start;
    for seed in seeds {
        let arm = Arm::ALL[seed as usize % Arm::ALL.len()];
        let seen = match seed % 4 {
            0 => Seen::Pose,
            1 => Seen::Position,
            2 => Seen::Targets(vec![[0.1, 0.0, 0.05], [0.0, 0.1, 0.08]]),
            _ => Seen::Position,
        };
        let conditions = match seed % 3 {
            0 => Conditions::default(),
            1 => Conditions::rich(),
            _ => Conditions {
                commands: true,
                direction: true,
                ..Conditions::default()
            },
        };
        let instrument = Instrument {
            student: (seed % 5 == 0).then_some(4),
            outliers: (seed % 7 == 0).then_some((0.04, 4e-3)),
            ..Instrument::new(seen)
        };
        let mut cell = Cell::new(arm, seed);
        let visits = cell.schedule(&conditions, 100, 0);
        if hide && let Some(hidden) = Hidden::draw(kinds[seed as usize % kinds.len()], arm, seed) {
            // over a pause that nobody wrote down a drifting base is a jump
            if matches!(hidden, Hidden::TimeDrift { joint: None }) && !conditions.time {
                continue;
            }
            cell = match cell.clone().showing(hidden, 2.0, &visits, &instrument) {
                Ok(cell) => cell,
                Err(_) => continue,
            };
        }
        let data = cell.measure(&visits, &conditions, &instrument, 0).dataset();
        let found = findings(&cell.robot(), &data);
        if !found.is_empty() {
            let hidden: Vec<_> = cell.hidden().collect();
            loud.push(format!("{arm:?} {seed} {hidden:?}: {found:?}"));
        }
    }
    assert!(loud.is_empty(), "{} of {count}: {loud:#?}", loud.len());
}

#[test]
fn right_input_is_left_alone() {
    quiet(0..40, false);
}

#[test]
fn what_the_arm_does_is_no_fault_of_the_input() {
    quiet(0..48, true);
}

#[test]
fn a_joint_that_counts_the_other_way() {
    is_found(Kind::WrongSign, &["q3"], |data| {
        each_q(data, |q| q[2] = -q[2])
    });
    is_found(Kind::WrongSign, &["q6"], |data| {
        each_q(data, |q| q[5] = -q[5])
    });
}

#[test]
fn exchanged_joint_columns() {
    is_found(Kind::ExchangedJoints, &["q4", "q6"], |data| {
        each_q(data, |q| q.swap(3, 5));
    });
}

#[test]
fn a_coupled_joint() {
    is_found(Kind::CoupledJoint, &["q3"], |data| {
        each_q(data, |q| q[2] -= q[1])
    });
}

#[test]
fn units() {
    is_found(Kind::WrongUnit, &["q5"], |data| {
        each_q(data, |q| q[4] = q[4].to_radians());
    });
    is_found(Kind::WrongUnit, &[], |data| {
        each_q(data, |q| q.iter_mut().for_each(|q| *q = q.to_radians()));
    });
    is_found(Kind::WrongUnit, &["x", "y", "z"], |data| {
        for row in &mut data.rows {
            row.position = row.position.map(|p| p.map(|x| x * 1e-3));
        }
    });
    is_found(Kind::WrongUnit, &["y"], |data| {
        for row in &mut data.rows {
            row.position = row.position.map(|[x, y, z]| [x, y * 1e-3, z]);
        }
    });
}

#[test]
fn a_left_handed_frame() {
    for arm in SIX_AXES {
        let found = with_fault(arm, Seen::Position, 3, |data| {
            for row in &mut data.rows {
                row.position = row.position.map(|[x, y, z]| [y, x, z]);
            }
        });
        assert_eq!(kinds(&found), [Kind::MirroredFrame], "{arm:?}: {found:#?}");
    }
}

#[test]
fn rotation_conventions() {
    let turned = |change: fn([f64; 4]) -> [f64; 4], says: &str| {
        for arm in Arm::ALL {
            let found = with_fault(arm, Seen::Pose, 4, |data| {
                for row in &mut data.rows {
                    row.orientation = row.orientation.map(change);
                }
            });
            assert_eq!(
                kinds(&found),
                [Kind::RotationConvention],
                "{arm:?}: {found:#?}"
            );
            assert!(found[0].saw.contains(says), "{arm:?}: {found:#?}");
        }
    };
    turned(|[w, x, y, z]| [w, -x, -y, -z], "inverse");
    turned(|[w, x, y, z]| [x, y, z, w], "x y z w:");
    turned(|[w, x, y, z]| [-x, -y, -z, w], "x y z w and of the inverse");
}

#[test]
fn all_rows_shifted_by_one() {
    for arm in Arm::ALL {
        let found = with_fault(arm, Seen::Position, 5, |data| {
            let points: Vec<_> = data.rows.iter().map(|r| r.position).collect();
            for (row, point) in data.rows.iter_mut().skip(1).zip(points) {
                row.position = point;
            }
            data.rows.remove(0);
        });
        assert_eq!(kinds(&found), [Kind::ShiftedRows], "{arm:?}: {found:#?}");
        assert!(found[0].saw.contains("1 row below"), "{arm:?}: {found:#?}");
    }
}

#[test]
fn rows_shifted_from_some_row_on() {
    for seen in [Seen::Position, Seen::Pose] {
        let found = with_fault(Arm::Puma560, seen, 6, |data| {
            let values: Vec<_> = (data.rows.iter())
                .map(|r| (r.position, r.orientation))
                .collect();
            for i in 71..data.rows.len() {
                (data.rows[i].position, data.rows[i].orientation) = values[i - 1];
            }
            data.rows.remove(70);
        });
        assert_eq!(kinds(&found), [Kind::ShiftedRows], "{found:#?}");
        let rows = &found[0].rows;
        // the first shifted row's joints are gone with the row that was removed
        assert!(rows.len() >= 27 && rows.iter().all(|r| *r > 71), "{rows:?}");
    }
}

#[test]
fn swapped_rows() {
    for arm in Arm::ALL {
        for seen in [Seen::Position, Seen::Pose] {
            let found = with_fault(arm, seen, 7, |data| {
                let (a, b) = (data.rows[20].clone(), data.rows[55].clone());
                data.rows[20].position = b.position;
                data.rows[20].orientation = b.orientation;
                data.rows[55].position = a.position;
                data.rows[55].orientation = a.orientation;
            });
            assert_eq!(kinds(&found), [Kind::SwappedRows], "{arm:?}: {found:#?}");
            assert_eq!(found[0].rows, [21, 56]);
        }
    }
}

#[test]
fn duplicated_rows() {
    let found = with_fault(Arm::Ur10, Seen::Position, 8, |data| {
        // the whole row, and only what was measured
        let row = data.rows[30].clone();
        data.rows[31].q = row.q;
        data.rows[31].position = row.position;
        data.rows[60].position = data.rows[40].position;
    });
    assert_eq!(kinds(&found), [Kind::DuplicatedRows; 2], "{found:#?}");
    assert_eq!(
        (&found[0].rows[..], &found[1].rows[..]),
        (&[31, 32][..], &[41, 61][..])
    );
    assert!(found[0].saw.contains("the same to the last digit"));
    assert!(found[1].saw.contains("different joints"));
}

#[test]
fn an_instrument_that_moved() {
    for (seed, arm) in (0..).zip(Arm::ALL) {
        for seen in [Seen::Position, Seen::Pose] {
            let found = with_fault(arm, seen, seed, |data| {
                let turn = UnitQuaternion::from_scaled_axis(Vector3::new(2e-4, -3e-4, 1e-4));
                for row in data.rows.iter_mut().skip(64) {
                    let shift = Vector3::new(2e-4, -1e-4, 3e-4);
                    row.position = row
                        .position
                        .map(|p| (turn * Vector3::from(p) + shift).into());
                    row.orientation = row.orientation.map(|[w, x, y, z]| {
                        let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
                        let q = turn * q;
                        [q.w, q.i, q.j, q.k]
                    });
                }
            });
            assert_eq!(
                kinds(&found),
                [Kind::InstrumentMoved],
                "{arm:?}: {found:#?}"
            );
            let row = found[0].rows[0];
            assert!((61..=69).contains(&row), "{arm:?}: {found:#?}");
        }
    }
}

#[test]
fn joints_read_before_the_arm_had_settled() {
    for (seed, arm) in (0..).zip(SIX_AXES) {
        let conditions = Conditions {
            commands: true,
            ..Conditions::default()
        };
        let cell = Cell::new(arm, seed).with(Hidden::EarlyReading, 1e-3);
        let visits = cell.schedule(&conditions, 150, 0);
        let instrument = Instrument::new(Seen::Pose);
        let data = cell.measure(&visits, &conditions, &instrument, 0).dataset();
        let found = findings(&cell.robot(), &data);
        assert_eq!(
            kinds(&found),
            [Kind::EarlyReading, Kind::CommandsFitBetter],
            "{arm:?}: {found:#?}"
        );
    }
}

#[test]
fn measured_files_are_right_but_for_the_one_that_was_read_early() {
    let Some(folder) = robots::measured() else {
        return;
    };
    for (name, wanted) in [
        ("iiwa7", &[][..]),
        ("irb120_tracker", &[Kind::EarlyReading]),
        ("irb120_tracker_cmd", &[]),
        ("ur10_grid", &[]),
    ] {
        let robot = Robot::read(&folder.join(format!("{name}_robot.toml"))).unwrap();
        let file = folder.join(format!("{name}.csv"));
        let data = read(&file, &Expected::of(&robot), Purpose::Fit).unwrap();
        let problem = Problem::new(&robot, &data, Joints::Readings, Vec::new());
        let fitted = identify(&problem).unwrap();
        let found = check(&problem, &data, &robot, Some(&fitted.geometric));
        assert_eq!(kinds(&found), wanted, "{name}: {found:#?}");
    }
}
