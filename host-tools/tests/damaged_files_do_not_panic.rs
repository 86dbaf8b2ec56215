//! Files with anything in them are read or refused, and what is refused is named in one line.

use std::fs;
use std::path::Path;

use crate::support::{self, ROBOT, folder};
use truepose_host::description::Robot;
use truepose_host::error::Error;
use truepose_host::measurement::{Expected, Purpose, read};

/// Repeatable draws (Marsaglia's xorshift).
struct Draws(u64);

impl Draws {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % n as u64).unwrap()
    }
}

/// What tends to break readers.
const SPLINTERS: [&str; 24] = [
    "",
    "\n",
    "\r\n",
    ",",
    ",,,,",
    "\"",
    "#",
    "nan",
    "-inf",
    "1e999",
    "-0",
    "\u{feff}",
    "é",
    "\0",
    "[",
    "]",
    "[[",
    "=",
    "<",
    ">",
    "/>",
    "&",
    "_mm",
    "99999999999999999999",
];

/// `text` with one to four places deleted, doubled or filled with splinters.
fn damaged(text: &str, draws: &mut Draws) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..=draws.below(4) {
        let at = draws.below(bytes.len() + 1);
        let to = (at + draws.below(12)).min(bytes.len());
        let piece = match draws.below(3) {
            0 => Vec::new(),
            1 => bytes[at..to].repeat(2),
            _ => SPLINTERS[draws.below(SPLINTERS.len())].as_bytes().to_vec(),
        };
        bytes.splice(at..to, piece);
    }
    bytes
}

/// Reads `rounds` damaged copies of `text`. Returns how many were refused.
fn refused(
    file: &Path,
    text: &str,
    rounds: usize,
    reader: impl Fn(&Path) -> Result<(), Error>,
) -> usize {
    let mut draws = Draws(0x5EED_0000 + text.len() as u64);
    let mut refused = 0;
    for _ in 0..rounds {
        fs::write(file, damaged(text, &mut draws)).unwrap();
        if let Err(error) = reader(file) {
            let message = error.to_string();
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(message.contains(name), "{message}");
            assert!(message.trim_end().lines().count() == 1, "{message:?}");
            refused += 1;
        }
    }
    refused
}

#[test]
fn damaged_descriptions() {
    let folder = folder("damaged_descriptions");
    let reader = |file: &Path| Robot::read(file).map(drop);
    let bad = refused(&folder.join("robot.toml"), ROBOT, 600, reader);
    // Damage inside a comment or a number may pass; most does not.
    assert!((60..600).contains(&bad), "{bad}");
}

#[test]
fn damaged_urdf() {
    let folder = folder("damaged_urdf");
    let urdf = r#"<?xml version="1.0"?>
<robot name="two">
  <link name="a"/><link name="b"><inertial><origin xyz="0 0 1"/><mass value="2"/></inertial></link>
  <link name="c"/>
  <joint name="j1" type="revolute"><parent link="a"/><child link="b"/>
    <origin xyz="0 0 0.5" rpy="0 0.1 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/></joint>
  <joint name="j2" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/></joint>
</robot>
"#;
    let reader = |file: &Path| Robot::read(file).map(drop);
    let bad = refused(&folder.join("robot.urdf"), urdf, 600, reader);
    assert!((60..600).contains(&bad), "{bad}");
}

#[test]
fn damaged_measurements_and_sidecars() {
    let folder = folder("damaged_measurements");
    let expected = Expected::of(&support::robot(&folder));
    let mut table =
        String::from("# header\nq1,q2,q3,q4,q5,q6,x,y,z,qw,qx,qy,qz,temp,session,set\n");
    for k in 0..12 {
        table += &format!("0.{k},0.1,-0.{k},0.2,0.3,0.4,1.{k},0.5,0.3,0,1,0,0,20.{k},1,\n");
    }
    let file = folder.join("D.csv");
    for purpose in [
        Purpose::Fit,
        Purpose::Check,
        Purpose::Joints,
        Purpose::Targets,
    ] {
        let reader = |file: &Path| read(file, &expected, purpose).map(drop);
        let bad = refused(&file, &table, 200, reader);
        assert!((20..200).contains(&bad), "{purpose:?}: {bad}");
    }
    fs::write(&file, &table).unwrap();
    let sidecar = "position_sigma_mm = 0.05\norientation_sigma_deg = 0.02\n# end\n";
    let reader = |_: &Path| read(&file, &expected, Purpose::Fit).map(drop);
    let bad = refused(&folder.join("D.toml"), sidecar, 200, reader);
    assert!((20..200).contains(&bad), "{bad}");
}
