//! Standard errors as a reader wants them, and how sure an effect is.

use nalgebra::{DMatrix, Matrix3, Vector3};
use truepose::Pose;

use super::Stage;
use super::unknown::Unknown;

impl Stage {
    /// Standard error of an unknown in its unit, by the residual's own size; `None` where it
    /// was not identified. Of a turn of base or tool: of its roll, pitch or yaw.
    pub fn sigma(&self, unknown: Unknown) -> Option<f64> {
        let turn = |axis: usize| match unknown {
            Unknown::Base { session, .. } => Unknown::Base { session, axis },
            _ => Unknown::Tool { axis },
        };
        let (pose, axis) = match unknown {
            Unknown::Base { session, axis } if axis >= 3 => (self.arm.bases.get(session)?, axis),
            Unknown::Tool { axis } if axis >= 3 => (&self.arm.tool, axis),
            _ => return self.fit.sigma(unknown),
        };
        let at = |u: Unknown| self.fit.unknowns.iter().position(|&k| k == u);
        at(unknown)?;
        let places: [Option<usize>; 3] = std::array::from_fn(|i| at(turn(3 + i)));
        let covariance = Matrix3::from_fn(|i, j| match (places[i], places[j]) {
            (Some(i), Some(j)) => self.fit.covariance[(i, j)],
            _ => 0.0,
        });
        let row = rpy_per_turn(pose)?.row(axis - 3).into_owned();
        let variance = (row * covariance * row.transpose())[(0, 0)];
        Some((variance * self.fit.variance()).sqrt())
    }

    /// Probability that noise alone would make an effect's values as large (Wald's test:
    /// `vᵀ C⁻¹ v` is chi-square in their number). `None` where none was identified.
    pub fn p_value(&self, effect: usize) -> Option<f64> {
        let mut places = Vec::new();
        let mut values = Vec::new();
        for (k, unknown) in self.fit.unknowns.iter().enumerate() {
            if matches!(unknown, Unknown::Effect { effect: e, .. } if *e == effect) {
                places.push(k);
                values.push(unknown.value(&self.arm));
            }
        }
        if places.is_empty() {
            return None;
        }
        let n = places.len();
        let scale = self.fit.variance();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            scale * self.fit.covariance[(places[i], places[j])]
        });
        let values = nalgebra::DVector::from_vec(values);
        let solved = covariance.cholesky()?.solve(&values);
        Some(chi_square_tail(values.dot(&solved), n))
    }
}

/// d (roll, pitch, yaw) / d (turn about the fixed axes). `None` at pitch = +-pi/2, where roll
/// and yaw are about the same axis.
///
/// The turn is `yaw z + pitch Rz(yaw) y + roll Rz(yaw) Ry(pitch) x`; this is the inverse.
fn rpy_per_turn(pose: &Pose<f64>) -> Option<Matrix3<f64>> {
    let rpy = pose.rpy();
    if rpy.y.cos().abs() < 1e-6 {
        return None;
    }
    let yaw = Pose::rotate_z(rpy.z);
    let pitch = yaw.then(&Pose::rotate_y(rpy.y));
    Matrix3::from_columns(&[
        pitch.rotation * Vector3::x(),
        yaw.rotation * Vector3::y(),
        Vector3::z(),
    ])
    .try_inverse()
}

/// Probability that a chi-square variable of `freedom` degrees exceeds `x`: closed form by
/// the recurrence in steps of two degrees (Abramowitz and Stegun 26.4.4, 26.4.5).
pub(crate) fn chi_square_tail(x: f64, freedom: usize) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return 1.0;
    }
    let half = 0.5 * x;
    let odd = freedom % 2 == 1;
    let (mut tail, mut term) = if odd {
        let first = 2.0 * (half / std::f64::consts::PI).sqrt() * (-half).exp();
        (libm::erfc(half.sqrt()), first)
    } else {
        ((-half).exp(), half * (-half).exp())
    };
    let mut k = if odd { 1 } else { 2 };
    while k < freedom {
        tail += term;
        k += 2;
        term *= x / k as f64;
    }
    tail.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_tails_are_those_of_the_tables() {
        // Upper 5 % points of any table, three decimals printed.
        for (freedom, x) in [
            (1, 3.841),
            (2, 5.991),
            (3, 7.815),
            (4, 9.488),
            (5, 11.070),
            (10, 18.307),
        ] {
            let p = chi_square_tail(x, freedom);
            assert!((p - 0.05).abs() < 2e-5, "{freedom}: {p}");
        }
        assert!(chi_square_tail(0.0, 3) > 0.999);
        assert!(chi_square_tail(1e5, 2) < 1e-300);
    }

    #[test]
    fn roll_pitch_and_yaw_follow_turns_as_differences_say() {
        let pose = Pose::from_xyz_rpy(Vector3::zeros(), Vector3::new(0.4, -0.7, 2.1));
        let analytic = rpy_per_turn(&pose).unwrap();
        for axis in 0..3 {
            let mut turn = Vector3::zeros();
            turn[axis] = 1e-6;
            let at = |sign: f64| {
                let turned = Pose::from_rotation_vector(&(turn * sign));
                Pose::new(turned.rotation * pose.rotation, Vector3::zeros()).rpy()
            };
            let slope = (at(1.0) - at(-1.0)) / 2e-6;
            // central differences of 1e-6: rounding of 1e-10
            assert!((slope - analytic.column(axis)).norm() < 1e-8);
        }
    }
}
