//! A URDF file stands in for a description.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use truepose::{JointKind, Pose};
use truepose_host::description::Robot;

fn file(name: &str, text: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("urdf");
    fs::create_dir_all(&folder).unwrap();
    let file = folder.join(name);
    fs::write(&file, text).unwrap();
    file
}

/// Three moving joints with fixed ones before, between and behind them.
const ARM: &str = r#"<?xml version="1.0"?>
<robot name="crane">
  <link name="world"/>
  <link name="foot"><inertial><mass value="100"/></inertial></link>
  <link name="column">
    <inertial><origin xyz="0.1 0 0.5" rpy="1 2 3"/><mass value="10"/></inertial>
  </link>
  <link name="lamp">
    <inertial><origin xyz="0 0 0.1"/><mass value="2.5"/></inertial>
  </link>
  <link name="slide"/>
  <link name="hand"><inertial><mass value="1"/></inertial></link>
  <link name="tip"/>
  <joint name="bolts" type="fixed">
    <parent link="world"/><child link="foot"/><origin xyz="1 2 3" rpy="0.1 -0.2 0.3"/>
  </joint>
  <joint name="turn" type="continuous">
    <parent link="foot"/><child link="column"/><origin xyz="0 0 0.4" rpy="0 0.5 0"/>
    <axis xyz="0 0 2"/>
  </joint>
  <joint name="bracket" type="fixed">
    <parent link="column"/><child link="lamp"/><origin xyz="0 0 1" rpy="0 0 1"/>
  </joint>
  <joint name="run" type="prismatic">
    <parent link="lamp"/><child link="slide"/><origin xyz="0.2 0 0" rpy="-0.7 0 0"/>
    <axis xyz="1 1 0"/><limit lower="-0.1" upper="0.6" effort="1" velocity="1"/>
  </joint>
  <joint name="wrist" type="revolute">
    <parent link="slide"/><child link="hand"/><origin xyz="0 0.1 0"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="nail" type="fixed">
    <parent link="hand"/><child link="tip"/><origin xyz="0 0 0.3" rpy="0 0 0.25"/>
  </joint>
</robot>
"#;

/// The same arm multiplied out as URDF defines it: each joint's origin, then a turn about or
/// a slide along its axis.
fn by_definition(q: &[f64; 3]) -> Pose<f64> {
    let at = |x: f64, y: f64, z: f64, r: f64, p: f64, w: f64| {
        Pose::from_xyz_rpy(Vector3::new(x, y, z), Vector3::new(r, p, w))
    };
    let diagonal = 1.0 / 2.0_f64.sqrt();
    [
        at(1.0, 2.0, 3.0, 0.1, -0.2, 0.3),
        at(0.0, 0.0, 0.4, 0.0, 0.5, 0.0),
        Pose::rotate_z(q[0]),
        at(0.0, 0.0, 1.0, 0.0, 0.0, 1.0),
        at(0.2, 0.0, 0.0, -0.7, 0.0, 0.0),
        Pose::translate(q[1] * diagonal, q[1] * diagonal, 0.0),
        at(0.0, 0.1, 0.0, 0.0, 0.0, 0.0),
        // the axis is x where the file says nothing
        Pose::rotate_x(q[2]),
        at(0.0, 0.0, 0.3, 0.0, 0.0, 0.25),
    ]
    .iter()
    .fold(Pose::identity(), |t, next| t.then(next))
}

#[test]
fn the_arm_moves_as_the_file_defines() {
    let robot = Robot::read(&file("crane.urdf", ARM)).unwrap();
    assert_eq!(robot.name, "crane");
    let kinds: Vec<JointKind> = robot.joints.iter().map(|j| j.joint.kind).collect();
    use JointKind::{Prismatic, Revolute};
    assert_eq!(kinds, [Revolute, Prismatic, Revolute]);
    let limits: Vec<_> = robot.joints.iter().map(|j| j.limits).collect();
    assert_eq!(limits, [None, Some([-0.1, 0.6]), Some([-1.0, 2.0])]);
    for q in [[0.0; 3], [0.4, 0.2, -0.9], [-3.0, -0.1, 2.0]] {
        let (found, wanted) = (robot.forward(&q), by_definition(&q));
        let off = (found.translation - wanted.translation).norm()
            + (found.rotation - wanted.rotation).norm();
        // a dozen products of numbers of the size of 5
        assert!(off < 1e-13, "{q:?}: {off}");
    }
}

