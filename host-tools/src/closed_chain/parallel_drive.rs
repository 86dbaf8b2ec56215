//! The redundant parallel-drive shoulder, NH 3.2: a plate turns about a fixed point O, four
//! actuators push it, and their four lengths are one more than its freedoms.
//!
//! Actuators 1 and 2 end in B1, 3 and 4 in B2. B1 is where three spheres meet: about A1 and A2
//! with the actuators' lengths, about O with the plate's. So is B2, and the plate keeps the two
//! at their distance: that is the loop. The paper gives no dimensions; these are ours, of the
//! size that its offsets and gains speak of.

use nalgebra::{Matrix3, Vector3};
use truepose::Pose;

use super::{Closure, Loop};
use crate::random::Random;

/// The mechanism, m, O at the origin. Its geometry is known, gains and offsets are not.
#[derive(Clone, Debug, PartialEq)]
pub struct ParallelDrive {
    /// Fixed ends of the actuators.
    pub anchors: [Vector3<f64>; 4],
    /// B1 and B2 with the plate at rest.
    pub plate: [Vector3<f64>; 2],
    /// Noise of a sensor, V.
    pub sigma: f64,
}

/// How far the plate turns from rest about any axis, rad.
const TURN: f64 = 0.45;

impl ParallelDrive {
    /// With a noise of `sigma`, V.
    pub fn new(sigma: f64) -> Self {
        let plate = [Vector3::new(0.06, 0.0, 0.0), Vector3::new(0.0, 0.06, 0.0)];
        // Across the plate's arms: where those turn by a right angle the lengths say nothing.
        let anchor = |p: [f64; 3]| Vector3::from(p);
        Self {
            anchors: [
                anchor([0.0, -0.075, -0.02]),
                anchor([0.0, 0.02, -0.075]),
                anchor([-0.075, 0.0, -0.02]),
                anchor([0.02, 0.0, -0.075]),
            ],
            plate,
            sigma,
        }
    }

    /// Gains, m/V, and offsets, m, near those of the paper's table 1, of which it starts from
    /// 3.6 mm/V and 95 mm.
    pub fn built() -> Vec<f64> {
        let mm = [3.664, 3.631, 3.581, 3.670, 97.8, 99.3, 96.2, 100.4];
        mm.iter().map(|x| x * 1e-3).collect()
    }

    /// What the paper starts from.
    pub fn nominal() -> Vec<f64> {
        let mut x = vec![3.6e-3; 4];
        x.extend([95e-3; 4]);
        x
    }

    /// `count` orientations of the plate, read with noise.
    pub fn measure(&self, x: &[f64], count: usize, random: &mut Random) -> Vec<Vec<f64>> {
        (0..count)
            .map(|_| {
                let mut axis = || random.between(-TURN, TURN);
                let turn = Pose::from_rotation_vector(&Vector3::new(axis(), axis(), axis()));
                let ends = self.plate.map(|b| turn.rotation * b);
                (0..4)
                    .map(|i| {
                        let d = (ends[i / 2] - self.anchors[i]).norm();
                        (d - x[4 + i]) / x[i] + self.sigma * random.normal()
                    })
                    .collect()
            })
            .collect()
    }

    /// B1 or B2 (0 or 1) by the lengths of its two actuators, and d B / d of both lengths.
    /// Of the two points where three spheres meet, the one on the side of the plate at rest.
    /// `None` where they do not meet, or touch only, so that lengths say nothing to first order.
    fn end(&self, which: usize, lengths: [f64; 2]) -> Option<(Vector3<f64>, [Vector3<f64>; 2])> {
        let [a, c] = [self.anchors[2 * which], self.anchors[2 * which + 1]];
        let rest = self.plate[which];
        let k = rest.norm_squared();
        // |B - A|^2 = d^2 less |B|^2 = k^2 is linear: A B = (k^2 + |A|^2 - d^2) / 2.
        let normal = a.cross(&c);
        let right = [(a, lengths[0]), (c, lengths[1])]
            .map(|(anchor, d)| (k + anchor.norm_squared() - d * d) / 2.0);
        let plane = Matrix3::from_rows(&[a.transpose(), c.transpose(), normal.transpose()]);
        let foot = plane.try_inverse()? * Vector3::new(right[0], right[1], 0.0);
        let height = k - foot.norm_squared();
        if height <= 1e-12 * k {
            return None;
        }
        let side = normal.dot(&rest).signum() * (height / normal.norm_squared()).sqrt();
        let b = foot + normal * side;
        let slopes = Matrix3::from_rows(&[(b - a).transpose(), (b - c).transpose(), b.transpose()]);
        let inverse = slopes.try_inverse()?;
        let by = |i: usize| inverse.column(i) * lengths[i];
        Some((b, [by(0), by(1)]))
    }
}

impl Loop for ParallelDrive {
    fn parameters(&self) -> Vec<(String, &'static str)> {
        let each = [("s", "m/V"), ("d0", "m")];
        each.iter()
            .flat_map(|(name, unit)| (1..=4).map(move |i| (format!("{name}{i}"), *unit)))
            .collect()
    }

    fn equations(&self) -> usize {
        1
    }

    /// NH 20 and 21.
    fn closure(&self, x: &[f64], v: &[f64]) -> Option<Closure> {
        let d = |i: usize| x[i] * v[i] + x[4 + i];
        let (b1, by1) = self.end(0, [d(0), d(1)])?;
        let (b2, by2) = self.end(1, [d(2), d(3)])?;
        let way = b1 - b2;
        let held = (self.plate[0] - self.plate[1]).norm_squared();
        let by_length = [
            2.0 * way.dot(&by1[0]),
            2.0 * way.dot(&by1[1]),
            -2.0 * way.dot(&by2[0]),
            -2.0 * way.dot(&by2[1]),
        ];
        let gains = by_length.iter().zip(v).map(|(f, v)| f * v);
        let squares = by_length.iter().zip(x).map(|(f, s)| (f * s).powi(2));
        Some(Closure {
            residual: vec![way.norm_squared() - held],
            gradient: gains.chain(by_length).collect(),
            sigma: vec![self.sigma * squares.sum::<f64>().sqrt()],
        })
    }
}
