//! Outputs are written whole, together, or not at all.

use std::fs;
use std::path::{Path, PathBuf};

use truepose_host::output::{Output, check, commit};

/// An empty folder for one test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn output(file: &Path, text: &str) -> Output {
    Output {
        file: file.to_path_buf(),
        bytes: text.as_bytes().to_vec(),
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entry = |e: std::io::Result<fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(entry).collect();
    names.sort();
    names
}

#[test]
fn all_outputs_appear_and_nothing_else() {
    let folder = folder("all_outputs_appear");
    let (a, b) = (folder.join("a.tpb"), folder.join("b.json"));
    fs::write(&b, "old").unwrap();
    check(&[&a, &b], &[]).unwrap();
    assert_eq!(names(&folder), ["b.json"], "checking leaves nothing behind");
    assert_eq!(fs::read_to_string(&b).unwrap(), "old");
    commit(&[output(&a, "A"), output(&b, "B")]).unwrap();
    assert_eq!(names(&folder), ["a.tpb", "b.json"]);
    assert_eq!(fs::read_to_string(&a).unwrap(), "A");
    assert_eq!(fs::read_to_string(&b).unwrap(), "B");
}

#[test]
fn one_that_cannot_be_written_stops_the_others() {
    let folder = folder("one_stops_the_others");
    let good = folder.join("good");
    let bad = folder.join("no such folder").join("bad");
    let error = check(&[&good, &bad], &[]).unwrap_err().to_string();
    assert!(error.contains("bad: cannot be written"), "{error}");
    commit(&[output(&good, "A"), output(&bad, "B")]).unwrap_err();
    assert_eq!(names(&folder), [""; 0]);
}

#[test]
fn a_folder_a_twin_and_an_input_are_refused() {
    let folder = folder("refused_outputs");
    let (a, input) = (folder.join("a"), folder.join("data.csv"));
    fs::write(&input, "q1").unwrap();
    for (outputs, inputs, expected) in [
        (vec![folder.as_path()], vec![], "found a directory"),
        (vec![&a, &a], vec![], "two outputs"),
        (
            vec![&input],
            vec![input.as_path()],
            "is read, so it is not written",
        ),
    ] {
        let error = check(&outputs, &inputs).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert_eq!(names(&folder), ["data.csv"]);
}