#[test]
fn masses_hang_on_the_link_that_carries_them() {
    let robot = Robot::read(&file("masses.urdf", ARM)).unwrap();
    let masses: Vec<f64> = robot.masses().iter().map(|m| m.mass).collect();
    // the foot stands still; the lamp is bolted to the column
    assert_eq!(masses, [12.5, 0.0, 1.0]);
    // A link's centre in the world at any pose, as gravity sees it.
    let q = [0.7, 0.3, -0.4];
    let distal = robot.joints[0].joint.transform(q[0]);
    let found = distal.point(&robot.masses()[0].com);
    let column = Pose::from_xyz_rpy(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, -0.2, 0.3))
        .then(&Pose::translate(0.0, 0.0, 0.4))
        .then(&Pose::rotate_y(0.5))
        .then(&Pose::rotate_z(q[0]));
    let lamp = column.then(&Pose::translate(0.0, 0.0, 1.0));
    let wanted = (column.point(&Vector3::new(0.1, 0.0, 0.5)) * 10.0
        + lamp.point(&Vector3::new(0.0, 0.0, 0.1)) * 2.5)
        / 12.5;
    assert!((found - wanted).norm() < 1e-13, "{found} {wanted}");
}

#[test]
fn of_several_ends_the_named_one_is_taken() {
    let camera = r#"<link name="camera"/><joint name="glue" type="fixed"><parent link="slide"/>
        <child link="camera"/></joint></robot>"#;
    let text = ARM.replace("</robot>", camera);
    let path = file("ends.urdf", &text);
    let error = Robot::read(&path).unwrap_err().to_string();
    let expected = "robot crane: found the last links camera, tip, expected one last link";
    assert!(error.contains(expected), "{error}");
    let named = PathBuf::from(format!("{}#camera", path.display()));
    assert_eq!(Robot::read(&named).unwrap().joints.len(), 2);
    let named = PathBuf::from(format!("{}#hand", path.display()));
    assert_eq!(Robot::read(&named).unwrap().joints.len(), 3);
    let named = PathBuf::from(format!("{}#nose", path.display()));
    assert!(
        Robot::read(&named)
            .unwrap_err()
            .to_string()
            .contains("not nose")
    );
    let text = text.replace("\"tip\"", "\"tool0\"");
    assert_eq!(
        Robot::read(&file("ends.urdf", &text)).unwrap().joints.len(),
        3
    );
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    for (from, to, expected) in [
        ("</robot>", "</robt>", "text that is not XML"),
        (
            "0.2 0 0",
            "0.2 0",
            ":25:47: found xyz=\"0.2 0\", expected 3 finite numbers",
        ),
        ("0.2 0 0", "0.2 0 nan", "found xyz=\"0.2 0 nan\""),
        (
            "\"1 1 0\"",
            "\"0 0 0\"",
            ":24:3: joint run: found an axis of length zero",
        ),
        (
            "\"prismatic\"",
            "\"planar\"",
            "joint run: found a planar joint, expected revolute",
        ),
        (
            "<axis xyz=\"1 1 0\"/>",
            "<mimic joint=\"turn\"/>",
            "joint run: found a joint that",
        ),
        (
            "child link=\"lamp\"",
            "child link=\"lump\"",
            "joint bracket: found the link lump",
        ),
        (
            "parent link=\"world\"",
            "parent link=\"tip\"",
            "found links in a circle",
        ),
        (
            "value=\"10\"",
            "value=\"-10\"",
            "link column: found a mass of -10 kg",
        ),
        ("<child link=\"slide\"/>", "", "without link"),
    ] {
        let result = Robot::read(&file("wrong.urdf", &ARM.replace(from, to)));
        let error = result.unwrap_err().to_string();
        assert!(error.contains("wrong.urdf"), "{error}");
        assert!(error.contains(expected), "{to}: {error}");
    }
    let text = "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:arm/></robot>";
    let error = Robot::read(&file("macro.urdf", text))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("expand the file with xacro first"),
        "{error}"
    );
    let error = Robot::read(&file("sdf.urdf", "<sdf/>"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("found <sdf>, expected <robot>"), "{error}");
}
