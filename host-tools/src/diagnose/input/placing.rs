//! Base and tool from positions, quickly and in spite of bad rows: what every suspicion is
//! judged by.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use truepose::{BakedJoint, Frame, Pose, forward};

use crate::identify::align::{best_fit, nearest_rotation};
use crate::identify::arm::ArmModel;

/// The drawing's kinematics from the robot base to the flange.
pub(super) struct Flanges {
    from_base: Pose<f64>,
    joints: Vec<BakedJoint<f64>>,
    to_flange: Pose<f64>,
}

impl Flanges {
    pub(super) fn new(drawing: &ArmModel) -> Self {
        let view = drawing.view(0);
        let base = drawing
            .bases
            .first()
            .copied()
            .unwrap_or_else(Pose::identity);
        Self {
            from_base: base.inverse().then(view.base),
            joints: view.joints.to_vec(),
            to_flange: view.tool.then(&drawing.tool.inverse()),
        }
    }

    /// Flange in the robot base at readings `q`.
    pub(super) fn at(&self, q: &[f64]) -> Pose<f64> {
        let mut frames = vec![Frame::identity(); self.joints.len()];
        forward(&self.from_base, &self.joints, q, &mut frames).then(&self.to_flange)
    }
}

/// Where base and tool are.
#[derive(Clone, Debug)]
pub(super) struct Placing {
    /// World to robot base.
    pub(super) base: Pose<f64>,
    /// Flange to tool.
    pub(super) tool: Pose<f64>,
    /// Median distance between prediction and measurement, m.
    pub(super) distance: f64,
    /// Median angle, rad; zero where no orientation was measured.
    pub(super) angle: f64,
    /// How the orientations were to be read.
    pub(super) reading: Reading,
}

/// How an orientation may have been written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reading {
    AsWritten,
    Inverse,
    /// `x y z w` in the columns `w x y z`.
    ScalarLast,
    ScalarLastInverse,
}

impl Reading {
    pub(super) const ALL: [Self; 4] = [
        Self::AsWritten,
        Self::Inverse,
        Self::ScalarLast,
        Self::ScalarLastInverse,
    ];

    /// The rotation that is meant.
    pub(super) fn of(self, written: &Matrix3<f64>) -> Matrix3<f64> {
        let reordered = || {
            let [a, b, c, d] = Pose::new(*written, Vector3::zeros()).quaternion();
            Pose::from_quaternion([d, a, b, c], Vector3::zeros()).map_or(*written, |p| p.rotation)
        };
        match self {
            Self::AsWritten => *written,
            Self::Inverse => written.transpose(),
            Self::ScalarLast => reordered(),
            Self::ScalarLastInverse => reordered().transpose(),
        }
    }
}

/// One row as it enters a placing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Flange in the robot base.
    pub(super) flange: Pose<f64>,
    /// Measured tool point, m.
    pub(super) point: Vector3<f64>,
    /// Measured orientation.
    pub(super) rotation: Option<Matrix3<f64>>,
}

/// Lever by which an angle counts as a distance, m.
pub(super) const LEVER: f64 = 0.3;
const ITERATIONS: usize = 12;

impl Placing {
    /// The misfit by which suspicions are compared, m.
    pub(super) fn misfit(&self) -> f64 {
        self.distance + LEVER * self.angle
    }

    /// Where the tool is with the flange at `flange`.
    pub(super) fn predict(&self, flange: &Pose<f64>) -> Pose<f64> {
        self.base.then(flange).then(&self.tool)
    }

