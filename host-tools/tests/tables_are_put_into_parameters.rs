//! `teach` puts what the methods polynomial and cmac need into the parameters, `compensate` uses
//! it; and commands taught on one robot become those of another.

use std::fs;
use std::path::Path;

use crate::support::{blob, folder, robot, said, truepose, write_blob};
use truepose::effects::Conditions;

const COMMANDS: &str = "q1,q2,q3,q4,q5,q6
0.1,0.3,-0.2,0.4,0.9,-0.3
0.5,0.7,-0.5,0.8,1.3,0.3
0.3,0.5,-0.4,0.6,1.1,0.1
";

fn numbers(file: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(file).unwrap();
    let row = |line: &str| line.split(',').map(|n| n.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_method_without_its_tables_says_how_to_make_them_and_has_them_then() {
    let folder = folder("teach");
    write_blob(&folder);
    fs::write(folder.join("T.csv"), COMMANDS).unwrap();
    for method in ["polynomial", "cmac"] {
        let compensate = |params: &str| {
            let out = truepose(
                &folder,
                &[
                    "compensate",
                    "--params",
                    params,
                    "--taught",
                    "T.csv",
                    "--out",
                    "C.csv",
                    "--method",
                    method,
                ],
            );
            said(&out)
        };
        let (status, _, talk) = compensate("P.tpb");
        assert_eq!(status, 2);
        let advice = format!(
            "no {method} was taught: truepose teach --params P.tpb --method {method} --out FILE"
        );
        assert!(talk.contains(&advice), "{talk}");
        assert!(!folder.join("C.csv").exists());

        // Joint 6 has no limits.
        let teach = |more: &[&str]| {
            let mut arguments = vec!["teach", "--params", "P.tpb", "--method", method];
            arguments.extend(["--out", "P2.tpb", "--json", "T.json"]);
            arguments.extend(more);
            said(&truepose(&folder, &arguments))
        };
        let (status, _, talk) = teach(&[]);
        assert_eq!(status, 2);
        assert!(talk.contains("joint 6 has no limits"), "{talk}");
        assert!(!folder.join("P2.tpb").exists());

        let (status, text, talk) = teach(&["--targets", "T.csv"]);
        assert_eq!(status, 0, "{text}{talk}");
        // The memory is said before it is spent.
        assert!(talk.contains(" kB of tables"), "{talk}");
        let json = fs::read_to_string(folder.join("T.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let rms = |when: &str| json[when]["mm"].as_f64().unwrap();
        assert!(rms("after") < 0.5 * rms("before"), "{text}");
        assert!(json["bytes"]["tables"].as_u64().unwrap() <= 16_000);

        let (status, text, _) = compensate("P2.tpb");
        assert_eq!(status, 0);
        let first = format!("six: 3 targets by {method} in f64, written to C.csv");
        assert_eq!(text.lines().next(), Some(first.as_str()));
        // The blob names the method by itself.
        let (_, text, _) = said(&truepose(&folder, &["inspect", "P2.tpb"]));
        assert!(text.contains(&format!("compensation: {method}")), "{text}");
        for file in ["C.csv", "P2.tpb"] {
            fs::remove_file(folder.join(file)).unwrap();
        }
    }
    let tiny = [
        "teach", "--params", "P.tpb", "--method", "cmac", "--memory", "1",
    ];
    let more = ["--targets", "T.csv", "--out", "P3.tpb"];
    let (status, _, talk) = said(&truepose(&folder, &[&tiny[..], &more[..]].concat()));
    assert_eq!(status, 2);
    assert!(
        talk.contains("takes 12.3 kB at least: raise --memory"),
        "{talk}"
    );
}

/// MRD 5.22: the replaced robot puts its tool where the one that was taught had it.
#[test]
fn taught_commands_move_to_the_robot_that_replaces_the_one_they_were_taught_on() {
    let folder = folder("taught");
    let b = write_blob(&folder);
    let mut a = blob(&robot(&folder));
    for (k, joint) in a.calibrated.joints.iter_mut().enumerate() {
        joint.theta += 2e-3 * f64::from(u8::try_from(k).unwrap()) - 4e-3;
        joint.a -= 4e-4;
        joint.alpha += 1e-3;
    }
    let mut buffer = vec![0; 8192];
    fs::write(folder.join("A.tpb"), a.encode(&mut buffer).unwrap()).unwrap();
    fs::write(folder.join("T.csv"), COMMANDS).unwrap();
    let (status, text, talk) = said(&truepose(
        &folder,
        &[
            "compensate",
            "--params",
            "P.tpb",
            "--taught",
            "T.csv",
            "--from",
            "A.tpb",
            "--out",
            "C.csv",
        ],
    ));
    assert_eq!((status, talk.as_str()), (0, ""), "{text}");
    let (a, b) = (a.model::<f64, 6>().unwrap(), b.model::<f64, 6>().unwrap());
    fs::write(folder.join("plain.csv"), COMMANDS).unwrap();
    let conditions = Conditions::default();
    for (taught, moved) in numbers(&folder.join("plain.csv"))
        .iter()
        .zip(numbers(&folder.join("C.csv")))
    {
        let at = |q: &[f64]| -> [f64; 6] { q[..6].try_into().unwrap() };
        let wanted = a.predict(&at(taught), &conditions);
        let left = b.predict(&at(&moved), &conditions).twist_to(&wanted);
        assert!(
            left.linear.norm() < 1e-6 && left.angular.norm() < 1e-6,
            "{left:?}"
        );
        let before = b.predict(&at(taught), &conditions).twist_to(&wanted);
        assert!(before.linear.norm() > 1e-3, "{before:?}");
    }
    // One table, not two; and the other robot's parameters only with commands taught on it.
    let both = ["compensate", "--params", "P.tpb", "--out", "D.csv"];
    for more in [
        &["--targets", "T.csv", "--taught", "T.csv"][..],
        &["--targets", "T.csv", "--from", "A.tpb"],
        &[],
    ] {
        let (status, _, _) = said(&truepose(&folder, &[&both[..], more].concat()));
        assert_eq!(status, 2);
    }
}
