//! Bad input gives one message that names the place, exit status 2, and writes nothing.

use std::fs;

use crate::support::{self, folder, names, said, truepose, write_blob};
use truepose_host::measurement::{Expected, Purpose, read};

const HEADER: &str = "q1,q2,q3,q4,q5,q6,x,y,z\n";

/// Tables for the arm of `support`, and what the message must say. The rows: enough good
/// ones, then, where the table is about a row, the bad one.
fn tables() -> Vec<(&'static str, String, &'static str)> {
    let good: String = (0..20)
        .map(|k| format!("0.{k},0.1,-0.{k},0.2,0.3,0.4,1.{k},0.5,0.3\n"))
        .collect();
    let row = |row: &str| format!("{HEADER}{good}{row}\n");
    let header = |header: &str| format!("{header}\n{good}");
    vec![
        (
            "empty",
            String::new(),
            "empty.csv: found nothing, expected a header row",
        ),
        (
            "comment",
            "# only this\n".into(),
            "comment.csv: found nothing",
        ),
        (
            "header",
            HEADER.into(),
            "header.csv: found a header without rows",
        ),
        (
            "no_q6",
            "q1,q2,q3,q4,q5,x,y,z\n0,0,0,0,0,1,1,1\n".into(),
            "no_q6.csv:1: q6: found no such column, expected q1 to q6, one a joint of the robot",
        ),
        (
            "q7",
            header("q1,q2,q3,q4,q5,q6,q7,y,z"),
            "q7.csv:1: q7: found a column q7, expected joints 1 to 6: the robot has 6",
        ),
        (
            "q0",
            header("q1,q2,q3,q4,q5,q6,q0,y,z"),
            "q0.csv:1: q0: found a column q0",
        ),
        (
            "no_z",
            header("q1,q2,q3,q4,q5,q6,x,y,order"),
            "no_z.csv:1: z: found no such column, expected x, y and z of every target",
        ),
        (
            "nothing_measured",
            header("q1,q2,q3,q4,q5,q6,a,b,c"),
            "x: found no such column, expected something measured",
        ),
        (
            "twice",
            header("q1,q2,q3,q4,q5,q6,x,x_mm,z"),
            "twice.csv:1: x_mm: found x_mm beside x, expected each quantity once",
        ),
        (
            "wrong_unit",
            header("q1_mm,q2,q3,q4,q5,q6,x,y,z"),
            "wrong_unit.csv:1: q1_mm: found the unit suffix _mm, expected an angle",
        ),
        (
            "upper_case",
            header("Q1,Q2,Q3,Q4,Q5,Q6,X,Y,Z"),
            "q1: found no such column, expected q1 to q6, one a joint of the robot; column names \
             are in lower case",
        ),
        (
            "no_header",
            good.clone(),
            "the first row must name the columns",
        ),
        (
            "semicolons",
            format!("{HEADER}{good}").replace(',', ";"),
            "separate the columns by commas",
        ),
        (
            "nan",
            row("0,0,0,0,0,0,1,NaN,1"),
            "nan.csv:22: row 21, column y: found \"NaN\", expected a finite number",
        ),
        (
            "infinite",
            row("0,0,0,inf,0,0,1,1,1"),
            "infinite.csv:22: row 21, column q4: found \"inf\"",
        ),
        (
            "word",
            row("0,0,0,0,0,0,one,1,1"),
            "word.csv:22: row 21, column x: found \"one\", expected a finite number; correct the",
        ),
        (
            "huge",
            row("0,0,0,0,0,0,1,1e300,1"),
            "huge.csv:22: row 21, column y: found \"1e300\", expected at most 1e9 m",
        ),
        (
            "ragged",
            row("0,0,0,0,0,0,1,1"),
            "ragged.csv:22: row 21: found 8 cells, expected 9, as in the header",
        ),
        (
            "degrees",
            row("0,45.5,0,0,0,0,1,1,1"),
            "degrees.csv:22: row 21, column q2: found 45.500000 rad, expected joint limits -1.920 \
             to 1.920 rad; if the column is in degrees, name it q2_deg",
        ),
        (
            "no_limits",
            row("0,0,0,0,0,-179,1,1,1"),
            "row 21, column q6: found -179.000000 rad, expected at most 25 rad; if the column is",
        ),
        (
            "millimetres",
            format!(
                "{HEADER}{}",
                "0,0,0,0,0,0,1200,300,20\n1,0,0,0,0,0,-900,50,20\n".repeat(10)
            ),
            "millimetres.csv:1: x: found positions ",
        ),
        (
            "one_row",
            format!("{HEADER}0,0,0,0,0,0,1,1,1\n"),
            "one_row.csv: found 1 row to fit (3 equations; 0 held back, 0 left out), expected at \
             least 30 equations: a robot of 6 joints has so many unknowns; measure more poses",
        ),
        (
            "all_blank",
            format!("{HEADER}0,0,0,0,0,0,,,\n,,,,,,1,1,1\n"),
            "all_blank.csv: found no row with joints and a measured value",
        ),
        (
            "quaternion",
            format!(
                "{},qw,qx,qy,qz\n0,0,0,0,0,0,1,1,1,0.5,0.5,0.5,0.6\n",
                HEADER.trim()
            ),
            "quaternion.csv:2: row 1, column qw, qx, qy, qz: found a quaternion of length 1.0536",
        ),
        (
            "no_qz",
            format!("{},qw,qx,qy\n0,0,0,0,0,0,1,1,1,1,0,0\n", HEADER.trim()),
            "no_qz.csv:1: qz: found no such column, expected the whole quaternion",
        ),
        (
            "direction",
            format!(
                "{},dir1\n# so far\n\n0,0,0,0,0,0,1,1,1,0.5\n",
                HEADER.trim()
            ),
            "direction.csv:4: row 1, column dir1: found \"0.5\", expected -1, 0 or 1",
        ),
        (
            "set",
            format!("{},set\n0,0,0,0,0,0,1,1,1,train\n", HEADER.trim()),
            "set.csv:2: row 1, column set: found \"train\", expected identify or verify",
        ),
        (
            "session",
            format!("{},session\n0,0,0,0,0,0,1,1,1,1.5\n", HEADER.trim()),
            "session.csv:2: row 1, column session: found \"1.5\", expected an integer",
        ),
        (
            "no_session",
            format!(
                "{},session\n0,0,0,0,0,0,1,1,1,1\n0,0,0,0,0,0,1,1,1,\n",
                HEADER.trim()
            ),
            "no_session.csv:3: row 2, column session: found a blank cell",
        ),
        (
            "x3",
            format!("{},x3,y3,z3\n0,0,0,0,0,0,1,1,1,1,1,1\n", HEADER.trim()),
            "x3.csv:1: x2: found no such column",
        ),
        (
            "qcmd",
            format!("{},qcmd2\n0,0,0,0,0,0,1,1,1,1\n", HEADER.trim()),
            "qcmd.csv:1: qcmd1: found no such column, expected qcmd1 to qcmd6, or none of them",
        ),
        (
            "temp2",
            format!("{},temp2\n0,0,0,0,0,0,1,1,1,1\n", HEADER.trim()),
            "temp2.csv:1: temp1: found no such column, expected temp1, temp2, ... without gaps",
        ),
    ]
}

