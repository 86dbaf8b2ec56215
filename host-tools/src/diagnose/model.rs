//! The arm with what has been added to it so far, and its refit.

use truepose::effects::Effect;

use super::hypothesis::{Hypothesis, Members};
use super::space::Space;
use crate::identify::arm::ArmModel;
use crate::identify::linearize::{Linear, linearize};
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::solve::Solved;
use crate::identify::unknown::Unknown;
use crate::identify::{Failure, fit};

/// Geometry and accepted hypotheses, fitted together.
#[derive(Clone)]
pub struct Extended {
    /// The arm as fitted.
    pub arm: ArmModel,
    /// What has been added, in order.
    pub accepted: Vec<Hypothesis>,
    /// The fit.
    pub fit: Solved,
}

impl Extended {
    /// Refits `geometry` and the accepted hypotheses, starting from `arm`.
    pub fn fitted(
        arm: &ArmModel,
        geometry: &[Unknown],
        accepted: Vec<Hypothesis>,
        observations: &[&Observation],
        sigmas: Sigmas,
    ) -> Result<Self, Failure> {
        let mut arm = arm.clone();
        let mut unknowns = geometry.to_vec();
        arm.effects.clear();
        let mut early = false;
        for hypothesis in &accepted {
            match &hypothesis.members {
                Members::EarlyReading => {
                    early = true;
                    unknowns.push(Unknown::EarlyReading);
                }
                Members::Effects(effects) => {
                    for effect in effects {
                        let index = arm.effects.len();
                        let values = effect.model().values().len();
                        unknowns.extend((0..values).map(|value| Unknown::Effect {
                            effect: index,
                            value,
                        }));
                        arm.effects.push(*effect);
                    }
                }
            }
        }
        if !early {
            arm.early_reading = 0.0;
        }
        arm.bake();
        let (fit, _) = fit(&mut arm, &unknowns, observations, sigmas);
        if !fit.converged {
            return Err(Failure::NotConverged);
        }
        let mut extended = Self { arm, accepted, fit };
        extended.take_values();
        Ok(extended)
    }

    /// Copies the fitted effects back into the hypotheses, so that the next fit starts there.
    fn take_values(&mut self) {
        let mut fitted = self.arm.effects.iter();
        for hypothesis in &mut self.accepted {
            if let Members::Effects(effects) = &mut hypothesis.members {
                for effect in effects {
                    if let Some(from) = fitted.next() {
                        *effect = *from;
                    }
                }
            }
        }
    }

    /// Effects of accepted hypothesis `index`, as fitted.
    pub fn effects_of(&self, index: usize) -> &[Effect<'static, f64>] {
        match self.accepted.get(index).map(|h| &h.members) {
            Some(Members::Effects(effects)) => effects,
            _ => &[],
        }
    }

    /// Linearised around the fit.
    pub fn linear(&self, observations: &[&Observation], sigmas: Sigmas) -> Linear {
        let scales: Vec<f64> = self
            .fit
            .unknowns
            .iter()
            .map(|u| u.expected(&self.arm))
            .collect();
        linearize(&self.arm, &self.fit.unknowns, &scales, observations, sigmas)
    }

    /// The problem that is left.
    pub fn space(&self, observations: &[&Observation], sigmas: Sigmas) -> (Linear, Space) {
        let linear = self.linear(observations, sigmas);
        let space = Space::new(&linear, observations);
        (linear, space)
    }
}
