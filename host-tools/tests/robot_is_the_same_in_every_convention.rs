//! One physical robot in every convention: the same poses at every reading, by the files too.

use std::fs;
use std::path::Path;

use nalgebra::Vector3;
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};
use truepose_host::cell::{Arm, Cell};
use truepose_host::convert::{Form, ZeroPosition, calibrated, convert};
use truepose_host::description::{Robot, RobotJoint};
use truepose_host::identify::arm::ArmModel;
use truepose_host::random::Random;

use crate::support::{self, folder, said, truepose};
use crate::synthetic::{CONVENTIONS, anywhere, arm, readings};

/// A synthetic arm with a base anywhere, limits and masses.
fn robot(convention: Convention, kinds: &str, parallel: &[usize], seed: u64) -> Robot {
    let model = arm(convention, kinds, parallel, seed);
    let mut random = Random::new(seed, 94);
    Robot {
        name: "synthetic".to_owned(),
        base: anywhere(&mut random),
        joints: (model.joints.iter())
            .map(|joint| RobotJoint {
                joint: *joint,
                limits: Some([-2.0, 2.5]),
                ratio: Some(-81.0),
                resolution: Some(1e-5),
                link: Some(LinkMass {
                    mass: random.between(1.0, 9.0),
                    com: Vector3::from(random.direction()) * 0.2,
                }),
            })
            .collect(),
        tool: model.tool,
        gravity: Vector3::from(random.direction()) * 9.81,
        source: "synthetic.toml".into(),
    }
}

/// Largest difference of tool poses (m and rad), of links' centres of mass (m) and of gravity
/// in the world, at random readings.
fn apart(a: &Robot, b: &Robot) -> f64 {
    let mut random = Random::new(5, 95);
    let mut far = ((a.base.rotation * a.gravity) - (b.base.rotation * b.gravity)).norm();
    for _ in 0..20 {
        let q = readings(&ArmModel::drawn(a), &mut random);
        let twist = a.forward(&q).twist_to(&b.forward(&q));
        far = far.max(twist.linear.norm()).max(twist.angular.norm());
        let (mut x, mut y) = (a.base, b.base);
        for ((j, k), q) in a.joints.iter().zip(&b.joints).zip(&q) {
            x = x.then(&j.joint.transform(*q));
            y = y.then(&k.joint.transform(*q));
            let of = |pose: &Pose<f64>, joint: &RobotJoint| pose.point(&joint.link.unwrap().com);
            far = far.max((of(&x, j) - of(&y, k)).norm());
        }
    }
    far
}

/// 1e-12 m per link and nanoradian of rounding is far below anything that is measured.
const ROUNDING: f64 = 2e-12;

