//! The next effect: significant among all candidates, better on held-back rows, sensible.

use nalgebra::DMatrix;
use truepose::JointKind;
use truepose::effects::KINDS;

use super::clock::needs_time;
use super::curve::{self, Smoothness};
use super::exchange::EVIDENT;
use super::hypothesis::{Hypothesis, Members, YIELDS, curves};
use super::model::Extended;
use super::rivals::bic;
use super::search::{ALPHA, Ranked, Search, Step};
use super::sensible::sensible;
use super::smoothness::Evidence;
use super::space::{Space, columns};
use super::validate::{Comparison, HeldBack};
use crate::identify::Failure;
use crate::identify::linearize::Linear;

/// Candidates that a step compares on held-back rows.
const SHORTLIST: usize = 100;

/// Of these, significant ones that are tried before the search gives up.
const TRIES: usize = 40;

/// Functions of one joint's reading that a curve has to predict better than, all together.
const FEW: usize = 3;

/// Angles of blocks in joint space may be angles that the rest of the rows do not show, and
/// there a curve says nothing: it may not be worse there, by this many standard errors.
pub(super) const UNSEEN: f64 = -1.0;

/// A joint's curve as smooth as is likeliest.
pub(super) struct Smoothed {
    pub(super) curve: Hypothesis,
    smooth: Smoothness,
    /// Columns of its amplitudes.
    columns: DMatrix<f64>,
    /// Logarithm of the likelihood of what was measured, over that without it.
    pub(super) worth: f64,
    /// Share of the squared residual that it takes.
    share: f64,
}

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
            let Some(own) = with(candidate) else {
                self.refused.push(candidate.clone());
                continue;
            };
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
                    if !group {
                        return true;
                    }
                    // as many joints as the other has values are not plainer than it: the rows
                    // decide
                    let pruned = self.pruned(trial, last);
                    let left = pruned.effects_of(last).len();
                    let worse = || bic(self, &pruned) - bic(self, &own) > EVIDENT;
                    left > candidate.len() || left > 1 && !worse()
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
            let of_reading: Vec<&Hypothesis> = candidates
                .iter()
                .filter(|h| h.joint == candidate.joint && is_of_reading(h))
                .collect();
            let curve = self.curve_instead(&own, candidate, &of_reading);
            if curve.is_some() {
                // what gravity does to a joint is nearly a function of its reading: a curve
                // would swallow it
                let on_joint = |h: &Hypothesis| {
                    matches!(h.kind, "joint-compliance" | "tool-load")
                        && acts_on(h, candidate.joint)
                };
                for &g in ready.iter().filter(|&&g| on_joint(&candidates[order[g]])) {
                    if let Some((_, seen)) = held(g)
                        && with(&candidates[order[g]]).is_some()
                    {
                        return Ok(Some(step(g, &seen)));
                    }
                }
            }
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

    /// A joint's curve in place of `candidate`, a function of the same joint's reading, where it
    /// predicts held-back rows better than the best few such functions together: a curve is free
    /// to be any of them.
    ///
    /// Compared at the geometry of `own`, the fit with the candidate: geometry had taken up part
    /// of it before, and its second order there is what a curve can follow and a name cannot.
    fn curve_instead(
        &self,
        own: &Extended,
        candidate: &Hypothesis,
        of_reading: &[&Hypothesis],
    ) -> Option<(Hypothesis, [f64; 3])> {
        if !is_of_reading(candidate) {
            return None;
        }
        let model = own.clone().without_last();
        let (linear, space) = model.space(&self.observations, self.sigmas);
        let found = self.smoothed(&model, candidate, &linear, &space)?;
        let [at_random, in_time, in_space] = self.held_back_from(&found, &linear);
        let ratios = [at_random.ratio(), in_time.ratio(), in_space.ratio()];
        let holds = at_random.t() > 2.0 && ratios[1] < 1.0 && in_space.t() > UNSEEN;
        let against = Comparison {
            without: self.few(&model, &linear, of_reading),
            with: at_random.with,
        };
        (holds && against.t() > 2.0).then_some((found.curve, ratios))
    }

    /// Squared errors of rows held back at random with the best few of `hypotheses`, chosen one
    /// by one.
    fn few(&self, model: &Extended, linear: &Linear, hypotheses: &[&Hypothesis]) -> Vec<f64> {
        let all = columns(&model.arm, hypotheses, &self.observations, self.sigmas);
        let mut base = linear.jacobian.clone();
        let mut left: Vec<usize> = (0..hypotheses.len()).collect();
        let mut errors: Option<Vec<f64>> = None;
        for _ in 0..FEW {
            let extra = all.select(&left);
            let fold = &self.folds[0][0];
            let rows = &self.observations;
            let held_back = HeldBack::new(rows, fold, &base, &extra.matrix, &linear.residual);
            let tried = extra.groups.iter().map(|&(start, len)| {
                let seen = held_back.compare(start..start + len, None);
                (seen.with.iter().sum::<f64>(), seen)
            });
            let best = tried
                .enumerate()
                .min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0));
            let Some((place, (_, seen))) = best.filter(|(_, (_, seen))| seen.t() > 1.0) else {
                break;
            };
            let (start, len) = extra.groups[place];
            let chosen = extra.matrix.columns(start, len);
            let width = base.ncols();
            base = base.resize_horizontally(width + len, 0.0);
            base.columns_mut(width, len).copy_from(&chosen);
            left.remove(place);
            errors = Some(seen.with);
        }
        errors.unwrap_or_else(|| {
            let fold = &self.folds[0][0];
            let none = DMatrix::zeros(linear.residual.len(), 0);
            HeldBack::new(&self.observations, fold, &base, &none, &linear.residual)
                .compare(0..0, None)
                .with
        })
    }

    /// The curve of a joint where nothing else passes: likelier than none by what its two
    /// constants would gain where there is none (chi-square with 2 degrees at most: the chance of
    /// a likelihood ratio L is 1 / L), and it has to hold on rows that it has not seen.
    fn best_curve(&self, model: &Extended, linear: &Linear, space: &Space) -> Option<Step> {
        let candidates = curves(&model.arm, KINDS.len());
        let smoothed = candidates.iter().filter_map(|candidate| {
            let found = self.smoothed(model, candidate, linear, space)?;
            let ln_p = -found.worth - candidate.ln_weight;
            (ln_p < ALPHA.ln()).then_some((found, ln_p))
        });
        let mut significant: Vec<(Smoothed, f64)> = smoothed.collect();
        // stable: joints of equal chance stay in their order
        significant.sort_by(|a, b| a.1.total_cmp(&b.1));
        let ranking: Vec<Ranked> = significant
            .iter()
            .map(|(found, ln_p)| Ranked {
                label: found.curve.label(),
                ln_p: *ln_p,
                share: found.share,
            })
            .collect();
        significant.into_iter().find_map(|(found, ln_p)| {
            let seen = self.held_back_from(&found, linear);
            let ratios = [0, 1, 2].map(|b| seen[b].ratio());
            let [at_random, _, in_space] = &seen;
            let holds = at_random.t() > 2.0 && ratios[1] < 1.0 && in_space.t() > UNSEEN;
            holds.then(|| Step {
                hypothesis: found.curve,
                ln_p,
                held_back: Some(ratios),
                ranking: ranking.clone(),
            })
        })
    }

    /// The curve of the candidate's joint, as smooth as is likeliest; `None` where there is one
    /// already or the joint does not turn.
    pub(super) fn smoothed(
        &self,
        model: &Extended,
        candidate: &Hypothesis,
        linear: &Linear,
        space: &Space,
    ) -> Option<Smoothed> {
        let joint = candidate.joint?;
        let has = |h: &Hypothesis| h.kind == "joint-curve" && h.joint == Some(joint);
        let turns = model.arm.joints[joint].kind == JointKind::Revolute;
        if !turns || model.accepted.iter().any(has) {
            return None;
        }
        let cells = curve::columns(&model.arm, joint, &self.observations, self.sigmas);
        let extra = cells * curve::waves();
        let evidence = Evidence::new(&linear.jacobian, &extra, &linear.residual, space.freedom)?;
        let (smooth, worth) = evidence.likeliest(Smoothness::FIRST);
        let curve = Hypothesis {
            kind: "joint-curve",
            joint: Some(joint),
            order: None,
            from: None,
            members: Members::Curve(smooth),
            ln_weight: candidate.ln_weight,
        };
        Some(Smoothed {
            curve,
            smooth,
            worth,
            share: evidence.share(smooth),
            columns: extra,
        })
    }

    /// What a curve does to rows held back at random, in blocks of time, in blocks of joint space.
    pub(super) fn held_back_from(&self, found: &Smoothed, linear: &Linear) -> [Comparison; 3] {
        let prior = curve::precision_of_waves(found.smooth);
        [0, 1, 2].map(|b| {
            let held_back = HeldBack::new(
                &self.observations,
                &self.folds[0][b],
                &linear.jacobian,
                &found.columns,
                &linear.residual,
            );
            held_back.compare(0..found.columns.ncols(), Some(&prior))
        })
    }
}

