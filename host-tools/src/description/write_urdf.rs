//! Robot descriptions written in URDF: a new file, or the user's own with its joints moved.
//!
//! Numbers have all their digits, so [`super::urdf`] reads the same poses back to rounding.
//! The user's file is changed only where a joint stands: names, meshes, limits, comments and
//! what other programs keep in it stay.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use roxmltree::{Document, Node};
use truepose::{JointKind, Pose};

use super::Robot;
use super::urdf::{Tree, Urdf, child, moves};
use crate::convert::{Axis, ZeroPosition, shortest_turn};
use crate::error::{Error, Place};

/// A new file. Every frame stands as the base's does at zero, on its joint's axis; the tool is
/// the link `tool0`. A base that is not at the world's origin hangs on a link `world`.
pub(super) fn write(robot: &Robot) -> Result<String, Error> {
    let zero = ZeroPosition::of(robot);
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n",
        escaped(&robot.name)
    );
    if robot.base != Pose::identity() {
        text += "  <link name=\"world\"/>\n";
        text += &fixed("base", "world", "base_link", &robot.base);
    }
    text += "  <link name=\"base_link\"/>\n";
    let mut at = Pose::<f64>::identity();
    let mut parent = "base_link".to_owned();
    for (k, (axis, described)) in zero.axes.iter().zip(&robot.joints).enumerate() {
        let number = k + 1;
        let mut frame = at;
        if axis.kind == JointKind::Revolute {
            frame.translation = axis.point;
        }
        let (kind, limit) = match (axis.kind, described.limits) {
            (JointKind::Revolute, None) => ("continuous", String::new()),
            (kind, Some([low, high])) => (
                if kind == JointKind::Revolute {
                    "revolute"
                } else {
                    "prismatic"
                },
                // Required, and not known here: 0 as the URDF manual's own examples have it.
                format!(
                    "    <limit lower=\"{low}\" upper=\"{high}\" effort=\"0\" velocity=\"0\"/>\n"
                ),
            ),
            (JointKind::Prismatic, None) => {
                return Err(Place::file(&robot.source).bad(
                    format!("joint {number}, which slides without limits"),
                    "limits, which URDF requires of a slide",
                    "give it limits_mm",
                ));
            }
        };
        let name = format!("link_{number}");
        text += &format!(
            "  <joint name=\"joint_{number}\" type=\"{kind}\">\n    {}\n    \
             <parent link=\"{parent}\"/>\n    <child link=\"{name}\"/>\n    \
             <axis xyz=\"{}\"/>\n{limit}  </joint>\n",
            origin(&at.inverse().then(&frame)),
            numbers(axis.direction.as_slice()),
        );
        text += &match (&described.link, zero.links.get(k)) {
            (Some(mass), Some(link)) if mass.mass > 0.0 => {
                let com = frame.inverse().then(link).point(&mass.com);
                let place = Pose::translate(com.x, com.y, com.z);
                format!(
                    "  <link name=\"{name}\">\n    <inertial>\n      {}\n      \
                     <mass value=\"{}\"/>\n      <!-- not known: a point mass -->\n      \
                     <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>\n    \
                     </inertial>\n  </link>\n",
                    origin(&place),
                    mass.mass
                )
            }
            _ => format!("  <link name=\"{name}\"/>\n"),
        };
        at = frame;
        parent = name;
    }
    text += &fixed("tool", &parent, "tool0", &at.inverse().then(&zero.tool));
    Ok(text + "  <link name=\"tool0\"/>\n</robot>\n")
}