    /// Places base and tool; `tool` is the first guess of the tool point in the flange, m.
    /// `None` for fewer than four samples. Iteratively reweighted Gauss-Newton, weights of
    /// Cauchy at the median distance; orientations follow by a weighted mean.
    pub(super) fn find(samples: &[Sample], tool: Vector3<f64>) -> Option<Self> {
        if samples.len() < 4 {
            return None;
        }
        let from: Vec<Vector3<f64>> = samples.iter().map(|s| s.flange.point(&tool)).collect();
        let to: Vec<Vector3<f64>> = samples.iter().map(|s| s.point).collect();
        let mut base = best_fit(&from, &to)?;
        let mut tool = tool;
        let mut distances = vec![0.0; samples.len()];
        let mut median = f64::INFINITY;
        for _ in 0..ITERATIONS {
            for (d, s) in distances.iter_mut().zip(samples) {
                *d = (s.point - base.point(&s.flange.point(&tool))).norm();
            }
            let now = middle(&distances);
            if !now.is_finite() || (median - now).abs() <= 1e-6 * now {
                median = now;
                break;
            }
            median = now;
            let scale = now.max(1e-7);
            let mut normal = SMatrix::<f64, 9, 9>::zeros();
            let mut gradient = SVector::<f64, 9>::zeros();
            for (s, d) in samples.iter().zip(&distances) {
                let weight = 1.0 / (1.0 + (d / scale).powi(2));
                let arm = base.rotation * s.flange.point(&tool);
                let residual = s.point - (base.translation + arm);
                let mut jacobian = SMatrix::<f64, 3, 9>::zeros();
                jacobian
                    .fixed_view_mut::<3, 3>(0, 0)
                    .copy_from(&Matrix3::identity());
                jacobian
                    .fixed_view_mut::<3, 3>(0, 3)
                    .copy_from(&(-arm.cross_matrix()));
                jacobian
                    .fixed_view_mut::<3, 3>(0, 6)
                    .copy_from(&(base.rotation * s.flange.rotation));
                normal += jacobian.tr_mul(&jacobian) * weight;
                gradient += jacobian.tr_mul(&residual) * weight;
            }
            // tool and base are one where the last axes are parallel to the first
            let ridge = 1e-9 * normal.trace();
            let step = (normal + SMatrix::identity() * ridge)
                .cholesky()?
                .solve(&gradient);
            base.translation += step.fixed_rows::<3>(0);
            let turn = Pose::from_rotation_vector(&step.fixed_rows::<3>(3).into_owned());
            base.rotation = turn.rotation * base.rotation;
            tool += step.fixed_rows::<3>(6);
        }
        let mut found = Self {
            base,
            tool: Pose::new(Matrix3::identity(), tool),
            distance: median,
            angle: 0.0,
            reading: Reading::AsWritten,
        };
        let mut best: Option<(f64, Reading, Matrix3<f64>)> = None;
        for reading in Reading::ALL {
            if let Some((angle, turn)) = found.orient(samples, reading)
                && best.as_ref().is_none_or(|b| angle < b.0)
            {
                best = Some((angle, reading, turn));
            }
        }
        if let Some((angle, reading, turn)) = best {
            (found.angle, found.reading) = (angle, reading);
            found.tool.rotation = turn;
        }
        Some(found)
    }

    /// Median angle and tool orientation under one way to read the orientations.
    pub(super) fn orient(
        &self,
        samples: &[Sample],
        reading: Reading,
    ) -> Option<(f64, Matrix3<f64>)> {
        let turns: Vec<Matrix3<f64>> = samples
            .iter()
            .filter_map(|s| {
                let flange = self.base.rotation * s.flange.rotation;
                Some(flange.transpose() * reading.of(&s.rotation?))
            })
            .collect();
        if turns.is_empty() {
            return None;
        }
        let mut weights = vec![1.0; turns.len()];
        let (mut median, mut mean) = (0.0, Matrix3::identity());
        for _ in 0..3 {
            let sum: Matrix3<f64> = turns.iter().zip(&weights).map(|(t, w)| t * *w).sum();
            mean = nearest_rotation(&sum)?;
            let angles: Vec<f64> = turns
                .iter()
                .map(|t| angle(&(mean.transpose() * t)))
                .collect();
            median = middle(&angles);
            for (w, a) in weights.iter_mut().zip(&angles) {
                *w = 1.0 / (1.0 + (a / median.max(1e-9)).powi(2));
            }
        }
        Some((median, mean))
    }
}

/// Angle of a rotation, rad.
pub(super) fn angle(r: &Matrix3<f64>) -> f64 {
    Pose::new(*r, Vector3::zeros()).rotation_vector().norm()
}

/// Upper median; 0 of nothing.
pub(super) fn middle(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let at = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
