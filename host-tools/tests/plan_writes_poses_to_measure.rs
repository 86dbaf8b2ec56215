//! `plan` from the command line.

use crate::support::{folder, robot, said, truepose, write_blob};
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
fn pairs_and_touches_come_with_what_belongs_together() {
    let folder = folder("plan-kinds");
    let robot = robot(&folder);
    let run = |more: &[&str]| {
        let base = [
            "plan",
            "--robot",
            "robot.toml",
            "--out",
            "POSES.csv",
            "--json",
            "p.json",
        ];
        let (status, out, err) = said(&truepose(&folder, &[&base[..], more].concat()));
        assert_eq!(status, 0, "{out}{err}");
        let read_to = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read_to("p.json")).unwrap();
        (read_to("POSES.csv"), json, out)
    };
    let (csv, json, _) = run(&["--poses", "60", "--measure", "distance"]);
    assert_eq!(json["poses"], 60);
    let pairs: Vec<&str> = csv
        .lines()
        .skip(1)
        .filter_map(|l| l.split(',').nth(6))
        .collect();
    assert_eq!(pairs.len(), 60);
    assert!(pairs.chunks(2).all(|pair| pair[0] == pair[1]), "{pairs:?}");
    let touch = [
        "--poses",
        "40",
        "--measure",
        "touch",
        "--point-mm",
        "500,300,300",
        "--point-mm",
        "400,-400,500",
        "--plane-mm",
        "0,0,100,0,0.1,1",
    ];
    let (csv, _, _) = run(&touch);
    assert!(csv.starts_with("q1,q2,q3,q4,q5,q6,point,plane\n"), "{csv}");
    let one = |line: &str| {
        line.split(',')
            .skip(6)
            .filter(|cell| !cell.is_empty())
            .count()
            == 1
    };
    assert!(csv.lines().skip(1).all(one), "{csv}");
    let stations = [
        "--poses",
        "24",
        "--measure",
        "bearing",
        "--station-mm",
        "3000,500,400",
        "--station-mm",
        "500,3000,200",
    ];
    let (csv, json, out) = run(&stations);
    assert_eq!(csv.lines().count(), 25);
    assert!(out.contains("deg alone"), "{out}");
    let names = json["parameters"].as_array().unwrap();
    let station = |n: &&serde_json::Value| n.as_str().unwrap().starts_with("station 2");
    assert_eq!(names.iter().filter(station).count(), 6);
    let expected = Expected::of(&robot);
    assert!(read(&folder.join("POSES.csv"), &expected, Purpose::Joints).is_ok());
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
        (
            vec!["--poses", "30", "--measure", "bearing"],
            "--station-mm",
        ),
        (vec!["--poses", "30", "--measure", "touch"], "--point-mm"),
        (
            vec!["--poses", "61", "--measure", "distance"],
            "even number",
        ),
        (vec!["--poses", "30", "--point-mm", "1,2,3"], "touch"),
        (
            vec!["--poses", "30", "--measure", "touch", "--point-mm", "1,2"],
            "3 numbers",
        ),
    ] {
        let arguments: Vec<&str> = base.iter().copied().chain(more).collect();
        let (status, _, err) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2, "{err}");
        assert!(err.contains(says), "{says}: {err}");
        assert!(!folder.join("POSES.csv").exists());
    }
}
