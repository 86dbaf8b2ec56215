//! The whole diagnosis: search, refit on all rows, rivals, verdict.

use truepose::effects::{Effect, JointCurve, encode};

use super::hypothesis::{Hypothesis, Members};
use super::model::Extended;
use super::noise::estimated;
use super::search::{Search, Step};
use super::validate::{Blocks, folds};
use super::whiteness::{Whiteness, whiteness};
use crate::identify::arm::{ArmModel, Curve};
use crate::identify::assess::{Statistics, errors};
use crate::identify::gross::{gross, levers};
use crate::identify::observation::Observation;
use crate::identify::readings::Identified;
use crate::identify::{Failure, Stage, geometry};

/// Scalar equations that the search works on; more rows are thinned evenly, and all of them
/// take part in the final fit.
const SEARCH_EQUATIONS: usize = 2400;

/// Rivals that explain the rows this much worse (difference in BIC) cannot be ruled out.
const RIVAL: f64 = 10.0;

/// Rivals this close make the verdict ambiguous: odds below 20 to 1.
const UNDECIDED: f64 = 6.0;

/// Seed of the permutation tests.
const SEED: u64 = 1;

/// What else an effect could have been.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The other explanation.
    pub hypothesis: Hypothesis,
    /// Cosine between what the two do to the measurements, beyond what the model has.
    pub similarity: f64,
    /// How much worse it explains them.
    pub delta_bic: f64,
}

/// An effect that was added.
#[derive(Clone, Debug)]
pub struct Named {
    /// How it was found.
    pub step: Step,
    /// Its effects as finally fitted; empty for a fault of the recording.
    pub effects: Vec<Effect<'static, f64>>,
    /// Rms of the verify rows without it and with it, in the order of addition, m.
    pub rms: [f64; 2],
    /// What else it could have been, likeliest first.
    pub rivals: Vec<Rival>,
}

/// Result of [`diagnose`].
pub struct Diagnosis {
    /// The identification, its complete stage replaced by geometry and effects.
    pub identified: Identified,
    /// What was added.
    pub named: Vec<Named>,
    /// Tests of what is left.
    pub whiteness: Option<Whiteness>,
    /// Geometry and complete model cross-validated on contiguous blocks, m.
    pub blocks: Option<[Statistics; 2]>,
    /// The effect as which some rival cannot be ruled out.
    pub ambiguous: bool,
}

fn thinned<'a>(observations: &[&'a Observation]) -> Vec<&'a Observation> {
    let equations: usize = observations.iter().map(|o| o.equations()).sum();
    let n = observations.len();
    let wanted = (n * SEARCH_EQUATIONS / equations.max(1)).clamp(1, n.max(1));
    (0..n)
        .filter(|i| (i + 1) * wanted / n != i * wanted / n)
        .map(|i| observations[i])
        .collect()
}

/// Finds what `identified` lacks. `progress` is told every step in a few words.
pub fn diagnose(mut identified: Identified, progress: &dyn Fn(&str)) -> Result<Diagnosis, Failure> {
    let problem = identified.problem.clone();
    let calibration = &identified.calibration;
    let rejected = &calibration.rejected;
    let mut kept: Vec<&Observation> = problem
        .identify
        .iter()
        .filter(|o| !rejected.contains(&o.row))
        .collect();
    let unknowns = geometry(&problem, calibration);
    let arm = calibration.geometric.arm.clone();

    progress("searching");
    let rows = thinned(&kept);
    let mut search = Search::new(&arm, rows, problem.sigmas, unknowns.clone());
    let found = search.run(&arm, progress)?;

    progress("fitting all rows");
    let mut sigmas = search.sigmas;
    let all = |arm: &ArmModel, kept: &[&Observation], sigmas| {
        Extended::fitted(arm, &unknowns, found.model.accepted.clone(), kept, sigmas)
    };
    let mut model = all(&found.model.arm, &kept, sigmas)?;
    sigmas = estimated(&model.arm, &kept, sigmas, model.fit.unknowns.len());
    model = all(&model.arm, &kept, sigmas)?;
    // with the effects in, gross rows show that hid behind them
    let worst = gross(&model.arm, &kept, sigmas);
    if !worst.is_empty() {
        let rows = worst.iter().map(|&i| kept[i].row);
        identified.calibration.rejected.extend(rows);
        identified.calibration.rejected.sort_unstable();
        kept = (0..kept.len())
            .filter(|i| !worst.contains(i))
            .map(|i| kept[i])
            .collect();
        sigmas = estimated(&model.arm, &kept, sigmas, model.fit.unknowns.len());
        model = all(&model.arm, &kept, sigmas)?;
    }

    progress("looking for rivals");
    let verify: Vec<&Observation> = problem.verify.iter().collect();
    let mut named = Vec::new();
    let mut ambiguous = false;
    let mut before = rms(&arm, &verify);
    for (index, hypothesis) in model.accepted.iter().enumerate() {
        let known = found
            .steps
            .iter()
            .find(|s| s.hypothesis.is_same(hypothesis));
        let step = match known {
            Some(step) => step.clone(),
            None => exchanged(&search, &found.model, index),
        };
        let so_far = model.accepted[..=index].to_vec();
        let partial = Extended::fitted(&arm, &unknowns, so_far, &search.observations, sigmas);
        let after = partial.map_or(before, |m| rms(&m.arm, &verify));
        let rivals = rivals(&search, &found.model, hypothesis);
        ambiguous |= rivals.iter().any(|r| r.delta_bic < UNDECIDED);
        named.push(Named {
            step,
            effects: model.effects_of(index).to_vec(),
            rms: [before, after],
            rivals,
        });
        before = after;
    }

    progress("testing what is left");
    let whiteness = whiteness(&model.arm, &model.fit.unknowns, &kept, sigmas, SEED);
    let blocks = blocks(&search, &arm, &model);
    let mut arm = model.arm.clone();
    for curve in std::mem::take(&mut arm.curves) {
        if let Some(effect) = stored(&curve) {
            arm.effects.push(effect);
        }
    }
    arm.bake();
    identified.calibration.complete = Stage {
        arm,
        fit: model.fit,
    };
    Ok(Diagnosis {
        identified,
        named,
        whiteness,
        blocks,
        ambiguous,
    })
}

