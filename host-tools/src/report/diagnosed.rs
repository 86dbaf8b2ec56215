//! From a diagnosis to its report.

use std::collections::BTreeMap;

use truepose::effects::{self, Kind};

use super::Report;
use super::evidence::evidence;
use super::figures::significant;
use super::schema::{Alternative, BlockErrors, Effect, Shuffled, Spread, Verdict};
use crate::diagnose::clock::needs_time;
use crate::diagnose::hypothesis::Members;
use crate::diagnose::input::Finding;
use crate::diagnose::unnamed::{named_column, variables};
use crate::diagnose::{Answer, Diagnosis, Named, Rival};
use crate::identify::assess::Statistics;
use crate::identify::unknown::Unknown;
use crate::identify::{Failure, Stage};
use crate::measurement::Dataset;

const MM: f64 = 1e3;

/// What is left over the declared noise, from which on the report says so.
const ABOVE_DECLARED: f64 = 2.0;

impl Report {
    /// Of a diagnosis. `robot`: its name. `input`: what is wrong with the table itself.
    pub fn of_diagnosis(
        robot: &str,
        data: &Dataset,
        diagnosis: &Diagnosis,
        input: &[Finding],
    ) -> Result<Self, Failure> {
        let mut report = Self::new(robot, data, &diagnosis.identified)?;
        let stage = &diagnosis.identified.calibration.complete;
        report.summary.effects = diagnosis
            .named
            .iter()
            .flat_map(|named| effects(named, stage))
            .collect();
        report.summary.error_mm_blocks =
            diagnosis
                .blocks
                .as_ref()
                .map(|[geometric, complete]| BlockErrors {
                    geometric: spread(geometric),
                    complete: spread(complete),
                });
        report.summary.verdict = match verdict(diagnosis) {
            // an effect stands where a parameter that is held may be wrong
            Verdict::Explained if report.held_explains => Verdict::Ambiguous,
            verdict => verdict,
        };
        report.evidence = evidence(diagnosis);
        report.reasons = reasons(diagnosis, &report);
        for finding in input {
            let (saw, advice) = (&finding.saw, &finding.advice);
            report.noticed.insert(0, format!("input: {saw}; {advice}"));
        }
        let sentences = [
            &report.reasons,
            &report.assumed,
            &report.held_back,
            &report.noticed,
        ];
        report.summary.notes = sentences.into_iter().flatten().cloned().collect();
        Ok(report)
    }
}

fn spread(s: &Statistics) -> Spread {
    Spread {
        rms: s.rms * MM,
        mean: s.mean * MM,
        max: s.max * MM,
    }
}

fn verdict(diagnosis: &Diagnosis) -> Verdict {
    match diagnosis.answer() {
        Answer::Explained => Verdict::Explained,
        Answer::NothingMissing => Verdict::NothingMissing,
        Answer::StructureRemains => Verdict::StructureRemains,
        Answer::Ambiguous => Verdict::Ambiguous,
    }
}

