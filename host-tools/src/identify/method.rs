//! How the best parameters are looked for: the estimators of MRD chapter 4 behind one call.
//!
//! On well-posed data with equal weights all of them come to the same parameters; they differ
//! in what they assume, in what else they tell, and in cost (`docs/ESTIMATORS.md`).

use std::str::FromStr;

use super::arm::ArmModel;
use super::factor::Dropped;
use super::golden;
use super::kalman::{self, Innovations};
use super::observation::{Observation, Sigmas};
use super::prior::Prior;
use super::robust::{self, Outlier};
use super::solve::{self, Solved, distinguishable};
use super::unknown::Unknown;

/// An estimator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Linear least squares, linearised anew until the step vanishes; every equation counts
    /// alike, a metre as a radian. MRD 4.44, 4.7.
    LeastSquares,
    /// The same with every equation weighted by the inverse of its noise. MRD 4.71.
    WeightedLeastSquares,
    /// The same with steps shortened where the model is not linear. MRD 4.4.2.
    #[default]
    LevenbergMarquardt,
    /// Linear minimum variance: the drawing is one more measurement. MRD 4.69.
    MinimumVariance,
    /// Row by row, with the drawing as the start and, if asked for, parameters that wander.
    /// MRD 4.104 to 4.112.
    Kalman,
    /// Golden-section searches along one direction after another; no Jacobian. MRD 4.4.1.
    GoldenSection,
}

/// What a large residual costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// Its square. Gross rows are looked for and left out.
    #[default]
    Square,
    /// Huber's: its size beyond 1.345 times the noise.
    Huber,
    /// Tukey's biweight: no more beyond 4.685 times the noise.
    Tukey,
}

/// All estimators by their names on the command line.
pub const ESTIMATORS: [(&str, Estimator); 6] = [
    ("least-squares", Estimator::LeastSquares),
    ("weighted-least-squares", Estimator::WeightedLeastSquares),
    ("levenberg-marquardt", Estimator::LevenbergMarquardt),
    ("minimum-variance", Estimator::MinimumVariance),
    ("kalman", Estimator::Kalman),
    ("golden-section", Estimator::GoldenSection),
];

/// All losses by their names on the command line.
pub const LOSSES: [(&str, Loss); 3] = [
    ("square", Loss::Square),
    ("huber", Loss::Huber),
    ("tukey", Loss::Tukey),
];

fn named<T: Copy>(all: &[(&str, T)], name: &str) -> Result<T, String> {
    let found = all.iter().find(|(n, _)| *n == name);
    found.map(|(_, it)| *it).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(n, _)| *n).collect();
        format!("one of {}", names.join(", "))
    })
}

fn name_of<T: Copy + PartialEq>(all: &[(&'static str, T)], it: T) -> &'static str {
    all.iter().find(|(_, x)| *x == it).map_or("", |(n, _)| n)
}

impl Estimator {
    /// True where the drawing counts as a measurement.
    pub fn uses_prior(self) -> bool {
        matches!(self, Self::MinimumVariance | Self::Kalman)
    }

    /// On the command line and in reports.
    pub fn name(self) -> &'static str {
        name_of(&ESTIMATORS, self)
    }
}

impl Loss {
    /// On the command line and in reports.
    pub fn name(self) -> &'static str {
        name_of(&LOSSES, self)
    }
}

impl FromStr for Estimator {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        named(&ESTIMATORS, name)
    }
}

impl FromStr for Loss {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        named(&LOSSES, name)
    }
}

/// An estimator with what it needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// How.
    pub estimator: Estimator,
    /// What large residuals cost.
    pub loss: Loss,
    /// How far joint parameters may be from the drawing, one standard deviation, m and rad;
    /// for minimum variance and Kalman.
    pub tolerance: [f64; 2],
    /// [`identify`](super::identify) finds the size of the tolerance by cross-validation, and
    /// only its proportions are as given; a single fit takes it as it is.
    pub cross_validated: bool,
    /// How far joint parameters wander from row to row, one standard deviation, m and rad;
    /// for Kalman.
    pub process_noise: f64,
}

impl Default for Method {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            loss: Loss::default(),
            tolerance: [5e-3, 0.5_f64.to_radians()],
            cross_validated: false,
            process_noise: 0.0,
        }
    }
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The fit.
    pub solved: Solved,
    /// Unknowns that these observations cannot tell apart, with the reason.
    pub dropped: Vec<(Unknown, Dropped)>,
    /// Rows that a robust loss trusts less than half.
    pub outliers: Vec<Outlier>,
    /// What a Kalman filter saw on its last way through.
    pub innovations: Option<Innovations>,
}

/// What a fit is made of.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) drawing: &'a ArmModel,
    pub(super) candidates: &'a [Unknown],
    pub(super) sigmas: Sigmas,
}

impl Method {
    /// Fits those of `candidates` (in order of priority) that `observations` can tell apart.
    /// `drawing`: where the joint parameters are expected. On return `arm` holds the solution.
    pub fn fit(
        &self,
        arm: &mut ArmModel,
        drawing: &ArmModel,
        candidates: &[Unknown],
        observations: &[&Observation],
        sigmas: Sigmas,
    ) -> Fitted {
        let task = Task {
            drawing,
            candidates,
            sigmas,
        };
        match self.loss {
            Loss::Square => self.once(arm, &task, observations),
            Loss::Huber | Loss::Tukey => robust::fit(self, arm, &task, observations),
        }
    }

    /// The same with the weights that the observations have.
    pub(super) fn once(
        &self,
        arm: &mut ArmModel,
        task: &Task<'_>,
        observations: &[&Observation],
    ) -> Fitted {
        let Task {
            drawing,
            candidates,
            sigmas,
        } = *task;
        let plain = |(solved, dropped)| Fitted {
            solved,
            dropped,
            outliers: Vec::new(),
            innovations: None,
        };
        let prior = Prior::Drawing {
            arm: drawing,
            tolerance: self.tolerance,
        };
        match self.estimator {
            Estimator::LevenbergMarquardt => plain(solve::fit(
                arm,
                candidates,
                observations,
                sigmas,
                Prior::None,
            )),
            Estimator::WeightedLeastSquares => plain(solve::fit_undamped(
                arm,
                candidates,
                observations,
                sigmas,
                Prior::None,
            )),
            Estimator::MinimumVariance => plain(solve::fit_undamped(
                arm,
                candidates,
                observations,
                sigmas,
                prior,
            )),
            Estimator::LeastSquares => {
                // metres and radians alike
                let one = Sigmas::alike(sigmas.position);
                plain(solve::fit_undamped(
                    arm,
                    candidates,
                    observations,
                    one,
                    Prior::None,
                ))
            }
            Estimator::Kalman | Estimator::GoldenSection => {
                let selection = distinguishable(arm, candidates, observations, sigmas);
                let kept = selection.kept.iter().map(|&k| candidates[k]);
                let unknowns: Vec<Unknown> = kept.collect();
                let dropped = selection.dropped.into_iter();
                let dropped = dropped.map(|(k, why)| (candidates[k], why)).collect();
                if self.estimator == Estimator::GoldenSection {
                    let solved = golden::search(arm, &unknowns, observations, sigmas);
                    return plain((solved, dropped));
                }
                let (solved, innovations) = kalman::filter(
                    arm,
                    &unknowns,
                    observations,
                    sigmas,
                    prior,
                    self.process_noise,
                );
                Fitted {
                    innovations: Some(innovations),
                    ..plain((solved, dropped))
                }
            }
        }
    }
}
