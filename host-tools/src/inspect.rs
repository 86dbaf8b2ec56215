//! What a blob says, in words.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use truepose::params::{Blob, Description, HEADER, LAYOUT, UNLIMITED};
use truepose::{JointKind, Pose, StoredPose};

/// A blob in the words of reports. SI units; joints count from 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Name of the robot.
    pub robot: String,
    /// Size of the blob in bytes.
    pub bytes: usize,
    /// Layout of the blob.
    pub layout: u16,
    /// What wrote it.
    pub written_by: String,
    /// Name of the measurements.
    pub data: String,
    /// Date, as its writer put it; may be empty.
    pub date: String,
    /// Rows that the fit used, rows held back from it.
    pub rows: Rows,
    /// Rms position error of the rows held back, m.
    pub rms: BeforeAfter,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: [f64; 3],
    /// Mass of the links together, kg.
    pub mass: f64,
    /// One a joint.
    pub joints: Vec<Joint>,
    /// Base, joints and tool: drawn and identified.
    pub parameters: Vec<Parameter>,
    /// What the rigid chain lacks.
    pub effects: Vec<Effect>,
    /// How the controller compensates.
    pub compensation: Compensation,
}

/// Number of rows on either side of the split.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rows {
    /// Used by the fit.
    pub identify: u32,
    /// Held back.
    pub verify: u32,
}

/// Without and with the identified parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeforeAfter {
    /// m.
    pub before: f64,
    /// m.
    pub after: f64,
}

/// What is known of a joint besides its geometry.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Joint {
    /// `"revolute"` or `"prismatic"`.
    pub kind: &'static str,
    /// `"rad"` or `"m"`.
    pub unit: &'static str,
    /// Lower and upper limit of its command.
    pub limits: Option<[f64; 2]>,
    /// Smallest step of its command; 0 unknown.
    pub resolution: f64,
}

/// One geometric parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Such as `joint 3 alpha`.
    pub name: String,
    /// `"rad"` or `"m"`.
    pub unit: &'static str,
    /// As drawn.
    pub nominal: f64,
    /// As identified.
    pub value: f64,
}

/// One effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// As in reports.
    pub kind: &'static str,
    /// Joint; none for the base.
    pub joint: Option<usize>,
    /// Per joint turn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<f64>,
    /// The other joint or link.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<usize>,
    /// Values and constants by name.
    pub parameters: BTreeMap<&'static str, f64>,
    /// Their units by name.
    pub units: BTreeMap<&'static str, &'static str>,
}

/// Settings of the compensator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compensation {
    /// Name of the method.
    pub method: &'static str,
    /// At most.
    pub iterations: u8,
    /// Predicted error at which it stops, m.
    pub position_tolerance: f64,
    /// Predicted error at which it stops, rad.
    pub orientation_tolerance: f64,
    /// Largest correction of a revolute joint, rad.
    pub largest_turn: f64,
    /// Largest correction of a prismatic joint, m.
    pub largest_slide: f64,
}

/// Looks at a blob of `bytes` bytes.
pub fn inspect(blob: &Blob<'_>, bytes: usize) -> Inspection {
    let (settings, from) = (&blob.settings, &blob.provenance);
    let of_joint = |((joint, &limits), &resolution): ((&truepose::Joint<f64>, _), &f64)| {
        let (kind, unit) = match joint.kind {
            JointKind::Revolute => ("revolute", "rad"),
            JointKind::Prismatic => ("prismatic", "m"),
        };
        let [low, high]: [f64; 2] = limits;
        Joint {
            kind,
            unit,
            limits: (low > UNLIMITED[0] || high < UNLIMITED[1]).then_some(limits),
            resolution,
        }
    };
    let joints = blob.calibrated.joints.iter();
    Inspection {
        robot: blob.robot.to_string(),
        bytes,
        layout: LAYOUT,
        written_by: from.tool.to_string(),
        data: from.data.to_string(),
        date: from.date.to_string(),
        rows: Rows {
            identify: from.rows_identify,
            verify: from.rows_verify,
        },
        rms: BeforeAfter {
            before: from.rms_before,
            after: from.rms_after,
        },
        gravity: blob.gravity,
        mass: blob.calibrated.masses.iter().map(|m| m.mass).sum(),
        joints: joints
            .zip(&blob.limits)
            .zip(&blob.resolution)
            .map(of_joint)
            .collect(),
        parameters: parameters(&blob.nominal, &blob.calibrated),
        effects: blob.effects.iter().map(effect).collect(),
        compensation: Compensation {
            method: settings.method.name(),
            iterations: settings.max_iterations,
            position_tolerance: settings.position_tolerance,
            orientation_tolerance: settings.orientation_tolerance,
            largest_turn: settings.correction_bound[0],
            largest_slide: settings.correction_bound[1],
        },
    }
}

fn parameters(nominal: &Description, calibrated: &Description) -> Vec<Parameter> {
    let mut list = frame("base", &nominal.base, &calibrated.base);
    let pairs = nominal.joints.iter().zip(&calibrated.joints);
    for (number, (nominal, calibrated)) in (1..).zip(pairs) {
        for &parameter in calibrated.parameters() {
            let both = [nominal, calibrated].map(|joint| joint.parameter(parameter));
            // Beta is Hayati's: an ordinary joint has none.
            let absent = both.iter().all(|x| *x == 0.0);
            if parameter == truepose::Parameter::Beta && absent {
                continue;
            }
            list.push(Parameter {
                name: format!("joint {number} {}", parameter.name()),
                unit: parameter.unit(),
                nominal: both[0],
                value: both[1],
            });
        }
    }
    list.extend(frame("tool", &nominal.tool, &calibrated.tool));
    list
}

