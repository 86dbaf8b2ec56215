//! What is worked in per request gives what the effects' contract gives, partial by partial.

use crate::described::{Baked, Given};
use crate::random::Random;
use crate::samples::{JOINTS, arm, given, one_of_each};
use truepose::effects::{
    Effect, GearEccentricity, GearRipple, Grows, JointCompliance, JointCurve, JointGain, Reading,
    Stage, ThermalGrowth, encode,
};
use truepose::{Frame, JointKind, Pose, Scalar, Twist, forward};

const TABLE: [u8; 8] = [10, 0, 200, 3, 7, 0x90, 60, 0];

/// By the contract alone: additions to the readings, the chain, displacements of the tool.
fn by_contract(baked: &Baked<f64>, effects: &[Effect<'_, f64>], given: &Given<f64>) -> Pose<f64> {
    let mut corrected = given.q.clone();
    let mut moved = Twist::zero();
    for effect in effects {
        let model = effect.model();
        if effect.stage() == Stage::Reading {
            let at = Reading {
                q: &given.q,
                direction: &given.direction,
                ambient: &given.ambient,
            };
            for (k, value) in model.values().iter().enumerate() {
                let addition = model.reading_partial(k, &at) * value;
                if let Some(q) = model.joint().and_then(|j| corrected.get_mut(j)) {
                    *q += addition;
                }
            }
        }
    }
    let mut frames = vec![Frame::identity(); corrected.len()];
    let rigid = forward(&baked.base, &baked.joints, &corrected, &mut frames).then(&baked.tool);
    let readings: Vec<_> = effects
        .iter()
        .filter(|e| e.stage() == Stage::Reading)
        .copied()
        .collect();
    baked.predict(&readings, given, |posture| {
        for effect in effects.iter().filter(|e| e.stage() == Stage::Posture) {
            let model = effect.model();
            for (k, &value) in model.values().iter().enumerate() {
                let d = model.posture_partial(k, posture);
                let arm = rigid.translation - d.origin;
                moved = moved.plus(&d.twist.at(&arm).scaled(value));
            }
        }
    });
    rigid.displaced(&moved)
}

/// Largest entry of the difference.
fn apart<T: Scalar>(a: &Pose<T>, b: &Pose<f64>) -> f64 {
    let a = a.cast::<f64>();
    let turned = (a.rotation - b.rotation).amax();
    turned.max((a.translation - b.translation).amax())
}

/// Every kind, and several of those that share a joint.
fn many(random: &mut Random, joints: usize) -> Vec<Effect<'static, f64>> {
    let mut effects = one_of_each();
    for j in (0..7).take(joints) {
        effects.push(Effect::JointCompliance(JointCompliance::new(j)));
        effects.push(Effect::JointGain(JointGain::new(j)));
        effects.push(Effect::ThermalGrowth(ThermalGrowth::new(j, Grows::Link, 1)));
        effects.push(Effect::JointCurve(JointCurve::turn(j, 0.0, &TABLE)));
        let order = f64::from(j % 6) + 1.0;
        effects.push(Effect::GearEccentricity(GearEccentricity::new(j, order)));
        effects.push(Effect::GearRipple(GearRipple::new(j, 2.0)));
    }
    // Angles of 1e-3: compliances times N m, curves times counts.
    for effect in &mut effects {
        let unit = match effect {
            Effect::JointCompliance(_) => 1e-5,
            Effect::JointCurve(_) => 1e-6,
            Effect::JointGain(_) | Effect::ThermalGrowth(_) => 1e-4,
            _ => 1e-3,
        };
        for value in effect.model_mut().values_mut() {
            *value = random.within(unit);
        }
    }
    effects
}

#[test]
fn every_kind_alone() {
    let mut random = Random(41);
    for case in 0..40 {
        let arm = arm(&mut random, case);
        let mut effects = many(&mut random, arm.joints.len());
        let baked = arm.bake(&mut effects);
        let given = given(&mut random, arm.joints.len());
        for effect in effects {
            let with = baked.predict(&[effect], &given, |_| {}).pose();
            let off = apart(&with, &by_contract(&baked, &[effect], &given));
            assert!(off < 1e-12, "{effect:?}: {off:e}");
        }
    }
}

