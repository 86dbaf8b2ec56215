//! The arm under identification: its description and the baked form that is evaluated.

use crate::description::Robot;
use nalgebra::Vector3;
use truepose::effects::{Description, Effect, hat};
use truepose::jacobian::{AttachedTwist, Attachment, carried, parameter_twists};
use truepose::{Arm, BakedJoint, Gauge, Joint, LinkMass, Parameter, Pose, Twist, bake};

use super::relation::Plane;

/// The irregular error of a revolute joint's own angle as a periodic table of a turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Joint, from 0.
    pub joint: usize,
    /// One a cell, cell 0 at zero reading, rad; NaN where nothing was measured nearby.
    pub values: Vec<f64>,
}

impl Curve {
    /// The two cells that a reading lies between, and their weights.
    pub fn cells(&self, q: f64) -> [(usize, f64); 2] {
        let density = self.values.len() as f64 / std::f64::consts::TAU;
        match hat(q, density, self.values.len()) {
            Some(h) => [(h.index, 1.0 - h.fraction), (h.next, h.fraction)],
            None => [(0, 0.0), (0, 0.0)],
        }
    }

    /// What it adds to the reading, rad.
    pub fn at(&self, q: f64) -> f64 {
        let weighted = |(cell, weight): (usize, f64)| match self.values.get(cell) {
            Some(value) if value.is_finite() => value * weight,
            _ => 0.0,
        };
        self.cells(q).into_iter().map(weighted).sum()
    }
}

/// A described arm with everything that measuring it adds, and its baked form.
#[derive(Clone, Debug)]
pub struct ArmModel {
    /// World to described robot base, one for each placement of the instrument.
    pub bases: Vec<Pose<f64>>,
    /// Described joints.
    pub joints: Vec<Joint<f64>>,
    /// Masses in the links' distal frames.
    pub masses: Vec<LinkMass<f64>>,
    /// Last link's distal frame to tool.
    pub tool: Pose<f64>,
    /// Motor turns per joint turn, without sign; `None` where nobody knows.
    pub ratios: Vec<Option<f64>>,
    /// Acceleration of gravity in the robot base, m/s^2.
    pub gravity: Vector3<f64>,
    /// Further targets in the tool frame, m.
    pub targets: Vec<Vector3<f64>>,
    /// Fixed end of the wire or bar in the world, m.
    pub anchor: Vector3<f64>,
    /// Fixed points that the tool point touches, in the world, m.
    pub points: Vec<Vector3<f64>>,
    /// Fixed planes that the tool point touches, in the world.
    pub planes: Vec<Plane>,
    /// Stations that bearings are taken from, in the world; the first is the world's own
    /// frame.
    pub stations: Vec<Pose<f64>>,
    /// What the rigid chain lacks.
    pub effects: Vec<Effect<'static, f64>>,
    /// Joints read before the arm had settled: what the joint that moved farthest still
    /// lacked, rad or m. A fault of the recording, never of the arm.
    pub early_reading: f64,
    /// The file has no time, and the row's number stands for it: what drifts belongs to the
    /// series of measurements.
    pub counts_rows: bool,
    /// Curves of joints while they are being identified, evaluated on the readings.
    pub curves: Vec<Curve>,
    baked: Vec<BakedJoint<f64>>,
    gauges: Vec<Gauge<f64>>,
    baked_tool: Pose<f64>,
    baked_bases: Vec<Pose<f64>>,
    gravities: Vec<Vector3<f64>>,
}

impl ArmModel {
    /// A rigid arm. `joints` and `masses` have one entry a joint.
    pub fn new(
        base: Pose<f64>,
        joints: Vec<Joint<f64>>,
        masses: Vec<LinkMass<f64>>,
        tool: Pose<f64>,
        gravity: Vector3<f64>,
    ) -> Self {
        let count = joints.len();
        let mut arm = Self {
            bases: vec![base],
            joints,
            masses,
            tool,
            ratios: vec![None; count],
            gravity,
            targets: Vec::new(),
            anchor: Vector3::zeros(),
            points: Vec::new(),
            planes: Vec::new(),
            stations: vec![Pose::identity()],
            effects: Vec::new(),
            early_reading: 0.0,
            counts_rows: false,
            curves: Vec::new(),
            baked: vec![BakedJoint::identity(); count],
            gauges: vec![Pose::identity(); count],
            baked_tool: Pose::identity(),
            baked_bases: Vec::new(),
            gravities: Vec::new(),
        };
        arm.bake();
        arm
    }

