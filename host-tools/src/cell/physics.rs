//! Where the cell's arm really stands: the product of its 4 x 4 transforms, with what the
//! hidden effects add at the place where each of them acts.

use nalgebra::Vector3;

use super::campaign::Visit;
use super::drawing::{Drawing, Kind};
use super::hidden::{Hidden, Shape};
use super::solid::{Solid, axes, moved, origin, place};

/// Temperature at which the arm was built, degC.
const BUILT_AT: f64 = 20.0;
/// Acceleration of gravity in the base frame, m/s^2.
pub(crate) const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// A hidden effect with its size and its drawn shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) hidden: Hidden,
    pub(crate) size: f64,
    pub(crate) shape: Shape,
}

/// The arm as it stands in the cell.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    pub(crate) built: Drawing,
    /// World to robot base.
    pub(crate) base: Solid,
    /// Largest gravity torque that each joint sees without payload, N m (N).
    pub(crate) torque_scale: Vec<f64>,
}

/// Rigid frames of one pose, in the world.
pub(crate) struct Frames {
    /// Joint frames after the motion, z along the axis.
    pub(crate) joints: Vec<Solid>,
    /// Far ends of the links.
    pub(crate) ends: Vec<Solid>,
    pub(crate) tool: Solid,
}

/// What gravity does to one pose, world axes.
struct Loads {
    /// About each joint frame's origin, of everything beyond, N m.
    moments: Vec<Vector3<f64>>,
    /// About each link's far end, of everything beyond that, N m.
    end_moments: Vec<Vector3<f64>>,
    /// On everything beyond each joint, N.
    forces: Vec<Vector3<f64>>,
    /// About the base's origin, of everything, N m.
    overturning: Vector3<f64>,
    gravity: Vector3<f64>,
}

/// Small displacements `[dx dy dz rx ry rz]` at the places where effects act.
struct Deflections {
    /// Of the whole cell, in the world.
    world: [f64; 6],
    /// Of the base, in its own frame.
    base: [f64; 6],
    /// Added to the readings.
    joints: Vec<f64>,
    /// In the joint frames after the motion.
    bearings: Vec<[f64; 6]>,
    /// In the frames at the links' far ends.
    ends: Vec<[f64; 6]>,
    /// Factors of the links' lengths.
    growth: Vec<f64>,
}

impl Body {
    /// Rigid frames at joint values `q`.
    pub(crate) fn frames(&self, q: &[f64]) -> Frames {
        let count = self.built.links.len();
        let (mut joints, mut ends) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut at = self.base;
        for (link, &q) in self.built.links.iter().zip(q) {
            if link.proximal {
                at *= link.before(1.0);
            }
            at *= link.motion(q);
            joints.push(at);
            at *= link.after(1.0);
            ends.push(at);
        }
        Frames {
            joints,
            ends,
            tool: at * self.built.tool_pose(),
        }
    }

    fn loads(&self, frames: &Frames, visit: &Visit) -> Loads {
        let gravity = axes(&self.base) * Vector3::from(GRAVITY);
        let count = frames.joints.len();
        let mut mass = visit.payload;
        let mut first = place(&frames.tool, visit.payload_com) * visit.payload;
        let zeros = vec![Vector3::zeros(); count];
        let mut loads = Loads {
            moments: zeros.clone(),
            end_moments: zeros.clone(),
            forces: zeros,
            overturning: Vector3::zeros(),
            gravity,
        };
        for j in (0..count).rev() {
            let link = &self.built.links[j];
            loads.end_moments[j] = (first - origin(&frames.ends[j]) * mass).cross(&gravity);
            mass += link.mass;
            first += place(&frames.ends[j], link.com) * link.mass;
            loads.moments[j] = (first - origin(&frames.joints[j]) * mass).cross(&gravity);
            loads.forces[j] = gravity * mass;
        }
        loads.overturning = (first - origin(&self.base) * mass).cross(&gravity);
        loads
    }

    /// Gravity's torque on joint `j` (its force, for a slide).
    fn torque(&self, j: usize, frames: &Frames, loads: &Loads) -> f64 {
        let z = axes(&frames.joints[j]).column(2).into_owned();
        match self.built.links[j].kind {
            Kind::Revolute => z.dot(&loads.moments[j]),
            Kind::Prismatic => z.dot(&loads.forces[j]),
        }
    }

    /// Largest torques over the given postures, at least 1 N m (N).
    pub(crate) fn largest_torques(&self, postures: &[Visit]) -> Vec<f64> {
        let mut largest = vec![1.0_f64; self.built.links.len()];
        for visit in postures {
            let frames = self.frames(&visit.q);
            let loads = self.loads(&frames, visit);
            for (j, largest) in largest.iter_mut().enumerate() {
                *largest = largest.max(self.torque(j, &frames, &loads).abs());
            }
        }
        largest
    }

