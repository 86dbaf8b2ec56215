//! The whole diagnosis: search, refit on all rows, rivals, verdict.

use truepose::effects::{Effect, JointCurve, encode};

use super::addition::drifts;
use super::clock::count_rows;
use super::control::{Control, control};
use super::doubt::doubt;
use super::friction::{Friction, friction};
use super::hypothesis::Members;
use super::model::Extended;
use super::noise::estimated;
use super::opponent::{Opponent, opponent};
use super::proportion::{Disproportion, disproportion};
use super::rivals::{Rival, rivals};
use super::search::{Search, Step};
use super::unseen::{Unseen, unseen};
use super::whiteness::{Whiteness, whiteness};
use crate::identify::arm::{ArmModel, Curve};
use crate::identify::assess::{Statistics, errors};
use crate::identify::gross::{gross, gross_unseen};
use crate::identify::noise::fitted;
use crate::identify::observation::Observation;
use crate::identify::readings::Identified;
use crate::identify::solve::misfit;
use crate::identify::{Failure, Stage, geometry};

/// Scalar equations that the search works on; more rows are thinned evenly, and all of them
/// take part in the final fit.
const SEARCH_EQUATIONS: usize = 2400;

/// Rivals this close make the verdict ambiguous: odds below 20 to 1.
pub const UNDECIDED: f64 = 6.0;

/// How often gross rows are looked for once the model is complete.
const GROSS_PASSES: usize = 5;

/// Seed of the permutation tests.
const SEED: u64 = 1;

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
    /// Itself with what it depends on shuffled.
    pub control: Option<Control>,
    /// Why its name is no more than what it looks like, where there is a reason.
    pub doubt: Option<String>,
}

/// The answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// What is left is noise.
    Explained,
    /// Geometry alone was enough.
    NothingMissing,
    /// More is there than has a name.
    StructureRemains,
    /// These poses cannot tell some effect from another.
    Ambiguous,
}

/// Result of [`diagnose`].
pub struct Diagnosis {
    /// The identification, its complete stage replaced by geometry and effects.
    pub identified: Identified,
    /// What was added.
    pub named: Vec<Named>,
    /// Tests of what is left.
    pub whiteness: Option<Whiteness>,
    /// The named effect that follows its cause least in proportion.
    pub disproportion: Option<Disproportion>,
    /// Friction in the place of a joint that gives way.
    pub friction: Option<Friction>,
    /// What a term without a name still sees beside the names.
    pub opponent: Option<Opponent>,
    /// Rows that no fit has seen, against those of the fit.
    pub unseen: Option<Unseen>,
    /// Geometry and complete model cross-validated on contiguous blocks, m.
    pub blocks: Option<[Statistics; 2]>,
    /// Some effect has a rival that cannot be ruled out.
    pub ambiguous: bool,
    /// Something was found and taken back, since it made rows worse that no fit had seen.
    pub withdrawn: bool,
}

impl Diagnosis {
    /// The answer in one word. A term without a name is structure that remains, however well
    /// it fits.
    pub fn answer(&self) -> Answer {
        let nameless = self
            .named
            .iter()
            .any(|n| n.step.hypothesis.kind == "unnamed");
        let structure = self.whiteness.as_ref().is_some_and(|w| w.structure);
        let worse = self.unseen.is_some_and(|u| u.worse);
        let bent = self.disproportion.as_ref().is_some_and(|d| d.bent);
        let beaten = self.opponent.as_ref().is_some_and(|o| o.stronger);
        let sticks = self.friction.is_some_and(|f| f.likelier);
        if nameless || structure || worse || bent || sticks || beaten || self.withdrawn {
            Answer::StructureRemains
        } else if self.named.is_empty() {
            Answer::NothingMissing
        } else if self.ambiguous {
            Answer::Ambiguous
        } else {
            Answer::Explained
        }
    }
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
    let by_rows = count_rows(&mut identified.problem);
    let problem = identified.problem.clone();
    let calibration = &identified.calibration;
    let mut kept = fitted(&problem, calibration);
    let unknowns = geometry(&problem, calibration);
    let mut arm = calibration.geometric.arm.clone();
    arm.counts_rows = by_rows;

