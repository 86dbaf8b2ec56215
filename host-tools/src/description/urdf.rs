//! Robot descriptions in URDF, as far as a serial arm needs it.
//!
//! The chain runs from the root link to the tip: the only leaf, the leaf `tool0` (what ROS
//! calls the arm's own tool frame), or the link named behind a `#` after the file's name.
//! Every moving joint becomes a zero-reference joint, its axis and point in the root link's
//! frame with all joints at zero; fixed joints and the tip's place become part of it and of
//! the tool. Links on a fixed joint, and whatever else hangs on the arm, weigh on the link
//! that carries them, as it hangs at zero. Not read: transmissions, meshes, inertia tensors.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;
use roxmltree::{Document, Node};
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};

use super::zero_reference::unit;
use super::{GRAVITY, Robot, RobotJoint};
use crate::error::{Error, Place};

/// Whether a text is XML rather than TOML.
pub(super) fn is_xml(text: &str) -> bool {
    text.trim_start().starts_with('<')
}

/// Reads the text of `file`; `tip` is the link named after the file's name.
pub(super) fn parse(file: &Path, text: &str, tip: Option<&str>) -> Result<Robot, Error> {
    let document = Document::parse(text).map_err(|e| {
        let at = e.pos();
        let place = Place {
            character: Some(at.col as usize),
            ..Place::line(file, at.row as usize)
        };
        place.bad(
            format!("text that is not XML ({e})"),
            "a URDF file",
            "correct the line",
        )
    })?;
    let urdf = Urdf {
        file,
        document: &document,
    };
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        return Err(urdf.place(root).bad(
            format!("<{}>", root.tag_name().name()),
            "<robot>",
            "name a URDF file",
        ));
    }
    let is_macro = |n: &Node<'_, '_>| {
        n.tag_name()
            .namespace()
            .is_some_and(|ns| ns.contains("xacro"))
    };
    if let Some(node) = root.descendants().find(is_macro) {
        return Err(urdf.place(node).bad(
            "a xacro macro",
            "plain URDF",
            "expand the file with xacro first",
        ));
    }
    let tree = Tree::of(&urdf, root)?;
    let tip = tree.tip(tip)?;
    let chain = tree.chain(tip);
    let joints = tree.joints(&chain)?;
    Ok(Robot {
        name: root.attribute("name").unwrap_or("").to_owned(),
        base: Pose::identity(),
        joints,
        tool: tree.pose(tip),
        gravity: Vector3::from(GRAVITY),
        source: file.to_path_buf(),
    })
}

/// The file, for messages and numbers.
pub(super) struct Urdf<'t> {
    pub(super) file: &'t Path,
    pub(super) document: &'t Document<'t>,
}

/// A joint element and the links that it connects.
#[derive(Clone, Copy)]
pub(super) struct Edge<'t> {
    pub(super) node: Node<'t, 't>,
    pub(super) parent: &'t str,
    /// Root to joint frame with all joints at zero.
    t_root_joint: Pose<f64>,
}

/// The links of the file, each with the joint that it hangs on.
pub(super) struct Tree<'t> {
    urdf: &'t Urdf<'t>,
    robot: Node<'t, 't>,
    links: BTreeMap<&'t str, Node<'t, 't>>,
    /// By child link; the root has none.
    pub(super) edges: BTreeMap<&'t str, Edge<'t>>,
}

impl<'t> Urdf<'t> {
    fn place(&self, node: Node<'_, '_>) -> Place {
        let at = self.document.text_pos_at(node.range().start);
        let place = Place {
            character: Some(at.col as usize),
            ..Place::line(self.file, at.row as usize)
        };
        match node.attribute("name") {
            Some(name) => place.column(&format!("{} {name}", node.tag_name().name())),
            None => place,
        }
    }

