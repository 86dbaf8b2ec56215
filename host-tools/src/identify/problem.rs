//! From a robot description and a measurement file to a problem that can be solved.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use truepose::Pose;
use truepose::effects::Effect;

use super::arm::ArmModel;
use super::held::{Held, Wish};
use super::method::Method;
use super::observation::{Observation, Sigmas};
use super::relation::Relation;
use super::view::{Fixed, View};
use super::{Failure, placement};
use crate::description::Robot;
use crate::measurement::{Dataset, Noise, Row, Set};

/// Noise assumed where the file declares none: a good laser tracker's, a good arm's
/// repeatability when it touches, a good theodolite's.
pub const ASSUMED: Sigmas = Sigmas {
    position: 5e-5,
    orientation: 0.02 * std::f64::consts::PI / 180.0,
    length: 5e-5,
    distance: 5e-5,
    contact: 5e-5,
    bearing: 1e-5,
};

/// Which columns the joints are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joints {
    /// `q1` .. `qN`.
    Readings,
    /// `qcmd1` .. `qcmdN`.
    Commands,
}

/// Everything that a fit needs, in SI units.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The drawing; base and tool are first guesses.
    pub drawing: ArmModel,
    /// Rows to fit.
    pub identify: Vec<Observation>,
    /// Rows that no fit sees.
    pub verify: Vec<Observation>,
    /// Noise that the residuals are weighted by.
    pub sigmas: Sigmas,
    /// Placements of the instrument: the numbers in the column `session`, in rising order.
    pub sessions: Vec<i64>,
    /// Fixed points that are touched: the numbers in the column `point`, in rising order. Or
    /// those that are seen from the tool: the numbers of their columns.
    pub points: Vec<i64>,
    /// Fixed planes that are touched: the numbers in the column `plane`, in rising order.
    pub planes: Vec<i64>,
    /// Stations that bearings are taken from.
    pub stations: usize,
    /// Drawn offsets of further targets in the tool frame, m.
    pub target_offsets: Vec<Vector3<f64>>,
    /// The offsets are known, not first guesses: a calibrated tool (MRD 6.2).
    pub targets_known: bool,
    /// Parameters that stay as drawn because a person wants it so.
    pub held: Held,
    /// Effects to identify together with the geometry.
    pub effects: Vec<Effect<'static, f64>>,
    /// How to look for the parameters.
    pub method: Method,
}

impl Problem {
    /// From what was read, `effects` to be identified with the geometry.
    pub fn new(
        robot: &Robot,
        data: &Dataset,
        joints: Joints,
        effects: Vec<Effect<'static, f64>>,
    ) -> Self {
        let rows = Rows::of(data, joints);
        Self {
            drawing: ArmModel::drawn(robot),
            identify: rows.identify,
            verify: rows.verify,
            sigmas: weights(&data.noise),
            sessions: rows.sessions,
            points: rows.points,
            planes: rows.planes,
            stations: rows.stations,
            target_offsets: data
                .target_offsets
                .iter()
                .copied()
                .map(Vector3::from)
                .collect(),
            targets_known: data.targets_known,
            held: Held::default(),
            effects,
            method: Method::default(),
        }
    }

    /// Holds what `wish` does not want identified.
    pub fn hold(&mut self, wish: &Wish) -> Result<(), Failure> {
        let mut arm = self.drawing.clone();
        arm.targets = self.target_offsets.clone();
        let around = placement(&Self {
            held: Held::default(),
            ..self.clone()
        });
        self.held = wish.among(&arm, &around).map_err(Failure::Wish)?;
        Ok(())
    }
}

/// The rows of a file as observations, and what their labels stand for.
pub(crate) struct Rows {
    pub(crate) identify: Vec<Observation>,
    pub(crate) verify: Vec<Observation>,
    pub(crate) sessions: Vec<i64>,
    pub(crate) points: Vec<i64>,
    pub(crate) planes: Vec<i64>,
    pub(crate) stations: usize,
}

impl Rows {
    pub(crate) fn of(data: &Dataset, joints: Joints) -> Self {
        let numbers = places(data.rows.iter().map(|row| row.session.unwrap_or(0)));
        let board = data.has_board();
        let touched = data.rows.iter().filter_map(|row| row.relations.point);
        let points = places(touched.chain(data.rows.iter().flat_map(|row| seen(row, board))));
        let planes = places(data.rows.iter().filter_map(|row| row.relations.plane));
        let labels = Labels {
            points: &points,
            planes: &planes,
            board,
        };
        let (mut identify, mut verify) = (Vec::new(), Vec::new());
        let mut before: Option<&[f64]> = None;
        // rows that wait for the other of their pair
        let mut waiting: BTreeMap<i64, (Observation, Option<f64>)> = BTreeMap::new();
        for row in &data.rows {
            let session = numbers.get(&row.session.unwrap_or(0)).copied().unwrap_or(0);
            let mut observation = observation(row, before, session, joints);
            before = Some(&row.q);
            observation.relations = labels.relations(row);
            if let Some(pair) = row.relations.pair {
                match waiting.remove(&pair) {
                    Some(first) => {
                        let distance = row.relations.distance.or(first.1);
                        if let Some(distance) = distance {
                            observation.relations.push(Relation::Distance {
                                to: Box::new(first.0),
                                distance,
                            });
                        }
                    }
                    None => {
                        let posture = Observation {
                            position: None,
                            rotation: None,
                            targets: Vec::new(),
                            length: None,
                            relations: Vec::new(),
                            ..observation.clone()
                        };
                        waiting.insert(pair, (posture, row.relations.distance));
                    }
                }
            }
            if observation.equations() == 0 && row.relations.pair.is_some() {
                continue;
            }
            match row.set {
                Set::Identify => identify.push(observation),
                Set::Verify => verify.push(observation),
            }
        }
        Self {
            identify,
            verify,
            sessions: numbers.into_keys().collect(),
            points: points.into_keys().collect(),
            planes: planes.into_keys().collect(),
            stations: data
                .rows
                .iter()
                .map(|row| row.relations.bearings.len())
                .max()
                .unwrap_or(0),
        }
    }
}

