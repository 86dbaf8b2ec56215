//! Measurements that bind the tool point without giving it: lengths, distances between poses,
//! touches of points and planes, bearings, what is seen from the tool.
//!
//! A blob does not say where a wire ends, a point or plane is, or a second theodolite stands
//! (where a board is it says: that is the world): that is fitted to the new rows first, for either model on its own. The tool stands where
//! the controller's code puts it, row by row: an arm without joints, with a base for each.

use nalgebra::{Matrix3, Vector3};
use truepose::Pose;

use super::Errors;
use crate::error::{Error, Place};
use crate::identify::align::{guess_around, nearest_rotation, resected};
use crate::identify::arm::ArmModel;
use crate::identify::assess::{Statistics, errors};
use crate::identify::evaluator::Evaluator;
use crate::identify::fit;
use crate::identify::observation::{Kind, Observation, Sigmas};
use crate::identify::prior::Prior;
use crate::identify::problem::{Joints, Rows, weights};
use crate::identify::relation::Relation;
use crate::identify::unknown::Unknown;
use crate::identify::view::board;
use crate::measurement::Dataset;

/// The new rows, and what has to be found before they can be compared.
pub(super) struct Bound {
    observations: Vec<Observation>,
    unknowns: Vec<Unknown>,
    sigmas: Sigmas,
}

/// A thing whose place is unknown.
struct Thing {
    name: String,
    unknowns: Vec<Unknown>,
    /// Equations of one row with it, and rows with it.
    equations: usize,
    rows: usize,
}

impl Bound {
    /// Of a table. With `realign` the first station stands elsewhere too.
    pub(super) fn new(table: &Dataset, realign: bool) -> Result<Self, Error> {
        let rows = Rows::of(table, Joints::Readings);
        let mut observations = rows.identify;
        observations.extend(rows.verify);
        observations.sort_by_key(|o| o.row);
        let (points, planes) = (rows.points, rows.planes);
        let place = |o: &mut Observation| {
            (o.q, o.direction, o.travel) = Default::default();
            o.session = table
                .rows
                .binary_search_by_key(&o.row, |row| row.number)
                .unwrap_or(0);
        };
        for o in &mut observations {
            place(o);
            for relation in &mut o.relations {
                if let Relation::Distance { to, .. } = relation {
                    place(to);
                }
            }
        }
        observations.retain(|o| o.equations() > 0);
        let count = |is: &dyn Fn(&Relation) -> bool| {
            let touches = |o: &&Observation| o.relations.iter().any(is);
            observations.iter().filter(touches).count()
        };
        let sighted = |k: usize| {
            let mut all = observations.iter().flat_map(|o| &o.relations);
            !all.any(|r| r.point() == Some(k) && r.kind() != Kind::Bearing)
        };
        let mut things = Vec::new();
        if realign && table.has_board() {
            things.push(Thing {
                name: "the board".to_owned(),
                unknowns: (0..6)
                    .map(|axis| Unknown::Station { station: 0, axis })
                    .collect(),
                equations: 6,
                rows: observations.iter().filter_map(board).count(),
            });
        }
        let lengths = observations.iter().filter(|o| o.length.is_some()).count();
        if lengths > 0 {
            things.push(Thing {
                name: "the wire's fixed end".to_owned(),
                unknowns: (0..3).map(|axis| Unknown::Anchor { axis }).collect(),
                equations: 1,
                rows: lengths,
            });
        }
        for (k, label) in points.iter().enumerate() {
            things.push(Thing {
                name: format!("point {label}"),
                unknowns: (0..3)
                    .map(|axis| Unknown::Point { point: k, axis })
                    .collect(),
                equations: 3 - usize::from(sighted(k)),
                rows: count(&|r| r.point() == Some(k)),
            });
        }
        for (k, label) in planes.iter().enumerate() {
            things.push(Thing {
                name: format!("plane {label}"),
                unknowns: (0..3)
                    .map(|value| Unknown::Plane { plane: k, value })
                    .collect(),
                equations: 1,
                rows: count(&|r| matches!(r, Relation::Plane { plane } if *plane == k)),
            });
        }
        for k in usize::from(!realign)..rows.stations {
            things.push(Thing {
                name: format!("station {}", k + 1),
                unknowns: (0..6)
                    .map(|axis| Unknown::Station { station: k, axis })
                    .collect(),
                equations: 2,
                rows: count(&|r| matches!(r, Relation::Bearing { station, .. } if *station == k)),
            });
        }
        let place = Place::file(&table.file);
        for thing in &things {
            // one equation more than unknowns; a station's first guess takes six rows
            let enough = match thing.unknowns.first() {
                Some(Unknown::Station { .. }) => 6,
                _ => thing.unknowns.len() / thing.equations + 1,
            };
            if thing.rows < enough {
                return Err(place.bad(
                    format!("{} rows with {}", thing.rows, thing.name),
                    format!("at least {enough}: where it is has to be found from them"),
                    "measure more poses",
                ));
            }
        }
        if observations.is_empty() {
            return Err(place.bad(
                "no measured row",
                "at least one",
                "measure the compensated poses",
            ));
        }
        Ok(Self {
            observations,
            unknowns: things.into_iter().flat_map(|t| t.unknowns).collect(),
            sigmas: weights(&table.noise),
        })
    }

