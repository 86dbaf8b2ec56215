//! Residuals and their derivatives, whitened by the instrument's noise.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use truepose::effects::{Ambient, Effect, Reading, Stage};
use truepose::jacobian::{AttachedTwist, reading_column};
use truepose::{Frame, Pose, Scratch, Twist};

use super::arm::ArmModel;
use super::observation::{Observation, Sigmas};
use super::unknown::Unknown;

/// How one unknown reaches the measurement.
enum Path {
    Base {
        session: usize,
        unit: Twist<f64>,
    },
    Attached([Option<AttachedTwist<f64>>; 2]),
    /// The tool, which turns with whatever bends before it.
    Tool(AttachedTwist<f64>),
    Target {
        target: usize,
        unit: Vector3<f64>,
    },
    Anchor {
        unit: Vector3<f64>,
    },
    /// Place among the values of all effects.
    Effect {
        place: usize,
    },
    EarlyReading,
}

fn unit(axis: usize) -> Vector3<f64> {
    let mut v = Vector3::zeros();
    v[axis % 3] = 1.0;
    v
}

fn paths(arm: &ArmModel, unknowns: &[Unknown]) -> Vec<Path> {
    let path = |unknown: &Unknown| match *unknown {
        Unknown::Base { session, axis } => Path::Base {
            session,
            unit: if axis < 3 {
                Twist::new(unit(axis), Vector3::zeros())
            } else {
                Twist::new(Vector3::zeros(), unit(axis))
            },
        },
        Unknown::Tool { axis } => Path::Tool(arm.tool_twist(axis)),
        Unknown::Joint(j, parameter) => Path::Attached(arm.joint_twists(j, parameter)),
        Unknown::Target { target, axis } => Path::Target {
            target,
            unit: unit(axis),
        },
        Unknown::Anchor { axis } => Path::Anchor { unit: unit(axis) },
        Unknown::Effect { effect, value } => {
            let before = arm.effects.iter().take(effect);
            let place = before.map(|e| e.model().values().len()).sum::<usize>() + value;
            Path::Effect { place }
        }
        Unknown::EarlyReading => Path::EarlyReading,
    };
    unknowns.iter().map(path).collect()
}

/// The forward model at one observation, with everything that derivatives need.
pub struct Evaluator<'a> {
    arm: &'a ArmModel,
    sigmas: Sigmas,
    q: Vec<f64>,
    frames: Vec<Frame<f64>>,
    moments: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
    rigid: Pose<f64>,
    pose: Pose<f64>,
}

impl<'a> Evaluator<'a> {
    /// For `arm` as it is now.
    pub fn new(arm: &'a ArmModel, sigmas: Sigmas) -> Self {
        let n = arm.joint_count();
        Self {
            arm,
            sigmas,
            q: vec![0.0; n],
            frames: vec![Frame::identity(); n],
            moments: vec![Vector3::zeros(); n],
            forces: vec![Vector3::zeros(); n],
            rigid: Pose::identity(),
            pose: Pose::identity(),
        }
    }

    /// Moves to readings `q` under the given conditions; returns the predicted tool pose in
    /// the world of `session`.
    pub fn go(
        &mut self,
        session: usize,
        q: &[f64],
        direction: &[f64],
        ambient: &Ambient<f64>,
    ) -> Pose<f64> {
        let prediction = self.arm.view(session).predict(
            q,
            direction,
            ambient,
            &mut Scratch {
                q: &mut self.q,
                frames: &mut self.frames,
                moments: &mut self.moments,
                forces: &mut self.forces,
            },
        );
        self.rigid = prediction.rigid;
        self.pose = prediction.pose();
        self.pose
    }

    /// Moves to an observation.
    pub fn observe(&mut self, o: &Observation) -> Pose<f64> {
        let early = self.arm.early_reading;
        if early.abs() < f64::MIN_POSITIVE && self.arm.curves.is_empty() {
            return self.go(o.session, &o.q, &o.direction, &o.ambient);
        }
        let mut q: Vec<f64> =
            o.q.iter()
                .zip(&o.travel)
                .map(|(q, d)| q + early * d)
                .collect();
        for curve in &self.arm.curves {
            q[curve.joint] += curve.at(o.q[curve.joint]);
        }
        self.go(o.session, &q, &o.direction, &o.ambient)
    }

    /// Displacement of the tool per unit of what the joints lacked when they were read.
    pub fn early_twist(&self, o: &Observation) -> Twist<f64> {
        let each = o.travel.iter().enumerate();
        each.fold(Twist::zero(), |sum, (j, &d)| {
            sum.plus(&self.joint_twist(j).scaled(d))
        })
    }