/// Noise as declared, as assumed where it is not.
pub fn weights(declared: &Noise) -> Sigmas {
    Sigmas {
        position: declared.position.unwrap_or(ASSUMED.position),
        orientation: declared.orientation.unwrap_or(ASSUMED.orientation),
        length: declared.length.unwrap_or(ASSUMED.length),
        distance: declared.distance.unwrap_or(ASSUMED.distance),
        contact: declared.contact.unwrap_or(ASSUMED.contact),
        bearing: declared.bearing.unwrap_or(ASSUMED.bearing),
    }
}

/// Distinct numbers in rising order, each with its place.
fn places(numbers: impl Iterator<Item = i64>) -> BTreeMap<i64, usize> {
    let mut places: BTreeMap<i64, usize> = numbers.map(|n| (n, 0)).collect();
    for (index, place) in places.values_mut().enumerate() {
        *place = index;
    }
    places
}

/// Numbers of the fixed points that a row sees from the tool; the first thing of a table with a
/// `board` is that.
fn seen(row: &Row, board: bool) -> impl Iterator<Item = i64> {
    let things = (1..).zip(&row.relations.seen).skip(usize::from(board));
    things
        .filter(|(_, seen)| seen.position.is_some() || seen.bearing.is_some())
        .map(|(number, _)| number)
}

/// What turns labels of the file into places.
struct Labels<'a> {
    points: &'a BTreeMap<i64, usize>,
    planes: &'a BTreeMap<i64, usize>,
    /// The first thing that is seen from the tool is a board.
    board: bool,
}

impl Labels<'_> {
    /// Of one row, distances aside.
    fn relations(&self, row: &Row) -> Vec<Relation> {
        let r = &row.relations;
        let mut relations = Vec::new();
        if let Some(&point) = r.point.and_then(|n| self.points.get(&n)) {
            relations.push(Relation::Point { point });
        }
        if let Some(&plane) = r.plane.and_then(|n| self.planes.get(&n)) {
            relations.push(Relation::Plane { plane });
        }
        for (station, bearing) in r.bearings.iter().enumerate() {
            if let Some([azimuth, elevation]) = *bearing {
                relations.push(Relation::Bearing {
                    station,
                    azimuth,
                    elevation,
                });
            }
        }
        self.views(row, &mut relations);
        relations
    }

    /// What an instrument on the tool sees in one row.
    fn views(&self, row: &Row, relations: &mut Vec<Relation>) {
        for (number, seen) in (1..).zip(&row.relations.seen) {
            let of = match self.points.get(&number) {
                _ if self.board && number == 1 => Fixed::Board,
                Some(&point) => Fixed::Point(point),
                None => continue,
            };
            let at = seen.position.map(Vector3::from);
            relations.extend(at.map(|at| Relation::View(View::At { of, at })));
            let sight = |[azimuth, elevation]: [f64; 2]| View::Sight {
                of,
                azimuth,
                elevation,
            };
            relations.extend(seen.bearing.map(sight).map(Relation::View));
        }
        let turn = row.relations.seen_turn;
        let turn = turn.and_then(|wxyz| Pose::from_quaternion(wxyz, Vector3::zeros()));
        relations.extend(turn.map(|pose| {
            let rotation = pose.rotation;
            Relation::View(View::Turn { rotation })
        }));
    }
}

fn observation(row: &Row, before: Option<&[f64]>, session: usize, joints: Joints) -> Observation {
    let q = match (joints, &row.q_command) {
        (Joints::Commands, Some(q)) => q.clone(),
        _ => row.q.clone(),
    };
    Observation {
        row: row.number,
        q,
        direction: row.direction.clone(),
        travel: travel(&row.q, before),
        ambient: row.ambient(),
        session,
        position: row.position.map(Vector3::from),
        rotation: row.pose().map(|p| p.rotation),
        targets: row.targets.iter().map(|t| t.map(Vector3::from)).collect(),
        length: row.length,
        ..Observation::default()
    }
}

/// Share of every joint in the move from `before` to `q`.
fn travel(q: &[f64], before: Option<&[f64]>) -> Vec<f64> {
    let moves: Vec<f64> = match before {
        Some(before) => q.iter().zip(before).map(|(a, b)| a - b).collect(),
        None => vec![0.0; q.len()],
    };
    let farthest = moves.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if farthest > 0.0 {
        moves.iter().map(|x| x / farthest).collect()
    } else {
        moves
    }
}
