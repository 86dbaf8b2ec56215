//! Two explanations that the measured poses cannot tell apart, and the poses that do.

use crate::synthetic::{SIGMAS, Seen, arm, built, measured, problem};
use nalgebra::Vector3;
use truepose::Convention;
use truepose::effects::{Effect, GearEccentricity};
use truepose_host::diagnose::hypothesis::Hypothesis;
use truepose_host::diagnose::model::Extended;
use truepose_host::diagnose::{Diagnosis, UNDECIDED, diagnose};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::evaluator::Evaluator;
use truepose_host::identify::linearize::residuals;
use truepose_host::identify::observation::Observation;
use truepose_host::identify::problem::Joints;
use truepose_host::identify::readings::Identified;
use truepose_host::identify::{geometry, identify};
use truepose_host::plan::discriminate;
use truepose_host::random::Random;

/// Joint 3's gear runs out of true once a turn.
const JOINT: u8 = 2;

fn diagnosed(drawing: &ArmModel, rows: &[Observation], verify: &[Observation]) -> Diagnosis {
    let mut problem = problem(drawing, rows.to_vec());
    problem.verify = verify.to_vec();
    let calibration = identify(&problem).unwrap();
    let identified = Identified {
        problem,
        calibration,
        joints: Joints::Readings,
        comparison: None,
    };
    diagnose(identified, &|_| {}).unwrap()
}

/// Rivals that these rows leave open.
fn open(diagnosis: &Diagnosis) -> usize {
    let rivals = diagnosis.named.iter().flat_map(|n| &n.rivals);
    rivals
        .filter(|r| r.delta_bic < UNDECIDED && r.similarity > 0.7)
        .count()
}

#[test]
fn chosen_poses_decide_what_a_narrow_range_left_open() {
    let drawing = arm(Convention::Dh, "RRRRRR", &[], 3);
    let mut truth = built(&drawing, 1e-3, 3);
    let mut gear = GearEccentricity::new(JOINT, 1.0);
    gear.amplitude = [4e-4, 0.0];
    truth.effects.push(Effect::GearEccentricity(gear));
    truth.bake();

    // a tenth of a turn: a sine there is nearly a straight line
    let all = measured(&truth, Seen::Position, 3000, 1.0, 3);
    let narrow: Vec<Observation> = all
        .into_iter()
        .filter(|o| o.q[usize::from(JOINT)].abs() < 0.3)
        .collect();
    let (rows, verify) = narrow.split_at(narrow.len() * 3 / 4);
    let before = diagnosed(&drawing, rows, verify);
    assert!(open(&before) > 0, "nothing open: {:?}", before.named);

    let limits = vec![[-3.0, 3.0]; 6];
    let decision = discriminate(&before, &limits, 20, 1).unwrap();
    assert_eq!(decision.poses.len(), 20);
    for dispute in &decision.disputes {
        assert!(dispute.planned > 4.0 * UNDECIDED, "{dispute:?}");
    }

    let mut random = Random::new(9, 9);
    let mut evaluator = Evaluator::new(&truth, SIGMAS);
    let mut more = rows.to_vec();
    for q in &decision.poses {
        let mut o = Observation {
            q: q.clone(),
            row: more.len() + 1000,
            ..rows[0].clone()
        };
        let pose = evaluator.observe(&o);
        let noise = Vector3::new(random.normal(), random.normal(), random.normal());
        o.position = Some(pose.translation + noise * SIGMAS.position);
        more.push(o);
    }
    // each explanation fitted to the rows there were, and to those with the chosen ones
    let squares = |rows: &[Observation], hypothesis: &Hypothesis| {
        let calibration = &before.identified.calibration;
        let rows: Vec<&Observation> = rows.iter().collect();
        let unknowns = geometry(&before.identified.problem, calibration);
        let arm = &calibration.geometric.arm;
        let accepted = vec![hypothesis.clone()];
        let fitted = Extended::fitted(arm, &unknowns, accepted, &rows, SIGMAS).unwrap();
        residuals(&fitted.arm, &rows, SIGMAS).norm_squared()
    };
    let found = &before.named[0];
    let truth = found
        .rivals
        .iter()
        .map(|r| &r.hypothesis)
        .find(|h| h.kind == "gear-eccentricity" && near(h.order, 1.0))
        .unwrap();
    let lead = |rows: &[Observation]| squares(rows, &found.step.hypothesis) - squares(rows, truth);
    assert!(lead(rows).abs() < UNDECIDED, "{}", lead(rows));
    assert!(lead(&more) > 10.0 * UNDECIDED, "{}", lead(&more));

    // the diagnosis of all rows names the true one
    let after = diagnosed(&drawing, &more, verify);
    let named = &after.named[0].step.hypothesis;
    assert_eq!(named.kind, "gear-eccentricity", "{}", named.label());
    assert_eq!(named.joint, Some(usize::from(JOINT)));
    assert!(near(named.order, 1.0), "{}", named.label());
}

fn near(order: Option<f64>, wanted: f64) -> bool {
    order.is_some_and(|order| (order - wanted).abs() < 1e-9)
}