fn frame(name: &str, nominal: &StoredPose, calibrated: &StoredPose) -> Vec<Parameter> {
    let [nominal, calibrated] = [nominal, calibrated].map(|stored| {
        let pose = Pose::from(stored);
        let rpy = pose.rpy();
        let p = pose.translation;
        [p.x, p.y, p.z, rpy.x, rpy.y, rpy.z]
    });
    ["x", "y", "z", "roll", "pitch", "yaw"]
        .into_iter()
        .zip(nominal.into_iter().zip(calibrated))
        .map(|(axis, (nominal, value))| Parameter {
            name: format!("{name} {axis}"),
            unit: if axis.len() == 1 { "m" } else { "rad" },
            nominal,
            value,
        })
        .collect()
}

fn effect(effect: &truepose::effects::Effect<'_, f64>) -> Effect {
    let model = effect.model();
    let selector = model.selector();
    let values = model.parameters().iter().zip(model.values());
    let constants = model.constant_names().iter().zip(model.constants());
    // An order that selects the effect is said beside its joint.
    let constants = constants.filter(|((name, _), _)| *name != "order");
    let mut parameters = BTreeMap::new();
    let mut units = BTreeMap::new();
    for (&(name, unit), &value) in values.chain(constants) {
        parameters.insert(name, value);
        units.insert(name, unit);
    }
    Effect {
        kind: model.kind(),
        joint: model.joint().map(|j| j + 1),
        order: selector.order,
        from: selector.from.map(|j| j + 1),
        parameters,
        units,
    }
}

/// A length or angle as people read it: mm or deg.
fn for_people(value: f64, unit: &str) -> (f64, &'static str) {
    match unit {
        "m" => (value * 1e3, "mm"),
        _ => (value.to_degrees(), "deg"),
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rows { identify, verify } = self.rows;
        writeln!(
            f,
            "{}: {} joints; {} bytes ({HEADER} of header), layout {}, checksum good",
            self.robot,
            self.joints.len(),
            self.bytes,
            self.layout
        )?;
        let date = if self.date.is_empty() { "" } else { ", " };
        writeln!(
            f,
            "from {} by {}{date}{}: {identify} rows fitted, {verify} held back",
            self.data, self.written_by, self.date
        )?;
        writeln!(
            f,
            "rms position error of the rows held back: {:.3} mm before, {:.3} mm after\n",
            self.rms.before * 1e3,
            self.rms.after * 1e3
        )?;
        writeln!(
            f,
            "{:<18}{:>14}{:>14}{:>12}",
            "parameter", "nominal", "identified", "change"
        )?;
        for p in &self.parameters {
            let (nominal, unit) = for_people(p.nominal, p.unit);
            let (value, _) = for_people(p.value, p.unit);
            writeln!(
                f,
                "{:<18}{nominal:>14.4}{value:>14.4}{:>+12.4} {unit}",
                p.name,
                value - nominal
            )?;
        }
        writeln!(f)?;
        if self.effects.is_empty() {
            writeln!(f, "no effects: geometry only")?;
        }
        for effect in &self.effects {
            write!(f, "{}", effect.kind)?;
            match effect.joint {
                Some(joint) => write!(f, " of joint {joint}")?,
                None => write!(f, " of the base")?,
            }
            if let Some(order) = effect.order {
                write!(f, ", order {order}")?;
            }
            if let Some(from) = effect.from {
                write!(f, ", from joint {from}")?;
            }
            write!(f, ":")?;
            for (name, value) in &effect.parameters {
                let unit = effect.units.get(name).copied().unwrap_or("");
                write!(f, " {name} {value:.3e} {unit}")?;
            }
            writeln!(f)?;
        }
        let [gx, gy, gz] = self.gravity;
        writeln!(
            f,
            "\ngravity {gx:.2} {gy:.2} {gz:.2} m/s^2 in the base frame; links weigh {:.1} kg",
            self.mass
        )?;
        for (number, joint) in (1..).zip(&self.joints) {
            write!(f, "joint {number}: {}", joint.kind)?;
            match joint.limits {
                Some([low, high]) => {
                    let (low, unit) = for_people(low, joint.unit);
                    let (high, _) = for_people(high, joint.unit);
                    write!(f, ", {low:.1} to {high:.1} {unit}")?;
                }
                None => write!(f, ", no limits")?,
            }
            if joint.resolution > 0.0 {
                let (step, unit) = for_people(joint.resolution, joint.unit);
                write!(f, ", steps of {step:.5} {unit}")?;
            }
            writeln!(f)?;
        }
        let c = &self.compensation;
        writeln!(
            f,
            "compensation: {}, at most {} iterations, until below {} um and {:.2} mdeg; \
             corrections up to {:.1} deg, {:.0} mm",
            c.method,
            c.iterations,
            c.position_tolerance * 1e6,
            c.orientation_tolerance.to_degrees() * 1e3,
            c.largest_turn.to_degrees(),
            c.largest_slide * 1e3
        )
    }
}