/// One sentence of what was found, one of what is left.
fn reasons(diagnosis: &Diagnosis, report: &Report) -> Vec<String> {
    let mut reasons = Vec::new();
    if let Some(found) = found(report) {
        reasons.push(found);
    }
    match &diagnosis.whiteness {
        Some(w) if w.structure => {
            let saw = w.tests.first().map_or("", |t| t.saw.as_str());
            reasons.push(format!(
                "what is left is not noise (chance {}): {saw}",
                significant(w.p_value)
            ));
        }
        Some(w) => reasons.push(format!(
            "what is left looks like noise: its structure could be chance with probability {}",
            significant(w.p_value)
        )),
        None => reasons.push("too few rows to test what is left for structure".to_owned()),
    }
    let noise = &report.summary.noise_mm;
    if let (Some(declared), Some(left)) = (noise.declared, noise.estimated)
        && left > ABOVE_DECLARED * declared
    {
        reasons.push(format!(
            "what is left is {} times the declared noise: either too little was declared, or arm or \
             instrument err in ways that no column of this file goes with",
            significant(left / declared)
        ));
    }
    if let Some(bent) = diagnosis.disproportion.as_ref().filter(|d| d.bent) {
        let named = diagnosis.named.get(bent.index);
        reasons.push(format!(
            "{} does not stay in proportion to its cause: it changes with {} (chance {})",
            named.map_or_else(String::new, |n| n.step.hypothesis.label()),
            bent.with,
            significant(bent.ln_p.exp())
        ));
    }
    if let Some(sticks) = diagnosis.friction.filter(|f| f.likelier) {
        let named = diagnosis.named.get(sticks.index);
        reasons.push(format!(
            "{}: {} (odds {} to 1)",
            named.map_or_else(String::new, |n| n.step.hypothesis.label()),
            sticks.in_words(),
            significant(sticks.ln_odds.exp())
        ));
    }
    if let Some(opponent) = diagnosis.opponent.as_ref().filter(|o| o.stronger) {
        reasons.push(format!(
            "beside the names there is something like: {} (chance {}, rows that no fit has seen \
             included)",
            opponent.label,
            significant(opponent.ln_p.exp())
        ));
    }
    if let Some(unseen) = diagnosis.unseen.filter(|u| u.worse) {
        reasons.push(format!(
            "rows that no fit has seen miss by {} times what noise and the parameters' \
             uncertainty account for (chance {}): the model bends to something that it lacks",
            significant(unseen.ratio),
            significant(unseen.p_value)
        ));
    }
    if diagnosis.withdrawn {
        reasons.push(
            "something was found and taken back, since it made rows worse that no fit had seen"
                .to_owned(),
        );
    }
    let in_doubt = diagnosis.named.iter().filter(|n| n.doubt.is_some());
    let in_doubt: Vec<String> = in_doubt.map(|n| n.step.hypothesis.label()).collect();
    if !in_doubt.is_empty() {
        reasons.push(format!(
            "names in doubt, since something without a name is beside them or they do not stay in \
             proportion: {}",
            in_doubt.join(", ")
        ));
    }
    let stage = &diagnosis.identified.calibration.complete;
    if stage.arm.counts_rows && stage.arm.effects.iter().any(needs_time) {
        reasons.push(
            "the file has no column t, so the row's number stands for the time: what drifts with \
             it belongs to this series and is not compensated; times in s are rows"
                .to_owned(),
        );
    }
    let any = |is: fn(&effects::Effect<'static, f64>) -> bool| stage.arm.effects.iter().any(is);
    if any(|e| matches!(e, effects::Effect::GravityLever(_)))
        && !any(|e| matches!(e, effects::Effect::JointCompliance(_)))
    {
        reasons.push(
            "what the links weigh was found from these rows, since masses are not described or \
             not as the arm has them; it holds for the payload of these rows, and rows with other \
             payloads are needed to correct for another one"
                .to_owned(),
        );
    }
    reasons
}

/// The first effects in words, in the order of addition, and the error before and after each.
fn found(report: &Report) -> Option<String> {
    const SAID: usize = 3;
    let last = report.evidence.last()?;
    let said: Vec<String> = report
        .evidence
        .iter()
        .take(SAID)
        .map(|e| {
            let [before, after] = e.rms_mm.map(significant);
            let looks = if e.doubt.is_some() {
                "looks like: "
            } else {
                ""
            };
            format!(
                "{looks}{}: adding it takes the error from {before} mm to {after} mm",
                e.words
            )
        })
        .collect();
    let mut sentence = said.join("; ");
    match report.evidence.len().saturating_sub(SAID) {
        0 => {}
        1 => sentence += "; one more",
        more => sentence += &format!("; {more} more"),
    }
    if report.evidence.len() > SAID {
        sentence += &format!(" to {} mm", significant(last.rms_mm[1]));
    }
    if let Some(noise) = report.summary.noise_mm.declared {
        sentence += &format!(
            "; the instrument's noise is {} mm an axis",
            significant(noise)
        );
    }
    Some(sentence)
}

/// One entry an effect; members of a group share the group's figures.
fn effects(named: &Named, stage: &Stage) -> Vec<Effect> {
    let hypothesis = &named.step.hypothesis;
    let entry = |joint: Option<usize>, component: Option<String>| Effect {
        kind: hypothesis.kind.to_owned(),
        joint: joint.map(|j| j + 1),
        order: hypothesis.order,
        from: hypothesis.from.map(|j| j + 1),
        component,
        depends_on: Vec::new(),
        parameters: BTreeMap::new(),
        sigma: BTreeMap::new(),
        p_value: named.step.ln_p.exp().min(1.0),
        rms_before_mm: named.rms[0] * MM,
        rms_after_mm: named.rms[1] * MM,
        alternatives: named.rivals.iter().map(alternative).collect(),
        control: named.control.map(|c| Shuffled {
            covariate: c.covariate.to_owned(),
            own: c.own,
            shuffled: c.shuffled,
            largest: c.largest,
            move_before: c.move_before,
        }),
        in_doubt: named.doubt.clone(),
    };
    match &hypothesis.members {
        Members::EarlyReading => {
            let mut effect = entry(None, None);
            effect
                .parameters
                .insert("lack".to_owned(), stage.arm.early_reading);
            if let Some(sigma) = stage.sigma(Unknown::EarlyReading) {
                effect.sigma.insert("lack".to_owned(), sigma);
            }
            vec![effect]
        }
        Members::Curve(_) => {
            let mut effect = entry(hypothesis.joint, None);
            let found = stage.arm.effects.iter().filter_map(|e| match e {
                truepose::effects::Effect::JointCurve(c)
                    if Some(usize::from(c.joint)) == hypothesis.joint =>
                {
                    Some(c)
                }
                _ => None,
            });
            for curve in found {
                let cells: Vec<f64> = (0..curve.cells())
                    .filter_map(|i| curve.cell(i).map(|c: f64| c * curve.scale[0]))
                    .collect();
                let n = cells.len().max(1) as f64;
                let rms = (cells.iter().map(|c| c * c).sum::<f64>() / n).sqrt();
                let peak = cells.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
                effect.parameters.insert("rms".to_owned(), rms);
                effect.parameters.insert("peak".to_owned(), peak);
                effect
                    .parameters
                    .insert("measured share".to_owned(), n / curve.cells().max(1) as f64);
            }
            vec![effect]
        }
        Members::Effects(_) => named
            .effects
            .iter()
            .map(|effect| {
                let model = effect.model();
                let component = model.selector().component.and_then(|component| {
                    let all = Kind::of(model.kind())?.components;
                    all.get(usize::from(component)).map(|c| (*c).to_owned())
                });
                let mut shown = entry(model.joint(), component);
                // whose weight it is
                shown.from = model.selector().from.map(|j| j + 1);
                if let truepose::effects::Effect::Unnamed(term) = effect {
                    shown.depends_on = variables(term).into_iter().map(named_column).collect();
                    if let truepose::effects::Place::Base { axis, .. } = term.place {
                        let name = truepose::effects::AXES.get(usize::from(axis));
                        shown.component = name.map(|n| (*n).to_owned());
                    }
                }
                let place = stage.arm.effects.iter().position(|e| e == effect);
                for (value, ((name, _), x)) in
                    model.parameters().iter().zip(model.values()).enumerate()
                {
                    shown.parameters.insert((*name).to_owned(), *x);
                    let sigma =
                        place.and_then(|effect| stage.sigma(Unknown::Effect { effect, value }));
                    if let Some(sigma) = sigma {
                        shown.sigma.insert((*name).to_owned(), sigma);
                    }
                }
                for ((name, _), x) in model.constant_names().iter().zip(model.constants()) {
                    if *name != "order" {
                        shown.parameters.insert((*name).to_owned(), *x);
                    }
                }
                shown
            })
            .collect(),
    }
}

/// A rival as reports have it.
pub(super) fn alternative(rival: &Rival) -> Alternative {
    let hypothesis = &rival.hypothesis;
    Alternative {
        kind: hypothesis.kind.to_owned(),
        joint: hypothesis.joint.map(|j| j + 1),
        order: hypothesis.order,
        from: hypothesis.from.map(|j| j + 1),
        similarity: rival.similarity,
        delta_bic: rival.delta_bic,
    }
}
