//! The commands take names of parameters to hold or to free, and a prior's size from the rows.

use std::fmt::Write as _;
use std::fs;

use crate::parameters_are_held_or_free::offset;
use crate::support::{folder, names, robot, said, truepose};
use crate::synthetic::SIGMAS;
use nalgebra::Vector3;
use serde_json::Value;
use truepose::compensate::spherical_wrist::SphericalWrist;
use truepose::effects::{Ambient, Effect, GearEccentricity};
use truepose::params::Blob;
use truepose::{Model, Parameter};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::random::Random;

/// A table of `rows` of the arm in `folder`, its offsets off by up to half a degree, with
/// 30 um of noise.
fn table(folder: &std::path::Path, rows: usize, effects: Vec<Effect<'static, f64>>) {
    let mut truth = offset(&ArmModel::drawn(&robot(folder)), 5);
    truth.effects = effects;
    truth.bake();
    let mut random = Random::new(6, 3);
    let limits = [165.0, 110.0, 70.0, 160.0, 120.0, 180.0_f64];
    let mut evaluator = Evaluator::new(&truth, SIGMAS);
    let mut csv = String::from("q1,q2,q3,q4,q5,q6,x,y,z\n");
    for _ in 0..rows {
        let q = limits.map(|l| random.between(-l, l).to_radians());
        let pose = evaluator.go(0, &q, &[0.0; 6], &Ambient::default());
        let noise = [0; 3].map(|_| 3e-5 * random.normal());
        let p = pose.translation + Vector3::from(noise);
        let joints: Vec<String> = q.iter().map(f64::to_string).collect();
        writeln!(csv, "{},{},{},{}", joints.join(","), p.x, p.y, p.z).unwrap();
    }
    fs::write(folder.join("d.csv"), csv).unwrap();
    fs::write(folder.join("d.toml"), "position_sigma_mm = 0.03\n").unwrap();
}

fn json(file: &std::path::Path) -> Value {
    serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap()
}

const FILES: [&str; 8] = [
    "--robot",
    "robot.toml",
    "--data",
    "d.csv",
    "--out",
    "p.tpb",
    "--json",
    "r.json",
];

fn run(folder: &std::path::Path, command: &str, options: &[&str]) -> (i32, String, String) {
    let all: Vec<&str> = [command]
        .into_iter()
        .chain(FILES)
        .chain(options.iter().copied())
        .collect();
    said(&truepose(folder, &all))
}

#[test]
fn a_controller_with_a_closed_form_gets_offsets_and_keeps_it() {
    let folder = folder("held-offsets");
    table(&folder, 80, Vec::new());
    for (options, closed) in [(&["--only", "offsets"][..], true), (&[][..], false)] {
        let (status, out, err) = run(&folder, "identify", options);
        assert_eq!(status, 0, "{out}{err}");
        let report = json(&folder.join("r.json"));
        assert_eq!(report["verdict"], "nothing-missing");
        let count = &report["completeness"];
        // 4R + 2P + 6; positions show all of them but the tool's turn
        assert_eq!(
            (count["complete"].as_u64(), count["rank"].as_u64()),
            (Some(30), Some(30))
        );
        assert_eq!(count["identified"], if closed { 13 } else { 27 });
        assert_eq!(count["held"], if closed { 24 } else { 0 });
        assert!(
            out.contains("4R + 2P + 6 = 30 parameters, which is the rank"),
            "{out}"
        );
        let bytes = fs::read(folder.join("p.tpb")).unwrap();
        let blob = Blob::decode(&bytes).unwrap();
        let model: Model<'_, f64, 6> = blob.model().unwrap();
        assert!(SphericalWrist::of(&model.nominal).is_some());
        assert_eq!(SphericalWrist::of(&model.calibrated).is_some(), closed);
        let mut moved = 0;
        for (is, drawn) in blob.calibrated.joints.iter().zip(&blob.nominal.joints) {
            for &parameter in is.parameters() {
                let same =
                    is.parameter(parameter).to_bits() == drawn.parameter(parameter).to_bits();
                moved += usize::from(!same);
                assert!(same || parameter == Parameter::Theta || !closed);
            }
        }
        assert_eq!(moved == 4, closed, "{moved}");
        let of = |name: &str| {
            let all = report["parameters"].as_array().unwrap();
            all.iter().find(|p| p["name"] == name).unwrap().clone()
        };
        if closed {
            assert_eq!(of("joint 3 a")["status"], "fixed");
            assert_eq!(of("joint 3 a")["value"], of("joint 3 a")["nominal"]);
            let note = of("joint 3 a")["note"].as_str().unwrap().to_owned();
            assert!(note.contains("--only \"offsets\""), "{note}");
            assert_eq!(of("joint 3 theta")["status"], "identified");
            assert!(out.contains("held at the drawing's value"), "{out}");
        }
    }
}