    progress("searching");
    let rows = thinned(&kept);
    let mut search = Search::new(&arm, rows, problem.sigmas, unknowns.clone());
    let mut found = search.run(&arm, progress)?;
    let (mut blocks, mut withdrawn) = held(&search, &arm, &mut found.model);

    progress("fitting all rows");
    let mut sigmas = search.sigmas;
    let accepted = found.model.accepted.clone();
    let all = |arm: &ArmModel, kept: &[&Observation], sigmas| {
        Extended::fitted(arm, &unknowns, accepted.clone(), kept, sigmas)
    };
    let mut model = all(&found.model.arm, &kept, sigmas)?;
    sigmas = estimated(&model.arm, &kept, sigmas, model.fit.unknowns.len());
    model = all(&model.arm, &kept, sigmas)?;
    let at_first = kept.len();
    // with the effects in, gross rows show that hid behind them, and behind each other
    for _ in 0..GROSS_PASSES {
        let worst = gross(
            &model.arm,
            &kept,
            sigmas,
            &misfit(&model.arm, &kept, sigmas),
        );
        if worst.is_empty() {
            break;
        }
        kept = (0..kept.len())
            .filter(|i| !worst.contains(i))
            .map(|i| kept[i])
            .collect();
        // once for the fit, which the gross rows had spoiled, and once for its noise
        for _ in 0..2 {
            sigmas = estimated(&model.arm, &kept, sigmas, model.fit.unknowns.len());
            model = all(&model.arm, &kept, sigmas)?;
        }
    }

    let verify: Vec<&Observation> = problem.verify.iter().collect();
    let gross = gross_unseen(&arm, &model.arm, &kept, &verify, sigmas);
    let used = |o: &&Observation| !gross.contains(&o.row);
    let verify: Vec<&Observation> = verify.into_iter().filter(used).collect();
    // these rows may take back and never add: what makes them worse than geometry does goes, the
    // last addition first
    while !model.accepted.is_empty() && rms(&deployable(&model.arm), &verify) > rms(&arm, &verify) {
        found.model.accepted.pop();
        found.model = search.fit(&found.model.arm, found.model.accepted)?;
        (blocks, _) = held(&search, &arm, &mut found.model);
        let fewer = found.model.accepted.clone();
        model = Extended::fitted(&model.arm, &unknowns, fewer, &kept, sigmas)?;
        withdrawn = true;
    }
    let left_out = |o: &&Observation| !kept.iter().chain(&verify).any(|k| k.row == o.row);
    let all = problem.identify.iter().chain(&problem.verify);
    identified.calibration.rejected = all.filter(left_out).map(|o| o.row).collect();
    identified.calibration.rejected.sort_unstable();

    progress("looking for rivals");
    let (thin, thin_verify) = (thinned(&kept), thinned(&verify));
    let disproportion = disproportion(&model, &thin, &thin_verify, sigmas);
    let opponent = opponent(&model, &thin, &thin_verify, sigmas);
    let friction = friction(&model, &thin, &thin_verify, sigmas);
    let complete = deployable(&model.arm);
    let mut named = Vec::new();
    let mut ambiguous = false;
    let mut before = rms(&arm, &verify);
    let mut partial = arm.clone();
    for (index, hypothesis) in model.accepted.iter().enumerate() {
        let known = found
            .steps
            .iter()
            .find(|s| s.hypothesis.is_same(hypothesis));
        let step = match known {
            Some(step) => step.clone(),
            None => exchanged(&search, &found.model, index),
        };
        if index + 1 == model.accepted.len() {
            partial = complete.clone();
        } else {
            let so_far = model.accepted[..=index].to_vec();
            partial = Extended::fitted(&partial, &unknowns, so_far, &kept, sigmas)?.arm;
        }
        let after = rms(&partial, &verify);
        let rivals = rivals(&search, &found.model, index);
        ambiguous |= rivals.iter().any(|r| r.delta_bic < UNDECIDED);
        named.push(Named {
            step,
            effects: model.effects_of(index).to_vec(),
            rms: [before, after],
            rivals,
            control: control(&search, &found.model, index, &problem),
            doubt: doubt(&model.accepted, index, disproportion.as_ref(), friction),
        });
        before = after;
    }

