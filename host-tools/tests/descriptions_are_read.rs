//! Robot descriptions mean what the file format says.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use truepose::{Convention, JointKind, Pose};
use truepose_host::description::Robot;

/// A file of its own for one test.
fn file(name: &str, text: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("descriptions");
    fs::create_dir_all(&folder).unwrap();
    let file = folder.join(name);
    fs::write(&file, text).unwrap();
    file
}

/// Numbers that went through a unit or a handful of rotations.
const ROUNDING: f64 = 1e-14;

fn assert_near(a: &Pose<f64>, b: &Pose<f64>) {
    let off = (a.translation - b.translation).norm() + (a.rotation - b.rotation).norm();
    assert!(off < 10.0 * ROUNDING, "{a:?}\n{b:?}");
}

#[test]
fn every_key_arrives_in_si() {
    let text = r#"
name = "two joints"
[base]
xyz_mm = [1.0, 2.0, 3.0]
rpy_deg = [10.0, 20.0, 30.0]
[[joint]]
type = "revolute"
convention = "dh"
theta_deg = 90.0
d_mm = 100
a = 0.2
alpha = 1.5
limits_deg = [-90.0, 45.0]
ratio = -101.0
resolution_deg = 0.001
[joint.link]
mass = 17.4
com_mm = [-68.0, 6.0, -16.0]
[[joint]]
type = "prismatic"
convention = "hayati"
d_um = 500.0
beta_deg = 3.0
limits_mm = [0.0, 250.0]
resolution_um = 5.0
[tool]
xyz = [0.0, 0.0, 0.05625]
[gravity]
xyz = [0.0, 9.81, 0.0]
"#;
    let robot = Robot::read(&file("si.toml", text)).unwrap();
    assert_eq!(robot.name, "two joints");
    let degree = PI / 180.0;
    let base = Pose::from_xyz_rpy(
        Vector3::new(1e-3, 2e-3, 3e-3),
        Vector3::new(10.0, 20.0, 30.0) * degree,
    );
    assert_near(&robot.base, &base);
    let near = |a: f64, b: f64| assert!((a - b).abs() < ROUNDING, "{a} {b}");
    let [first, second] = &robot.joints[..] else {
        panic!("two joints");
    };
    assert_eq!(first.joint.kind, JointKind::Revolute);
    assert_eq!(first.joint.convention, Convention::Dh);
    near(first.joint.theta, FRAC_PI_2);
    near(first.joint.d, 0.1);
    near(first.joint.a, 0.2);
    near(first.joint.alpha, 1.5);
    near(first.limits.unwrap()[0], -FRAC_PI_2);
    near(first.limits.unwrap()[1], FRAC_PI_2 / 2.0);
    assert_eq!(first.ratio, Some(-101.0));
    near(first.resolution.unwrap(), 0.001 * degree);
    near(first.link.unwrap().mass, 17.4);
    near(first.link.unwrap().com.x, -0.068);
    assert_eq!(second.joint.convention, Convention::Hayati);
    near(second.joint.d, 5e-4);
    near(second.joint.beta, 3.0 * degree);
    near(second.limits.unwrap()[1], 0.25);
    near(second.resolution.unwrap(), 5e-6);
    assert!(second.link.is_none());
    near(robot.tool.translation.z, 0.05625);
    assert_eq!(robot.gravity, Vector3::new(0.0, 9.81, 0.0));
}

#[test]
fn what_is_not_said_is_zero_without_limits_under_ordinary_gravity() {
    let text = "[[joint]]\ntype = \"revolute\"\nconvention = \"mdh\"\n";
    let robot = Robot::read(&file("least.toml", text)).unwrap();
    assert_eq!(robot.name, "least");
    assert_eq!(robot.base, Pose::identity());
    assert_eq!(robot.tool, Pose::identity());
    assert_eq!(robot.gravity, Vector3::new(0.0, 0.0, -9.81));
    let joint = &robot.joints[0];
    assert_eq!(
        (joint.limits, joint.ratio, joint.resolution),
        (None, None, None)
    );
    assert_near(&joint.joint.transform(0.3), &Pose::rotate_z(0.3));
}

/// The PUMA's first three joints in standard DH, its axes read off the drawing.
const DH: &str = r#"
[[joint]]
type = "revolute"
convention = "dh"
d_mm = 660.0
alpha_deg = -90.0
[[joint]]
type = "revolute"
convention = "dh"
d_mm = 149.5
a_mm = 432.0
[[joint]]
type = "revolute"
convention = "dh"
a_mm = -20.5
alpha_deg = 90.0
"#;