    /// Rows that are compared.
    pub(super) fn rows(&self) -> usize {
        self.observations.len()
    }

    /// True if something was to be found first.
    pub(super) fn is_realigned(&self) -> bool {
        !self.unknowns.is_empty()
    }

    /// Stations by their bearings of where the tool is, a board by where the tool sees it.
    fn guess_stations(&self, arm: &mut ArmModel) {
        let boards = self.observations.iter().filter_map(|o| {
            let base = arm.bases.get(o.session)?;
            Some(base.then(&board(o)?))
        });
        let boards: Vec<Pose<f64>> = boards.collect();
        let is_free = |u: &Unknown| matches!(u, Unknown::Station { station: 0, .. });
        if !boards.is_empty() && self.unknowns.iter().any(is_free) {
            let mean = boards.iter().map(|b| b.translation).sum::<Vector3<f64>>();
            let turns = boards.iter().map(|b| b.rotation).sum::<Matrix3<f64>>();
            if let Some(rotation) = nearest_rotation(&turns) {
                arm.stations[0] = Pose::new(rotation, mean / boards.len() as f64);
            }
        }
        let unknown = |u: &Unknown| match u {
            Unknown::Station { station, axis: 0 } => Some(*station),
            _ => None,
        };
        for station in self.unknowns.iter().filter_map(unknown) {
            let (mut points, mut directions) = (Vec::new(), Vec::new());
            for o in &self.observations {
                let seen = o.relations.iter().filter_map(|r| r.sight(station));
                for direction in seen {
                    points.push(arm.bases[o.session].translation);
                    directions.push(direction);
                }
            }
            if let Some(from_station) = resected(&points, &directions) {
                arm.stations[station] = from_station.inverse();
            }
        }
    }

    /// Errors of a model that puts the tool at `predicted`, one a row of the table.
    pub(super) fn errors(&self, predicted: &[Pose<f64>]) -> Option<Errors> {
        let mut arm = ArmModel::new(
            Pose::identity(),
            Vec::new(),
            Vec::new(),
            Pose::identity(),
            Vector3::zeros(),
        );
        arm.bases = predicted.to_vec();
        arm.bake();
        let rows: Vec<&Observation> = self.observations.iter().collect();
        guess_around(&mut arm, &rows, &vec![Pose::identity(); rows.len()]);
        self.guess_stations(&mut arm);
        let mut fitted = 0;
        if self.is_realigned() {
            let (solved, _) = fit(&mut arm, &self.unknowns, &rows, self.sigmas, Prior::None);
            fitted = solved.unknowns.len();
        }
        let mut evaluator = Evaluator::new(&arm, Sigmas::UNIT);
        let (mut square, mut equations) = (0.0, 0);
        let mut angles = Vec::new();
        // a turn of the tool shows as well, over the distance to what is seen
        let tool_point_alone = !rows.iter().any(|o| o.is_view());
        for o in &rows {
            evaluator.observe(o);
            let mut residual = vec![0.0; o.equations()];
            evaluator.residual(o, &mut residual);
            let ways = evaluator.ways(o);
            // two tool points share the error of a distance
            let postures = o.postures().count() as f64;
            let each = residual.iter().zip(&ways).map(|(r, way)| (r * way).powi(2));
            square += each.sum::<f64>() / postures;
            equations += residual.len();
            for relation in &o.relations {
                if relation.kind() == Kind::Bearing {
                    let across = relation.error(&arm, evaluator.tool(), None);
                    angles.push(across / relation.range(&arm, evaluator.tool()));
                }
            }
        }
        let freedom = equations.saturating_sub(fitted).max(1) as f64;
        let errors = errors(&arm, &rows);
        Some(Errors {
            position: Statistics::of(&errors.distances)?,
            orientation: Statistics::of(&errors.angles),
            bearing: Statistics::of(&angles),
            tool_point: tool_point_alone.then(|| (3.0 * square / freedom).sqrt()),
        })
    }
}
