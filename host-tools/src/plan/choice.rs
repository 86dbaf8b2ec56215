//! What is free in a measurement that is planned, and what of it the arm has to meet.
//!
//! A choice is a row of numbers within limits: the readings of the joints; for a distance
//! those of both postures; for a touch, where there are several points and planes, the number
//! of the one that is touched, rounded down. A choice of a touch is *brought* to it.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::identify::arm::ArmModel;
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::relation::Relation;
use crate::random::Random;

/// What is going to be measured at each pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The tool point.
    Position,
    /// The tool's full pose.
    Pose,
    /// The length of a wire to the tool point.
    Length,
    /// Bearings of the tool point from every station.
    Bearing,
    /// The distance to the tool point at another pose: poses come in pairs.
    Distance,
    /// A fixed point or plane that the tool point touches.
    Touch,
}

/// A touch is met when the tool point is this near, m.
const MET: f64 = 1e-9;
/// Steps after which it is not met.
const STEPS: usize = 40;
/// How a measurement is chosen.
#[derive(Clone, Debug)]
pub struct Choice {
    seen: Seen,
    joints: usize,
    limits: Vec<[f64; 2]>,
    /// Points, then planes.
    touched: Vec<Relation>,
}

impl Choice {
    /// `limits`: lower and upper end of every joint of `arm`, rad or m.
    pub fn new(arm: &ArmModel, seen: Seen, limits: &[[f64; 2]]) -> Self {
        let points = (0..arm.points.len()).map(|point| Relation::Point { point });
        let planes = (0..arm.planes.len()).map(|plane| Relation::Plane { plane });
        let touched: Vec<Relation> = match seen {
            Seen::Touch => points.chain(planes).collect(),
            _ => Vec::new(),
        };
        let mut all = limits.to_vec();
        match seen {
            Seen::Distance => all.extend(limits),
            Seen::Touch if touched.len() > 1 => all.push([0.0, touched.len() as f64]),
            _ => {}
        }
        Self {
            seen,
            joints: limits.len(),
            limits: all,
            touched,
        }
    }

    /// Lower and upper end of every number.
    pub fn limits(&self) -> &[[f64; 2]] {
        &self.limits
    }

