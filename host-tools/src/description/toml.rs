//! Robot descriptions in the project's own form: TOML, see the guide's file formats.

use std::path::Path;

use nalgebra::Vector3;
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};

use super::zero_reference::{into_link_frames, unit};
use super::{GRAVITY, Robot, RobotJoint};
use crate::error::Error;
use crate::keys::{Document, Table};
use crate::units::Quantity;

/// No link is longer, m; a longer one is a length in millimetres without its suffix.
const LONGEST_LINK: f64 = 50.0;
/// No offset turns further, rad; one that does is in degrees without its suffix.
const LARGEST_ANGLE: f64 = 13.0;

/// Reads the text of `file`.
pub(super) fn parse(file: &Path, text: &str) -> Result<Robot, Error> {
    let document = Document { file, text };
    let root = document.parse()?;
    let mut table = Table::root(document, &root);
    let name = table.text("name")?.map(str::to_owned);
    let base = frame(table.table("base")?)?;
    let mut joints = Vec::new();
    for joint in table.tables("joint")? {
        joints.push(self::joint(joint)?);
    }
    let tool = frame(table.table("tool")?)?;
    for x in tool.translation.iter() {
        check_length(&table, "tool", *x)?;
    }
    let gravity = match table.table("gravity")? {
        Some(mut table) => {
            let xyz = table.numbers::<3>("xyz", Quantity::Other)?;
            table.finish()?;
            xyz.unwrap_or(GRAVITY)
        }
        None => GRAVITY,
    };
    if joints.is_empty() {
        return Err(table.place().bad(
            "no joints",
            "one [[joint]] table a joint, base to tool",
            "describe the joints",
        ));
    }
    table.finish()?;
    into_link_frames(&mut joints);
    Ok(Robot {
        name: name.unwrap_or_else(|| stem(file)),
        base,
        joints,
        tool,
        gravity: Vector3::from(gravity),
        source: file.to_path_buf(),
    })
}

/// The file's name without folder and extension.
fn stem(file: &Path) -> String {
    file.file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}

fn frame(table: Option<Table<'_, '_>>) -> Result<Pose<f64>, Error> {
    let Some(mut table) = table else {
        return Ok(Pose::identity());
    };
    let xyz = table.numbers::<3>("xyz", Quantity::Length)?;
    let rpy = table.numbers::<3>("rpy", Quantity::Angle)?;
    for angle in rpy.unwrap_or_default() {
        check_angle(&table, "rpy", angle)?;
    }
    table.finish()?;
    Ok(Pose::from_xyz_rpy(
        Vector3::from(xyz.unwrap_or_default()),
        Vector3::from(rpy.unwrap_or_default()),
    ))
}

fn joint(mut table: Table<'_, '_>) -> Result<RobotJoint, Error> {
    let kind = match table.text("type")? {
        Some("revolute") => JointKind::Revolute,
        Some("prismatic") => JointKind::Prismatic,
        other => {
            return Err(named(&table, "type", other, "revolute or prismatic"));
        }
    };
    let convention = match table.text("convention")? {
        Some("dh") => Convention::Dh,
        Some("hayati") => Convention::Hayati,
        Some("mdh") => Convention::Mdh,
        Some("zero-reference") => Convention::ZeroReference,
        other => {
            let expected = "dh, hayati, mdh or zero-reference";
            return Err(named(&table, "convention", other, expected));
        }
    };
    let mut joint = Joint::new(kind, convention);
    joint.theta = angle(&mut table, "theta")?;
    joint.d = length(&mut table, "d")?;
    joint.a = length(&mut table, "a")?;
    joint.alpha = angle(&mut table, "alpha")?;
    joint.beta = angle(&mut table, "beta")?;
    let axis = table.numbers::<3>("axis", Quantity::Other)?;
    let point = table.numbers::<3>("point", Quantity::Length)?;
    if convention == Convention::ZeroReference {
        let Some(axis) = axis else {
            return Err(table.place().bad(
                "no axis",
                "axis = [x, y, z], the joint's direction in the base frame at q = 0",
                "add it: a zero-reference joint is its axis",
            ));
        };
        joint.axis = unit(&Vector3::from(axis)).ok_or_else(|| {
            table.place_of("axis").bad(
                format!("{axis:?}"),
                "a direction",
                "give a vector that is not zero",
            )
        })?;
        joint.point = Vector3::from(point.unwrap_or_default());
    }
    check_unused(&table, &joint, axis.is_some() || point.is_some())?;

    let quantity = match kind {
        JointKind::Revolute => Quantity::Angle,
        JointKind::Prismatic => Quantity::Length,
    };
    let limits = table.numbers::<2>("limits", quantity)?;
    if let Some([low, high]) = limits
        && low >= high
    {
        return Err(table.place().bad(
            format!("limits from {low} to {high} {}", quantity.unit()),
            "the lower one first",
            "exchange or correct them",
        ));
    }
    let ratio = table.number("ratio", Quantity::Other)?;
    if ratio == Some(0.0) {
        return Err(table.place_of("ratio").bad(
            "0",
            "motor turns per joint turn, signed",
            "correct it, or delete it if it is not known",
        ));
    }
    let resolution = table.number("resolution", quantity)?;
    if resolution.is_some_and(|r| r <= 0.0) {
        return Err(table.place().bad(
            "a resolution that is not above zero",
            "the smallest step of the joint command",
            "correct it, or delete it if it is not known",
        ));
    }
    let link = match table.table("link")? {
        Some(table) => Some(link(table)?),
        None => None,
    };
    table.finish()?;
    Ok(RobotJoint {
        joint,
        limits,
        ratio,
        resolution,
        link,
    })
}