    /// An attribute that must be there.
    fn attribute(&self, node: Node<'t, 't>, name: &str) -> Result<&'t str, Error> {
        node.attribute(name).ok_or_else(|| {
            self.place(node).bad(
                format!("<{}> without {name}", node.tag_name().name()),
                format!("{name}=\"...\""),
                "add it",
            )
        })
    }

    /// `N` finite numbers in an attribute; `default` where there is none.
    fn numbers<const N: usize>(
        &self,
        node: Option<Node<'t, 't>>,
        name: &str,
        default: [f64; N],
    ) -> Result<[f64; N], Error> {
        let Some((node, text)) = node.and_then(|n| Some((n, n.attribute(name)?))) else {
            return Ok(default);
        };
        let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
        numbers
            .ok()
            .filter(|numbers| numbers.iter().all(|x| x.is_finite()))
            .and_then(|numbers| numbers.try_into().ok())
            .ok_or_else(|| {
                self.place(node).bad(
                    format!("{name}={text:?}"),
                    format!("{N} finite numbers"),
                    "correct the attribute",
                )
            })
    }

    /// `<origin xyz rpy/>` of a joint or an inertial.
    fn origin(&self, node: Node<'t, 't>) -> Result<Pose<f64>, Error> {
        let origin = child(node, "origin");
        let xyz = self.numbers(origin, "xyz", [0.0; 3])?;
        let rpy = self.numbers(origin, "rpy", [0.0; 3])?;
        Ok(Pose::from_xyz_rpy(xyz.into(), rpy.into()))
    }
}

pub(super) fn child<'t>(node: Node<'t, 't>, name: &str) -> Option<Node<'t, 't>> {
    node.children().find(|n| n.has_tag_name(name))
}

pub(super) fn moves(node: Node<'_, '_>) -> bool {
    node.attribute("type") != Some("fixed")
}

impl<'t> Tree<'t> {
    pub(super) fn of(urdf: &'t Urdf<'t>, robot: Node<'t, 't>) -> Result<Self, Error> {
        let mut tree = Self {
            urdf,
            robot,
            links: BTreeMap::new(),
            edges: BTreeMap::new(),
        };
        for node in robot.children().filter(|n| n.has_tag_name("link")) {
            let name = urdf.attribute(node, "name")?;
            if tree.links.insert(name, node).is_some() {
                return Err(tree.twice(node));
            }
        }
        for node in robot.children().filter(|n| n.has_tag_name("joint")) {
            let [parent, child] = ["parent", "child"].map(|end| {
                let end = child(node, end).unwrap_or(node);
                let link = urdf.attribute(end, "link")?;
                if tree.links.contains_key(link) {
                    return Ok(link);
                }
                Err(urdf.place(node).bad(
                    format!("the link {link}, which is not in the file"),
                    "links of this file",
                    "correct the name or add the link",
                ))
            });
            let edge = Edge {
                node,
                parent: parent?,
                t_root_joint: urdf.origin(node)?,
            };
            if tree.edges.insert(child?, edge).is_some() {
                return Err(tree.twice(node));
            }
        }
        tree.place_joints()?;
        Ok(tree)
    }

    fn twice(&self, node: Node<'_, '_>) -> Error {
        self.urdf.place(node).bad(
            "a second link of that name, or a second joint to the same link",
            "a tree",
            "delete or rename one of the two",
        )
    }

    /// Turns the origins, read relative to their parents, into poses in the root.
    fn place_joints(&mut self) -> Result<(), Error> {
        let mut placed = BTreeMap::new();
        for &link in self.links.keys() {
            let mut chain = Vec::new();
            let mut at = link;
            while let Some(edge) = self.edges.get(at) {
                chain.push((at, edge));
                at = edge.parent;
                if chain.len() > self.edges.len() {
                    return Err(self.urdf.place(edge.node).bad(
                        "links in a circle",
                        "a tree with one root",
                        "correct parent and child",
                    ));
                }
            }
            let from_root = chain.iter().rev();
            let pose = from_root.fold(Pose::identity(), |t, (_, e)| t.then(&e.t_root_joint));
            placed.insert(link, pose);
        }
        for (link, edge) in &mut self.edges {
            if let Some(pose) = placed.get(link) {
                edge.t_root_joint = *pose;
            }
        }
        Ok(())
    }

    /// Root to the link's frame with all joints at zero.
    pub(super) fn pose(&self, link: &str) -> Pose<f64> {
        self.edges
            .get(link)
            .map_or_else(Pose::identity, |edge| edge.t_root_joint)
    }

    /// Links from the first below the root to `tip`.
    pub(super) fn chain(&self, tip: &'t str) -> Vec<&'t str> {
        let mut chain = vec![tip];
        let mut at = tip;
        while let Some(edge) = self.edges.get(at) {
            at = edge.parent;
            chain.push(at);
        }
        chain.pop();
        chain.reverse();
        chain
    }

    pub(super) fn tip(&self, named: Option<&str>) -> Result<&'t str, Error> {
        let is_leaf = |link: &&str| !self.edges.values().any(|e| e.parent == *link);
        let leaves: Vec<&str> = self.links.keys().copied().filter(is_leaf).collect();
        let by_name = |name: &str| self.links.keys().copied().find(|link| *link == name);
        let expected = match named {
            Some(name) => match by_name(name) {
                Some(link) => return Ok(link),
                None => format!("a link of this file to end at, not {name}"),
            },
            None => match (&leaves[..], by_name("tool0")) {
                ([leaf], _) => return Ok(leaf),
                (_, Some(leaf)) => return Ok(leaf),
                _ => "one last link, or one named tool0".to_owned(),
            },
        };
        Err(self.urdf.place(self.robot).bad(
            format!("the last links {}", leaves.join(", ")),
            expected,
            format!("name the link to end at: {}#LINK", self.urdf.file.display()),
        ))
    }