    progress("testing what is left");
    let whiteness = whiteness(&model.arm, &model.fit.unknowns, &kept, sigmas, SEED);
    let unseen = unseen(&model, &thin, &thin_verify, sigmas);
    // where nothing was found and no row left out, the answer is the one that was there
    let changed = !model.accepted.is_empty() || kept.len() < at_first;
    identified.calibration.complete = match changed {
        true => Stage {
            arm: complete,
            fit: model.fit,
            sigmas,
        },
        false => identified.calibration.geometric.clone(),
    };
    Ok(Diagnosis {
        identified,
        named,
        whiteness,
        disproportion,
        friction,
        opponent,
        unseen,
        blocks,
        ambiguous,
        withdrawn,
    })
}

/// What there is to say of a hypothesis that came in by exchange, or that others made
/// smaller after it came in.
fn exchanged(search: &Search<'_>, model: &Extended, index: usize) -> Step {
    let hypothesis = model.accepted[index].clone();
    let ln_p = match hypothesis.members {
        Members::Curve(_) => search.curve_by_chance(model, index),
        _ => search
            .substitutes(model, index, false)
            .ok()
            .map(|found| found.own.ln_p - hypothesis.ln_weight),
    };
    let ln_p = ln_p.unwrap_or(0.0);
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

/// Takes back what makes rows of unseen blocks worse in every way to hold them back, the last
/// addition first. Where something drifts, blocks of time have nothing to be predicted from, and
/// those of joint space alone decide. Returns the errors of all blocks and whether anything was
/// taken back.
fn held(
    search: &Search<'_>,
    geometric: &ArmModel,
    model: &mut Extended,
) -> (Option<[Statistics; 2]>, bool) {
    let mut withdrawn = false;
    loop {
        let of = |folds: &[&Vec<usize>]| blocks(search, folds, geometric, model);
        let drifts = model.accepted.iter().any(drifts);
        let mut first = None;
        let mut worse = true;
        for (way, [_, in_time, in_space]) in search.folds.iter().enumerate() {
            let all = of(&[in_time, in_space]);
            let deciding = match drifts {
                true => of(&[in_space]),
                false => all,
            };
            worse &= deciding.is_some_and(|[without, with]| with.rms >= without.rms);
            if way == 0 {
                first = all;
            }
        }
        if !worse || model.accepted.is_empty() {
            return (first, withdrawn);
        }
        let mut fewer = model.accepted.clone();
        fewer.pop();
        match search.fit(&model.arm, fewer) {
            Ok(smaller) => *model = smaller,
            Err(_) => return (first, withdrawn),
        }
        withdrawn = true;
    }
}

/// Errors of geometry alone and of the complete model on rows of blocks, contiguous in row
/// order and in joint space, that each fit has not seen.
fn blocks(
    search: &Search<'_>,
    folds: &[&Vec<usize>],
    geometric: &ArmModel,
    model: &Extended,
) -> Option<[Statistics; 2]> {
    let observations = &search.observations;
    let mut distances = [Vec::new(), Vec::new()];
    for fold in folds {
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

/// The arm with its curves in the form that the controller reads.
fn deployable(arm: &ArmModel) -> ArmModel {
    let mut arm = arm.clone();
    for curve in std::mem::take(&mut arm.curves) {
        arm.effects.extend(stored(&curve));
    }
    arm.bake();
    arm
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
