//! Measurements that do not give the tool point but bind it: a ball bar between two poses, a
//! fixed point or plane that a probe touches, the bearings of a theodolite, what a camera on the
//! tool sees.
//!
//! Each is one or more equations `predicted(p) = measured` of the tool point p. The prediction
//! depends on the arm and on what stands around it: unknown points, planes and stations, which
//! are identified with the arm.

use nalgebra::{Matrix3, Vector3};
use truepose::{Pose, Twist};

use super::arm::ArmModel;
use super::observation::{Kind, Observation};
use super::view::View;

/// A plane by the height of its points along its steepest axis k over the two others:
/// `p[k] = level + slopes[0] p[k + 1] + slopes[1] p[k + 2]`, axes counted round. The axis
/// along which the first guess is steepest never divides by zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plane {
    /// k, 0 to 2 for x to z of the world.
    pub axis: usize,
    /// m.
    pub level: f64,
    /// m/m.
    pub slopes: [f64; 2],
}

impl Plane {
    /// Through `point` with normal `normal`, which need not be of length one.
    pub fn new(point: &Vector3<f64>, normal: &Vector3<f64>) -> Self {
        let axis = normal.iamax();
        let slope = |i: usize| -normal[(axis + i) % 3] / normal[axis];
        let slopes = [slope(1), slope(2)];
        let along = slopes[0] * point[(axis + 1) % 3] + slopes[1] * point[(axis + 2) % 3];
        Self {
            axis,
            level: point[axis] - along,
            slopes,
        }
    }

    /// Unit normal.
    pub fn normal(&self) -> Vector3<f64> {
        let mut n = Vector3::zeros();
        n[self.axis] = 1.0;
        n[(self.axis + 1) % 3] = -self.slopes[0];
        n[(self.axis + 2) % 3] = -self.slopes[1];
        n.normalize()
    }

    /// Distance of a point, positive on the side of the normal, m.
    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        let n = self.normal();
        n.dot(p) - n[self.axis] * self.level
    }

    /// d distance / d (level, slopes).
    fn partial(&self, p: &Vector3<f64>, k: usize) -> f64 {
        let scale = self.normal()[self.axis];
        match k {
            0 => -scale,
            _ => {
                let i = k - 1;
                let along = p[(self.axis + k) % 3] * scale;
                -along - self.distance(p) * self.slopes[i] * scale * scale
            }
        }
    }
}

/// One such measurement. Deviations are of one equation each.
#[derive(Clone, Debug)]
pub enum Relation {
    /// Distance to where the tool point was at another posture, m.
    Distance {
        /// The other posture; what was measured there does not count here.
        to: Box<Observation>,
        /// m.
        distance: f64,
    },
    /// The tool point is at a fixed point.
    Point {
        /// Index in [`ArmModel::points`].
        point: usize,
    },
    /// The tool point is in a fixed plane.
    Plane {
        /// Index in [`ArmModel::planes`].
        plane: usize,
    },
    /// Direction to the tool point from a station, in the station's frame.
    Bearing {
        /// Index in [`ArmModel::stations`].
        station: usize,
        /// From x towards y about z, rad.
        azimuth: f64,
        /// Above the x-y plane, rad.
        elevation: f64,
    },
    /// What an instrument on the tool sees of something fixed.
    View(View),
}

/// An unknown of what stands around the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Around {
    Point(usize, usize),
    Plane(usize, usize),
    Station(usize, usize),
}

impl Relation {
    /// Scalar equations.
    pub fn equations(&self) -> usize {
        match self {
            Self::Distance { .. } | Self::Plane { .. } => 1,
            Self::Bearing { .. } => 2,
            Self::Point { .. } => 3,
            Self::View(view) => view.equations(),
        }
    }

