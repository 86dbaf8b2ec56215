//! What an instrument on the tool sees of fixed things: the pose of a board, points, bearings
//! of points, all in the tool's own frame.
//!
//! The prediction is made there too, so that noise is as the instrument has it: a turn of the
//! tool acts over the distance to what is seen. A board whose pose is seen is the world's own
//! frame, as the first station of bearings is; points are found with the arm.

use nalgebra::{Matrix3, Vector3};
use truepose::{Pose, Twist};

use super::arm::ArmModel;
use super::observation::{Kind, Observation};
use super::relation::{Around, Relation, bearing, bearing_gradient};

/// Something that does not move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fixed {
    /// The board, [`ArmModel::stations`] 0: its origin.
    Board,
    /// Index in [`ArmModel::points`].
    Point(usize),
}

/// One thing that is seen.
#[derive(Clone, Debug, PartialEq)]
pub enum View {
    /// Where it is in the tool's frame.
    At {
        /// What.
        of: Fixed,
        /// m.
        at: Vector3<f64>,
    },
    /// How the board is turned in the tool's frame.
    Turn {
        /// Board to tool.
        rotation: Matrix3<f64>,
    },
    /// Its direction in the tool's frame.
    Sight {
        /// What.
        of: Fixed,
        /// From x towards y about z, rad.
        azimuth: f64,
        /// Above the x-y plane, rad.
        elevation: f64,
    },
}

impl Fixed {
    /// Where it is in the world, m.
    fn place(self, arm: &ArmModel) -> Option<Vector3<f64>> {
        match self {
            Self::Board => arm.stations.first().map(|board| board.translation),
            Self::Point(k) => arm.points.get(k).copied(),
        }
    }

    /// d place / d an unknown of the surroundings; `None` where it is not its own.
    fn moved(self, of: Around) -> Option<Vector3<f64>> {
        match (self, of) {
            (Self::Board, Around::Station(0, axis)) if axis < 3 => Some(Vector3::ith(axis, 1.0)),
            (Self::Point(k), Around::Point(point, axis)) if k == point => {
                Some(Vector3::ith(axis, 1.0))
            }
            _ => None,
        }
    }
}

impl View {
    /// Scalar equations.
    pub fn equations(&self) -> usize {
        match self {
            Self::At { .. } | Self::Turn { .. } => 3,
            Self::Sight { .. } => 2,
        }
    }

    /// What its equations are of.
    pub fn kind(&self) -> Kind {
        match self {
            Self::At { .. } => Kind::Position,
            Self::Turn { .. } => Kind::Orientation,
            Self::Sight { .. } => Kind::Bearing,
        }
    }

    /// Index of the fixed point that is seen.
    pub(super) fn point(&self) -> Option<usize> {
        match *self {
            Self::At {
                of: Fixed::Point(k),
                ..
            }
            | Self::Sight {
                of: Fixed::Point(k),
                ..
            } => Some(k),
            _ => None,
        }
    }

    /// The fixed thing in the world, less the tool point, m; zero where there is none such.
    fn line(&self, arm: &ArmModel, tool: &Pose<f64>) -> Vector3<f64> {
        let place = match self {
            Self::At { of, .. } | Self::Sight { of, .. } => of.place(arm),
            Self::Turn { .. } => None,
        };
        place.map_or_else(Vector3::zeros, |place| place - tool.translation)
    }

    /// Measured minus predicted, tool axes.
    pub(super) fn residual(&self, arm: &ArmModel, tool: &Pose<f64>) -> [f64; 3] {
        let seen = tool.rotation.tr_mul(&self.line(arm, tool));
        match self {
            Self::At { at, .. } => (at - seen).into(),
            Self::Turn { rotation } => {
                let Some(board) = arm.stations.first() else {
                    return [0.0; 3];
                };
                let predicted = tool.rotation.tr_mul(&board.rotation);
                let turn = Pose::new(rotation * predicted.transpose(), Vector3::zeros());
                turn.rotation_vector().into()
            }
            Self::Sight {
                azimuth, elevation, ..
            } => {
                let [a, e] = bearing(&Pose::identity(), &seen);
                let turn = std::f64::consts::TAU;
                let off = azimuth - a;
                [off - turn * (off / turn).round(), elevation - e, 0.0]
            }
        }
    }