    fn joints(&self, chain: &[&'t str]) -> Result<Vec<RobotJoint>, Error> {
        let mut joints = Vec::new();
        let mut carriers = Vec::new();
        for link in chain {
            let Some(edge) = self.edges.get(link).filter(|e| moves(e.node)) else {
                continue;
            };
            joints.push(self.joint(edge)?);
            carriers.push(*link);
        }
        if joints.is_empty() {
            return Err(self.urdf.place(self.robot).bad(
                "no moving joint on the way to the last link",
                "a serial arm",
                format!("name the link to end at: {}#LINK", self.urdf.file.display()),
            ));
        }
        for (&link, node) in &self.links {
            // The last moving link of the arm that it hangs on.
            let way = self.chain(link);
            let carrier = carriers.iter().rposition(|c| way.contains(c));
            if let Some(joint) = carrier.and_then(|k| joints.get_mut(k))
                && let Some(mass) = self.mass(link, *node)?
            {
                let before = joint.link.unwrap_or_else(LinkMass::none);
                let sum = before.mass + mass.mass;
                if sum > 0.0 {
                    let moment = before.com * before.mass + mass.com * mass.mass;
                    joint.link = Some(LinkMass {
                        mass: sum,
                        com: moment / sum,
                    });
                }
            }
        }
        Ok(joints)
    }

    fn joint(&self, edge: &Edge<'t>) -> Result<RobotJoint, Error> {
        let kind = match self.urdf.attribute(edge.node, "type")? {
            "revolute" | "continuous" => JointKind::Revolute,
            "prismatic" => JointKind::Prismatic,
            other => {
                return Err(self.urdf.place(edge.node).bad(
                    format!("a {other} joint"),
                    "revolute, continuous, prismatic or fixed",
                    "such a joint cannot be part of the arm",
                ));
            }
        };
        if child(edge.node, "mimic").is_some() {
            return Err(self.urdf.place(edge.node).bad(
                "a joint that mimics another",
                "joints with readings of their own",
                "describe the arm in TOML",
            ));
        }
        let axis = child(edge.node, "axis");
        let xyz: [f64; 3] = self.urdf.numbers(axis, "xyz", [1.0, 0.0, 0.0])?;
        let axis = unit(&xyz.into()).ok_or_else(|| {
            self.urdf.place(edge.node).bad(
                "an axis of length zero",
                "a direction",
                "correct the axis",
            )
        })?;
        let frame = &edge.t_root_joint;
        let mut joint = Joint::new(kind, Convention::ZeroReference);
        joint.axis = unit(&(frame.rotation * axis)).unwrap_or(axis);
        if kind == JointKind::Revolute {
            joint.point = frame.translation;
        }
        let limit = child(edge.node, "limit");
        let [low] = self.urdf.numbers(limit, "lower", [0.0])?;
        let [high] = self.urdf.numbers(limit, "upper", [0.0])?;
        let endless = edge.node.attribute("type") == Some("continuous");
        Ok(RobotJoint {
            joint,
            limits: (!endless && low < high).then_some([low, high]),
            ratio: None,
            resolution: None,
            link: None,
        })
    }

    /// Mass of a link, its centre in the root's frame with all joints at zero.
    fn mass(&self, link: &str, node: Node<'t, 't>) -> Result<Option<LinkMass<f64>>, Error> {
        let Some(inertial) = child(node, "inertial") else {
            return Ok(None);
        };
        let [mass] = self.urdf.numbers(child(inertial, "mass"), "value", [0.0])?;
        if mass < 0.0 {
            return Err(self.urdf.place(node).bad(
                format!("a mass of {mass} kg"),
                "a mass that is not negative",
                "correct it",
            ));
        }
        let com = self.urdf.origin(inertial)?.translation;
        Ok(Some(LinkMass {
            mass,
            com: self.pose(link).point(&com),
        }))
    }
}
