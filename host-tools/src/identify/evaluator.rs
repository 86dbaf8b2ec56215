//! The forward model at one measured row: its residual, and what moves it.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};
use truepose::effects::{Ambient, Effect, Reading, Stage};
use truepose::jacobian::{AttachedTwist, reading_column};
use truepose::{Frame, Pose, PreparedJoint, Scratch, Twist, forward};

use super::arm::ArmModel;
use super::attached::{At, Attached};
use super::observation::{Kind, Observation, Sigmas};
pub use super::posture::Posture;
use super::relation::{Around, Relation};
use super::unknown::Unknown;

/// How one unknown reaches the measurement.
pub(super) enum Path {
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
    Around(Around),
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

pub(super) fn paths(arm: &ArmModel, unknowns: &[Unknown]) -> Vec<Path> {
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
        Unknown::Point { point, axis } => Path::Around(Around::Point(point, axis)),
        Unknown::Plane { plane, value } => Path::Around(Around::Plane(plane, value)),
        Unknown::Station { station, axis } => Path::Around(Around::Station(station, axis)),
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
    prepared: Vec<PreparedJoint<'a, f64>>,
    readings: Vec<f64>,
    frames: Vec<Frame<f64>>,
    moments: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
    rigid: Pose<f64>,
    pose: Pose<f64>,
    /// Tool point at the other posture of each relation that has one.
    far: Vec<Option<Vector3<f64>>>,
}

impl<'a> Evaluator<'a> {
    /// For `arm` as it is now.
    pub fn new(arm: &'a ArmModel, sigmas: Sigmas) -> Self {
        let n = arm.joint_count();
        Self {
            arm,
            sigmas,
            prepared: vec![PreparedJoint::empty(); n],
            readings: vec![0.0; n],
            frames: vec![Frame::identity(); n],
            moments: vec![Vector3::zeros(); n],
            forces: vec![Vector3::zeros(); n],
            rigid: Pose::identity(),
            pose: Pose::identity(),
            far: Vec::new(),
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
        let view = self.arm.view(session);
        if view.effects.is_empty() {
            let flange = forward(view.base, view.joints, q, &mut self.frames);
            self.rigid = flange.then(view.tool);
            self.pose = self.rigid;
            return self.pose;
        }
        let prediction = view
            .prepare(direction, ambient, &mut self.prepared)
            .predict(
                q,
                &mut Scratch {
                    readings: &mut self.readings,
                    frames: &mut self.frames,
                    moments: &mut self.moments,
                    forces: &mut self.forces,
                },
            );
        self.rigid = prediction.rigid;
        self.pose = prediction.pose();
        self.pose
    }

    /// Moves to an observation, by way of the other postures that it is measured from.
    pub fn observe(&mut self, o: &Observation) -> Pose<f64> {
        self.far.clear();
        for relation in &o.relations {
            let far = match relation {
                Relation::Distance { to, .. } => Some(self.posture(to).translation),
                _ => None,
            };
            self.far.push(far);
        }
        self.posture(o)
    }

    fn posture(&mut self, o: &Observation) -> Pose<f64> {
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
                *out = x * (o.weight / sigma);
            }
        };
        let s = &self.sigmas;
        let p = self.pose.translation;
        if let Some(position) = o.position {
            push(position - p, s.position);
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
            let predicted = (p - self.arm.anchor).norm();
            if let Some(out) = rows.next() {
                *out = (length - predicted) * (o.weight / s.length);
            }
        }
        for (relation, far) in o.relations.iter().zip(&self.far) {
            let scale = o.weight / self.sigmas.of(relation.kind());
            let off = relation.residual(self.arm, &self.pose, far.as_ref());
            for (x, out) in off.iter().take(relation.equations()).zip(rows.by_ref()) {
                *out = x * scale;
            }
        }
    }

    /// How far the tool point moves where an equation changes by one of its unit, m: the
    /// distance across the line of sight for bearings, one for all else.
    pub fn ways(&self, o: &Observation) -> Vec<f64> {
        let mut ways = vec![1.0; related(o)];
        for relation in &o.relations {
            let way = relation.way(self.arm, &self.pose);
            ways.extend(way.iter().take(relation.equations()));
        }
        ways
    }

