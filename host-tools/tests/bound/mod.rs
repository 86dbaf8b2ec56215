//! Postures that are measured without giving the tool point: distances between two, touches
//! of points and planes, bearings; and what an instrument on the tool sees.

use nalgebra::{DMatrix, DVector, Vector3};
use truepose::Pose;
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::observation::Observation;
use truepose_host::identify::problem::Problem;
use truepose_host::identify::relation::{Plane, Relation, bearing};
use truepose_host::identify::view::{Fixed, View};
use truepose_host::random::Random;

use crate::synthetic::{SIGMAS, anywhere, built, problem, readings};

/// What the tool point is bound by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Bound {
    Distance,
    Points,
    Planes,
    Bearings,
    /// The tool sees a board's pose.
    Board,
    /// The tool sees where points are.
    Marks,
    /// The tool sees bearings of points.
    Sights,
}

impl Bound {
    pub(crate) const ALL: [Self; 7] = [
        Self::Distance,
        Self::Points,
        Self::Planes,
        Self::Bearings,
        Self::Board,
        Self::Marks,
        Self::Sights,
    ];

    /// The instrument is on the tool.
    pub(crate) fn is_view(self) -> bool {
        matches!(self, Self::Board | Self::Marks | Self::Sights)
    }
}

/// What the tool at `tool` sees of a board that is the world.
pub(crate) fn board(tool: &Pose<f64>, noise: f64, chance: &mut Random) -> [Relation; 2] {
    let mut off = |sigma: f64| Vector3::from([0.0; 3].map(|_| noise * sigma * chance.normal()));
    let seen = tool.inverse();
    let at = seen.translation + off(SIGMAS.position);
    let turn = Pose::from_rotation_vector(&off(SIGMAS.orientation));
    let rotation = turn.rotation * seen.rotation;
    let of = Fixed::Board;
    [View::At { of, at }, View::Turn { rotation }].map(Relation::View)
}

/// At random readings, nothing measured.
pub(crate) fn posture(arm: &ArmModel, random: &mut Random) -> Observation {
    let n = arm.joint_count();
    Observation {
        q: readings(arm, random),
        direction: vec![0.0; n],
        travel: vec![0.0; n],
        ..Observation::default()
    }
}

/// Moves `o` until what `off` says of the tool point is zero: Newton's steps of least size.
fn brought(
    arm: &ArmModel,
    o: &mut Observation,
    off: impl Fn(Vector3<f64>) -> DVector<f64>,
) -> bool {
    let mut evaluator = Evaluator::new(arm, SIGMAS);
    for _ in 0..100 {
        let p = evaluator.observe(o).translation;
        let miss = off(p);
        if miss.norm() < 1e-14 {
            return true;
        }
        let n = arm.joint_count();
        // d miss / d p by differences: the functions here are straight or nearly so
        let h = 1e-6;
        let slope = DMatrix::from_fn(miss.len(), 3, |i, axis| {
            let step = Vector3::ith(axis, h);
            (off(p + step)[i] - off(p - step)[i]) / (2.0 * h)
        });
        let joints = DMatrix::from_fn(3, n, |i, j| evaluator.joint_twist(j).linear[i]);
        let j = slope * joints;
        let Ok(step) = j.svd(true, true).solve(&miss, 1e-6) else {
            return false;
        };
        let step = &step * (0.3 / step.norm().max(0.3));
        o.q.iter_mut().zip(step.iter()).for_each(|(q, d)| *q -= d);
    }
    false
}

