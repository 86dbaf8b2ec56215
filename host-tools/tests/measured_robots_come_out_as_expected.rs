//! The real measurements, against an independent fit of the same files.

use std::path::Path;

use crate::robots;
use truepose_host::description::Robot;
use truepose_host::identify::named::effects;
use truepose_host::identify::readings::identify_file;
use truepose_host::measurement::{Expected, Purpose, read};
use truepose_host::report::Report;
use truepose_host::report::schema::{Status, Verdict};

fn report(folder: &Path, name: &str, named: &[&str]) -> Report {
    let robot = Robot::read(&folder.join(format!("{name}_robot.toml"))).unwrap();
    let file = folder.join(format!("{name}.csv"));
    let data = read(&file, &Expected::of(&robot), Purpose::Fit).unwrap();
    let named: Vec<String> = named.iter().map(|&s| s.to_owned()).collect();
    let effects = effects(&named, &robot, &data).unwrap();
    let identified = identify_file(&robot, &data, effects).unwrap();
    Report::new(&robot.name, &data, &identified).unwrap()
}

/// The figures are printed with three digits; another weighting of the same data moves them
/// by less than this.
fn close(found: f64, expected: f64) -> bool {
    (found / expected - 1.0).abs() < 0.01
}

#[test]
fn geometry_alone_explains_as_much_as_an_independent_fit() {
    let Some(folder) = robots::measured() else {
        return;
    };
    for (name, nominal, geometric) in [
        ("ur10_grid", 0.848, 0.443),
        ("iiwa7", 1.210, 0.694),
        ("irb120_tracker", 0.954, 0.583),
        ("irb120_tracker_cmd", 0.871, 0.283),
    ] {
        let report = report(&folder, name, &[]);
        let [before, after] = report.before_and_after_mm();
        assert!(close(before, nominal), "{name}: {before}");
        assert!(close(after, geometric), "{name}: {after}");
        assert_eq!(report.summary.verdict, Verdict::StructureRemains, "{name}");
        for p in &report.summary.parameters {
            let finite = p.value.is_finite() && p.sigma.is_none_or(|s| s.is_finite() && s > 0.0);
            assert!(finite, "{name}: {}", p.name);
            assert_eq!(
                p.sigma.is_some(),
                p.status == Status::Identified,
                "{}",
                p.name
            );
        }
    }
}

#[test]
fn joint_compliance_named_on_the_command_line_explains_most_of_the_rest() {
    let Some(folder) = robots::measured() else {
        return;
    };
    for (name, at_most) in [("iiwa7", 0.334), ("irb120_tracker_cmd", 0.15)] {
        let report = report(&folder, name, &["joint-compliance"]);
        let [_, after] = report.before_and_after_mm();
        assert!(after < at_most, "{name}: {after}");
        assert!(report.summary.effects.len() >= 3, "{name}");
    }
}
