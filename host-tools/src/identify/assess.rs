//! How far predictions are from measurements, in the instrument's own terms.

use super::arm::ArmModel;
use super::evaluator::Evaluator;
use super::observation::{Observation, Sigmas};

/// Statistics of a set of distances or angles, SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Root mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
    /// 95 % interval of `rms`, from the scatter of the squares.
    pub rms_interval95: [f64; 2],
    /// Number of values.
    pub count: usize,
}

impl Statistics {
    /// Of `values`; `None` if there are none.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let squares: Vec<f64> = values.iter().map(|x| x * x).collect();
        let mean_square = squares.iter().sum::<f64>() / n;
        let spread = squares
            .iter()
            .map(|x| (x - mean_square).powi(2))
            .sum::<f64>();
        let error = (spread / n.max(2.0) / (n - 1.0).max(1.0)).sqrt();
        let end = |sign: f64| (mean_square + sign * 1.96 * error).max(0.0).sqrt();
        Some(Self {
            rms: mean_square.sqrt(),
            mean: values.iter().sum::<f64>() / n,
            max: values.iter().copied().fold(0.0, f64::max),
            rms_interval95: [end(-1.0), end(1.0)],
            count: values.len(),
        })
    }
}

/// Distances between prediction and measurement of a set of rows.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    /// One a measured point (tool point and further targets), length or relation, m.
    pub distances: Vec<f64>,
    /// One a measured orientation, rad.
    pub angles: Vec<f64>,
}

/// Errors of `arm` on `observations`.
pub fn errors(arm: &ArmModel, observations: &[&Observation]) -> Errors {
    let unit = Sigmas::UNIT;
    let mut evaluator = Evaluator::new(arm, unit);
    let mut errors = Errors::default();
    for o in observations {
        evaluator.observe(o);
        evaluator.distances(o, |d| errors.distances.push(d));
        evaluator.angles(o, |a| errors.angles.push(a));
    }
    errors
}
