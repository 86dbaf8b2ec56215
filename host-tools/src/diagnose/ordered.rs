//! What was found, the most important first.

use super::hypothesis::Hypothesis;
use super::model::Extended;
use super::search::Search;
use super::space::columns;
use crate::identify::Failure;
use crate::identify::arm::ArmModel;

impl Search<'_> {
    /// The same model, its hypotheses in the order in which each explains most beside those
    /// before it, `arm` without any of them. Exchanges and removals leave them in an order that
    /// says how they were found and not what they are worth.
    pub(super) fn ordered(&self, arm: &ArmModel, model: Extended) -> Result<Extended, Failure> {
        let mut left = model.accepted.clone();
        if left.len() < 2 {
            return Ok(model);
        }
        let mut ordered: Vec<Hypothesis> = Vec::with_capacity(left.len());
        while left.len() > 1 {
            let before = self.fit(arm, ordered.clone())?;
            let (_, space) = before.space(&self.observations, self.sigmas);
            let references: Vec<&Hypothesis> = left.iter().collect();
            let columns = columns(&before.arm, &references, &self.observations, self.sigmas);
            let scores = space.scores(&columns);
            let worth = |i: usize| scores[i].gain + 2.0 * left[i].ln_weight;
            // the first of equals stays the first
            let best = (0..left.len())
                .rev()
                .max_by(|&a, &b| worth(a).total_cmp(&worth(b)));
            ordered.push(left.remove(best.unwrap_or(0)));
        }
        ordered.append(&mut left);
        self.fit(&model.arm, ordered)
    }
}