#[test]
fn every_form_of_every_arm_reaches_the_same_poses() {
    for kinds in ["RRRRRR", "RRPRRR", "PPPRR", "RRPR", "PRRRP", "RPRRRRR"] {
        for from in CONVENTIONS {
            for parallel in [&[][..], &[1]] {
                for seed in 0..3 {
                    let robot = robot(from, kinds, parallel, seed);
                    for form in Form::ALL {
                        let Ok(converted) = convert(&robot, form) else {
                            // A milliradian from parallel: 0.4 m apart, 400 m to the normal.
                            assert!(!parallel.is_empty(), "{from:?} {kinds} {form:?}");
                            assert!(matches!(form, Form::Dh | Form::Mdh));
                            continue;
                        };
                        let far = apart(&robot, &converted.robot);
                        let span = match form {
                            // Common normals up to 50 m away carry rounding with them.
                            Form::Dh | Form::Mdh if !parallel.is_empty() => 50.0,
                            _ => 1.0,
                        };
                        assert!(far < span * ROUNDING, "{from:?} {kinds} {form:?} {far:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn files_give_the_same_poses_when_they_are_read_again() {
    let folder = folder("files_give_the_same_poses");
    let (toml, urdf) = (folder.join("r.toml"), folder.join("r.urdf"));
    for (n, kinds) in ["RRRRRR", "RRPRRR"].into_iter().enumerate() {
        for from in CONVENTIONS {
            let robot = robot(from, kinds, &[1], n as u64);
            for form in [Form::Hayati, Form::ZeroReference] {
                let converted = convert(&robot, form).unwrap().robot;
                fs::write(&toml, converted.to_toml()).unwrap();
                let read = Robot::read(&toml).unwrap();
                let far = apart(&robot, &read);
                assert!(far < 2.0 * ROUNDING, "{from:?} {kinds} {form:?} {far:e}");
                let kept = |r: &Robot| -> Vec<_> {
                    let of = |j: &RobotJoint| (j.ratio, j.link.unwrap().mass.to_bits());
                    r.joints.iter().map(of).collect()
                };
                assert_eq!(kept(&read), kept(&converted));
            }
            fs::write(&urdf, robot.to_urdf().unwrap()).unwrap();
            let mut read = Robot::read(&urdf).unwrap();
            // A URDF file has no gravity: it is assumed.
            read.gravity = read.base.rotation.transpose() * robot.base.rotation * robot.gravity;
            let far = apart(&robot, &read);
            assert!(far < ROUNDING, "urdf of {from:?} {kinds} {far:e}");
            assert_eq!(read.joints[0].limits, robot.joints[0].limits);
        }
    }
}

#[test]
fn drawings_come_back_as_they_were_drawn() {
    // Built again from where the axes are: the tables of the drawings, to rounding.
    for which in [
        Arm::Puma560,
        Arm::Ur10,
        Arm::Irb120,
        Arm::Stanford,
        Arm::Panda,
    ] {
        let drawn = Cell::as_drawn(which).robot();
        let form = match drawn.joints[0].joint.convention {
            Convention::Mdh => Form::Mdh,
            _ => Form::Dh,
        };
        let axes = convert(&drawn, Form::ZeroReference).unwrap().robot;
        let back = convert(&axes, form).unwrap().robot;
        let direct = convert(&drawn, form).unwrap().robot;
        for (k, (a, b)) in drawn.joints.iter().zip(&direct.joints).enumerate() {
            let (a, b) = (a.joint, b.joint);
            let same = |p: f64, q: f64| {
                let off = (p - q + 1.0).rem_euclid(std::f64::consts::TAU) - 1.0;
                off.abs() < 1e-12
            };
            let all = same(a.theta, b.theta) && same(a.alpha, b.alpha);
            assert!(
                all && same(a.a, b.a) && same(a.d, b.d),
                "{which:?} {k}: {a:?} {b:?}"
            );
        }
        assert!(apart_no_mass(&drawn, &back) < ROUNDING, "{which:?}");
    }
}

fn apart_no_mass(a: &Robot, b: &Robot) -> f64 {
    let mut random = Random::new(6, 95);
    (0..20)
        .map(|_| {
            let q = readings(&ArmModel::drawn(a), &mut random);
            let twist = a.forward(&q).twist_to(&b.forward(&q));
            twist.linear.norm().max(twist.angular.norm())
        })
        .fold(0.0, f64::max)
}

#[test]
fn exactly_parallel_axes_are_dh_and_nearly_parallel_ones_are_refused_by_name() {
    let mut drawn = Cell::as_drawn(Arm::Puma560).robot();
    assert!(convert(&drawn, Form::Dh).is_ok());
    let hayati = convert(&drawn, Form::Hayati).unwrap();
    assert_eq!(hayati.nearly_parallel.len(), 1);
    assert_eq!(hayati.nearly_parallel[0].first, 1);
    assert_eq!(hayati.robot.joints[1].joint.convention, Convention::Hayati);
    assert!(apart_no_mass(&drawn, &hayati.robot) < ROUNDING);
    // 20 microradians out of parallel: 432 mm of link, 21 km to the common normal.
    drawn.joints[1].joint.convention = Convention::Hayati;
    drawn.joints[1].joint.beta = 2e-5;
    for form in [Form::Dh, Form::Mdh] {
        let refused = convert(&drawn, form).unwrap_err();
        assert_eq!(refused.first, 1);
        let text = refused.to_string();
        assert!(
            text.contains("axes 2 and 3 are 0.001146 deg from parallel"),
            "{text}"
        );
    }
    for form in [Form::Hayati, Form::ZeroReference] {
        let converted = convert(&drawn, form).unwrap().robot;
        assert!(apart_no_mass(&drawn, &converted) < ROUNDING);
    }
}

#[test]
fn axes_are_where_measuring_by_hand_would_find_them() {
    // The PUMA of MRD 6.1 by its drawing: from table 6.1 to table 6.2, inches.
    let inch = 0.0254;
    let quarter = std::f64::consts::FRAC_PI_2;
    let joint = |d: f64, a: f64, alpha: f64| RobotJoint {
        joint: Joint::dh(
            JointKind::Revolute,
            0.0,
            d * inch,
            a * inch,
            alpha * quarter,
        ),
        limits: None,
        ratio: None,
        resolution: None,
        link: None,
    };
    let base = Joint::dh(
        JointKind::Revolute,
        0.0,
        33.6 * inch,
        -15.0 * inch,
        -quarter,
    );
    let robot = Robot {
        name: "PUMA".to_owned(),
        base: base.after(),
        joints: vec![
            joint(14.7, 0.0, -1.0),
            joint(0.0, 17.0, 0.0),
            joint(5.87, -0.8, 1.0),
            joint(17.05, 0.0, -1.0),
            joint(0.0, 0.0, 1.0),
            joint(0.0, 0.0, 0.0),
        ],
        tool: Pose::identity(),
        gravity: Vector3::zeros(),
        source: "puma.toml".into(),
    };
    let zero = ZeroPosition::of(&robot);
    let printed = [
        ([0., 1., 0.], [-15.0, 14.7, 33.6]),
        ([0., 0., -1.], [-15.0, 14.7, 27.73]),
        ([0., 0., -1.], [2.0, 14.7, 27.73]),
        ([0., 1., 0.], [1.2, 31.75, 27.73]),
        ([0., 0., -1.], [1.2, 31.75, 27.73]),
        ([0., 1., 0.], [1.2, 31.75, 27.73]),
    ];
    for (axis, (u, p)) in zero.axes.iter().zip(printed) {
        let in_world = axis.moved(&robot.base);
        assert!((in_world.direction - Vector3::from(u)).norm() < 1e-12);
        let way = in_world.point - Vector3::from(p) * inch;
        assert!(way.cross(&in_world.direction).norm() < 1e-12, "{way}");
    }
}

/// The file's joints are off from where they were drawn, a camera hangs on the arm, the tip is
/// on a fixed joint, one origin is missing and one pitches by a right angle.
const URDF: &str = r#"<?xml version="1.0"?>
<!-- kept -->
<robot name="three">
  <link name="base"/>
  <joint name="j1" type="continuous">
    <parent link="base"/><child link="l1"/><axis xyz="0 0 1"/>
  </joint>
  <link name="l1"><visual><geometry><mesh filename="l1.stl"/></geometry></visual></link>
  <joint name="plate" type="fixed"><origin xyz="0 0.1 0.4"/><parent link="l1"/><child link="p"/></joint>
  <link name="p"/>
  <joint name="j2" type="revolute">
    <origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>
    <parent link="p"/><child link="l2"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="10" velocity="1"/>
  </joint>
  <link name="l2"/>
  <joint name="j3" type="prismatic">
    <origin xyz="0.5 0 0" rpy="0.3 0 0"></origin>
    <parent link="l2"/><child link="l3"/><axis xyz="0 0 -1"/>
    <limit lower="-0.3" upper="0.2" effort="10" velocity="1"/>
  </joint>
  <link name="l3"/>
  <joint name="j4" type="continuous">
    <origin xyz="0.1 0.2 0.3"/><parent link="l3"/><child link="l4"/><axis xyz="1 1 0"/>
  </joint>
  <link name="l4"/>
  <joint name="cam" type="fixed"><origin xyz="0 0 1"/><parent link="l4"/><child link="camera"/></joint>
  <link name="camera"/>
  <joint name="t" type="fixed"><parent link="l4"/><child link="tool0"/></joint>
  <link name="tool0"/>
  <gazebo reference="l1"><material>Red</material></gazebo>
</robot>
"#;

#[test]
fn urdf_file_of_the_user_keeps_all_but_where_its_joints_stand() {
    let folder = folder("urdf_file_of_the_user");
    let file = folder.join("arm.urdf");
    fs::write(&file, URDF).unwrap();
    for tip in ["", "#l4"] {
        let named = format!("{}{tip}", file.display());
        let named = Path::new(&named);
        let drawn = Robot::read(named).unwrap();
        let mut built = drawn.clone();
        let mut random = Random::new(3, 0);
        for described in &mut built.joints {
            let joint = &mut described.joint;
            let all = joint.parameters();
            for p in all {
                *joint.parameter_mut(*p) += random.between(-3e-3, 3e-3);
            }
        }
        built.tool = built.tool.then(&anywhere(&mut random));
        let text = drawn.rewrite_urdf(named, &built).unwrap().unwrap();
        for kept in [
            "<!-- kept -->",
            "l1.stl",
            "<gazebo reference=\"l1\">",
            "effort=\"10\"",
        ] {
            assert!(text.contains(kept), "{text}");
        }
        let again = folder.join("again.urdf");
        fs::write(&again, &text).unwrap();
        let tip = if tip.is_empty() { "" } else { "#l4_tool" };
        let read = Robot::read(Path::new(&format!("{}{tip}", again.display()))).unwrap();
        let far = apart_no_mass(&built, &read);
        assert!(far < ROUNDING, "{far:e}");
        // A frame beside the arm went with the link that carries it: a few mm, no more.
        let camera = |file: &Path| {
            let robot = Robot::read(Path::new(&format!("{}#camera", file.display()))).unwrap();
            robot.forward(&[0.0; 4])
        };
        let moved = camera(&file).twist_to(&camera(&again));
        let far = moved.linear.norm();
        assert!(
            far > 1e-4 && far < 0.03 && moved.angular.norm() < 0.03,
            "{far}"
        );
    }
}

#[test]
fn command_writes_drawn_and_identified_arms() {
    let folder = folder("command_converts");
    let blob = support::write_blob(&folder);
    let run = |arguments: &[&str]| said(&truepose(&folder, arguments));
    for to in ["dh", "hayati", "mdh", "zero-reference", "urdf"] {
        let (code, out, _) = run(&["convert", "--robot", "robot.toml", "--to", to, "--out", "x"]);
        assert_eq!(code, 0);
        assert!(
            out.contains(&format!("as drawn as {to}, written to x")),
            "{out}"
        );
        let drawn = Robot::read(&folder.join("robot.toml")).unwrap();
        let read = Robot::read(&folder.join("x")).unwrap();
        assert!(apart_no_mass(&drawn, &read) < 3.0 * ROUNDING);
    }
    let identified = [
        "convert",
        "--robot",
        "robot.toml",
        "--params",
        "P.tpb",
        "--out",
        "y",
    ];
    let (code, out, _) = run(&[&identified[..], &["--to", "hayati"]].concat());
    assert_eq!(code, 0);
    let drawn = Robot::read(&folder.join("robot.toml")).unwrap();
    let expected = calibrated(&drawn, &blob).unwrap();
    let read = Robot::read(&folder.join("y")).unwrap();
    assert!(apart_no_mass(&expected, &read) < 3.0 * ROUNDING);
    assert!(
        out.contains("gear-eccentricity is not geometry and stays behind"),
        "{out}"
    );
    assert!(out.contains("axes 2 and 3 are"), "{out}");
    // The same as DH: a fraction of a millirad from parallel is too far for it.
    fs::remove_file(folder.join("y")).unwrap();
    let (code, _, err) = run(&[&identified[..], &["--to", "dh"]].concat());
    assert_eq!(code, 2);
    assert!(err.contains("dh cannot express them; use hayati"), "{err}");
    assert!(!folder.join("y").exists());
    let (code, _, err) = run(&[
        "convert",
        "--robot",
        "robot.toml",
        "--to",
        "polar",
        "--out",
        "y",
    ]);
    assert_eq!(code, 2);
    assert!(err.contains("polar"), "{err}");
}