    /// What its equations are of.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Distance { .. } => Kind::Distance,
            Self::Point { .. } | Self::Plane { .. } => Kind::Contact,
            Self::Bearing { .. } => Kind::Bearing,
            Self::View(view) => view.kind(),
        }
    }

    /// Index of the fixed point that is touched or seen.
    pub fn point(&self) -> Option<usize> {
        match self {
            Self::Point { point } => Some(*point),
            Self::View(view) => view.point(),
            _ => None,
        }
    }

    /// True if a turn of the tool about its point shows.
    pub fn turns(&self) -> bool {
        matches!(self, Self::View(_))
    }

    /// Measured minus predicted, the first [`Self::equations`] of the three. `tool`: where the
    /// tool is here; `far`: the tool point at the other posture of a distance.
    pub fn residual(
        &self,
        arm: &ArmModel,
        tool: &Pose<f64>,
        far: Option<&Vector3<f64>>,
    ) -> [f64; 3] {
        let p = &tool.translation;
        match *self {
            Self::Distance { distance, .. } => {
                let predicted = far.map_or(distance, |far| (p - far).norm());
                [distance - predicted, 0.0, 0.0]
            }
            Self::Point { point, .. } => match arm.points.get(point) {
                Some(fixed) => (fixed - p).into(),
                None => [0.0; 3],
            },
            Self::Plane { plane, .. } => match arm.planes.get(plane) {
                Some(plane) => [-plane.distance(p), 0.0, 0.0],
                None => [0.0; 3],
            },
            Self::Bearing {
                station,
                azimuth,
                elevation,
                ..
            } => match arm.stations.get(station) {
                Some(station) => {
                    let [a, e] = bearing(station, p);
                    let turn = std::f64::consts::TAU;
                    let off = azimuth - a;
                    [off - turn * (off / turn).round(), elevation - e, 0.0]
                }
                None => [0.0; 3],
            },
            Self::View(ref view) => view.residual(arm, tool),
        }
    }

    /// What a displacement of the tool (world axes at the tool point) does to the prediction.
    pub fn moved(
        &self,
        arm: &ArmModel,
        tool: &Pose<f64>,
        far: Option<&Vector3<f64>>,
        twist: &Twist<f64>,
    ) -> Vector3<f64> {
        match self {
            Self::View(view) => view.moved(arm, tool, twist),
            _ => self.gradient(arm, &tool.translation, far) * twist.linear,
        }
    }

    /// d predicted / d p, a row an equation, world axes; of what a view sees, zero.
    fn gradient(
        &self,
        arm: &ArmModel,
        p: &Vector3<f64>,
        far: Option<&Vector3<f64>>,
    ) -> Matrix3<f64> {
        let one = |row: Vector3<f64>| {
            let mut rows = Matrix3::zeros();
            rows.set_row(0, &row.transpose());
            rows
        };
        match *self {
            Self::Distance { .. } => far.map_or_else(Matrix3::zeros, |far| {
                let bar = p - far;
                one(bar / bar.norm().max(1e-9))
            }),
            Self::Point { .. } => Matrix3::identity(),
            Self::Plane { plane, .. } => match arm.planes.get(plane) {
                Some(plane) => one(plane.normal()),
                None => Matrix3::zeros(),
            },
            Self::Bearing { station, .. } => match arm.stations.get(station) {
                Some(station) => bearing_gradient(station, p),
                None => Matrix3::zeros(),
            },
            Self::View(_) => Matrix3::zeros(),
        }
    }

    /// d predicted / d an unknown of the surroundings.
    pub(super) fn partial(&self, arm: &ArmModel, tool: &Pose<f64>, of: Around) -> Vector3<f64> {
        let p = &tool.translation;
        match (self, of) {
            (Self::View(view), _) => view.partial(arm, tool, of),
            (Self::Point { point, .. }, Around::Point(k, axis)) if *point == k => {
                -Vector3::ith(axis, 1.0)
            }
            (Self::Plane { plane, .. }, Around::Plane(k, value)) if *plane == k => {
                let partial = arm.planes.get(k).map_or(0.0, |it| it.partial(p, value));
                Vector3::new(partial, 0.0, 0.0)
            }
            (Self::Bearing { station, .. }, Around::Station(k, axis)) if *station == k => {
                let Some(pose) = arm.stations.get(k) else {
                    return Vector3::zeros();
                };
                // Moving the station is moving the point the other way.
                let moved = match axis {
                    0..3 => -Vector3::ith(axis, 1.0),
                    _ => (p - pose.translation).cross(&Vector3::ith(axis - 3, 1.0)),
                };
                bearing_gradient(pose, p) * moved
            }
            _ => Vector3::zeros(),
        }
    }

    /// How far the tool point moves where an equation changes by one of its unit, m: across
    /// the line of sight for a bearing, one for all else.
    pub(super) fn way(&self, arm: &ArmModel, tool: &Pose<f64>) -> [f64; 3] {
        let station = match self {
            Self::Bearing { station, .. } => station,
            Self::View(view) => return view.way(arm, tool),
            _ => return [1.0; 3],
        };
        let Some(station) = arm.stations.get(*station) else {
            return [0.0; 3];
        };
        let v = tool.translation - station.translation;
        let level = v.dot(&station.rotation.column(2));
        let out = (v.norm_squared() - level * level).max(0.0).sqrt();
        [out, v.norm(), 0.0]
    }

    /// Measured direction to the tool point, of length one, in the frame of `station`; `None`
    /// where the bearing is not from there.
    pub fn sight(&self, station: usize) -> Option<Vector3<f64>> {
        match *self {
            Self::Bearing {
                station: s,
                azimuth,
                elevation,
            } if s == station => {
                let ((sa, ca), (se, ce)) = (azimuth.sin_cos(), elevation.sin_cos());
                Some(Vector3::new(ca * ce, sa * ce, se))
            }
            _ => None,
        }
    }

    /// How far off a bearing sees what it is of, m; one for all else.
    pub fn range(&self, arm: &ArmModel, tool: &Pose<f64>) -> f64 {
        match self {
            Self::Bearing { station, .. } => {
                let from = arm.stations.get(*station);
                from.map_or(1.0, |from| (tool.translation - from.translation).norm())
            }
            Self::View(view) => view.range(arm, tool),
            _ => 1.0,
        }
    }

    /// How far the tool point, or what is seen from it, is from where the measurement has it,
    /// m; across the line of sight for a bearing; an angle, rad, of a board's turn.
    pub fn error(&self, arm: &ArmModel, tool: &Pose<f64>, far: Option<&Vector3<f64>>) -> f64 {
        let off = Vector3::from(self.residual(arm, tool, far));
        off.component_mul(&Vector3::from(self.way(arm, tool)))
            .norm()
    }
}

/// Azimuth and elevation of a point from a station, rad.
pub fn bearing(station: &Pose<f64>, p: &Vector3<f64>) -> [f64; 2] {
    let v = station.rotation.transpose() * (p - station.translation);
    [v.y.atan2(v.x), v.z.atan2(v.x.hypot(v.y))]
}

/// d (azimuth, elevation, -) / d p, world axes. Without bound towards the station's z axis.
pub(super) fn bearing_gradient(station: &Pose<f64>, p: &Vector3<f64>) -> Matrix3<f64> {
    let v = station.rotation.transpose() * (p - station.translation);
    let out = v.x.hypot(v.y).max(1e-9);
    let far = v.norm_squared().max(1e-18);
    let rows = Matrix3::new(
        -v.y / (out * out),
        v.x / (out * out),
        0.0,
        -v.x * v.z / (out * far),
        -v.y * v.z / (out * far),
        out / far,
        0.0,
        0.0,
        0.0,
    );
    rows * station.rotation.transpose()
}