/// A function of the joint's reading and of nothing else.
pub(super) fn is_of_reading(hypothesis: &Hypothesis) -> bool {
    matches!(
        hypothesis.kind,
        "gear-eccentricity" | "joint-gain" | "gear-ripple"
    )
}

/// Whether one of its effects moves the joint.
fn acts_on(hypothesis: &Hypothesis, joint: Option<usize>) -> bool {
    match &hypothesis.members {
        Members::Effects(effects) => effects.iter().any(|e| e.model().joint() == joint),
        Members::EarlyReading | Members::Curve(_) => false,
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
            first(&is_gravity_on_all),
            first(&|h| h.kind == "cross-axis-compliance"),
        ],
        "base-flex" | "cross-axis-compliance" | "unnamed" => {
            vec![first(&is_gravity_on_all)]
        }
        "axis-wobble" => vec![first(&|h| h.is_in_joint_frame_of(candidate))],
        _ => Vec::new(),
    };
    found.into_iter().flatten().collect()
}

/// Weight where it is described, or at the tool, on all joints.
fn is_gravity_on_all(hypothesis: &Hypothesis) -> bool {
    hypothesis.kind == YIELDS && hypothesis.joint.is_none() && !hypothesis.has_levers()
}

/// Held back in blocks of time, these have nothing to be predicted from. A term without a name
/// has to hold there all the same: a polynomial of the time fits anything that is slow.
pub(super) fn drifts(candidate: &Hypothesis) -> bool {
    match &candidate.members {
        Members::Effects(effects) if candidate.kind != "unnamed" => {
            let by_temperature = matches!(candidate.kind, "thermal-drift" | "thermal-growth");
            by_temperature || effects.iter().any(needs_time)
        }
        _ => false,
    }
}
