//! The postures that an observation depends on: its own, and the others of its distances.

use nalgebra::Vector3;
use truepose::Twist;

use super::evaluator::Evaluator;
use super::observation::Observation;

/// One of the postures that an observation's equations depend on.
pub struct Posture<'o> {
    /// Readings and conditions there.
    pub at: &'o Observation,
    /// Elsewhere: the equation, and its derivative by the tool point, over sigma.
    pub(super) far: Option<(usize, Vector3<f64>)>,
}

impl Posture<'_> {
    /// True for the observation's own.
    pub fn is_own(&self) -> bool {
        self.far.is_none()
    }

    /// What a displacement of the tool at this posture (world axes at the tool point) does to
    /// the prediction of the observation, over sigma: into `out` at the observation's own
    /// posture, which comes first, and added to it elsewhere.
    pub fn spread(&self, evaluator: &Evaluator<'_>, twist: &Twist<f64>, out: &mut [f64]) {
        match self.far {
            None => evaluator.spread(self.at, twist, out),
            Some((equation, gradient)) => {
                if let Some(out) = out.get_mut(equation) {
                    *out += gradient.dot(&twist.linear);
                }
            }
        }
    }
}