#[test]
fn names_that_are_not_there_end_the_command_and_write_nothing() {
    let folder = folder("held-misspelt");
    table(&folder, 40, Vec::new());
    for (options, says) in [
        (&["--hold", "joint 3 alhpa"][..], "is joint 3 alpha meant?"),
        (
            &["--only", "offsets, tol"],
            "--only \"tol\": no such parameter (is tool meant?)",
        ),
        (&["--hold", "base,tool,joint"], "leave nothing to identify"),
        (&["--hold", "base", "--free", "tool"], "--free \"tool\""),
    ] {
        for command in ["identify", "diagnose"] {
            let (status, out, err) = run(&folder, command, options);
            assert_eq!((status, out.as_str()), (2, ""), "{err}");
            assert!(err.contains(says), "{err}");
        }
        let mut plan = vec![
            "plan",
            "--robot",
            "robot.toml",
            "--poses",
            "5",
            "--out",
            "c.csv",
        ];
        plan.extend(options);
        let (status, _, err) = said(&truepose(&folder, &plan));
        assert!(status == 2 && err.contains(says), "{err}");
    }
    assert_eq!(names(&folder), ["d.csv", "d.toml", "robot.toml"]);
}

#[test]
fn diagnose_and_plan_take_the_same_names() {
    let folder = folder("held-diagnose");
    let eccentric = Effect::GearEccentricity(GearEccentricity {
        joint: 1,
        order: 1.0,
        amplitude: [8e-4, -4e-4],
    });
    table(&folder, 100, vec![eccentric]);
    let (status, out, err) = run(&folder, "diagnose", &["--only", "offsets"]);
    assert_eq!(status, 0, "{out}{err}");
    let report = json(&folder.join("r.json"));
    assert_eq!(report["verdict"], "explained", "{out}");
    assert_eq!(report["effects"][0]["kind"], "gear-eccentricity");
    assert_eq!(report["effects"].as_array().unwrap().len(), 1);
    for parameter in report["parameters"].as_array().unwrap() {
        let name = parameter["name"].as_str().unwrap();
        let free = name.contains("theta") || !name.starts_with("joint") || name.contains("gear");
        assert!(free || parameter["status"] == "fixed", "{parameter}");
    }

    let mut counts = Vec::new();
    for options in [&[][..], &["--only", "offsets"]] {
        let mut plan = vec!["plan", "--robot", "robot.toml", "--poses", "12"];
        plan.extend(["--out", "c.csv", "--json", "plan.json"]);
        plan.extend(options);
        let (status, out, err) = said(&truepose(&folder, &plan));
        assert_eq!(status, 0, "{out}{err}");
        let report = json(&folder.join("plan.json"));
        counts.push(report["parameters"].as_array().unwrap().len());
    }
    assert_eq!(counts, [27, 13]);
}

#[test]
fn what_is_held_and_wrong_is_not_explained_by_an_effect() {
    let folder = folder("held-wrong");
    table(&folder, 60, Vec::new());
    for command in ["diagnose", "identify"] {
        let (status, out, err) = run(&folder, command, &["--hold", "joint 3 theta"]);
        assert_eq!(status, 0, "{out}{err}");
        let verdict = json(&folder.join("r.json"))["verdict"].clone();
        assert!(
            verdict == "ambiguous" || verdict == "structure-remains",
            "{verdict}"
        );
        let says = "most of all joint 3 theta would leave its drawn value";
        assert!(out.contains(says), "{out}");
    }
    // what is held and right, or what another takes up whole, is only counted
    let (_, out, _) = run(&folder, "identify", &["--hold", "tool"]);
    assert!(out.contains("6 parameters are held as asked\n"), "{out}");
    let (_, out, _) = run(&folder, "identify", &["--only", "offsets"]);
    assert!(out.contains("24 parameters are held as asked\n"), "{out}");
}

#[test]
fn a_prior_takes_its_size_from_the_rows_where_asked() {
    let folder = folder("prior-size");
    table(&folder, 40, Vec::new());
    let method = ["--estimator", "minimum-variance"];
    let cross = [&method[..], &["--prior", "cross-validated"]].concat();
    let (status, out, err) = run(&folder, "identify", &cross);
    assert_eq!(status, 0, "{out}{err}");
    assert!(
        out.contains("size of the prior by cross-validation on"),
        "{out}"
    );
    let report = json(&folder.join("r.json"));
    let prior = &report["estimator"]["prior"];
    let tried = prior["tried"].as_array().unwrap();
    assert_eq!(tried.len(), 12);
    assert!(tried[0]["mm"].is_null());
    let least = |a: &&Value, b: &&Value| {
        let of = |t: &Value| t["rms_noise"].as_f64().unwrap();
        of(a).total_cmp(&of(b))
    };
    assert_eq!(tried.iter().min_by(least).unwrap()["mm"], prior["mm"]);

    let given = [&method[..], &["--prior-mm", "2"]].concat();
    assert_eq!(run(&folder, "identify", &given).0, 0);
    let prior = &json(&folder.join("r.json"))["estimator"]["prior"];
    assert_eq!(
        (prior["mm"].as_f64(), prior["deg"].as_f64()),
        (Some(2.0), Some(0.5))
    );
    assert!(prior.get("tried").is_none());

    let (status, _, err) = run(&folder, "identify", &["--prior", "cross-validated"]);
    assert!(
        status == 2 && err.contains("--estimator minimum-variance"),
        "{err}"
    );
}