/// What there is to say of a hypothesis that came in by exchange, or that others made
/// smaller after it came in.
fn exchanged(search: &Search<'_>, model: &Extended, index: usize) -> Step {
    let hypothesis = model.accepted[index].clone();
    let ln_p = match search.substitutes(model, index) {
        Ok(found) => found.own.ln_p - hypothesis.ln_weight,
        Err(_) => 0.0,
    };
    Step {
        hypothesis,
        ln_p,
        held_back: None,
        ranking: Vec::new(),
    }
}

fn rms(arm: &ArmModel, observations: &[&Observation]) -> f64 {
    Statistics::of(&errors(arm, observations).distances).map_or(0.0, |s| s.rms)
}

fn rivals(search: &Search<'_>, model: &Extended, hypothesis: &Hypothesis) -> Vec<Rival> {
    let place = model.accepted.iter().position(|h| h.is_same(hypothesis));
    if matches!(hypothesis.members, Members::Curve(_)) {
        return Vec::new();
    }
    let Some(Ok(substitutes)) = place.map(|index| search.substitutes(model, index)) else {
        return Vec::new();
    };
    let own = substitutes.own.gain;
    let others = substitutes.others.iter().zip(&substitutes.similarities);
    others
        .map(|((other, score), &similarity)| Rival {
            hypothesis: other.clone(),
            similarity,
            delta_bic: own - score.gain,
        })
        .enumerate()
        .filter(|(i, r)| *i < 3 || r.delta_bic < RIVAL)
        .map(|(_, r)| r)
        .collect()
}

/// Errors of geometry alone and of the complete model on rows of blocks, contiguous in row
/// order and in joint space, that each fit has not seen.
fn blocks(search: &Search<'_>, geometric: &ArmModel, model: &Extended) -> Option<[Statistics; 2]> {
    let observations = &search.observations;
    let levers = levers(geometric, observations, search.sigmas);
    let mut distances = [Vec::new(), Vec::new()];
    for blocks in [Blocks::Time, Blocks::Space] {
        let fold = folds(observations, &levers, blocks);
        for f in 0..=fold.iter().copied().max()? {
            let side = |held_back: bool| -> Vec<&Observation> {
                (0..observations.len())
                    .filter(|&i| (fold[i] == f) == held_back)
                    .map(|i| observations[i])
                    .collect()
            };
            let (seen, unseen) = (side(false), side(true));
            for (accepted, distances) in [Vec::new(), model.accepted.clone()]
                .into_iter()
                .zip(&mut distances)
            {
                let arm = if accepted.is_empty() {
                    geometric
                } else {
                    &model.arm
                };
                let refit =
                    Extended::fitted(arm, &search.geometry, accepted, &seen, search.sigmas).ok()?;
                distances.extend(errors(&refit.arm, &unseen).distances);
            }
        }
    }
    let [geometric, complete] = distances;
    Some([Statistics::of(&geometric)?, Statistics::of(&complete)?])
}

/// A curve in the form that the controller reads. Its table is borrowed by every copy of the
/// model and lives as long as the program: 360 bytes a joint.
fn stored(curve: &Curve) -> Option<Effect<'static, f64>> {
    let mut bytes = vec![0; 2 * curve.values.len()];
    let scale = encode(&curve.values, &mut bytes)?;
    let joint = u8::try_from(curve.joint).ok()?;
    let table: &'static [u8] = Box::leak(bytes.into_boxed_slice());
    Some(Effect::JointCurve(JointCurve::turn(joint, scale, table)))
}