#[test]
fn zero_reference_axes_are_in_the_base_frame() {
    // At q = 0 the second and third axes of DH above point along the base's y.
    let text = r#"
[[joint]]
type = "revolute"
convention = "zero-reference"
axis = [0.0, 0.0, 3.0]
[[joint]]
type = "revolute"
convention = "zero-reference"
axis = [0.0, 1.0, 0.0]
point_mm = [0.0, 0.0, 660.0]
[[joint]]
type = "revolute"
convention = "zero-reference"
axis = [0.0, 1e-200, 0.0]
point_mm = [432.0, 99.0, 660.0]
[tool]
xyz_mm = [411.5, 149.5, 660.0]
"#;
    let by_axes = Robot::read(&file("axes.toml", text)).unwrap();
    let by_dh = Robot::read(&file("dh.toml", DH)).unwrap();
    for q in [[0.0; 3], [0.3, -0.7, 1.1], [-2.0, 0.4, 0.5]] {
        assert_near(&by_axes.forward(&q), &by_dh.forward(&q));
    }
}

#[test]
fn a_zero_reference_joint_behind_dh_joints_is_still_in_the_base_frame() {
    let first_two: Vec<&str> = DH.split("[[joint]]").take(3).collect();
    let text = format!(
        "{}[[joint]]\n{}",
        first_two.join("[[joint]]"),
        r#"
type = "revolute"
convention = "zero-reference"
axis = [0.0, 2.0, 0.0]
point_mm = [432.0, 0.0, 660.0]
[tool]
# the second joint's frame at q = 0 lies along the base's x and z, its z along y
xyz_mm = [-20.5, 0.0, 0.0]
rpy_deg = [90.0, 0.0, 0.0]
"#
    );
    let mixed = Robot::read(&file("mixed.toml", &text)).unwrap();
    let by_dh = Robot::read(&file("dh2.toml", DH)).unwrap();
    for q in [[0.0; 3], [0.3, -0.7, 1.1], [-2.0, 0.4, 0.5]] {
        assert_near(&mixed.forward(&q), &by_dh.forward(&q));
    }
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let joint = "[[joint]]\ntype = \"revolute\"\nconvention = \"dh\"\n";
    for (extra, expected) in [
        (
            "theta_dge = 3\n",
            ":4:1: joint 1: found the unknown key theta_dge, expected one of",
        ),
        (
            "theta_deg = 3\ntheta = 1\n",
            ":4:1: joint 1, theta_deg: found theta_deg beside theta",
        ),
        (
            "a_mm = \"3\"\n",
            ":4:8: joint 1, a_mm: found \"3\", expected a finite number",
        ),
        (
            "a_mm = inf\n",
            ":4:8: joint 1, a_mm: found inf, expected a finite number",
        ),
        ("alpha = 90\n", ":4:1: joint 1, alpha: found 90 rad"),
        ("d = 340\n", ":4:1: joint 1, d: found 340 m"),
        ("beta_deg = 1\n", "only convention = \"hayati\" has beta"),
        ("axis = [0, 0, 1]\n", "zero-reference joint only"),
        (
            "limits_deg = [1]\n",
            ":4:14: joint 1, limits_deg: found [1], expected 2 finite",
        ),
        ("limits_deg = [2, 1]\n", "the lower one first"),
        ("limits_mm = [1, 2]\n", "unknown key limits_mm"),
        ("ratio = 0.0\n", "joint 1, ratio: found 0"),
        (
            "[joint.link]\nmass = -1\n",
            ":5:1: joint 1, link, mass: found -1",
        ),
        (
            "[joint.link]\nmas = 1\n",
            "joint 1, link: found the unknown key mas",
        ),
        ("a_mm = = 3\n", "text that is not TOML"),
        (
            "[tool]\nxyz_mm = [1, 2]\n",
            ":5:10: tool, xyz_mm: found [1, 2], expected 3 finite",
        ),
        (
            "[tol]\n",
            "found the unknown key tol, expected one of name, base, joint, tool, gravity",
        ),
    ] {
        let error = Robot::read(&file("wrong.toml", &format!("{joint}{extra}")));
        let error = error.unwrap_err().to_string();
        assert!(error.contains("wrong.toml"), "{error}");
        assert!(error.contains(expected), "{extra}{error}");
    }
    for (text, expected) in [
        ("", "found no joints"),
        (
            "[[joint]]\nconvention = \"dh\"\n",
            "joint 1, type: found no type, expected revolute",
        ),
        (
            "[[joint]]\ntype = \"revolute\"\nconvention = \"craig\"\n",
            ":3:1: joint 1, convention: found \"craig\", expected dh, hayati, mdh or zero-reference",
        ),
        (
            "[[joint]]\ntype = \"revolute\"\nconvention = \"hayati\"\nd_mm = 5\n",
            "found d = 0.005, expected no d in this convention; this convention has no d on a",
        ),
        (
            "[[joint]]\ntype = \"revolute\"\nconvention = \"zero-reference\"\n",
            "joint 1: found no axis",
        ),
        (
            "[[joint]]\ntype = \"revolute\"\nconvention = \"zero-reference\"\naxis = [0,0,0]\n",
            ":4:1: joint 1, axis: found [0.0, 0.0, 0.0], expected a direction",
        ),
    ] {
        let error = Robot::read(&file("wrong.toml", text))
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{text}{error}");
    }
}
