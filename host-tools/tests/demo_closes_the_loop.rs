//! `demo` runs with nothing prepared and ends better than it began.

use crate::support::{folder, names, said, truepose};

#[test]
fn every_step_of_the_loop_makes_the_arm_better() {
    let folder = folder("demo-loop");
    // A wrist, an arm without one, and a seventh joint.
    for arm in ["puma560", "ur10", "panda"] {
        let output = truepose(&folder, &["demo", "--arm", arm, "--json", "d.json"]);
        let (status, out, err) = said(&output);
        assert_eq!(status, 0, "{out}{err}");
        let text = std::fs::read_to_string(folder.join("d.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        for unit in ["error_mm", "error_deg"] {
            let rms = |part: &str, of: &str| json[part][unit][of]["rms"].as_f64().unwrap();
            for part in ["held_back", "executed"] {
                let [nominal, geometric, complete] =
                    ["nominal", "geometric", "final"].map(|of| rms(part, of));
                assert!(geometric < 0.5 * nominal, "{arm} {part} {unit}: {out}");
                assert!(complete < geometric, "{arm} {part} {unit}: {out}");
            }
        }
        // The noise is 0.02 mm an axis; what is left is that and the fit's own uncertainty.
        let after = json["executed"]["error_mm"]["final"]["rms"]
            .as_f64()
            .unwrap();
        assert!(after > 0.03 && after < 0.06, "{arm}: {out}");
        let hidden = json["hidden"]["amplitude"].as_f64().unwrap();
        let found = json["found"]["amplitude"].as_f64().unwrap();
        assert!((found / hidden - 1.0).abs() < 0.15, "{arm}: {out}");
        let verified = json["verify"]["error_mm"]["after"]["rms"].as_f64().unwrap();
        assert!((verified - after).abs() < 0.005, "{arm}: {out}");
        assert!(
            json["verify"]["iso9283"]["ap_mm"].as_f64().unwrap() < 0.06,
            "{arm}: {out}"
        );
    }
}

#[test]
fn files_that_it_keeps_run_through_the_other_commands() {
    let folder = folder("demo-keep");
    let output = truepose(&folder, &["demo", "--keep", "."]);
    let (status, out, err) = said(&output);
    assert_eq!(status, 0, "{out}{err}");
    let kept = ["NEW.csv", "P.tpb", "data.csv", "data.toml", "robot.toml"];
    assert_eq!(names(&folder), kept);
    let identify = [
        "identify",
        "--robot",
        "robot.toml",
        "--data",
        "data.csv",
        "--out",
        "Q.tpb",
        "--effect",
        "gear-eccentricity:2:1",
    ];
    let (status, out, err) = said(&truepose(&folder, &identify));
    assert_eq!(status, 0, "{out}{err}");
    for params in ["P.tpb", "Q.tpb"] {
        let verify = [
            "verify",
            "--params",
            params,
            "--data",
            "NEW.csv",
            "--accept-mm",
            "0.15",
        ];
        let (status, out, err) = said(&truepose(&folder, &verify));
        assert_eq!(status, 0, "{out}{err}");
    }
}

#[test]
fn same_seed_says_the_same_again() {
    let folder = folder("demo-again");
    let run = |seed: &str| said(&truepose(&folder, &["demo", "--seed", seed])).1;
    let first = run("3");
    assert_eq!(first, run("3"));
    assert_ne!(first, run("4"));
}

#[test]
fn what_it_cannot_show_is_exit_status_2() {
    let folder = folder("demo-refused");
    for wrong in [
        ["--joint", "3", "--arm", "stanford"],
        ["--joint", "7", "--arm", "puma560"],
        ["--poses", "3", "--seed", "1"],
    ] {
        let arguments: Vec<&str> = ["demo"].into_iter().chain(wrong).collect();
        let (status, _, err) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2, "{err}");
    }
    assert!(names(&folder).is_empty());
}
