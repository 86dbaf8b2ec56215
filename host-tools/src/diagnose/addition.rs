//! The next effect: significant among all candidates, better on held-back rows, sensible.

use truepose::JointKind;

use super::curve;
use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::search::{ALPHA, Ranked, Search, Step};
use super::sensible::sensible;
use super::space::{Space, columns};
use super::validate::{Comparison, HeldBack};
use crate::identify::Failure;
use crate::identify::linearize::Linear;

/// Candidates that a step compares on held-back rows.
const SHORTLIST: usize = 100;

/// Of these, significant ones that are tried before the search gives up.
const TRIES: usize = 12;

impl Search<'_> {
    /// The best candidate that is significant among all, lowers the held-back error, and has
    /// a sensible size; `None` where nothing passes.
    pub(super) fn best_addition(&mut self, model: &Extended) -> Result<Option<Step>, Failure> {
        let (linear, space) = model.space(&self.observations, self.sigmas);
        let candidates = self.candidates(model, &space);
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&model.arm, &references, &self.observations, self.sigmas);
        let scores = space.scores(&columns);
        let worth = |i: usize| scores[i].gain + 2.0 * candidates[i].ln_weight;
        let mut order: Vec<usize> = (0..scores.len()).collect();
        order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)).then(a.cmp(&b)));
        order.truncate(SHORTLIST);
        let passes = |i: usize| scores[i].ln_p - candidates[i].ln_weight < ALPHA.ln();
        if !order.iter().any(|&i| passes(i)) {
            return Ok(None);
        }
        let ranking: Vec<Ranked> = order
            .iter()
            .filter(|&&i| passes(i))
            .take(12)
            .map(|&i| Ranked {
                label: candidates[i].label(),
                ln_p: scores[i].ln_p - candidates[i].ln_weight,
                share: scores[i].reduction / space.rss,
            })
            .collect();
        let shortlist = columns.select(&order);
        let held_back = [0, 1, 2].map(|b| {
            HeldBack::new(
                &self.observations,
                &self.folds[b],
                &linear.jacobian,
                &shortlist.matrix,
                &space.residual,
            )
        });
        let weights: Vec<f64> = order.iter().map(|&i| candidates[i].ln_weight).collect();
        let chosen = |b: usize| held_back[b].nested(&shortlist.groups, &weights).0;
        let (in_space, in_time) = (chosen(2), chosen(1));
        let at_random = chosen(0);
        let ready: Vec<usize> = (0..order.len()).filter(|&k| passes(order[k])).collect();
        let compared = |k: usize| {
            let (start, len) = shortlist.groups[k];
            [0, 1, 2].map(|b| held_back[b].compare(start..start + len, None))
        };
        let step = |k: usize, compared: &[Comparison; 3]| Step {
            hypothesis: candidates[order[k]].clone(),
            ln_p: scores[order[k]].ln_p - weights[k],
            held_back: Some([0, 1, 2].map(|b| compared[b].ratio())),
            ranking: ranking.clone(),
        };
        for &k in ready.iter().take(TRIES) {
            let candidate = &candidates[order[k]];
            let seen = compared(k);
            // held back in blocks of time, drifts have nothing to be predicted from
            let drifts = depends_on_time(candidate.kind);
            let holds = seen[0].t() > 2.0
                && seen[2].ratio() < 1.0
                && (drifts || seen[1].ratio() < 1.0);
            let other = if drifts { &at_random } else { &in_time };
            if !holds || in_space.and(other).t() < 1.0 {
                continue;
            }
            let with = |candidate: &Hypothesis| {
                let mut accepted = model.accepted.clone();
                accepted.push(candidate.clone());
                let trial = self.fit(&model.arm, accepted).ok()?;
                sensible(&trial, trial.accepted.len() - 1).then_some(trial)
            };
            if with(candidate).is_none() {
                self.refused.push(candidate.clone());
                continue;
            }
            if bends(candidate) {
                // near-equal: gravity on several joints at once is what engineers expect
                let group = ready.iter().find(|&&g| {
                    let all = &candidates[order[g]];
                    all.kind == "joint-compliance" && all.joint.is_none()
                });
                if let Some(&g) = group {
                    let plain = compared(g);
                    let against = Comparison {
                        without: plain[0].with.clone(),
                        with: seen[0].with.clone(),
                    };
                    let several = with(&candidates[order[g]]).is_some_and(|trial| {
                        let trial = self.pruned(trial);
                        trial.effects_of(trial.accepted.len() - 1).len() > 1
                    });
                    if against.t() < 2.0 && several {
                        return Ok(Some(step(g, &plain)));
                    }
                }
            }
            let curve =
                self.curve_instead(model, candidate, &linear, &space, &seen[0], &ranking);
            return Ok(Some(curve.unwrap_or_else(|| step(k, &seen))));
        }
        Ok(None)
    }

    /// A joint's curve in place of a function of the same joint's reading, where it predicts
    /// held-back rows better.
    fn curve_instead(
        &self,
        model: &Extended,
        candidate: &Hypothesis,
        linear: &Linear,
        space: &Space,
        rival: &Comparison,
        ranking: &[Ranked],
    ) -> Option<Step> {
        let joint = candidate.joint?;
        let of_reading = matches!(
            candidate.kind,
            "gear-eccentricity" | "joint-gain" | "gear-ripple"
        );
        let has = model
            .accepted
            .iter()
            .any(|h| h.kind == "joint-curve" && h.joint == Some(joint));
        if !of_reading || has || model.arm.joints[joint].kind != JointKind::Revolute {
            return None;
        }
        let extra = curve::columns(&model.arm, joint, &self.observations, self.sigmas);
        let held_back = |b: usize| {
            HeldBack::new(
                &self.observations,
                &self.folds[b],
                &linear.jacobian,
                &extra,
                &space.residual,
            )
        };
        let all = 0..extra.ncols();
        let at_random = held_back(0);
        let mut best: Option<(f64, Comparison)> = None;
        for smooth in curve::SMOOTHNESS {
            let comparison = at_random.compare(all.clone(), Some(&curve::precision(smooth)));
            if best
                .as_ref()
                .is_none_or(|b| comparison.ratio() < b.1.ratio())
            {
                best = Some((smooth, comparison));
            }
        }
        let (smooth, comparison) = best?;
        let against = Comparison {
            without: rival.with.clone(),
            with: comparison.with.clone(),
        };
        if against.t() < 2.0 {
            return None;
        }
        let prior = curve::precision(smooth);
        let blocks = [1, 2].map(|b| held_back(b).compare(all.clone(), Some(&prior)).ratio());
        (blocks[0] < 1.0 && blocks[1] < 1.0).then(|| Step {
            hypothesis: Hypothesis {
                kind: "joint-curve",
                joint: Some(joint),
                order: None,
                from: None,
                members: Members::Curve(smooth),
                ln_weight: candidate.ln_weight,
            },
            ln_p: ranking.first().map_or(0.0, |r| r.ln_p),
            held_back: Some([comparison.ratio(), blocks[0], blocks[1]]),
            ranking: ranking.to_vec(),
        })
    }
}

/// Part of the arm gives way under gravity, other than a joint about its own axis.
fn bends(candidate: &Hypothesis) -> bool {
    matches!(
        candidate.kind,
        "link-bending" | "base-flex" | "cross-axis-compliance"
    )
}

/// Held back in blocks of time, these have nothing to be predicted from.
fn depends_on_time(kind: &str) -> bool {
    matches!(
        kind,
        "time-drift" | "warm-up" | "step-change" | "thermal-drift" | "thermal-growth"
    )
}

