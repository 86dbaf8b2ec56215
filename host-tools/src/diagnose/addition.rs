//! The next effect: significant among all candidates, better on held-back rows, sensible.

use std::ops::Range;

use truepose::JointKind;
use truepose::effects::KINDS;

use super::clock::needs_time;
use super::curve::{self, Smoothness};
use super::exchange::EVIDENT;
use super::hypothesis::{Hypothesis, Members, curves};
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
const TRIES: usize = 40;

/// Angles of blocks in joint space may be angles that the rest of the rows do not show, and
/// there a curve says nothing: it may not be worse there, by this many standard errors.
const UNSEEN: f64 = -1.0;

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
            return Ok(self.best_curve(model, &linear, &space));
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
        let held_back = |folds| {
            let folds: &[Vec<usize>; 3] = folds;
            [0, 1, 2].map(|b| {
                HeldBack::new(
                    &self.observations,
                    &folds[b],
                    &linear.jacobian,
                    &shortlist.matrix,
                    &space.residual,
                )
            })
        };
        let weights: Vec<f64> = order.iter().map(|&i| candidates[i].ln_weight).collect();
        let has_name = |k: usize| candidates[order[k]].kind != "unnamed";
        let drifts = |k: usize| drifts(&candidates[order[k]]);
        let ways: Vec<_> = self
            .folds
            .iter()
            .map(held_back)
            .map(|held_back| {
                let chosen = chosen(&held_back, &shortlist.groups, &weights, &has_name, &drifts);
                (held_back, chosen)
            })
            .collect();
        let ready: Vec<usize> = (0..order.len()).filter(|&k| passes(order[k])).collect();
        let compare = |held_back: &[HeldBack<'_>; 3], k: usize| {
            let (start, len) = shortlist.groups[k];
            [0, 1, 2].map(|b| held_back[b].compare(start..start + len, None))
        };
        // of the ways to hold back, the one in which a candidate holds
        let held = |k: usize| {
            ways.iter().find_map(|(held_back, chosen)| {
                let seen = compare(held_back, k);
                // held back in blocks of time, drifts have nothing to be predicted from
                let drifts = drifts(k);
                let holds =
                    seen[0].t() > 2.0 && seen[2].ratio() < 1.0 && (drifts || seen[1].ratio() < 1.0);
                let [at_random, in_time, in_space] = &chosen[usize::from(has_name(k))];
                let other = if drifts { at_random } else { in_time };
                (holds && in_space.and(other).t() >= 1.0).then_some((held_back, seen))
            })
        };
        let step = |k: usize, compared: &[Comparison; 3]| Step {
            hypothesis: candidates[order[k]].clone(),
            ln_p: scores[order[k]].ln_p - weights[k],
            held_back: Some([0, 1, 2].map(|b| compared[b].ratio())),
            ranking: ranking.clone(),
        };
        for &k in ready.iter().take(TRIES) {
            let candidate = &candidates[order[k]];
            let Some((held_back, seen)) = held(k) else {
                continue;
            };
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
            for g in plainer(candidate, &ready, &order, &candidates) {
                let (plain, gain) = (compare(held_back, g), scores[order[g]].gain);
                // one parameter against one or two: the rows themselves decide what they can
                let tilts = candidates[order[g]].kind == "cross-axis-compliance";
                if tilts && scores[order[k]].gain - gain > EVIDENT {
                    continue;
                }
                let against = Comparison {
                    without: plain[0].with.clone(),
                    with: seen[0].with.clone(),
                };
                let group = candidates[order[g]].joint.is_none();
                let fits = with(&candidates[order[g]]).is_some_and(|trial| {
                    let last = trial.accepted.len() - 1;
                    !group || self.pruned(trial, last).effects_of(last).len() > 1
                });
                // of one wobble in two frames the one in the joint's own may have two more
                // parameters, which cost a little on every row
                let score = scores[order[g]];
                let same = candidate.kind == "axis-wobble"
                    && scores[order[k]].reduction - score.reduction
                        < EVIDENT * (space.rss - score.reduction) / space.freedom;
                if (same || against.t() < 2.0) && plain[0].t() > 2.0 && fits {
                    return Ok(Some(step(g, &plain)));
                }
            }
            let found = step(k, &seen);
            let curve = self.curve_instead(model, candidate, &linear, &space, &seen[0]);
            return Ok(Some(match curve {
                Some((hypothesis, held_back)) => Step {
                    hypothesis,
                    held_back: Some(held_back),
                    ..found
                },
                None => found,
            }));
        }
        Ok(self.best_curve(model, &linear, &space))
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
    ) -> Option<(Hypothesis, [f64; 3])> {
        let of_reading = matches!(
            candidate.kind,
            "gear-eccentricity" | "joint-gain" | "gear-ripple"
        );
        if !of_reading {
            return None;
        }
        let (curve, [at_random, in_time, in_space]) =
            self.smoothed(model, candidate, linear, space)?;
        let against = Comparison {
            without: rival.with.clone(),
            with: at_random.with.clone(),
        };
        let ratios = [at_random.ratio(), in_time.ratio(), in_space.ratio()];
        (against.t() > 2.0 && ratios[1] < 1.0 && in_space.t() > UNSEEN).then_some((curve, ratios))
    }

    /// The curve of a joint where nothing else passes: hats far apart have to be significant,
    /// and the curve has to hold on rows that it has not seen.
    fn best_curve(&self, model: &Extended, linear: &Linear, space: &Space) -> Option<Step> {
        let candidates = curves(&model.arm, KINDS.len());
        let references: Vec<&Hypothesis> = candidates.iter().collect();
        let columns = columns(&model.arm, &references, &self.observations, self.sigmas);
        let scores = space.scores(&columns);
        let mut order: Vec<usize> = (0..candidates.len())
            .filter(|&i| scores[i].ln_p - candidates[i].ln_weight < ALPHA.ln())
            .collect();
        order.sort_by(|&a, &b| scores[a].ln_p.total_cmp(&scores[b].ln_p).then(a.cmp(&b)));
        let ranking: Vec<Ranked> = order
            .iter()
            .map(|&i| Ranked {
                label: candidates[i].label(),
                ln_p: scores[i].ln_p - candidates[i].ln_weight,
                share: scores[i].reduction / space.rss,
            })
            .collect();
        order.iter().find_map(|&i| {
            let (hypothesis, held_back) = self.smoothed(model, &candidates[i], linear, space)?;
            let ratios = [0, 1, 2].map(|b| held_back[b].ratio());
            let [at_random, _, in_space] = &held_back;
            let holds = at_random.t() > 2.0 && ratios[1] < 1.0 && in_space.t() > UNSEEN;
            holds.then(|| Step {
                hypothesis,
                ln_p: scores[i].ln_p - candidates[i].ln_weight,
                held_back: Some(ratios),
                ranking: ranking.clone(),
            })
        })
    }

    /// The curve of the candidate's joint, as smooth as random folds want it, and what it does
    /// to held-back rows; `None` where there is one already or the joint does not turn.
    fn smoothed(
        &self,
        model: &Extended,
        candidate: &Hypothesis,
        linear: &Linear,
        space: &Space,
    ) -> Option<(Hypothesis, [Comparison; 3])> {
        let joint = candidate.joint?;
        let has = |h: &Hypothesis| h.kind == "joint-curve" && h.joint == Some(joint);
        let turns = model.arm.joints[joint].kind == JointKind::Revolute;
        if !turns || model.accepted.iter().any(has) {
            return None;
        }
        let cells = curve::columns(&model.arm, joint, &self.observations, self.sigmas);
        let extra = cells * curve::waves();
        let all = 0..extra.ncols();
        let held_back = |b: usize| {
            HeldBack::new(
                &self.observations,
                &self.folds[0][b],
                &linear.jacobian,
                &extra,
                &space.residual,
            )
        };
        let at_random = held_back(0);
        let (smooth, at_random) = smoothest(&at_random, all.clone(), Smoothness::FIRST);
        let prior = curve::precision_of_waves(smooth);
        let [in_time, in_space] = [1, 2].map(|b| held_back(b).compare(all.clone(), Some(&prior)));
        let curve = Hypothesis {
            kind: "joint-curve",
            joint: Some(joint),
            order: None,
            from: None,
            members: Members::Curve(smooth),
            ln_weight: candidate.ln_weight,
        };
        Some((curve, [at_random, in_time, in_space]))
    }
}

