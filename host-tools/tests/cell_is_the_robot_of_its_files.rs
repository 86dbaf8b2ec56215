//! The simulated cell hands over what it says: its files read back to its rows, its drawing is
//! the arm that the library computes, and its numbers are the same everywhere.

use truepose_host::cell::{
    Arm, Cell, Conditions, Files, Hidden, Instrument, Measured, Seen, Visit,
};
use truepose_host::description::Robot;
use truepose_host::measurement::{Expected, Purpose, read};

/// Writes the three files into a folder of their own, for as long as `look` looks.
fn on_disk<T>(name: &str, files: &Files, look: impl FnOnce(&std::path::Path) -> T) -> T {
    let folder = std::env::temp_dir().join(format!("truepose-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("robot.toml"), &files.robot).unwrap();
    std::fs::write(folder.join("data.csv"), &files.data).unwrap();
    std::fs::write(folder.join("data.toml"), &files.sidecar).unwrap();
    let seen = look(&folder);
    std::fs::remove_dir_all(&folder).unwrap();
    seen
}

fn every_instrument() -> [Instrument; 4] {
    let offsets = vec![[0.1, 0.0, 0.02], [0.0, 0.12, -0.03]];
    [
        Seen::Position,
        Seen::Pose,
        Seen::Targets(offsets),
        Seen::Length,
    ]
    .map(Instrument::new)
}

fn measured(cell: &Cell, conditions: &Conditions, instrument: &Instrument) -> Measured {
    let visits = cell.schedule(conditions, 60, 0);
    cell.measure(&visits, conditions, instrument, 0)
}

#[test]
fn drawing_agrees_with_the_librarys_chain() {
    for arm in Arm::ALL {
        let cell = Cell::as_drawn(arm);
        let robot = cell.robot();
        for visit in cell.schedule(&Conditions::default(), 20, 3) {
            let ours = cell.truth(&visit);
            let theirs = robot.forward(&visit.q);
            let shift = (ours.fixed_view::<3, 1>(0, 3) - theirs.translation).norm();
            let turn = (ours.fixed_view::<3, 3>(0, 0) - theirs.rotation).norm();
            // Rounding of some thirty products of numbers about one.
            assert!(shift < 1e-14 && turn < 1e-14, "{arm:?}: {shift} {turn}");
        }
    }
}

#[test]
fn files_read_back_as_the_rows_that_were_measured() {
    let conditions = Conditions {
        commands: true,
        ..Conditions::rich()
    };
    for (arm, instrument) in Arm::ALL.into_iter().zip(every_instrument().iter().cycle()) {
        let cell = Cell::new(arm, 5).with(Hidden::EarlyReading, 1e-3);
        let measured = measured(&cell, &conditions, instrument);
        let name = format!("cell-files-{arm:?}");
        let (robot, data) = on_disk(&name, &cell.files(&measured), |folder| {
            let robot = Robot::read(&folder.join("robot.toml")).unwrap();
            let data = folder.join("data.csv");
            (
                robot.clone(),
                read(&data, &Expected::of(&robot), Purpose::Fit).unwrap(),
            )
        });
        let close = |a: f64, b: f64| (a - b).abs() < 1e-15 * (1.0 + a.abs());
        for (read, handed) in robot.joints.iter().zip(&cell.robot().joints) {
            for &parameter in read.joint.parameters() {
                let (a, b) = (
                    read.joint.parameter(parameter),
                    handed.joint.parameter(parameter),
                );
                assert!(close(a, b), "{arm:?} {parameter:?}: {a} {b}");
            }
            let (a, b) = (read.limits.unwrap(), handed.limits.unwrap());
            assert!(
                close(a[0], b[0]) && close(a[1], b[1]),
                "{arm:?}: {a:?} {b:?}"
            );
            let (a, b) = (read.link.unwrap(), handed.link.unwrap());
            assert!(close(a.mass, b.mass) && (a.com - b.com).norm() < 1e-15);
        }
        let handed = measured.dataset();
        assert_eq!(data.measured, handed.measured, "{arm:?}");
        assert_eq!(data.available, handed.available, "{arm:?}");
        assert_eq!(
            data.target_offsets.len(),
            handed.target_offsets.len(),
            "{arm:?}"
        );
        assert_eq!(
            data.noise.position.is_some(),
            handed.noise.position.is_some(),
            "{arm:?}"
        );
        assert_eq!(data.rows.len(), handed.rows.len(), "{arm:?}");
        for (mut read, handed) in data.rows.into_iter().zip(handed.rows) {
            // The reader brings quaternions to unit length once more.
            if let (Some(a), Some(b)) = (read.orientation, handed.orientation) {
                assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-15));
            }
            read.orientation = handed.orientation;
            assert_eq!(read, handed, "{arm:?}");
        }
    }
}

#[test]
fn same_seed_gives_the_same_file_on_every_machine() {
    let conditions = Conditions::rich();
    let text = |seed| {
        let cell = Cell::new(Arm::Stanford, seed).with(Hidden::JointCurve { joint: 1 }, 1e-3);
        measured(&cell, &conditions, &Instrument::new(Seen::Pose)).csv()
    };
    assert_eq!(text(1), text(1));
    assert_ne!(text(1), text(2));
    // FNV-1a, 64 bits, of the whole file. It changes with any change to the cell's arms,
    // random streams or physics, and only with such.
    let hash = text(1)
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    assert_eq!(format!("{hash:016x}"), "347cb477dcb1ce4b");
}

#[test]
fn early_reading_moves_the_readings_and_not_the_arm() {
    let still = Cell::new(Arm::Irb120, 2);
    let early = still.clone().with(Hidden::EarlyReading, 1e-3);
    let conditions = Conditions::default();
    let instrument = Instrument::perfect(Seen::Position);
    let (still, early) = (
        measured(&still, &conditions, &instrument),
        measured(&early, &conditions, &instrument),
    );
    for (a, b) in still.rows.iter().zip(&early.rows).skip(1) {
        assert_eq!(a.values, b.values);
        let farthest = a.reading.iter().zip(&b.reading).map(|(a, b)| (a - b).abs());
        let farthest = farthest.fold(0.0_f64, f64::max);
        assert!((farthest - 1e-3).abs() < 1e-12, "{farthest}");
    }
}

#[test]
fn compensated_commands_can_be_executed() {
    // A visit need not come from the cell's own schedule.
    let cell = Cell::new(Arm::Scara, 1).with(Hidden::Backlash { joint: 0 }, 1e-3);
    let q = [0.3, -0.5, 0.1, 0.2];
    let forth = Visit {
        previous: vec![0.2, -0.5, 0.1, 0.2],
        ..Visit::at(&q)
    };
    let back = Visit {
        previous: vec![0.4, -0.5, 0.1, 0.2],
        ..Visit::at(&q)
    };
    let (a, b, rest) = (
        cell.truth(&forth),
        cell.truth(&back),
        cell.truth(&Visit::at(&q)),
    );
    let apart = (a - b).fixed_view::<3, 1>(0, 3).norm();
    let radius = {
        let o = cell.truth(&Visit::at(&[0.0; 4]));
        assert!((o - rest).norm() > 0.1);
        apart / 2e-3
    };
    // Half a millimetre a milliradian at half a metre from the first axis.
    assert!((0.3..0.8).contains(&radius), "{radius}");
}
