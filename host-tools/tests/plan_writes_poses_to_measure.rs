//! `plan` from the command line.

mod support;

use support::{folder, robot, said, truepose, write_blob};
use truepose_host::measurement::{Expected, Purpose, read};

#[test]
fn poses_are_written_with_what_they_are_worth() {
    let folder = folder("plan-poses");
    let robot = robot(&folder);
    let arguments = [
        "plan",
        "--robot",
        "robot.toml",
        "--poses",
        "15",
        "--out",
        "POSES.csv",
        "--json",
        "p.json",
    ];
    let (status, out, err) = said(&truepose(&folder, &arguments));
    assert_eq!(status, 0, "{out}{err}");
    let table = read(
        &folder.join("POSES.csv"),
        &Expected::of(&robot),
        Purpose::Joints,
    )
    .unwrap();
    assert_eq!(table.rows.len(), 15);
    for row in &table.rows {
        for (q, joint) in row.q.iter().zip(&robot.joints) {
            let [low, high] = joint
                .limits
                .unwrap_or([-std::f64::consts::PI, std::f64::consts::PI]);
            assert!(*q >= low - 1e-6 && *q <= high + 1e-6, "{q}");
        }
    }
    let text = std::fs::read_to_string(folder.join("p.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |key: &str| json[key].as_f64().unwrap();
    assert!(number("o1") > number("o1_random") && number("o1") <= number("o1_bound"));
    assert_eq!(json["parameters"].as_array().unwrap().len(), 27);
    let forecast = json["forecast"].as_array().unwrap();
    assert_eq!(forecast.last().unwrap()["poses"], 15);
    // The alphabet of optimal design, and G, the largest variance of the predicted tool point.
    let max = forecast.last().unwrap()["max_mm"].as_f64().unwrap();
    assert!((number("g_mm2") - max * max).abs() < 1e-9);
    assert!(number("a") >= 1.0 / number("e") && number("a") <= 27.0 / number("e"));
    // Columns of unit length: the squares of the singular values sum to their number (SH 50),
    // so that no index is above one pose's share; the condition is better than by guesses.
    let unit = |key: &str| json["unit_columns"][key].as_f64().unwrap();
    assert!(unit("o1") <= 1.0 / 15.0_f64.sqrt() + 1e-12 && unit("o3") <= 1.0 && unit("d") < 0.0);
    assert!(unit("o4") <= unit("o3") && (unit("cond_j") * unit("o2") - 1.0).abs() < 1e-9);
    assert!(
        out.contains("27 parameters") && out.contains("workspace"),
        "{out}"
    );
}

#[test]
fn what_is_known_already_counts() {
    let folder = folder("plan-more");
    let _ = robot(&folder);
    write_blob(&folder);
    let first = [
        "plan",
        "--robot",
        "robot.toml",
        "--poses",
        "12",
        "--out",
        "D.csv",
        "--measure",
        "pose",
    ];
    assert_eq!(said(&truepose(&folder, &first)).0, 0);
    // The planned poses come back measured.
    let predict = [
        "predict", "--params", "P.tpb", "--data", "D.csv", "--out", "PRED.csv",
    ];
    assert_eq!(said(&truepose(&folder, &predict)).0, 0);
    let joined: Vec<String> = std::fs::read_to_string(folder.join("D.csv"))
        .unwrap()
        .lines()
        .zip(
            std::fs::read_to_string(folder.join("PRED.csv"))
                .unwrap()
                .lines(),
        )
        .map(|(q, pose)| format!("{q},{pose}\n"))
        .collect();
    std::fs::write(folder.join("D.csv"), joined.concat()).unwrap();
    let more = [
        "plan",
        "--robot",
        "robot.toml",
        "--params",
        "P.tpb",
        "--data",
        "D.csv",
        "--poses",
        "5",
        "--out",
        "MORE.csv",
        "--json",
        "p.json",
        "--minimax",
    ];
    let (status, out, err) = said(&truepose(&folder, &more));
    assert_eq!(status, 0, "{out}{err}");
    let text = std::fs::read_to_string(folder.join("p.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["measured_before"], 12);
    // 30 geometric ones of full poses, two of the eccentricity; no mass that would show the
    // third joint's compliance.
    assert_eq!(json["parameters"].as_array().unwrap().len(), 32, "{json}");
}

#[test]
fn what_cannot_be_planned_is_exit_status_2() {
    let folder = folder("plan-refused");
    let _ = robot(&folder);
    let base = ["plan", "--robot", "robot.toml", "--out", "POSES.csv"];
    for (more, says) in [
        (vec!["--poses", "4"], "27 parameters"),
        (vec!["--poses", "30", "--measure", "length"], "--anchor-mm"),
        (vec!["--poses", "30", "--anchor-mm", "1,2,3"], "length"),
        (
            vec!["--poses", "30", "--position-sigma-mm", "0"],
            "--position-sigma-mm",
        ),
        (vec!["--poses", "30", "--data", "none.csv"], "none.csv"),
    ] {
        let arguments: Vec<&str> = base.iter().copied().chain(more).collect();
        let (status, _, err) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2, "{err}");
        assert!(err.contains(says), "{says}: {err}");
        assert!(!folder.join("POSES.csv").exists());
    }
}