#[test]
fn every_bad_table_is_refused_with_its_place() {
    let folder = folder("bad_tables");
    let robot = support::robot(&folder);
    for (name, text, expected) in tables() {
        let file = folder.join(format!("{name}.csv"));
        fs::write(&file, text).unwrap();
        let error = read(&file, &Expected::of(&robot), Purpose::Fit);
        let error = error.expect_err(name).to_string();
        assert!(error.contains(expected), "{error}\n{expected}");
        assert!(!error.contains('\n'), "one line: {error}");
    }
}

#[test]
fn bytes_that_are_no_text_and_folders_are_refused() {
    let folder = folder("bad_files");
    let robot = support::robot(&folder);
    let file = folder.join("utf16.csv");
    let bytes: Vec<u8> = HEADER.encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(&file, [&[0xFF, 0xFE], &bytes[..]].concat()).unwrap();
    for (file, expected) in [
        (
            file.as_path(),
            "utf16.csv:1: found bytes that are not UTF-8, expected text in UTF-8",
        ),
        (
            folder.as_path(),
            "found a directory, expected a file; name the file in it",
        ),
        (&folder.join("none.csv"), "none.csv: cannot be read: "),
    ] {
        let error = read(file, &Expected::of(&robot), Purpose::Fit)
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn the_command_stops_with_status_2_and_writes_nothing() {
    let folder = folder("bad_command");
    write_blob(&folder);
    for (name, text, _) in tables() {
        fs::write(folder.join(format!("{name}.csv")), text).unwrap();
    }
    let before = names(&folder);
    for (name, _, expected) in tables() {
        // What is wrong with the measured values alone is no obstacle to predicting.
        if expected.contains("to fit") || expected.contains("measured") {
            continue;
        }
        if ["no_z", "all_blank"].contains(&name) {
            continue;
        }
        let data = format!("{name}.csv");
        let out = ["--out", "PRED.csv", "--json", "P.json"];
        let arguments = [&["predict", "--params", "P.tpb", "--data", &data], &out[..]].concat();
        let (status, text, talk) = said(&truepose(&folder, &arguments));
        assert_eq!((status, text.as_str()), (2, ""), "{name}: {talk}");
        assert!(talk.starts_with("error: "), "{talk}");
        assert!(talk.contains(expected), "{talk}\n{expected}");
    }
    assert_eq!(names(&folder), before);
}

#[test]
fn identify_stops_with_status_2_and_writes_nothing() {
    let folder = folder("bad_identify");
    fs::write(folder.join("R.toml"), support::ROBOT).unwrap();
    let unknown = support::ROBOT.replacen("\"dh\"", "\"craig\"", 1);
    fs::write(folder.join("craig.toml"), unknown).unwrap();
    for (name, text, _) in tables() {
        fs::write(folder.join(format!("{name}.csv")), text).unwrap();
    }
    let before = names(&folder);
    let identify = |robot: &str, data: &str| {
        let outputs = ["--out", "P.tpb", "--report", "R.html", "--json", "R.json"];
        let inputs = ["identify", "--robot", robot, "--data", data];
        said(&truepose(&folder, &[&inputs[..], &outputs].concat()))
    };
    for (name, _, expected) in tables() {
        let (status, text, talk) = identify("R.toml", &format!("{name}.csv"));
        assert_eq!((status, text.as_str()), (2, ""), "{name}: {talk}");
        let message = talk.lines().last().unwrap_or("");
        assert!(
            message.starts_with("error: ") && message.contains(expected),
            "{talk}"
        );
    }
    let (status, _, talk) = identify("craig.toml", "ragged.csv");
    assert_eq!(status, 2);
    let expected = "error: craig.toml:8:1: joint 1, convention: found \"craig\", expected dh, \
                    hayati, mdh or zero-reference; set convention\n";
    assert_eq!(talk, expected);
    assert_eq!(names(&folder), before);
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_anything_is_read() {
    let folder = folder("bad_outputs");
    write_blob(&folder);
    fs::write(folder.join("D.csv"), "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n").unwrap();
    let before = names(&folder);
    for (out, json, expected) in [
        (
            "no/such/folder.csv",
            "P.json",
            "no/such/folder.csv: cannot be written",
        ),
        (
            "PRED.csv",
            "no/such/folder.json",
            "no/such/folder.json: cannot be written",
        ),
        (".", "P.json", "found a directory, expected a file to write"),
        ("D.csv", "P.json", "D.csv: is read, so it is not written"),
        (
            "PRED.csv",
            "PRED.csv",
            "PRED.csv: two outputs are to be written there",
        ),
        ("PRED.csv", "P.tpb", "P.tpb: is read, so it is not written"),
    ] {
        let arguments = [
            "predict", "--params", "P.tpb", "--data", "D.csv", "--out", out, "--json", json,
        ];
        let (status, _, talk) = said(&truepose(&folder, &arguments));
        assert_eq!(status, 2, "{talk}");
        assert!(talk.contains(expected), "{talk}");
    }
    assert_eq!(names(&folder), before);
}

#[test]
fn wrong_usage_is_status_2() {
    let folder = folder("bad_usage");
    for arguments in [
        &[][..],
        &["predct"],
        &["predict", "--out", "x"],
        &["inspect"],
    ] {
        let (status, text, talk) = said(&truepose(&folder, arguments));
        assert_eq!((status, text.as_str()), (2, ""));
        assert!(talk.contains("Usage: truepose"), "{talk}");
    }
    let (status, text, _) = said(&truepose(&folder, &["--help"]));
    assert_eq!(status, 0);
    assert!(text.contains("Exit status: 0 done; 1 done, and the answer is no; 2 could not."));
}
