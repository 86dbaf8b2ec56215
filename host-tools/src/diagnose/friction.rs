//! Does a joint rather stick than yield?
//!
//! A joint that friction holds moves only by what gravity's torque has beyond the friction. Where
//! torques are mostly larger than that, the part in proportion to torque explains nearly all of it, and
//! no test of what is left sees the rest. So the two are asked against each other: the same
//! displacement, in proportion and beyond a threshold, with as many parameters. The rows of the
//! fit and those that it has not seen are asked alike; nothing is fitted to the answer.

use nalgebra::{DMatrix, DVector, Dyn, linalg::Cholesky};

use super::hypothesis::{Members, YIELDS};
use super::model::Extended;
use super::proportion::{Part, parts};
use super::space::Space;
use crate::identify::linearize::Linear;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::unknown::Unknown;

/// Thresholds that are tried, in the largest displacement, each as likely as the others.
const SHARES: [f64; 10] = [0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5];

/// A joint with friction at rest, against one that gives way in proportion to its torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Which of the accepted hypotheses.
    pub index: usize,
    /// The joint for which it is likeliest, from 0.
    pub joint: usize,
    /// The likeliest threshold over the largest torque.
    pub share: f64,
    /// Logarithm of how much likelier it is that one of the joints sticks, thresholds and joints
    /// averaged over.
    pub ln_odds: f64,
    /// True where that is likelier than not.
    pub likelier: bool,
}

impl Friction {
    /// As a person says it.
    pub fn in_words(&self) -> String {
        format!(
            "friction explains it better: joint {} would stick below {:.0} % of its largest torque",
            self.joint + 1,
            100.0 * self.share
        )
    }
}

/// The accepted yielding joints that rather stick; `None` where no joint yields by one value.
pub fn friction(
    model: &Extended,
    fitted: &[&Observation],
    unseen: &[&Observation],
    sigmas: Sigmas,
) -> Option<Friction> {
    let all: Vec<&Observation> = fitted.iter().chain(unseen).copied().collect();
    let (linear, space) = model.space(&all, sigmas);
    let factor = linear.jacobian.tr_mul(&linear.jacobian).cholesky()?;
    let parts = parts(model, &all, sigmas);
    let of = |index: usize| {
        // joint, threshold, logarithm of the likelihood ratio
        let mut tried: Vec<(usize, f64, f64)> = Vec::new();
        for part in parts.iter().filter(|p| p.index == index) {
            if let (Some(joint), Some(own)) = (part.joint, place(model, part)) {
                let against = Against::new(part, own, &linear, &factor, &space);
                let beyond = SHARES.map(|share| (joint, share, against.ln_likelier(share)));
                tried.extend(beyond);
            }
        }
        let (joint, share, best) = tried.iter().copied().max_by(|a, b| a.2.total_cmp(&b.2))?;
        let sum: f64 = tried.iter().map(|t| (t.2 - best).exp()).sum();
        let ln_odds = best + (sum / tried.len() as f64).ln();
        Some(Friction {
            index,
            joint,
            share,
            ln_odds,
            likelier: ln_odds > 0.0,
        })
    };
    let yielding = (0..model.accepted.len()).filter(|&i| model.accepted[i].kind == YIELDS);
    yielding
        .filter_map(of)
        .max_by(|a, b| a.ln_odds.total_cmp(&b.ln_odds))
}

/// Where the part's value is among the unknowns; `None` where it has several or was not fitted.
fn place(model: &Extended, part: &Part) -> Option<usize> {
    let Members::Effects(effects) = &model.accepted.get(part.index)?.members else {
        return None;
    };
    let on = |k: &usize| effects[*k].model().joint() == part.joint;
    let on: Vec<usize> = (0..effects.len()).filter(on).collect();
    let [only] = on[..] else {
        return None;
    };
    let before: usize = (0..part.index).map(|i| model.effects_of(i).len()).sum();
    let own = Unknown::Effect {
        effect: before + only,
        value: 0,
    };
    let single = effects[only].model().values().len() == 1;
    let found = model.fit.unknowns.iter().position(|u| *u == own);
    found.filter(|_| single)
}

/// A displacement in proportion, as fitted, against the same beyond a threshold.
struct Against<'a> {
    part: &'a Part,
    space: &'a Space,
    sizes: Vec<f64>,
    largest: f64,
    /// Unit vector of what the displacement alone explains, everything else free to readjust.
    own: DVector<f64>,
    /// What was measured along it.
    along: f64,
}

impl<'a> Against<'a> {
    fn new(
        part: &'a Part,
        place: usize,
        linear: &Linear,
        factor: &Cholesky<f64, Dyn>,
        space: &'a Space,
    ) -> Self {
        let mut unit = DMatrix::zeros(linear.jacobian.ncols(), 1);
        unit[(place, 0)] = 1.0;
        let dual = factor.solve(&unit);
        let own = (&linear.jacobian * &dual).column(0) / dual[(place, 0)].sqrt();
        let sizes = part.sizes();
        let as_fitted = part.times(linear.residual.len(), &vec![1.0; sizes.len()]);
        Self {
            along: own.dot(&(&linear.residual + as_fitted)),
            largest: sizes.iter().copied().fold(0.0, f64::max),
            own,
            part,
            space,
            sizes,
        }
    }

    /// Logarithm of the likelihood beyond `share` of the largest size over that in proportion.
    fn ln_likelier(&self, share: f64) -> f64 {
        let threshold = share * self.largest;
        let beyond = |s: &f64| match *s > threshold {
            true => 1.0 - threshold / s,
            false => 0.0,
        };
        let factors: Vec<f64> = self.sizes.iter().map(beyond).collect();
        let column = self.part.times(self.space.residual.len(), &factors);
        let along = self.own.dot(&column);
        let other = &column - &self.space.basis * self.space.basis.tr_mul(&column);
        let square = (other.norm_squared() + along * along).max(f64::MIN_POSITIVE);
        let explained = (other.dot(&self.space.residual) + along * self.along).powi(2) / square;
        let left = self.space.rss + self.along * self.along - explained;
        0.5 * self.space.effective * (self.space.rss / left.max(f64::MIN_POSITIVE)).ln()
    }
}