    /// Measured minus predicted over sigma, into `out` (one entry an equation).
    pub fn residual(&self, o: &Observation, out: &mut [f64]) {
        let mut rows = out.iter_mut();
        let mut push = |v: Vector3<f64>, sigma: f64| {
            for (x, out) in v.iter().zip(rows.by_ref()) {
                *out = x / sigma;
            }
        };
        let s = &self.sigmas;
        if let Some(position) = o.position {
            push(position - self.pose.translation, s.position);
        }
        if let Some(rotation) = o.rotation {
            let turn = Pose::new(rotation * self.pose.rotation.transpose(), Vector3::zeros());
            push(turn.rotation_vector(), s.orientation);
        }
        for (measured, offset) in o.targets.iter().zip(&self.arm.targets) {
            if let Some(measured) = measured {
                push(measured - self.pose.point(offset), s.position);
            }
        }
        if let Some(length) = o.length {
            let predicted = (self.pose.translation - self.arm.anchor).norm();
            if let Some(out) = rows.next() {
                *out = (length - predicted) / s.length;
            }
        }
    }

    /// What a displacement of the tool (world axes at the tool point) does to the prediction
    /// of an observation, over sigma, into `out`.
    pub fn spread(&self, o: &Observation, twist: &Twist<f64>, out: &mut [f64]) {
        let s = &self.sigmas;
        let mut rest = out;
        let mut push = |v: &Vector3<f64>, sigma: f64| {
            let scale = 1.0 / sigma;
            if let Some((three, after)) = std::mem::take(&mut rest).split_first_chunk_mut::<3>() {
                *three = [v.x * scale, v.y * scale, v.z * scale];
                rest = after;
            }
        };
        if o.position.is_some() {
            push(&twist.linear, s.position);
        }
        if o.rotation.is_some() {
            push(&twist.angular, s.orientation);
        }
        for (measured, offset) in o.targets.iter().zip(&self.arm.targets) {
            if measured.is_some() {
                push(&twist.at(&(self.pose.rotation * offset)).linear, s.position);
            }
        }
        if o.length.is_some() {
            let d = self.pose.translation - self.arm.anchor;
            if let Some(out) = rest.first_mut() {
                *out = d.dot(&twist.linear) / (d.norm().max(1e-9) * s.length);
            }
        }
    }

    /// Displacement of the tool per unit of what is added to the reading of joint `j`.
    pub fn joint_twist(&self, j: usize) -> Twist<f64> {
        reading_column(self.arm.baked(), &self.frames, j, &self.pose.translation)
    }

    /// Frame of joint `j`, or of the base: axes and origin in the world, at the observation
    /// last moved to.
    fn place(&self, o: &Observation, j: Option<usize>) -> (Matrix3<f64>, Vector3<f64>) {
        match j.and_then(|j| self.frames.get(j)) {
            Some(frame) => (frame.rotation, frame.origin),
            None => {
                let base = self.arm.baked_base(o.session);
                (base.rotation, base.translation)
            }
        }
    }

    /// A displacement of the tool (world axes at the tool point) as one of the frame of joint
    /// `j`, or of the base: its axes, at its origin.
    pub fn to_place(&self, o: &Observation, j: Option<usize>, twist: &Twist<f64>) -> Twist<f64> {
        let (axes, origin) = self.place(o, j);
        let there = twist.at(&(origin - self.pose.translation));
        Twist::new(axes.tr_mul(&there.linear), axes.tr_mul(&there.angular))
    }

    /// The other way round.
    pub fn from_place(&self, o: &Observation, j: Option<usize>, twist: &Twist<f64>) -> Twist<f64> {
        let (axes, origin) = self.place(o, j);
        Twist::new(axes * twist.linear, axes * twist.angular).at(&(self.pose.translation - origin))
    }

    /// Displacement of the tool per unit of each value of an effect, whether or not it is in
    /// the arm's list, at the observation last moved to.
    pub fn effect_twists(
        &mut self,
        o: &Observation,
        effect: &Effect<'_, f64>,
        mut each: impl FnMut(usize, Twist<f64>),
    ) {
        let model = effect.model();
        let count = model.values().len();
        match model.stage() {
            Stage::Reading => {
                let column = match model.joint() {
                    Some(j) => self.joint_twist(j),
                    None => Twist::zero(),
                };
                let at = Reading {
                    q: &o.q,
                    direction: &o.direction,
                    ambient: &o.ambient,
                };
                for k in 0..count {
                    each(k, column.scaled(model.reading_partial(k, &at)));
                }
            }
            Stage::Posture => {
                let rigid = self.rigid;
                let mut scratch = Scratch {
                    q: &mut self.q,
                    frames: &mut self.frames,
                    moments: &mut self.moments,
                    forces: &mut self.forces,
                };
                self.arm.view(o.session).with_posture(
                    &o.q,
                    &o.direction,
                    &o.ambient,
                    &rigid,
                    &mut scratch,
                    |at| {
                        for k in 0..count {
                            let d = model.posture_partial(k, at);
                            each(k, d.twist.at(&(rigid.translation - d.origin)));
                        }
                    },
                );
            }
        }
    }