    /// Where the tool really is.
    pub(crate) fn pose(&self, hidden: &[Placed], visit: &Visit) -> Solid {
        let count = self.built.links.len();
        let mut bent = Deflections {
            world: [0.0; 6],
            base: [0.0; 6],
            joints: vec![0.0; count],
            bearings: vec![[0.0; 6]; count],
            ends: vec![[0.0; 6]; count],
            growth: vec![1.0; count],
        };
        for placed in hidden {
            self.unloaded(placed, visit, &mut bent);
        }
        if hidden.iter().any(|p| is_load(&p.hidden)) {
            let q: Vec<f64> = visit
                .q
                .iter()
                .zip(&bent.joints)
                .map(|(a, b)| a + b)
                .collect();
            let frames = self.frames(&q);
            let loads = self.loads(&frames, visit);
            for placed in hidden {
                self.loaded(placed, visit, &frames, &loads, &mut bent);
            }
        }
        let mut at = moved(&bent.world) * self.base * moved(&bent.base);
        for (j, link) in self.built.links.iter().enumerate() {
            if link.proximal {
                at *= link.before(bent.growth[j]);
            }
            at *= link.motion(visit.q[j] + bent.joints[j]);
            at *= moved(&bent.bearings[j]);
            at *= link.after(bent.growth[j]);
            at *= moved(&bent.ends[j]);
        }
        at * self.built.tool_pose()
    }

    /// Effects that need no loads.
    fn unloaded(&self, placed: &Placed, visit: &Visit, bent: &mut Deflections) {
        let Placed {
            hidden,
            size,
            shape,
        } = *placed;
        let q = &visit.q;
        let hours = visit.time / 3600.0;
        let warming = visit.temperature - BUILT_AT;
        match hidden {
            Hidden::JointGain { joint } => bent.joints[joint] += size * q[joint],
            Hidden::GearEccentricity { joint, order } | Hidden::GearRipple { joint, order } => {
                bent.joints[joint] += size * libm::sin(f64::from(order) * q[joint] + shape.phase);
            }
            Hidden::JointCurve { joint } => bent.joints[joint] += size * shape.irregular(q[joint]),
            Hidden::Backlash { joint } => bent.joints[joint] += size * visit.direction(joint),
            Hidden::ThermalGrowth { link } => bent.growth[link] += size * warming,
            Hidden::ThermalDrift { joint } => bent.joints[joint] += size * warming,
            Hidden::TimeDrift { joint: Some(joint) } => bent.joints[joint] += size * hours,
            Hidden::TimeDrift { joint: None } => add(&mut bent.world, 0, &shape, size * hours),
            Hidden::WarmUp { joint, constant } => {
                bent.joints[joint] += size * libm::exp(-visit.time / constant);
            }
            Hidden::StepChange { joint, time } => {
                bent.joints[joint] += if visit.time >= time { size } else { 0.0 };
            }
            Hidden::JointCoupling { joint, from } => bent.joints[joint] += size * q[from],
            Hidden::AxisWobble { joint, order } => {
                let (s, c) = libm::sincos(f64::from(order) * q[joint] + shape.phase);
                let [[a, b], [d, e], ..] = shape.curve.map(|pair| pair.map(f64::signum));
                bent.bearings[joint][3] += size * (a * s + 0.3 * b * c);
                bent.bearings[joint][4] += size * (d * c + 0.3 * e * s);
            }
            Hidden::PrismaticStraightness { joint } => {
                let [low, high] = self.built.links[joint].limits;
                let travel = (q[joint] - low) / (high - low);
                for (k, [linear, square]) in shape.curve.iter().take(6).enumerate() {
                    let unit = if k < 3 { 0.1 * size } else { size };
                    bent.bearings[joint][k] +=
                        4.0 * unit * (linear * travel + square * travel * travel);
                }
            }
            Hidden::InstrumentMoved if visit.session > 0 => {
                add(&mut bent.world, 0, &shape, size);
                let [x, y, z] = shape.direction;
                let other = Shape {
                    direction: [y, z, -x],
                    ..shape
                };
                add(&mut bent.world, 3, &other, size);
            }
            Hidden::CablePull { joint } => {
                let count = q.len();
                let wrist = q[count.saturating_sub(3)] * q[count - 1];
                bent.joints[joint] += size * wrist;
            }
            Hidden::RockingBase => {
                let side = if q[0] < 0.0 { -size } else { size };
                let (s, c) = libm::sincos(shape.phase);
                bent.base[3] += side * c;
                bent.base[4] += side * s;
            }
            Hidden::Saturation { joint } => {
                let [[a, b], ..] = shape.curve.map(|pair| pair.map(f64::signum));
                let mixture = a * libm::sin(q[1]) + b * libm::sin(2.0 * q[2] + 0.5);
                bent.joints[joint] += size * libm::tanh(3.0 * mixture);
            }
            Hidden::LocalBump { joint } => {
                let [x, y, _] = shape.direction;
                let at = |k: usize, u: f64| {
                    let [low, high] = self.built.links[k].limits;
                    let width = match self.built.links[k].kind {
                        Kind::Revolute => 0.5,
                        Kind::Prismatic => 0.2 * (high - low),
                    };
                    (q[k] - (0.5 * (low + high) + 0.2 * u * (high - low))) / width
                };
                let (u, v) = (at(1, x), at(2, y));
                bent.joints[joint] += size * libm::exp(-0.5 * (u * u + v * v));
            }
            _ => {}
        }
    }