#[test]
fn all_together_in_any_order_and_beyond_what_is_told_apart() {
    let mut random = Random(42);
    for case in 0..60 {
        let arm = arm(&mut random, case);
        let mut effects = many(&mut random, arm.joints.len());
        let turn = case % effects.len();
        effects.rotate_left(turn);
        let baked = arm.bake(&mut effects);
        let given = given(&mut random, arm.joints.len());
        assert!(effects.len() > 64 || arm.joints.len() < JOINTS + 3);
        let with = baked.predict(&effects, &given, |_| {}).pose();
        let off = apart(&with, &by_contract(&baked, &effects, &given));
        assert!(off < 1e-12, "{off:e}");
    }
}

#[test]
fn in_f32_within_its_rounding() {
    let mut random = Random(43);
    let mut slides = 0;
    for case in 0..60 {
        let arm = arm(&mut random, case);
        slides += arm
            .joints
            .iter()
            .filter(|j| j.kind == JointKind::Prismatic)
            .count();
        let mut effects = many(&mut random, arm.joints.len());
        let baked = arm.bake(&mut effects);
        let given = given(&mut random, arm.joints.len());
        let exact = by_contract(&baked, &effects, &given);
        let rounded: Vec<Effect<'_, f32>> = effects.iter().map(Effect::cast).collect();
        let with = baked
            .cast::<f32>()
            .predict(&rounded, &given.cast(), |_| {})
            .pose();
        // Readings of up to 3.3 rad and coordinates of up to 8 m, rounded a few times.
        let off = apart(&with, &exact);
        assert!(off < 1e-5, "{off:e}");
    }
    assert!(slides > 20, "{slides}");
}

/// A table that can be looked up by integers is looked up many periods away, on both sides of
/// zero, at its ends and beside what was not measured.
#[test]
fn curves_in_f32_anywhere() {
    let mut random = Random(44);
    let mut largest: f64 = 0.0;
    for cells in [1, 2, 3, 7, 180, 181, 720] {
        for gaps in [false, true] {
            let values: Vec<f64> = (0..cells)
                .map(|_| match gaps && random.within(1.0) > 0.5 {
                    true => f64::NAN,
                    false => random.within(1e-3),
                })
                .collect();
            let mut table = vec![0; 2 * cells];
            let scale = encode(&values, &mut table).unwrap();
            let period = 1.0 + random.within(0.5);
            let curve = JointCurve::over(0, period, scale, &table);
            let effects = [Effect::JointCurve(curve)];
            let mut arm = arm(&mut random, 0);
            for joint in &mut arm.joints {
                joint.kind = JointKind::Prismatic;
            }
            let baked = arm.bake(&mut effects.clone());
            let rounded = effects.map(|effect| effect.cast());
            let single = baked.cast::<f32>();
            let mut given = given(&mut random, arm.joints.len());
            for _ in 0..300 {
                given.q[0] = f64::from((random.within(120.0) * period) as f32);
                let with = |effects: &[Effect<'_, f32>]| {
                    single.predict(effects, &given.cast(), |_| {}).pose()
                };
                let moved = with(&rounded).translation - with(&[]).translation;
                let at = Reading {
                    q: &given.q,
                    direction: &given.direction,
                    ambient: &given.ambient,
                };
                let wanted = effects[0].addition(&at).1;
                // Places of up to 180 m, and up to 720 cells a period: both have 24 bits.
                let off = (f64::from(moved.norm()) - wanted.abs()).abs();
                assert!(off < 1e-4, "{cells} cells, {}: {off:e}", given.q[0]);
                largest = largest.max(wanted.abs());
            }
        }
    }
    assert!(largest > 9e-4, "{largest}");
}
