//! The parameters of an arm model, one by one: name, unit, value, and how to change it.

use nalgebra::Vector3;
use truepose::effects::{Kind, Selector};
use truepose::{Parameter, Pose};

use super::arm::ArmModel;

/// One scalar that a fit may change. Axes count 0 to 2 for x, y, z, and 3 to 5 for turns
/// about them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// Placement `session` of the robot base; world axes, turns about the base's origin.
    Base {
        /// Placement of the instrument, from 0.
        session: usize,
        /// 0 to 5.
        axis: usize,
    },
    /// The tool in the last link; the link's distal axes, turns about the tool point.
    Tool {
        /// 0 to 5.
        axis: usize,
    },
    /// A parameter of a joint (from 0).
    Joint(usize, Parameter),
    /// Offset of a further target (from 0) along a tool axis.
    Target {
        /// 0 is the target of columns `x2`, `y2`, `z2`.
        target: usize,
        /// 0 to 2.
        axis: usize,
    },
    /// Fixed end of the wire or bar, world axis.
    Anchor {
        /// 0 to 2.
        axis: usize,
    },
    /// A fixed point that the tool touches, world axis.
    Point {
        /// From 0.
        point: usize,
        /// 0 to 2.
        axis: usize,
    },
    /// A fixed plane that the tool touches.
    Plane {
        /// From 0.
        plane: usize,
        /// 0 for the level, 1 and 2 for the slopes.
        value: usize,
    },
    /// A station that bearings are taken from; world axes, turns about its origin. Station 0
    /// is the world's frame and not unknown.
    Station {
        /// From 1.
        station: usize,
        /// 0 to 5.
        axis: usize,
    },
    /// A value of an effect.
    Effect {
        /// Index of the effect.
        effect: usize,
        /// Index of the value.
        value: usize,
    },
    /// What the joints lacked when they were read, of the joint that moved farthest.
    EarlyReading,
}

/// An effect as it stands in reports, joints counted from 1: `joint 2 gear-eccentricity
/// order 1`, `base time-drift yaw`.
pub fn effect_name(kind: &str, selector: &Selector) -> String {
    let mut name = match selector.joint {
        Some(j) => format!("joint {} {kind}", j + 1),
        None if Kind::of(kind).is_some_and(|k| k.base) => format!("base {kind}"),
        None => kind.to_owned(),
    };
    let component = selector.component.map(usize::from);
    if let (Some(c), Some(kind)) = (component, Kind::of(kind))
        && let Some(component) = kind.components.get(c)
    {
        name = format!("{name} {component}");
    }
    if let Some(order) = selector.order {
        name = format!("{name} order {order}");
    }
    if let Some(from) = selector.from {
        name = format!("{name} from {}", from + 1);
    }
    name
}

/// The most that an effect of a machine may have, by the unit of its value.
pub fn largest(unit: &str) -> f64 {
    match unit {
        "rad" | "m" => 5e-3,
        // a torque of 10 N m turns no gear by more than half a degree
        "rad/(N m)" | "rad s^2/m" => 1e-3,
        "kg rad/(N m)" => 1e-2,
        "1/(N m^2)" => 2e-3,
        "m/N" => 1e-5,
        // four times that of aluminium
        "1/K" => 1e-4,
        "rad/K" | "m/K" => 5e-4,
        // 0.6 deg a quarter of an hour
        "rad/s" | "m/s" => 1e-5,
        _ => 2e-2,
    }
}

const AXES: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

impl Unknown {
    /// As it stands in reports, joints counted from 1.
    pub fn name(&self, arm: &ArmModel) -> String {
        match *self {
            Self::Base { session: 0, axis } => format!("base {}", AXES[axis]),
            Self::Base { session, axis } => {
                format!("base {} of placement {}", AXES[axis], session + 1)
            }
            Self::Tool { axis } => format!("tool {}", AXES[axis]),
            Self::Joint(j, parameter) => format!("joint {} {}", j + 1, parameter.name()),
            Self::Target { target, axis } => format!("target {} {}", target + 2, AXES[axis]),
            Self::Anchor { axis } => format!("anchor {}", AXES[axis]),
            Self::Point { point, axis } => format!("point {} {}", point + 1, AXES[axis]),
            Self::Plane { plane, value } => {
                let steep = arm.planes.get(plane).map_or(2, |p| p.axis);
                let of = |i: usize| AXES[(steep + i) % 3];
                match value {
                    0 => format!("plane {} {} at the origin", plane + 1, of(0)),
                    _ => format!("plane {} slope of {} in {}", plane + 1, of(0), of(value)),
                }
            }
            Self::Station { station, axis } => format!("station {} {}", station + 1, AXES[axis]),
            Self::Effect { effect, value } => match arm.effects.get(effect) {
                Some(effect) => {
                    let model = effect.model();
                    let name = model.parameters().get(value).map_or("", |p| p.0);
                    format!("{} {name}", effect_name(model.kind(), &model.selector()))
                }
                None => String::new(),
            },
            Self::EarlyReading => "early-reading lack".to_owned(),
        }
    }