    /// Effects of gravity.
    fn loaded(
        &self,
        placed: &Placed,
        visit: &Visit,
        frames: &Frames,
        loads: &Loads,
        bent: &mut Deflections,
    ) {
        let Placed {
            hidden,
            size,
            shape,
        } = *placed;
        let torque = |j: usize| self.torque(j, frames, loads);
        match hidden {
            Hidden::JointCompliance { joint: Some(joint) } => {
                bent.joints[joint] += size * torque(joint);
            }
            Hidden::JointCompliance { joint: None } => {
                for (j, [x, _]) in (0..bent.joints.len()).zip(shape.curve) {
                    let share = 1.0 + 0.5 * libm::tanh(5.0 * x);
                    bent.joints[j] += size * share * torque(j);
                }
            }
            Hidden::CrossAxisCompliance { joint } => {
                let moment = axes(&frames.joints[joint]).transpose() * loads.moments[joint];
                bent.bearings[joint][3] += size * moment.x;
                bent.bearings[joint][4] += size * moment.y;
            }
            Hidden::ToolLoad => {
                let tool = origin(&frames.tool);
                for j in 0..bent.joints.len() {
                    let z = axes(&frames.joints[j]).column(2).into_owned();
                    let lever = tool - origin(&frames.joints[j]);
                    bent.joints[j] += match self.built.links[j].kind {
                        Kind::Revolute => size * z.dot(&lever.cross(&loads.gravity)),
                        Kind::Prismatic => 0.0,
                    };
                }
            }
            Hidden::LinkBending { link } => {
                // A round beam from the joint to its far end, or along the far end's x where
                // the two fall together.
                let beam = origin(&frames.ends[link]) - origin(&frames.joints[link]);
                let end = axes(&frames.ends[link]);
                let beam = match beam.norm() {
                    length if length > 0.01 => beam / length,
                    _ => end.column(0).into_owned(),
                };
                let moment = loads.end_moments[link];
                let across = end.transpose() * (moment - beam * beam.dot(&moment));
                for (k, m) in across.iter().enumerate() {
                    bent.ends[link][3 + k] += size * m;
                }
            }
            Hidden::BaseFlex => {
                let moment = axes(&self.base).transpose() * loads.overturning;
                let share = 1.0 + 0.5 * shape.direction[0];
                bent.base[3] += size * share * moment.x;
                bent.base[4] += size * (2.0 - share) * moment.y;
            }
            Hidden::StickSlip { joint } => {
                let t = torque(joint);
                let friction = 0.3 * self.torque_scale[joint];
                bent.joints[joint] += size * (t.abs() - friction).max(0.0).copysign(t);
            }
            Hidden::LoadedBacklash { joint } => {
                let load = torque(joint).abs() / self.torque_scale[joint];
                bent.joints[joint] += size * visit.direction(joint) * libm::sqrt(load);
            }
            _ => {}
        }
    }
}

/// True where [`Body::loaded`] has something to say.
fn is_load(hidden: &Hidden) -> bool {
    matches!(
        hidden,
        Hidden::JointCompliance { .. }
            | Hidden::CrossAxisCompliance { .. }
            | Hidden::ToolLoad
            | Hidden::LinkBending { .. }
            | Hidden::BaseFlex
            | Hidden::StickSlip { .. }
            | Hidden::LoadedBacklash { .. }
    )
}

/// What a joint reads when it is read too early, less what it should read: the share of its
/// last move that was still to come, negative.
pub(crate) fn early(hidden: &[Placed], visit: &Visit) -> Vec<f64> {
    let mut missing = vec![0.0; visit.q.len()];
    for placed in hidden {
        if placed.hidden == Hidden::EarlyReading {
            let moves = || visit.q.iter().zip(&visit.previous).map(|(q, p)| q - p);
            let farthest = moves().fold(0.0_f64, |a, b| a.max(b.abs()));
            if farthest > 0.0 {
                for (missing, step) in missing.iter_mut().zip(moves()) {
                    *missing -= placed.size * step / farthest;
                }
            }
        }
    }
    missing
}

/// `size` along the shape's direction, from entry `first` on.
fn add(twist: &mut [f64; 6], first: usize, shape: &Shape, size: f64) {
    for (entry, x) in twist.iter_mut().skip(first).zip(shape.direction) {
        *entry += size * x;
    }
}
