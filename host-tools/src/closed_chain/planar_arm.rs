//! The planar arm of three links under an instrument, NH 3.1.

use super::{Closure, Loop};
use crate::random::Random;

/// Joint `i` turns by `s_i v_i + theta0_i`; an instrument sees the end point. Readings of a
/// pose: three sensors, V, then x and y, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarArm {
    /// Noise of x and y, m.
    pub sigma: f64,
}

/// Lengths (m), gains (rad/V) and offsets (rad): NH 3.1.1.
const NOMINAL: [f64; 9] = {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6, PI};
    let gain = PI / 20.0;
    [
        2.0, 1.0, 0.5, gain, gain, gain, FRAC_PI_6, FRAC_PI_3, FRAC_PI_2,
    ]
};

/// Largest sensor reading, V.
const LARGEST: f64 = 10.0;

impl PlanarArm {
    /// The parameters of the paper: a, s, theta0, three each.
    pub fn nominal() -> Vec<f64> {
        NOMINAL.to_vec()
    }

    /// End point, m.
    pub fn end(x: &[f64], v: &[f64]) -> [f64; 2] {
        let (mut angle, mut end) = (0.0, [0.0; 2]);
        for i in 0..3 {
            angle += x[3 + i] * v[i] + x[6 + i];
            end[0] += x[i] * angle.cos();
            end[1] += x[i] * angle.sin();
        }
        end
    }

    /// The 343 equally spaced poses of NH 3.1.2, measured with noise.
    pub fn measure(&self, x: &[f64], random: &mut Random) -> Vec<Vec<f64>> {
        let step = |k: usize| -LARGEST + 2.0 * LARGEST * k as f64 / 6.0;
        (0..343)
            .map(|pose| {
                let v = [step(pose / 49), step(pose / 7 % 7), step(pose % 7)];
                let [px, py] = Self::end(x, &v);
                let [nx, ny] = [random.normal(), random.normal()];
                vec![v[0], v[1], v[2], px + self.sigma * nx, py + self.sigma * ny]
            })
            .collect()
    }
}

impl Loop for PlanarArm {
    fn parameters(&self) -> Vec<(String, &'static str)> {
        let each = [("a", "m"), ("s", "rad/V"), ("theta0", "rad")];
        each.iter()
            .flat_map(|(name, unit)| (1..=3).map(move |i| (format!("{name}{i}"), *unit)))
            .collect()
    }

    fn equations(&self) -> usize {
        2
    }

    fn closure(&self, x: &[f64], v: &[f64]) -> Option<Closure> {
        let end = Self::end(x, v);
        let mut gradient = vec![0.0; 18];
        let mut angle = 0.0;
        for i in 0..3 {
            angle += x[3 + i] * v[i] + x[6 + i];
            let (s, c) = angle.sin_cos();
            gradient[i] = c;
            gradient[9 + i] = s;
            // Joint j turns every link from j on.
            for j in 0..=i {
                for (row, moved) in [-x[i] * s, x[i] * c].into_iter().enumerate() {
                    gradient[9 * row + 3 + j] += moved * v[j];
                    gradient[9 * row + 6 + j] += moved;
                }
            }
        }
        Some(Closure {
            residual: vec![end[0] - v[3], end[1] - v[4]],
            gradient,
            sigma: vec![self.sigma; 2],
        })
    }
}