/// The smoothness at which a curve predicts held-back rows best, from `first` on, and what it
/// does to them.
pub(super) fn smoothest(
    held_back: &HeldBack<'_>,
    columns: Range<usize>,
    first: Smoothness,
) -> (Smoothness, Comparison) {
    let tried = |smooth: Smoothness| {
        let prior = curve::precision_of_waves(smooth);
        (smooth, held_back.compare(columns.clone(), Some(&prior)))
    };
    let mut best = tried(first);
    let mut seen = vec![first];
    loop {
        let mut better = false;
        for smooth in best.0.neighbours() {
            if seen.contains(&smooth) {
                continue;
            }
            seen.push(smooth);
            let trial = tried(smooth);
            if trial.1.ratio() < best.1.ratio() {
                best = trial;
                better = true;
                break;
            }
        }
        if !better {
            return best;
        }
    }
}

/// What choosing is worth on rows that took no part in it, held back in every way: choosing
/// among all candidates, and among those with a name. A name has to hold against other names;
/// what can be found by looking at thousands of nameless terms is no argument against it.
///
/// In blocks of time a name that drifts is no choice among names: there is nothing that it could
/// be predicted from.
fn chosen(
    held_back: &[HeldBack<'_>; 3],
    groups: &[(usize, usize)],
    weights: &[f64],
    has_name: &dyn Fn(usize) -> bool,
    drifts: &dyn Fn(usize) -> bool,
) -> [[Comparison; 3]; 2] {
    [false, true].map(|only_names| {
        [0, 1, 2].map(|b| {
            let may = |k: &usize| !only_names || (has_name(*k) && (b != 1 || !drifts(*k)));
            let of: Vec<usize> = (0..groups.len()).filter(may).collect();
            let groups: Vec<(usize, usize)> = of.iter().map(|&k| groups[k]).collect();
            let weights: Vec<f64> = of.iter().map(|&k| weights[k]).collect();
            held_back[b].nested(&groups, &weights).0
        })
    })
}

/// Places in `ready` of plainer explanations than the candidate, which are preferred where
/// held-back rows do not tell the difference.
///
/// For a part of the arm that bends, and for a term without a name: gravity on several joints at
/// once, which engineers expect. For a link also a joint that tilts across its axis, which has
/// one parameter. For an axis that wobbles in directions of the link before: one that does so
/// in the joint's own frame, in which everything else of a joint is described. A part that
/// turns one way round is the same thing in both, its orders one apart.
fn plainer(
    candidate: &Hypothesis,
    ready: &[usize],
    order: &[usize],
    candidates: &[Hypothesis],
) -> Vec<usize> {
    let first = |is: &dyn Fn(&Hypothesis) -> bool| {
        let found = ready.iter().find(|&&k| is(&candidates[order[k]]));
        found.copied()
    };
    let found = match candidate.kind {
        "link-bending" => vec![
            first(&|h| h.kind == "joint-compliance" && h.joint.is_none()),
            first(&|h| h.kind == "cross-axis-compliance"),
        ],
        "base-flex" | "cross-axis-compliance" | "unnamed" => {
            vec![first(&|h| {
                h.kind == "joint-compliance" && h.joint.is_none()
            })]
        }
        "axis-wobble" => vec![first(&|h| h.is_in_joint_frame_of(candidate))],
        _ => Vec::new(),
    };
    found.into_iter().flatten().collect()
}

/// Held back in blocks of time, these have nothing to be predicted from. A term without a name
/// has to hold there all the same: a polynomial of the time fits anything that is slow.
fn drifts(candidate: &Hypothesis) -> bool {
    match &candidate.members {
        Members::Effects(effects) if candidate.kind != "unnamed" => {
            let by_temperature = matches!(candidate.kind, "thermal-drift" | "thermal-growth");
            by_temperature || effects.iter().any(needs_time)
        }
        _ => false,
    }
}