/// `rows` postures of `truth`, each bound in one way. `noise`: times [`SIGMAS`].
pub(crate) fn bound(
    truth: &ArmModel,
    by: Bound,
    rows: usize,
    noise: f64,
    seed: u64,
) -> Vec<Observation> {
    let mut random = Random::new(seed, 5);
    let mut chance = Random::new(seed, 6);
    let mut evaluator = Evaluator::new(truth, SIGMAS);
    let mut found = Vec::new();
    while found.len() < rows {
        let mut o = posture(truth, &mut random);
        let index = found.len();
        o.row = index + 1;
        match by {
            Bound::Distance => {
                let to = posture(truth, &mut random);
                let far = evaluator.observe(&to).translation;
                let distance = (evaluator.observe(&o).translation - far).norm();
                let distance = distance + noise * SIGMAS.distance * chance.normal();
                o.relations.push(Relation::Distance {
                    to: Box::new(to),
                    distance,
                });
            }
            Bound::Points => {
                let point = index % truth.points.len();
                let away = [0.0; 3].map(|_| noise * SIGMAS.contact * chance.normal());
                let fixed = truth.points[point] + Vector3::from(away);
                let off = |p: Vector3<f64>| DVector::from_column_slice((p - fixed).as_slice());
                if !brought(truth, &mut o, off) {
                    continue;
                }
                o.relations.push(Relation::Point { point });
            }
            Bound::Planes => {
                let plane = index % truth.planes.len();
                let fixed = truth.planes[plane];
                let away = noise * SIGMAS.contact * chance.normal();
                let off = |p: Vector3<f64>| DVector::from_element(1, fixed.distance(&p) - away);
                if !brought(truth, &mut o, off) {
                    continue;
                }
                o.relations.push(Relation::Plane { plane });
            }
            Bound::Bearings => {
                let p = evaluator.observe(&o).translation;
                for (station, from) in truth.stations.iter().enumerate() {
                    let seen = bearing(from, &p);
                    let [azimuth, elevation] =
                        seen.map(|angle| angle + noise * SIGMAS.bearing * chance.normal());
                    o.relations.push(Relation::Bearing {
                        station,
                        azimuth,
                        elevation,
                    });
                }
            }
            Bound::Board => {
                let tool = evaluator.observe(&o);
                o.relations.extend(board(&tool, noise, &mut chance));
            }
            Bound::Marks => {
                let tool = evaluator.observe(&o);
                for (k, point) in truth.points.iter().enumerate() {
                    let away = [0.0; 3].map(|_| noise * SIGMAS.position * chance.normal());
                    let at = tool.inverse().point(point) + Vector3::from(away);
                    let of = Fixed::Point(k);
                    o.relations.push(Relation::View(View::At { of, at }));
                }
            }
            Bound::Sights => {
                let tool = evaluator.observe(&o);
                for (k, point) in truth.points.iter().enumerate() {
                    let seen = bearing(&tool, point);
                    // the azimuth means little near the zenith
                    if seen[1].abs() > 1.2 {
                        continue;
                    }
                    let [azimuth, elevation] =
                        seen.map(|angle| angle + noise * SIGMAS.bearing * chance.normal());
                    o.relations.push(Relation::View(View::Sight {
                        of: Fixed::Point(k),
                        azimuth,
                        elevation,
                    }));
                }
            }
        }
        found.push(o);
    }
    found
}

/// Where the base, the fixed things and the instruments really are.
pub(crate) fn surrounded(drawing: &ArmModel, by: Bound, seed: u64) -> ArmModel {
    let mut truth = built(drawing, 1e-3, seed);
    if by == Bound::Bearings {
        let far = anywhere(&mut Random::new(seed, 1));
        truth.bases[0] = Pose::new(far.rotation, Vector3::new(3.0, 1.0, -0.4));
        truth.stations = vec![
            Pose::identity(),
            Pose::from_xyz_rpy(Vector3::new(1.0, 4.0, 0.5), Vector3::new(0.02, -0.05, -1.3)),
        ];
    }
    if by == Bound::Board {
        truth.bases[0] = anywhere(&mut Random::new(seed, 1));
    }
    if by.is_view() {
        // mounted otherwise than it is drawn
        let turn = Pose::from_rotation_vector(&Vector3::new(1.1, -0.7, 1.6));
        truth.tool.rotation = turn.rotation * truth.tool.rotation;
    }
    truth.points = vec![
        Vector3::new(0.5, 0.2, 0.3),
        Vector3::new(-0.3, 0.45, 0.1),
        Vector3::new(0.1, -0.5, 0.5),
    ];
    truth.planes = vec![
        Plane::new(&Vector3::new(0.0, 0.0, 0.1), &Vector3::new(0.1, -0.2, 1.0)),
        Plane::new(&Vector3::new(0.4, 0.0, 0.0), &Vector3::new(1.0, 0.2, -0.1)),
        Plane::new(&Vector3::new(0.0, -0.3, 0.0), &Vector3::new(0.2, 1.0, 0.3)),
    ];
    truth.bake();
    truth
}

/// What identification is given of such rows.
pub(crate) fn problem_of(drawing: &ArmModel, by: Bound, identify: Vec<Observation>) -> Problem {
    let count = |is: &[Bound]| {
        if is.contains(&by) {
            (1..=3).collect()
        } else {
            Vec::new()
        }
    };
    Problem {
        points: count(&[Bound::Points, Bound::Marks, Bound::Sights]),
        planes: count(&[Bound::Planes]),
        stations: if by == Bound::Bearings { 2 } else { 0 },
        ..problem(drawing, identify)
    }
}
