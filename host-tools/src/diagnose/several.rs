//! Several functions of one joint's reading that stand for its curve.

use super::addition::{UNSEEN, is_of_reading};
use super::hypothesis::Hypothesis;
use super::model::Extended;
use super::search::Search;
use super::space::columns;
use super::validate::{Blocks, HeldBack};

impl Search<'_> {
    /// Logarithm of the chance of accepted curve `index`, all curves considered, by its likelihood
    /// over that of none.
    pub(super) fn curve_by_chance(&self, model: &Extended, index: usize) -> Option<f64> {
        let mut others = model.accepted.clone();
        let curve = others.remove(index);
        let without = self.fit(&model.arm, others).ok()?;
        let (linear, space) = without.space(&self.observations, self.sigmas);
        let found = self.smoothed(&without, &curve, &linear, &space)?;
        Some((-found.worth - curve.ln_weight).min(0.0))
    }

    /// The model with one curve of a joint in place of two or more functions of its reading,
    /// where it predicts rows held back at random better than they do. A curve has one name and
    /// goes to zero where nothing was measured; a list of orders goes wild there.
    pub(super) fn curve_for_several(&self, model: &Extended) -> Option<Extended> {
        (0..model.arm.joint_count()).find_map(|joint| {
            let is_one = |h: &&Hypothesis| h.joint == Some(joint) && is_of_reading(h);
            let several: Vec<&Hypothesis> = model.accepted.iter().filter(is_one).collect();
            if several.len() < 2 {
                return None;
            }
            let others = model.accepted.iter().filter(|h| !is_one(h)).cloned();
            let mut others: Vec<Hypothesis> = others.collect();
            let without = self.fit(&model.arm, others.clone()).ok()?;
            let (linear, space) = without.space(&self.observations, self.sigmas);
            let found = self.smoothed(&without, several[0], &linear, &space)?;
            let [at_random, in_time, in_space] = self.held_back_from(&found, &linear);
            let extra = columns(&without.arm, &several, &self.observations, self.sigmas).matrix;
            let fold = &self.folds[0][Blocks::Random as usize];
            let rows = &self.observations;
            let held_back = HeldBack::new(rows, fold, &linear.jacobian, &extra, &space.residual);
            let several = held_back.compare(0..extra.ncols(), None).with;
            let more = at_random.with.iter().sum::<f64>() < several.iter().sum();
            if !more || in_time.ratio() >= 1.0 || in_space.t() <= UNSEEN {
                return None;
            }
            others.push(found.curve);
            self.fit(&model.arm, others).ok()
        })
    }
}