    /// Distances between what was measured of an observation and where the arm, here, puts
    /// it, m: one a measured point, length or relation. Orientations are none.
    pub fn distances(&self, o: &Observation, mut each: impl FnMut(f64)) {
        let p = self.pose.translation;
        if let Some(position) = o.position {
            each((position - p).norm());
        }
        for (measured, offset) in o.targets.iter().zip(&self.arm.targets) {
            if let Some(measured) = measured {
                each((measured - self.pose.point(offset)).norm());
            }
        }
        if let Some(length) = o.length {
            each((length - (p - self.arm.anchor).norm()).abs());
        }
        for (relation, far) in o.relations.iter().zip(&self.far) {
            if relation.kind() != Kind::Orientation {
                each(relation.error(self.arm, &self.pose, far.as_ref()));
            }
        }
    }

    /// Angles between the orientations that were measured of an observation and those that the
    /// arm, here, predicts, rad.
    pub fn angles(&self, o: &Observation, mut each: impl FnMut(f64)) {
        if let Some(r) = o.rotation {
            let turn = Pose::new(r * self.pose.rotation.transpose(), Vector3::zeros());
            each(turn.rotation_vector().norm());
        }
        for relation in &o.relations {
            if relation.kind() == Kind::Orientation {
                each(relation.error(self.arm, &self.pose, None));
            }
        }
    }