    /// Displacement of the tool per unit of an unknown that moves it, at the observation last
    /// moved to; `None` for those that move something else. `effects`: twists of all values
    /// of the arm's effects, one after the other.
    fn twist(&self, o: &Observation, path: &Path, effects: &[Twist<f64>]) -> Option<Twist<f64>> {
        let p = self.pose.translation;
        Some(match path {
            Path::Base { session, unit } if *session == o.session => {
                unit.at(&(p - self.arm.bases[*session].translation))
            }
            Path::Base { .. } => Twist::zero(),
            Path::Attached(twists) => {
                let base = self.arm.baked_base(o.session);
                let mut sum = Twist::zero();
                for twist in twists.iter().flatten() {
                    sum = sum.plus(&twist.column(base, &self.frames, &p));
                }
                sum
            }
            Path::Tool(twist) => {
                let base = self.arm.baked_base(o.session);
                let rigid = twist.column(base, &self.frames, &self.rigid.translation);
                // Whatever bends, bends before the tool, which turns with it.
                let bent = self.pose.rotation * self.rigid.rotation.transpose();
                Twist::new(bent * rigid.linear, bent * rigid.angular)
            }
            Path::Effect { place } => effects.get(*place).copied().unwrap_or_else(Twist::zero),
            Path::EarlyReading => self.early_twist(o),
            Path::Target { .. } | Path::Anchor { .. } => return None,
        })
    }

    /// Column of an unknown that moves not the tool but what is measured of it.
    fn column(&self, o: &Observation, path: &Path, out: &mut [f64]) {
        let p = self.pose.translation;
        match path {
            Path::Target { target, unit } => {
                out.fill(0.0);
                let mut at =
                    3 * usize::from(o.position.is_some()) + 3 * usize::from(o.rotation.is_some());
                for (i, measured) in o.targets.iter().enumerate() {
                    if measured.is_none() {
                        continue;
                    }
                    if i == *target {
                        let v = self.pose.rotation * unit / self.sigmas.position;
                        out[at..at + 3].copy_from_slice(v.as_slice());
                    }
                    at += 3;
                }
            }
            Path::Anchor { unit } => {
                out.fill(0.0);
                if o.length.is_some() {
                    let d = p - self.arm.anchor;
                    if let Some(last) = out.last_mut() {
                        *last = -d.dot(unit) / (d.norm().max(1e-9) * self.sigmas.length);
                    }
                }
            }
            _ => out.fill(0.0),
        }
    }

    /// Twists of all values of the arm's effects at the observation last moved to.
    fn all_effect_twists(&mut self, o: &Observation, out: &mut Vec<Twist<f64>>) {
        out.clear();
        let arm = self.arm;
        for effect in &arm.effects {
            self.effect_twists(o, effect, |_, twist| out.push(twist));
        }
    }
}

/// Whitened residual and identification Jacobian of a set of observations; each column is
/// scaled by what may be expected of its unknown.
pub struct Linear {
    /// Equations x unknowns, over sigma, per expected deviation.
    pub jacobian: DMatrix<f64>,
    /// Measured minus predicted over sigma.
    pub residual: DVector<f64>,
}

/// Linearises the model around the arm as it is. `scales`: unit of each column, in the
/// unknown's own unit.
pub fn linearize(
    arm: &ArmModel,
    unknowns: &[Unknown],
    scales: &[f64],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Linear {
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut jacobian = DMatrix::zeros(rows, unknowns.len());
    let mut residual = DVector::zeros(rows);
    let paths = paths(arm, unknowns);
    let any_effect = paths.iter().any(|p| matches!(p, Path::Effect { .. }));
    let mut effects = Vec::new();
    let mut evaluator = Evaluator::new(arm, sigmas);
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        evaluator.observe(o);
        evaluator.residual(o, &mut residual.as_mut_slice()[start..end]);
        if any_effect {
            evaluator.all_effect_twists(o, &mut effects);
        }
        let columns = jacobian.as_mut_slice().chunks_exact_mut(rows.max(1));
        for ((path, scale), column) in paths.iter().zip(scales).zip(columns) {
            let column = &mut column[start..end];
            match evaluator.twist(o, path, &effects) {
                Some(twist) => evaluator.spread(o, &twist.scaled(*scale), column),
                None => {
                    evaluator.column(o, path, column);
                    for x in column {
                        *x *= scale;
                    }
                }
            }
        }
        start = end;
    }
    Linear { jacobian, residual }
}

/// Whitened residual alone.
pub fn residuals(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> DVector<f64> {
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut residual = DVector::zeros(rows);
    let mut evaluator = Evaluator::new(arm, sigmas);
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        evaluator.observe(o);
        evaluator.residual(o, &mut residual.as_mut_slice()[start..end]);
        start = end;
    }
    residual
}