    /// The readings, one set a posture.
    pub fn readings<'c>(&self, choice: &'c [f64]) -> Vec<&'c [f64]> {
        let postures = if self.seen == Seen::Distance { 2 } else { 1 };
        choice.chunks(self.joints.max(1)).take(postures).collect()
    }

    /// What is touched: the relation, a [`Relation::Point`] or [`Relation::Plane`].
    pub fn touched(&self, choice: &[f64]) -> Option<&Relation> {
        let number = choice.get(self.joints).map_or(0.0, |x| x.max(0.0));
        let last = self.touched.len().checked_sub(1)?;
        self.touched.get((number as usize).min(last))
    }

    /// The choice that a measured row was; `None` for a row of another kind.
    pub fn of(&self, o: &Observation) -> Option<Vec<f64>> {
        let mut choice = o.q.clone();
        match self.seen {
            Seen::Distance => choice.extend(&o.postures().nth(1)?.q),
            Seen::Touch if self.touched.len() > 1 => {
                let same = |r: &Relation| match (r, o.relations.first()) {
                    (Relation::Point { point: a }, Some(Relation::Point { point: b }))
                    | (Relation::Plane { plane: a }, Some(Relation::Plane { plane: b })) => a == b,
                    _ => false,
                };
                choice.push(self.touched.iter().position(same)? as f64 + 0.5);
            }
            _ => {}
        }
        Some(choice)
    }

    /// The measurement, under the conditions of `template`.
    pub fn observation(
        &self,
        arm: &ArmModel,
        template: &Observation,
        choice: &[f64],
    ) -> Observation {
        let none = vec![0.0; self.joints];
        let posture = |q: &[f64]| Observation {
            row: 0,
            q: q.to_vec(),
            direction: none.clone(),
            travel: none.clone(),
            ambient: template.ambient,
            session: template.session,
            ..Observation::default()
        };
        let mut readings = self.readings(choice).into_iter();
        let here = posture(readings.next().unwrap_or(&[]));
        let zero = Vector3::zeros();
        let unknown = Some(zero);
        match self.seen {
            Seen::Position => Observation {
                position: unknown,
                targets: vec![unknown; arm.targets.len()],
                ..here
            },
            Seen::Pose => Observation {
                position: unknown,
                rotation: Some(nalgebra::Matrix3::identity()),
                ..here
            },
            Seen::Length => Observation {
                length: Some(0.0),
                ..here
            },
            Seen::Bearing => Observation {
                relations: (0..arm.stations.len())
                    .map(|station| Relation::Bearing {
                        station,
                        azimuth: 0.0,
                        elevation: 0.0,
                    })
                    .collect(),
                ..here
            },
            Seen::Distance => Observation {
                relations: vec![Relation::Distance {
                    to: Box::new(posture(readings.next().unwrap_or(&[]))),
                    distance: 0.0,
                }],
                ..here
            },
            Seen::Touch => Observation {
                relations: self.touched(choice).cloned().into_iter().collect(),
                ..here
            },
        }
    }

    /// Rows of the highest measurement.
    pub fn height(&self, arm: &ArmModel) -> usize {
        match self.seen {
            Seen::Position => 3 + 3 * arm.targets.len(),
            Seen::Pose => 6,
            Seen::Length | Seen::Distance => 1,
            Seen::Bearing => 2 * arm.stations.len(),
            Seen::Touch => {
                let rows = self.touched.iter().map(Relation::equations);
                rows.max().unwrap_or(1)
            }
        }
    }

    /// Moves the readings of a touch, within their limits, until the tool point is there;
    /// false where it does not come there. Damped least-squares steps.
    pub fn bring(&self, arm: &ArmModel, choice: &mut [f64]) -> bool {
        let Some(relation) = self.touched(choice) else {
            return true;
        };
        let mut o = Observation {
            direction: vec![0.0; self.joints],
            travel: vec![0.0; self.joints],
            ..Observation::default()
        };
        let mut evaluator = Evaluator::new(arm, Sigmas::UNIT);
        for _ in 0..STEPS {
            o.q = choice.get(..self.joints).unwrap_or(&[]).to_vec();
            let tool = evaluator.observe(&o);
            // of a touch, where the tool should be less where it is
            let miss = relation.residual(arm, &tool, None);
            let miss = DVector::from_column_slice(&miss[..relation.equations()]);
            if miss.norm() < MET {
                return true;
            }
            let joints = (0..self.joints).map(|j| {
                let [low, high] = self.limits[j];
                // a joint at its limit that would go on is left out by the clamp below
                relation.moved(arm, &tool, None, &evaluator.joint_twist(j)) * (high - low)
            });
            let joints: Vec<Vector3<f64>> = joints.collect();
            let jacobian = DMatrix::from_fn(relation.equations(), self.joints, |i, j| joints[j][i]);
            let mut square = &jacobian * jacobian.transpose();
            for k in 0..square.nrows() {
                square[(k, k)] += 1e-6 + 1e-3 * miss.norm();
            }
            let Some(factor) = square.cholesky() else {
                return false;
            };
            let step = jacobian.tr_mul(&factor.solve(&miss));
            for ((q, &[low, high]), x) in choice.iter_mut().zip(&self.limits).zip(step.iter()) {
                *q = (*q + x * (high - low)).clamp(low, high);
            }
        }
        false
    }

    /// Choices at random; fewer than `count` where hardly any touch is met.
    pub fn draw(&self, arm: &ArmModel, count: usize, random: &mut Random) -> Vec<Vec<f64>> {
        super::brought(&self.limits, count, random, |q| self.bring(arm, q))
    }

    /// The measurements as a table to be filled in: readings, rad or m, and what belongs
    /// together. `points`, `planes`: the labels of those that are touched.
    pub fn table(&self, choices: &[Vec<f64>], points: &[i64], planes: &[i64]) -> String {
        let names = (1..=self.joints).map(|j| format!("q{j}"));
        let mut columns: Vec<String> = names.collect();
        let labels = |r: &Relation| match *r {
            Relation::Point { point } => [points.get(point).copied(), None],
            Relation::Plane { plane } => [None, planes.get(plane).copied()],
            _ => [None, None],
        };
        let touches = |k: usize| self.touched.iter().any(|r| labels(r)[k].is_some());
        let mut used = Vec::new();
        if self.seen == Seen::Distance {
            columns.push("pair".to_owned());
        }
        for (k, name) in ["point", "plane"].into_iter().enumerate() {
            if touches(k) {
                columns.push(name.to_owned());
                used.push(k);
            }
        }
        let mut csv = columns.join(",") + "\n";
        for (number, choice) in choices.iter().enumerate() {
            let touched = self.touched(choice).map_or([None; 2], labels);
            for q in self.readings(choice) {
                let mut cells: Vec<String> = q.iter().map(|x| format!("{x:.9}")).collect();
                if self.seen == Seen::Distance {
                    cells.push((number + 1).to_string());
                }
                for &k in &used {
                    cells.push(touched[k].map_or(String::new(), |label| label.to_string()));
                }
                csv += &(cells.join(",") + "\n");
            }
        }
        csv
    }
}