    /// What a displacement of the tool (world axes at the tool point) does to the prediction
    /// of an observation, over sigma, into `out`. The other posture of a distance stays:
    /// [`Posture::spread`] does both.
    #[inline]
    pub fn spread(&self, o: &Observation, twist: &Twist<f64>, out: &mut [f64]) {
        let s = &self.sigmas;
        let mut rest = out;
        let mut push = |v: &Vector3<f64>, sigma: f64| {
            let scale = o.weight / sigma;
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
        if !rest.is_empty() {
            self.spread_further(o, twist, rest);
        }
    }

    /// The same for what is measured beside position and orientation.
    #[inline(never)]
    fn spread_further(&self, o: &Observation, twist: &Twist<f64>, mut rest: &mut [f64]) {
        for (measured, offset) in o.targets.iter().zip(&self.arm.targets) {
            if measured.is_some() {
                let moved = twist.at(&(self.pose.rotation * offset)).linear;
                let scale = o.weight / self.sigmas.position;
                if let Some((three, after)) = std::mem::take(&mut rest).split_first_chunk_mut() {
                    *three = (moved * scale).into();
                    rest = after;
                }
            }
        }
        if o.length.is_some() {
            let d = self.pose.translation - self.arm.anchor;
            if let Some((out, after)) = std::mem::take(&mut rest).split_first_mut() {
                let sigma = self.sigmas.length;
                *out = d.dot(&twist.linear) * o.weight / (d.norm().max(1e-9) * sigma);
                rest = after;
            }
        }
        for (relation, far) in o.relations.iter().zip(&self.far) {
            let moved = relation.moved(self.arm, &self.pose, far.as_ref(), twist);
            let scale = o.weight / self.sigmas.of(relation.kind());
            let count = relation.equations().min(rest.len());
            let (these, after) = std::mem::take(&mut rest).split_at_mut(count);
            for (x, out) in moved.iter().zip(these) {
                *out = x * scale;
            }
            rest = after;
        }
    }

    /// Has `work` done at every posture that the observation's equations depend on: its own
    /// first, then the others of its distances, in the order of [`Observation::postures`]. The
    /// evaluator is at the posture then, and at the observation's own afterwards.
    pub fn each_posture(&mut self, o: &Observation, mut work: impl FnMut(&mut Self, &Posture<'_>)) {
        self.observe(o);
        work(self, &Posture { at: o, far: None });
        self.elsewhere(o, work);
    }

    /// The same at the other postures alone, of the observation last moved to.
    pub(super) fn elsewhere(
        &mut self,
        o: &Observation,
        mut work: impl FnMut(&mut Self, &Posture<'_>),
    ) {
        if self.far.iter().all(Option::is_none) {
            return;
        }
        let here = self.pose.translation;
        let mut at = related(o);
        for (k, relation) in o.relations.iter().enumerate() {
            let far = self.far.get(k).copied().flatten();
            if let (Relation::Distance { to, .. }, Some(far)) = (relation, far) {
                let bar = here - far;
                let scale = o.weight / (self.sigmas.of(relation.kind()) * bar.norm().max(1e-9));
                let gradient = bar * -scale;
                self.posture(to);
                let far = Some((at, gradient));
                work(self, &Posture { at: to, far });
            }
            at += relation.equations();
        }
        self.posture(o);
    }

    /// Predicted tool point in the world, at the posture last moved to, m.
    pub fn tool_point(&self) -> Vector3<f64> {
        self.pose.translation
    }

    /// Predicted tool pose in the world, at the posture last moved to.
    pub fn tool(&self) -> &Pose<f64> {
        &self.pose
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
                    readings: &mut self.readings,
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

    /// Columns of all unknowns that `attached` took in, at the observation last moved to.
    /// `place`: where in `columns` one of them is.
    #[inline]
    pub(super) fn attached(
        &self,
        o: &Observation,
        attached: &Attached,
        columns: &mut [f64],
        place: impl Fn(usize) -> Range<usize>,
    ) {
        let last = self.arm.bases.len() - 1;
        let at = At {
            baked_base: self.arm.baked_base(o.session),
            base: &self.arm.bases[o.session.min(last)].translation,
            frames: &self.frames,
            tool: &self.pose.translation,
        };
        // points that the tool carries beside its own, orientations, and what is seen from the
        // tool follow its turns
        let turns = o.rotation.is_some()
            || !o.targets.is_empty()
            || o.relations.iter().any(Relation::turns);
        attached.twists(&at, turns, |k, twist| {
            self.spread(o, twist, &mut columns[place(k)]);
        });
        attached.second_twists(&at, turns, |k, twist| {
            let column = &mut columns[place(k)];
            let mut more = vec![0.0; column.len()];
            self.spread(o, twist, &mut more);
            for (x, y) in column.iter_mut().zip(&more) {
                *x += y;
            }
        });
    }

    /// Displacement of the tool per unit of an unknown that moves it, at the observation last
    /// moved to; `None` for those that move something else. `effects`: twists of all values
    /// of the arm's effects, one after the other.
    pub(super) fn twist(
        &self,
        o: &Observation,
        path: &Path,
        effects: &[Twist<f64>],
    ) -> Option<Twist<f64>> {
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
            Path::Target { .. } | Path::Anchor { .. } | Path::Around(_) => return None,
        })
    }

    /// Column of an unknown that moves not the tool but what is measured of it.
    pub(super) fn column(&self, o: &Observation, path: &Path, out: &mut [f64]) {
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
                        let v = self.pose.rotation * unit * (o.weight / self.sigmas.position);
                        out[at..at + 3].copy_from_slice(v.as_slice());
                    }
                    at += 3;
                }
            }
            Path::Anchor { unit } => {
                out.fill(0.0);
                if o.length.is_some() {
                    let d = p - self.arm.anchor;
                    let at = related(o).saturating_sub(1);
                    if let Some(out) = out.get_mut(at) {
                        let scale = o.weight / (d.norm().max(1e-9) * self.sigmas.length);
                        *out = -d.dot(unit) * scale;
                    }
                }
            }
            Path::Around(of) => {
                out.fill(0.0);
                let mut at = related(o);
                for relation in &o.relations {
                    let partial = relation.partial(self.arm, &self.pose, *of);
                    let scale = o.weight / self.sigmas.of(relation.kind());
                    let end = at + relation.equations();
                    for (x, out) in partial.iter().zip(&mut out[at..end]) {
                        *out = x * scale;
                    }
                    at = end;
                }
            }
            _ => out.fill(0.0),
        }
    }

    /// Twists of all values of the arm's effects at the observation last moved to.
    pub(super) fn all_effect_twists(&mut self, o: &Observation, out: &mut Vec<Twist<f64>>) {
        out.clear();
        let arm = self.arm;
        for effect in &arm.effects {
            self.effect_twists(o, effect, |_, twist| out.push(twist));
        }
    }
}

/// Equations of an observation before its relations'.
fn related(o: &Observation) -> usize {
    let relations = o.relations.iter().map(Relation::equations);
    o.equations() - relations.sum::<usize>()
}