fn link(mut table: Table<'_, '_>) -> Result<LinkMass<f64>, Error> {
    let mass = table.number("mass", Quantity::Other)?.unwrap_or(0.0);
    let com = table.numbers::<3>("com", Quantity::Length)?;
    if mass < 0.0 {
        return Err(table
            .place_of("mass")
            .bad(format!("{mass}"), "a mass in kg", "correct it"));
    }
    for x in com.unwrap_or_default() {
        check_length(&table, "com", x)?;
    }
    table.finish()?;
    Ok(LinkMass {
        mass,
        com: Vector3::from(com.unwrap_or_default()),
    })
}

/// Parameters that the convention does not have must be absent or zero.
fn check_unused(table: &Table<'_, '_>, joint: &Joint<f64>, has_axis: bool) -> Result<(), Error> {
    let zero_reference = joint.convention == Convention::ZeroReference;
    if has_axis && !zero_reference {
        return Err(table.place().bad(
            "axis or point",
            "them in a zero-reference joint only",
            "delete them, or set convention = \"zero-reference\"",
        ));
    }
    let revolute = joint.kind == JointKind::Revolute;
    let hayati = joint.convention == Convention::Hayati;
    let unused: [(&str, f64, bool, &str); 5] = [
        (
            "theta",
            joint.theta,
            zero_reference && !revolute,
            "a sliding zero-reference joint turns nothing",
        ),
        (
            "d",
            joint.d,
            revolute && (zero_reference || hayati),
            "this convention has no d on a revolute joint: put the distance into the joint \
             before (its d or a), or use convention = \"dh\"",
        ),
        (
            "a",
            joint.a,
            zero_reference,
            "a zero-reference joint is its axis and point",
        ),
        (
            "alpha",
            joint.alpha,
            zero_reference,
            "a zero-reference joint is its axis and point",
        ),
        (
            "beta",
            joint.beta,
            !hayati,
            "only convention = \"hayati\" has beta",
        ),
    ];
    for (key, value, is_unused, advice) in unused {
        if is_unused && value != 0.0 {
            return Err(table.place().bad(
                format!("{key} = {value}"),
                format!("no {key} in this convention"),
                advice,
            ));
        }
    }
    Ok(())
}

fn angle(table: &mut Table<'_, '_>, key: &str) -> Result<f64, Error> {
    let x = table.number(key, Quantity::Angle)?.unwrap_or(0.0);
    check_angle(table, key, x)?;
    Ok(x)
}

fn length(table: &mut Table<'_, '_>, key: &str) -> Result<f64, Error> {
    let x = table.number(key, Quantity::Length)?.unwrap_or(0.0);
    check_length(table, key, x)?;
    Ok(x)
}

fn check_angle(table: &Table<'_, '_>, key: &str, x: f64) -> Result<(), Error> {
    if x.abs() <= LARGEST_ANGLE {
        return Ok(());
    }
    Err(table.place_of(key).bad(
        format!("{x} rad"),
        "an angle of at most two turns",
        format!("name it {key}_deg if it is in degrees"),
    ))
}

fn check_length(table: &Table<'_, '_>, key: &str, x: f64) -> Result<(), Error> {
    if x.abs() <= LONGEST_LINK {
        return Ok(());
    }
    Err(table.place_of(key).bad(
        format!("{x} m"),
        format!("a length below {LONGEST_LINK} m"),
        format!(
            "name it {}_mm if it is in millimetres",
            if key == "tool" { "xyz" } else { key }
        ),
    ))
}

fn named(table: &Table<'_, '_>, key: &str, found: Option<&str>, expected: &str) -> Error {
    table.place_of(key).bad(
        found.map_or_else(|| format!("no {key}"), |f| format!("{f:?}")),
        expected,
        format!("set {key}"),
    )
}