    /// SI unit.
    pub fn unit(&self, arm: &ArmModel) -> &'static str {
        match *self {
            Self::Base { axis, .. } | Self::Tool { axis } | Self::Station { axis, .. } => {
                if axis < 3 { "m" } else { "rad" }
            }
            Self::Joint(_, parameter) => parameter.unit(),
            Self::Target { .. } | Self::Anchor { .. } | Self::Point { .. } => "m",
            Self::Plane { value, .. } => match value {
                0 => "m",
                _ => "m/m",
            },
            Self::Effect { effect, value } => arm
                .effects
                .get(effect)
                .and_then(|e| e.model().parameters().get(value))
                .map_or("", |p| p.1),
            Self::EarlyReading => "rad",
        }
    }

    /// Present value. Turns of base and tool are fixed-axis roll, pitch and yaw.
    pub fn value(&self, arm: &ArmModel) -> f64 {
        let placed = |pose: &Pose<f64>, axis: usize| {
            if axis < 3 {
                pose.translation[axis]
            } else {
                pose.rpy()[axis - 3]
            }
        };
        match *self {
            Self::Base { session, axis } => arm.bases.get(session).map_or(0.0, |p| placed(p, axis)),
            Self::Tool { axis } => placed(&arm.tool, axis),
            Self::Joint(j, parameter) => arm.joints.get(j).map_or(0.0, |x| x.parameter(parameter)),
            Self::Target { target, axis } => arm.targets.get(target).map_or(0.0, |p| p[axis]),
            Self::Anchor { axis } => arm.anchor[axis],
            Self::Point { point, axis } => arm.points.get(point).map_or(0.0, |p| p[axis]),
            Self::Plane { plane, value } => arm.planes.get(plane).map_or(0.0, |p| match value {
                0 => p.level,
                _ => p.slopes[value - 1],
            }),
            Self::Station { station, axis } => {
                arm.stations.get(station).map_or(0.0, |p| placed(p, axis))
            }
            Self::Effect { effect, value } => arm
                .effects
                .get(effect)
                .and_then(|e| e.model().values().get(value).copied())
                .unwrap_or(0.0),
            Self::EarlyReading => arm.early_reading,
        }
    }

    /// How far it may be expected from the drawing, in its unit: what one column is scaled
    /// by. A placement may be anywhere.
    pub fn expected(&self, arm: &ArmModel) -> f64 {
        match *self {
            Self::Base { .. }
            | Self::Tool { .. }
            | Self::Target { .. }
            | Self::Anchor { .. }
            | Self::Point { .. }
            | Self::Plane { .. }
            | Self::Station { .. } => 1.0,
            // 0.5 mm and 0.5 mrad: a well-made arm
            Self::Joint(..) => 5e-4,
            Self::Effect { .. } => largest(self.unit(arm)),
            Self::EarlyReading => 1e-3,
        }
    }
}

/// Adds `step` (in the unknowns' units) to the arm and bakes it again.
pub fn apply(arm: &mut ArmModel, unknowns: &[Unknown], step: &[f64]) {
    let sessions = arm.bases.len();
    let mut base_turns = vec![Vector3::<f64>::zeros(); sessions];
    let mut station_turns = vec![Vector3::<f64>::zeros(); arm.stations.len()];
    let mut tool_turn = Vector3::<f64>::zeros();
    for (unknown, &delta) in unknowns.iter().zip(step) {
        match *unknown {
            Unknown::Base { session, axis } if session < sessions => {
                if axis < 3 {
                    arm.bases[session].translation[axis] += delta;
                } else {
                    base_turns[session][axis - 3] += delta;
                }
            }
            Unknown::Base { .. } => {}
            Unknown::Tool { axis } => {
                if axis < 3 {
                    arm.tool.translation[axis] += delta;
                } else {
                    tool_turn[axis - 3] += delta;
                }
            }
            Unknown::Joint(j, parameter) => {
                if let Some(joint) = arm.joints.get_mut(j) {
                    *joint.parameter_mut(parameter) += delta;
                }
            }
            Unknown::Target { target, axis } => {
                if let Some(point) = arm.targets.get_mut(target) {
                    point[axis] += delta;
                }
            }
            Unknown::Anchor { axis } => arm.anchor[axis] += delta,
            Unknown::Point { point, axis } => {
                if let Some(point) = arm.points.get_mut(point) {
                    point[axis] += delta;
                }
            }
            Unknown::Plane { plane, value } => {
                if let Some(plane) = arm.planes.get_mut(plane) {
                    match value {
                        0 => plane.level += delta,
                        _ => plane.slopes[value - 1] += delta,
                    }
                }
            }
            Unknown::Station { station: k, axis } => {
                if let Some(station) = arm.stations.get_mut(k) {
                    if axis < 3 {
                        station.translation[axis] += delta;
                    } else if let Some(turn) = station_turns.get_mut(k) {
                        turn[axis - 3] += delta;
                    }
                }
            }
            Unknown::Effect { effect, value } => {
                if let Some(value) = arm
                    .effects
                    .get_mut(effect)
                    .and_then(|e| e.model_mut().values_mut().get_mut(value))
                {
                    *value += delta;
                }
            }
            Unknown::EarlyReading => arm.early_reading += delta,
        }
    }
    let turned = |pose: &mut Pose<f64>, turn: &Vector3<f64>| {
        pose.rotation = Pose::from_rotation_vector(turn).rotation * pose.rotation;
    };
    for (base, turn) in arm.bases.iter_mut().zip(&base_turns) {
        turned(base, turn);
    }
    for (station, turn) in arm.stations.iter_mut().zip(&station_turns) {
        turned(station, turn);
    }
    arm.tool.rotation = Pose::from_rotation_vector(&tool_turn).rotation * arm.tool.rotation;
    arm.bake();
}