/// `text`, a URDF file that is read as `nominal`, with its joints where `calibrated` has them.
///
/// `calibrated`: the same joints as identified. Joint axes keep their direction in their own
/// frame; each frame turns and moves as little as brings it there, and so do the links on it.
/// The tip goes where the tool was found: by the fixed joint that leads to it, or where a
/// moving one does, by a new link that is named after it.
pub(super) fn rewrite(
    file: &Path,
    text: &str,
    tip: Option<&str>,
    nominal: &Robot,
    calibrated: &Robot,
) -> Result<String, Error> {
    let document =
        Document::parse(text).map_err(|e| Error::Usage(format!("{}: {e}", file.display())))?;
    let urdf = Urdf {
        file,
        document: &document,
    };
    let tree = Tree::of(&urdf, document.root_element())?;
    let tip = tree.tip(tip)?;
    let (before, after) = (ZeroPosition::of(nominal), ZeroPosition::of(calibrated));

    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    // Where every link of the arm stands now; links on fixed joints follow.
    let mut placed: BTreeMap<&str, Pose<f64>> = BTreeMap::new();
    let mut moving = 0;
    for link in tree.chain(tip) {
        let Some(edge) = tree.edges.get(link) else {
            continue;
        };
        let drawn = tree.pose(link);
        let parent_drawn = tree.pose(edge.parent);
        let parent = *placed.get(edge.parent).unwrap_or(&parent_drawn);
        let kept = parent.then(&parent_drawn.inverse()).then(&drawn);
        let frame = if moves(edge.node) {
            let k = moving;
            moving += 1;
            match (
                before.links.get(k),
                after.links.get(k),
                before.axes.get(k),
                after.axes.get(k),
            ) {
                (Some(old), Some(new), Some(was), Some(is)) => {
                    let carried = new.then(&old.inverse());
                    let frame = carried.then(&drawn);
                    onto(&was.moved(&carried), is, &frame)
                }
                _ => kept,
            }
        } else if link == tip {
            after.tool
        } else {
            kept
        };
        placed.insert(link, frame);
        if moves(edge.node) || link == tip {
            let place = origin(&parent.inverse().then(&frame));
            edits.push(match child(edge.node, "origin") {
                Some(old) => (old.range(), place),
                None => before_first_child(edge.node, place),
            });
        }
    }
    let last = placed.get(tip).copied().unwrap_or_else(Pose::identity);
    let ends_moving = tree.edges.get(tip).is_some_and(|edge| moves(edge.node));
    if ends_moving {
        let name = format!("{tip}_tool");
        let more = fixed(&name, tip, &name, &last.inverse().then(&after.tool));
        let end = text.rfind("</").unwrap_or(text.len());
        edits.push((
            end..end,
            format!("{more}  <link name=\"{}\"/>\n", escaped(&name)),
        ));
    }
    edits.sort_by_key(|(range, _)| range.start);
    let mut out = String::with_capacity(text.len() + 1024);
    let mut done = 0;
    for (range, new) in edits {
        out += text.get(done..range.start).unwrap_or("");
        out += &new;
        done = range.end;
    }
    Ok(out + text.get(done..).unwrap_or(""))
}

/// `frame`, which moves with the axis `was`, moved on as little as brings that onto `is`.
fn onto(was: &Axis, is: &Axis, frame: &Pose<f64>) -> Pose<f64> {
    let turn = shortest_turn(&was.direction, &is.direction);
    let at = match is.kind {
        JointKind::Revolute => {
            let way = frame.translation - is.point;
            is.point + is.direction * way.dot(&is.direction)
        }
        JointKind::Prismatic => frame.translation,
    };
    Pose::new(turn * frame.rotation, at)
}

fn before_first_child(node: Node<'_, '_>, place: String) -> (Range<usize>, String) {
    let first = node.children().find(Node::is_element).unwrap_or(node);
    let start = first.range().start;
    (start..start, format!("{place}\n    "))
}

fn fixed(name: &str, parent: &str, child: &str, pose: &Pose<f64>) -> String {
    let [name, parent, child] = [name, parent, child].map(escaped);
    format!(
        "  <joint name=\"{name}\" type=\"fixed\">\n    {}\n    <parent link=\"{parent}\"/>\n    \
         <child link=\"{child}\"/>\n  </joint>\n",
        origin(pose)
    )
}

fn origin(pose: &Pose<f64>) -> String {
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        numbers(pose.translation.as_slice()),
        numbers(pose.rpy().as_slice())
    )
}

fn numbers(values: &[f64]) -> String {
    // Adding zero makes -0 positive.
    let cells: Vec<String> = values.iter().map(|x| (x + 0.0).to_string()).collect();
    cells.join(" ")
}

/// As an attribute's value.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '"' => out += "&quot;",
            // Not allowed in XML 1.0 at all.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