    /// How the prediction moves with the fixed thing in the world.
    fn slope(&self, arm: &ArmModel, tool: &Pose<f64>) -> Matrix3<f64> {
        let into = tool.rotation.transpose();
        match self {
            Self::At { .. } | Self::Turn { .. } => into,
            Self::Sight { .. } => {
                let seen = into * self.line(arm, tool);
                bearing_gradient(&Pose::identity(), &seen) * into
            }
        }
    }

    /// What a displacement of the tool (world axes at the tool point) does to the prediction.
    /// Turns at a residual of zero.
    pub(super) fn moved(
        &self,
        arm: &ArmModel,
        tool: &Pose<f64>,
        twist: &Twist<f64>,
    ) -> Vector3<f64> {
        let by = match self {
            Self::Turn { .. } => twist.angular,
            _ => twist.at(&self.line(arm, tool)).linear,
        };
        self.slope(arm, tool) * -by
    }

    /// d predicted / d an unknown of the surroundings.
    pub(super) fn partial(&self, arm: &ArmModel, tool: &Pose<f64>, of: Around) -> Vector3<f64> {
        let moved = match (self, of) {
            (Self::Turn { .. }, Around::Station(0, axis)) if axis >= 3 => {
                Some(Vector3::ith(axis - 3, 1.0))
            }
            (Self::Turn { .. }, _) => None,
            (Self::At { of: thing, .. } | Self::Sight { of: thing, .. }, _) => thing.moved(of),
        };
        moved.map_or_else(Vector3::zeros, |moved| self.slope(arm, tool) * moved)
    }

    /// How far across the line of sight an equation of a bearing reaches, m; one for all else.
    pub(super) fn way(&self, arm: &ArmModel, tool: &Pose<f64>) -> [f64; 3] {
        match self {
            Self::Sight { .. } => {
                let seen = tool.rotation.tr_mul(&self.line(arm, tool));
                [seen.x.hypot(seen.y), seen.norm(), 0.0]
            }
            _ => [1.0; 3],
        }
    }

    /// Distance of what a bearing is of, m; one for all else.
    pub(super) fn range(&self, arm: &ArmModel, tool: &Pose<f64>) -> f64 {
        match self {
            Self::Sight { .. } => self.line(arm, tool).norm(),
            _ => 1.0,
        }
    }
}

/// Pose of the board in the tool's frame, where a row has all of it.
pub(crate) fn board(o: &Observation) -> Option<Pose<f64>> {
    let (mut place, mut turn) = (None, None);
    for relation in &o.relations {
        match relation {
            Relation::View(View::At {
                of: Fixed::Board,
                at,
            }) => place = Some(*at),
            Relation::View(View::Turn { rotation }) => turn = Some(*rotation),
            _ => {}
        }
    }
    Some(Pose::new(turn?, place?))
}

/// Where a fixed point is, from all that was seen of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Sightings {
    /// Sum of where it was seen, and how often.
    places: (Vector3<f64>, usize),
    /// Normal equations of the point nearest to all lines of sight.
    normal: Matrix3<f64>,
    right: Vector3<f64>,
}

impl Sightings {
    /// Adds what was seen with the tool at `tool`.
    pub(super) fn add(&mut self, view: &View, tool: &Pose<f64>) {
        match *view {
            View::At { at, .. } => {
                self.places.0 += tool.point(&at);
                self.places.1 += 1;
            }
            View::Sight {
                azimuth, elevation, ..
            } => {
                let ((sa, ca), (se, ce)) = (azimuth.sin_cos(), elevation.sin_cos());
                let along = tool.rotation * Vector3::new(ca * ce, sa * ce, se);
                let across = Matrix3::identity() - along * along.transpose();
                self.normal += across;
                self.right += across * tool.translation;
            }
            View::Turn { .. } => {}
        }
    }

    /// Their mean, or the point nearest to the lines; the origin where they do not meet.
    pub(super) fn place(&self) -> Vector3<f64> {
        match self.places {
            (sum, count) if count > 0 => sum / count as f64,
            _ => {
                let inverse = self.normal.try_inverse();
                inverse.map_or_else(Vector3::zeros, |inverse| inverse * self.right)
            }
        }
    }
}

/// The turns that take a cube to itself, the identity first: first guesses of how an
/// instrument may be mounted.
pub(super) fn quarter_turns() -> Vec<Matrix3<f64>> {
    let axes = || (0..6).map(|k| Vector3::<f64>::ith(k % 3, if k < 3 { 1.0 } else { -1.0 }));
    let mut turns = Vec::new();
    for x in axes() {
        for y in axes().filter(|y| x.dot(y).abs() < 0.5) {
            turns.push(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        }
    }
    turns
}