    /// The arm as it is drawn.
    pub fn drawn(robot: &Robot) -> Self {
        let mut arm = Self::new(
            robot.base,
            robot.geometry(),
            robot.masses(),
            robot.tool,
            robot.gravity,
        );
        arm.ratios = robot.joints.iter().map(|j| j.ratio.map(f64::abs)).collect();
        arm
    }

    /// To be called after any change of the description.
    pub fn bake(&mut self) {
        let (base, tool) = bake(
            &Pose::identity(),
            &self.joints,
            &self.masses,
            &self.tool,
            &mut self.baked,
            &mut self.gauges,
        );
        self.baked_tool = tool;
        let description = Description {
            base: &base.inverse(),
            joints: &self.joints,
            gauges: &self.gauges,
            tool: &self.tool,
        };
        for effect in &mut self.effects {
            effect.model_mut().attach(&description);
        }
        self.baked_bases.clear();
        self.gravities.clear();
        for described in &self.bases {
            self.baked_bases.push(described.then(&base));
            self.gravities.push(described.rotation * self.gravity);
        }
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Baked joints.
    pub fn baked(&self) -> &[BakedJoint<f64>] {
        &self.baked
    }

    /// Baked base of a placement of the instrument; the first where there is none such.
    pub fn baked_base(&self, session: usize) -> &Pose<f64> {
        let last = self.baked_bases.len().saturating_sub(1);
        &self.baked_bases[session.min(last)]
    }

    /// The forward model in the world of a placement of the instrument.
    pub fn view(&self, session: usize) -> Arm<'_, f64> {
        let last = self.gravities.len().saturating_sub(1);
        Arm {
            base: self.baked_base(session),
            joints: &self.baked,
            tool: &self.baked_tool,
            gravity: &self.gravities[session.min(last)],
            effects: &self.effects,
        }
    }

    /// Fixes an effect in the links as they are now; for effects that are not in the list.
    pub fn attach(&self, effect: &mut Effect<'static, f64>) {
        let base = self.baked_bases[0].inverse().then(&self.bases[0]);
        effect.model_mut().attach(&Description {
            base: &base,
            joints: &self.joints,
            gauges: &self.gauges,
            tool: &self.tool,
        });
    }

    /// How far the tool point is from the last joint's axis, m.
    pub fn tool_off_axis(&self) -> f64 {
        self.baked_tool.translation.xy().norm()
    }

    /// How a joint parameter moves the tool.
    pub fn joint_twists(&self, j: usize, parameter: Parameter) -> [Option<AttachedTwist<f64>>; 2] {
        // the described base seen from the baked one
        let base = self.baked_bases[0].inverse().then(&self.bases[0]);
        parameter_twists(&base, &self.joints, &self.gauges, j, parameter)
    }

    /// How the tool placement moves the tool: `axis` 0 to 2 shifts it along, 3 to 5 turns it
    /// about the axes of the last link's distal frame, at the tool point.
    pub fn tool_twist(&self, axis: usize) -> AttachedTwist<f64> {
        let last = self.joints.len() - 1;
        let mut unit = Vector3::zeros();
        unit[axis % 3] = 1.0;
        let twist = if axis < 3 {
            Twist::new(unit, Vector3::zeros())
        } else {
            Twist::new(self.tool.translation.cross(&unit), unit)
        };
        let flange = self.gauges[last].then(&self.joints[last].after());
        AttachedTwist {
            at: Attachment::Joint(last),
            twist: carried(&flange, &twist),
        }
    }
}
