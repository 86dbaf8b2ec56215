//! Diagnosis of an arm that is measured by distances between poses, touches of points and
//! planes, bearings, or a camera on the tool alone: what is hidden is named, and nothing where nothing is hidden.

use crate::bound::{Bound, bound, problem_of, surrounded};
use crate::synthetic::arm;
use truepose::Convention;
use truepose::effects::{Effect, Selector};
use truepose_host::diagnose::{Answer, Diagnosis, diagnose};
use truepose_host::identify::identify;
use truepose_host::identify::problem::Joints;
use truepose_host::identify::readings::Identified;

/// Rows that leave as many equations again as there are parameters.
fn rows(by: Bound) -> usize {
    match by {
        Bound::Distance => 240,
        Bound::Points => 80,
        Bound::Planes => 260,
        Bound::Bearings => 70,
        Bound::Board => 60,
        Bound::Marks => 40,
        Bound::Sights => 60,
    }
}

/// An arm whose second joint errs by `[sine, cosine]` of its own angle, rad, measured with the
/// noise that is declared.
fn diagnosed(by: Bound, eccentric: [f64; 2], seed: u64) -> Diagnosis {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 8);
    let mut truth = surrounded(&drawing, by, 8);
    if eccentric.iter().any(|x| x.abs() > 0.0) {
        let selector = Selector {
            joint: Some(1),
            order: Some(2.0),
            ..Selector::default()
        };
        let mut effect = Effect::named("gear-eccentricity", &selector).unwrap();
        effect.model_mut().values_mut().copy_from_slice(&eccentric);
        truth.effects.push(effect);
        truth.bake();
    }
    let mut problem = problem_of(&drawing, by, bound(&truth, by, rows(by), 1.0, seed));
    problem.verify = bound(&truth, by, rows(by) / 3, 1.0, seed + 1);
    let identified = Identified {
        calibration: identify(&problem).unwrap(),
        problem,
        joints: Joints::Readings,
        comparison: None,
    };
    diagnose(identified, &|_| {}).unwrap()
}

#[test]
fn what_is_hidden_is_named() {
    let hidden = [3e-4, -2e-4];
    for by in Bound::ALL {
        let diagnosis = diagnosed(by, hidden, 3);
        let named = diagnosis.named.first().unwrap();
        let hypothesis = &named.step.hypothesis;
        assert_eq!(
            hypothesis.label(),
            "joint 2 gear-eccentricity of order 2",
            "{by:?}"
        );
        assert_eq!(diagnosis.named.len(), 1, "{by:?}");
        assert_eq!(diagnosis.answer(), Answer::Explained, "{by:?}");
        // within four standard errors of the truth
        let stage = &diagnosis.identified.calibration.complete;
        let value = named.effects[0].model().values();
        for (k, (found, truth)) in value.iter().zip(hidden).enumerate() {
            let unknown = truepose_host::identify::unknown::Unknown::Effect {
                effect: 0,
                value: k,
            };
            let sigma = stage.fit.sigma(unknown).unwrap();
            assert!(
                (found - truth).abs() < 4.0 * sigma,
                "{by:?}: {found} of {truth}, {sigma}"
            );
            assert!(sigma < 3e-5, "{by:?}: {sigma}");
        }
        // rows that no fit has seen are better by it
        let [without, with] = named.rms;
        assert!(with < 0.7 * without, "{by:?}: {without} to {with} m");
    }
}

#[test]
fn nothing_is_named_where_nothing_is_hidden() {
    for by in Bound::ALL {
        for seed in [3, 5] {
            let diagnosis = diagnosed(by, [0.0; 2], seed);
            let labels: Vec<String> = diagnosis
                .named
                .iter()
                .map(|n| n.step.hypothesis.label())
                .collect();
            assert_eq!(
                diagnosis.answer(),
                Answer::NothingMissing,
                "{by:?}: {labels:?}"
            );
        }
    }
}
