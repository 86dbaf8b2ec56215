//! What a fit found, as tables of the report.

use std::collections::BTreeMap;

use truepose::effects::Kind;

use super::compose::MM;
use super::schema;
use crate::identify::problem::Problem;
use crate::identify::structure::{complete_count, structure};
use crate::identify::uncertainty::chi_square_tail;
use crate::identify::unknown::Unknown;
use crate::identify::{Calibration, Status};

/// Of base, joints and tool.
pub(super) fn completeness(problem: &Problem, calibration: &Calibration) -> schema::Completeness {
    let own = |u: &&Unknown| {
        matches!(
            u,
            Unknown::Base { session: 0, .. } | Unknown::Joint(..) | Unknown::Tool { .. }
        )
    };
    let arm = &calibration.nominal.arm;
    schema::Completeness {
        complete: complete_count(arm),
        rank: structure(arm, problem.sigmas).unknowns.len(),
        held: problem.held.len(),
        identified: calibration
            .geometric
            .fit
            .unknowns
            .iter()
            .filter(own)
            .count(),
    }
}

pub(super) fn parameters(calibration: &Calibration) -> Vec<schema::Parameter> {
    let complete = &calibration.complete;
    calibration
        .statuses
        .iter()
        .map(|(unknown, status)| {
            let (status, note) = match status {
                Status::Identified => (schema::Status::Identified, None),
                Status::Fixed(why) => (schema::Status::Fixed, Some(why.clone())),
                Status::Merged(why) => (schema::Status::Merged, Some(why.clone())),
            };
            schema::Parameter {
                name: unknown.name(&complete.arm),
                unit: unknown.unit(&complete.arm).to_owned(),
                nominal: unknown.value(&calibration.nominal.arm),
                value: unknown.value(&complete.arm),
                sigma: complete.sigma(*unknown),
                bootstrap: None,
                status,
                note,
            }
        })
        .collect()
}

/// Effects of which anything was identified. All were entered together, so each stands with
/// the error before and after all of them.
pub(super) fn effects(calibration: &Calibration, error_mm: &schema::Errors) -> Vec<schema::Effect> {
    let stage = &calibration.complete;
    let mut found = Vec::new();
    for (index, effect) in stage.arm.effects.iter().enumerate() {
        let Some(p_value) = stage.p_value(index) else {
            continue;
        };
        let model = effect.model();
        let selector = model.selector();
        let (mut parameters, mut sigma) = (BTreeMap::new(), BTreeMap::new());
        for (value, ((name, _), x)) in model.parameters().iter().zip(model.values()).enumerate() {
            parameters.insert((*name).to_owned(), *x);
            let unknown = Unknown::Effect {
                effect: index,
                value,
            };
            if let Some(s) = stage.sigma(unknown) {
                sigma.insert((*name).to_owned(), s);
            }
        }
        found.push(schema::Effect {
            kind: model.kind().to_owned(),
            joint: selector.joint.map(|j| j + 1),
            order: selector.order,
            from: selector.from.map(|j| j + 1),
            component: selector.component.and_then(|component| {
                let all = Kind::of(model.kind())?.components;
                all.get(usize::from(component)).map(|c| (*c).to_owned())
            }),
            depends_on: Vec::new(),
            parameters,
            sigma,
            p_value,
            rms_before_mm: error_mm.geometric.rms,
            rms_after_mm: error_mm.complete.spread.rms,
            alternatives: Vec::new(),
            control: None,
            in_doubt: None,
        });
    }
    let early = Unknown::EarlyReading;
    if let (Some(sigma), value) = (stage.sigma(early), stage.arm.early_reading) {
        found.push(schema::Effect {
            kind: "early-reading".to_owned(),
            joint: None,
            order: None,
            from: None,
            component: None,
            depends_on: Vec::new(),
            parameters: BTreeMap::from([("lack".to_owned(), value)]),
            sigma: BTreeMap::from([("lack".to_owned(), sigma)]),
            p_value: chi_square_tail((value / sigma).powi(2), 1),
            rms_before_mm: error_mm.geometric.rms,
            rms_after_mm: error_mm.complete.spread.rms,
            alternatives: Vec::new(),
            control: None,
            in_doubt: None,
        });
    }
    found
}

pub(super) fn estimator(problem: &Problem, calibration: &Calibration) -> schema::Estimator {
    let outliers = calibration.outliers.iter().map(|o| schema::Outlier {
        row: o.row,
        weight: o.weight,
    });
    schema::Estimator {
        name: problem.method.estimator.name().to_owned(),
        loss: problem.method.loss.name().to_owned(),
        iterations: calibration.complete.fit.iterations,
        outliers: outliers.collect(),
        innovations: calibration.innovations.map(|i| schema::Innovations {
            count: i.count,
            rms: i.size,
            p_mean: i.p_mean,
            p_correlation: i.p_correlation,
            p_drift: i.p_drift,
            drifts: i.drifts.map(|u| u.name(&calibration.complete.arm)),
            white: i.white(),
        }),
        prior: prior(calibration),
    }
}

/// What the drawing counted for.
fn prior(calibration: &Calibration) -> Option<schema::Prior> {
    let method = &calibration.method;
    let tolerance = |[length, angle]: [f64; 2]| schema::Tolerance {
        mm: length.is_finite().then_some(length * MM),
        deg: angle.is_finite().then_some(angle.to_degrees()),
    };
    let tried = calibration.sizes.iter().flat_map(|sizes| &sizes.tried);
    method.estimator.uses_prior().then(|| schema::Prior {
        tolerance: tolerance(method.tolerance),
        tried: tried
            .map(|tried| schema::Tried {
                tolerance: tolerance(tried.tolerance),
                rms_mm: tried.rms * MM,
                rms_noise: tried.whitened,
            })
            .collect(),
    })
}
