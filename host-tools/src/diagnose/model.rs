//! The arm with what has been added to it so far, and its refit.

use truepose::effects::Effect;

use super::curve;
use super::hypothesis::{Hypothesis, Members};
use super::space::Space;
use crate::identify::arm::ArmModel;
use crate::identify::linearize::{Linear, linearize};
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::prior::Prior;
use crate::identify::solve::{Solved, distinguishable};
use crate::identify::unknown::Unknown;
use crate::identify::{Failure, fit};

/// Gauss-Newton steps of curves with everything else; the second is already below the noise.
const CURVE_STEPS: usize = 2;

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
        let before = std::mem::take(&mut arm.curves);
        let mut smoothness = Vec::new();
        for hypothesis in &accepted {
            match &hypothesis.members {
                Members::Curve(smooth) => {
                    let joint = hypothesis.joint.unwrap_or(0);
                    let known = before.iter().find(|c| c.joint == joint).cloned();
                    arm.curves.push(known.unwrap_or_else(|| curve::flat(joint)));
                    smoothness.push(*smooth);
                }
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
        if !arm.curves.is_empty() {
            let kept = distinguishable(&arm, &unknowns, observations, sigmas).kept;
            let kept: Vec<Unknown> = kept.iter().map(|&k| unknowns[k]).collect();
            for _ in 0..CURVE_STEPS {
                if !curve::step(&mut arm, &kept, &smoothness, observations, sigmas) {
                    return Err(Failure::NotConverged(0.0));
                }
            }
        }
        let (fit, _) = fit(&mut arm, &unknowns, observations, sigmas, Prior::Effects);
        if !fit.converged {
            return Err(Failure::NotConverged(fit.variance().sqrt()));
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

    /// Without the hypothesis that came last, everything else left where the fit with it is.
    pub(super) fn without_last(mut self) -> Self {
        let last = self.accepted.len().saturating_sub(1);
        let kept = self.arm.effects.len() - self.effects_of(last).len();
        self.accepted.truncate(last);
        self.arm.effects.truncate(kept);
        self.arm.bake();
        let stays = |u: &Unknown| !matches!(u, Unknown::Effect { effect, .. } if *effect >= kept);
        self.fit.unknowns.retain(stays);
        self
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
