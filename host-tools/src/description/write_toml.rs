//! Robot descriptions written in the project's own form, which [`super::toml`] reads.

use nalgebra::Vector3;
use truepose::{Convention, JointKind, Pose};

use super::{Robot, RobotJoint};
use crate::convert::{ZeroPosition, convention_name};

/// The text of a description, lengths in mm and angles in deg to the thirteenth decimal: read
/// back, poses are the same to rounding. What a form cannot say in a file is left out: a
/// revolute Hayati joint's `d`, beta of other forms; [`crate::convert::convert`] leaves none.
pub(super) fn write(robot: &Robot) -> String {
    let mut text = format!("name = {}\n", quoted(&robot.name));
    text += &frame("base", &robot.base);
    let zero = ZeroPosition::of(robot);
    for (joint, axis) in robot.joints.iter().zip(&zero.axes) {
        text += &self::joint(joint, &axis.direction, &axis.point);
    }
    text += &frame("tool", &robot.tool);
    let gravity = list(robot.gravity.iter().copied());
    text + &format!("\n[gravity]\nxyz = {gravity}\n")
}

fn frame(name: &str, pose: &Pose<f64>) -> String {
    format!(
        "\n[{name}]\nxyz_mm = {}\nrpy_deg = {}\n",
        list(pose.translation.iter().map(|x| x * 1e3)),
        list(pose.rpy().iter().map(|x| x.to_degrees()))
    )
}

fn joint(described: &RobotJoint, axis: &Vector3<f64>, point: &Vector3<f64>) -> String {
    let joint = &described.joint;
    let revolute = joint.kind == JointKind::Revolute;
    let kind = if revolute { "revolute" } else { "prismatic" };
    let mut text = format!(
        "\n[[joint]]\ntype = \"{kind}\"\nconvention = \"{}\"\n",
        convention_name(joint.convention)
    );
    let mut line = |key: &str, value: String| text += &format!("{key} = {value}\n");
    let deg = |x: f64| number(x.to_degrees());
    let mm = |x: f64| number(x * 1e3);
    if joint.convention == Convention::ZeroReference {
        line("axis", list(axis.iter().copied()));
        if revolute {
            line("point_mm", list(point.iter().map(|x| x * 1e3)));
            line("theta_deg", deg(joint.theta));
        } else {
            line("d_mm", mm(joint.d));
        }
    } else {
        let hayati = joint.convention == Convention::Hayati;
        line("theta_deg", deg(joint.theta));
        if !(hayati && revolute) {
            line("d_mm", mm(joint.d));
        }
        line("a_mm", mm(joint.a));
        line("alpha_deg", deg(joint.alpha));
        if hayati {
            line("beta_deg", deg(joint.beta));
        }
    }
    let (unit, factor) = match revolute {
        true => ("deg", 1_f64.to_degrees()),
        false => ("mm", 1e3),
    };
    if let Some(limits) = described.limits {
        line(
            &format!("limits_{unit}"),
            list(limits.iter().map(|x| x * factor)),
        );
    }
    if let Some(ratio) = described.ratio {
        line("ratio", format!("{ratio:?}"));
    }
    if let Some(resolution) = described.resolution {
        // As small as it may be: its own digits.
        line(
            &format!("resolution_{unit}"),
            format!("{:?}", resolution * factor),
        );
    }
    if let Some(link) = &described.link {
        text += &format!(
            "\n[joint.link]\nmass = {:?}\ncom_mm = {}\n",
            link.mass,
            list(link.com.iter().map(|x| x * 1e3))
        );
    }
    text
}

fn list(numbers: impl Iterator<Item = f64>) -> String {
    let cells: Vec<String> = numbers.map(number).collect();
    format!("[{}]", cells.join(", "))
}

/// Thirteen decimals, of which zeros at the end are not written.
fn number(x: f64) -> String {
    let text = format!("{x:.13}");
    let text = text.trim_end_matches('0');
    match text.strip_suffix('.') {
        Some("-0") => "0.0".to_owned(),
        Some(whole) => format!("{whole}.0"),
        None => text.to_owned(),
    }
}

/// A basic string of TOML.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => {
                out.push('\\');
                out.push(c);
            }
            c if c.is_control() => out += &format!("\\u{:04X}", u32::from(c)),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
