//! What every effect promises: zero at zero, exact partials, linear in its values, finite at
//! extreme inputs, the same in f32, through the blob and under its name, and indifferent to
//! how the frames were baked.

use crate::described::{Baked, Given};
use crate::random::Random;
use crate::samples::{JOINTS, arm, given, one_of_each};
use nalgebra::Vector3;
use truepose::effects::{AXES, Ambient, Effect, KINDS, Reading, Selector, Stage, Wish};
use truepose::jacobian::reading_column;
use truepose::{Convention, Scalar};

/// Displacement of the tool by the partial of value `k`, for either stage.
fn partial(baked: &Baked<f64>, effect: &Effect<'_, f64>, k: usize, given: &Given<f64>) -> [f64; 6] {
    let model = effect.model();
    let mut rows = [0.0; 6];
    baked.predict(&[], given, |posture| {
        rows = match effect.stage() {
            Stage::Reading => {
                let d = model.reading_partial(
                    k,
                    &Reading {
                        q: &given.q,
                        direction: &given.direction,
                        ambient: &given.ambient,
                    },
                );
                let j = model.joint().unwrap_or(usize::MAX);
                let tool = &posture.tool.translation;
                reading_column(posture.joints, posture.frames, j, tool).scaled(d)
            }
            Stage::Posture => {
                let d = model.posture_partial(k, posture);
                d.twist.at(&(posture.tool.translation - d.origin))
            }
        }
        .rows();
    });
    rows
}

fn norm(rows: &[f64; 6]) -> f64 {
    rows.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn a_new_effect_changes_nothing() {
    let mut random = Random(11);
    for case in 0..50 {
        let arm = arm(&mut random, case);
        let mut effects = one_of_each();
        let baked = arm.bake(&mut effects);
        let given = given(&mut random, arm.joints.len());
        let with = baked.predict(&effects, &given, |_| {}).pose();
        let without = baked.predict(&[], &given, |_| {}).pose();
        assert_eq!(with, without);
    }
}

#[test]
fn partials_equal_central_differences_of_the_model() {
    let mut random = Random(12);
    let mut effects = one_of_each();
    let mut seen = vec![[false; 4]; effects.len()];
    for case in 0..60 {
        let arm = arm(&mut random, case);
        let baked = arm.bake(&mut effects);
        let given = given(&mut random, arm.joints.len());
        for (effect, seen) in effects.iter().zip(&mut seen) {
            let values = effect.model().values().len();
            for (k, seen) in seen.iter_mut().enumerate().take(values) {
                let analytic = partial(&baked, effect, k, &given);
                let size = norm(&analytic);
                if size < 1e-9 {
                    continue;
                }
                *seen = true;
                // a displacement of 1e-4 m or rad
                let h = 1e-4 / size;
                let pose = |h: f64| {
                    let mut moved = *effect;
                    moved.model_mut().values_mut()[k] = h;
                    baked.predict(&[moved], &given, |_| {}).pose()
                };
                let numeric = pose(-h).twist_to(&pose(h)).rows();
                for (a, n) in analytic.iter().zip(numeric) {
                    // truncation: third derivatives up to 10 times (1e-4)^2 / 6; rounding:
                    // eps / 1e-4 of poses up to 7 m
                    assert!(
                        (a - n / (2.0 * h)).abs() < 2e-8 * size,
                        "{} {k}: {a} {}",
                        effect.model().kind(),
                        n / (2.0 * h)
                    );
                }
            }
        }
    }
    for (effect, seen) in effects.iter().zip(&seen) {
        let values = effect.model().values().len();
        assert!(
            seen[..values].iter().all(|&s| s),
            "{} never did anything",
            effect.model().kind()
        );
    }
}

/// What an effect does: its addition to a reading, or its displacement of the tool.
fn effect_of<T: Scalar>(baked: &Baked<T>, effect: &Effect<'_, T>, given: &Given<T>) -> [T; 6] {
    let mut rows = [T::zero(); 6];
    baked.predict(&[], given, |posture| {
        rows = match effect.stage() {
            Stage::Reading => {
                let (_, addition) = effect.addition(&Reading {
                    q: &given.q,
                    direction: &given.direction,
                    ambient: &given.ambient,
                });
                [addition; 6]
            }
            Stage::Posture => effect.displacement(posture).rows(),
        };
    });
    rows
}

#[test]
fn effects_are_linear_in_their_values() {
    let mut random = Random(13);
    let mut effects = one_of_each();
    for case in 0..30 {
        let arm = arm(&mut random, case);
        let baked = arm.bake(&mut effects);
        let given = given(&mut random, arm.joints.len());
        for effect in &effects {
            let set = |values: &[f64]| {
                let mut set = *effect;
                set.model_mut().values_mut().copy_from_slice(values);
                effect_of(&baked, &set, &given)
            };
            let count = effect.model().values().len();
            let a: Vec<f64> = (0..count).map(|_| random.unit()).collect();
            let b: Vec<f64> = (0..count).map(|_| random.unit()).collect();
            let sum: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 3.0 * b).collect();
            let (a, b, sum) = (set(&a), set(&b), set(&sum));
            let scale = norm(&a) + norm(&b);
            for i in 0..6 {
                // a few dozen operations
                assert!((2.0 * a[i] - 3.0 * b[i] - sum[i]).abs() <= 1e-13 * scale);
            }
        }
    }
}

#[test]
fn effects_are_finite_at_extreme_inputs() {
    let mut random = Random(14);
    for case in 0..4 {
        let arm = arm(&mut random, case);
        let count = arm.joints.len();
        let mut effects = one_of_each();
        let baked = arm.bake(&mut effects);
        for effect in &mut effects {
            effect.model_mut().values_mut().fill(1.0);
        }
        for q in [0.0, 1e-30, -1e-3, std::f64::consts::PI, 1e3, -1e6] {
            for ambient in [
                Ambient::default(),
                Ambient {
                    payload: 1e6,
                    payload_com: Vector3::new(1e3, -1e3, 0.0),
                    temperature: [1e6; 8],
                    time: 1e12,
                },
                Ambient {
                    payload: 0.0,
                    payload_com: Vector3::zeros(),
                    temperature: [f64::NEG_INFINITY; 8],
                    time: -1e12,
                },
            ] {
                let given = Given {
                    q: vec![q; count],
                    direction: vec![1.0; count],
                    ambient,
                };
                for effect in &effects {
                    let wide = effect_of(&baked, effect, &given);
                    let narrow = effect_of(&baked.cast::<f32>(), &effect.cast(), &given.cast());
                    assert!(
                        wide.iter().all(|x| x.is_finite()) && narrow.iter().all(|x| x.is_finite()),
                        "{} at {q}",
                        effect.model().kind()
                    );
                }
            }
        }
    }
}

#[test]
fn unknown_conditions_switch_their_effects_off() {
    let mut random = Random(15);
    let arm = arm(&mut random, 0);
    let mut effects = one_of_each();
    let baked = arm.bake(&mut effects);
    let mut given = given(&mut random, arm.joints.len());
    given.ambient.temperature = Ambient::<f64>::default().temperature;
    given.ambient.time = Ambient::<f64>::default().time;
    let mut tried = 0;
    for effect in &mut effects {
        let needs = matches!(
            effect.model().kind(),
            "thermal-growth" | "thermal-drift" | "time-drift" | "warm-up" | "step-change"
        );
        if needs {
            tried += 1;
            effect.model_mut().values_mut().fill(1.0);
            assert!(effect_of(&baked, effect, &given).iter().all(|x| *x == 0.0));
        }
    }
    assert_eq!(tried, 7);
}

#[test]
fn f32_effects_stay_within_their_rounding() {
    let mut random = Random(16);
    let mut effects = one_of_each();
    for case in 0..12 {
        let arm = arm(&mut random, case);
        let baked = arm.bake(&mut effects);
        // readings that f32 has exactly: the comparison is of the effects
        let poses: Vec<Given<f64>> = (0..10)
            .map(|_| given(&mut random, arm.joints.len()).cast::<f32>().cast())
            .collect();
        for effect in &effects {
            for k in 0..effect.model().values().len() {
                let columns = poses
                    .iter()
                    .map(|pose| norm(&partial(&baked, effect, k, pose)));
                let largest = columns.fold(0.0, f64::max);
                if largest < 1e-9 {
                    continue;
                }
                // at most 1 mm or mrad
                let mut sized = *effect;
                sized.model_mut().values_mut()[k] = 1e-3 / largest;
                let wides = poses.iter().map(|pose| effect_of(&baked, &sized, pose));
                let wides: Vec<[f64; 6]> = wides.collect();
                let scale = wides.iter().map(norm).fold(0.0, f64::max);
                for (pose, wide) in poses.iter().zip(&wides) {
                    let narrow = effect_of(&baked.cast::<f32>(), &sized.cast(), &pose.cast());
                    // An order of h makes h times the rounding of q (2^-24 of 3 rad) a phase;
                    // the cells of a table and the flanks of a ramp likewise, some 100 times.
                    // Poses up to 7 m from the origin lose as much of their levers.
                    let order = effect.model().selector().order.unwrap_or(1.0).abs();
                    let tolerance = scale * 6e-8 * (100.0 + 3.0 * order);
                    for (w, n) in wide.iter().zip(narrow) {
                        assert!(
                            (w - f64::from(n)).abs() < tolerance,
                            "{} {k}: {w} {n}",
                            effect.model().kind()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn effects_come_back_from_the_blob() {
    let mut random = Random(17);
    let arm = arm(&mut random, 0);
    let mut effects = one_of_each();
    let mut attached = 0;
    for effect in &mut effects {
        for value in effect.model_mut().values_mut() {
            *value = random.unit();
        }
        arm.bake(std::slice::from_mut(effect));
        let mut buffer = [0; 512];
        let bytes = postcard::to_slice(effect, &mut buffer).unwrap();
        let mut back: Effect<'_, f64> = postcard::from_bytes(bytes).unwrap();
        attached += usize::from(back != *effect);
        // what is fixed in the links is not stored
        arm.bake(std::slice::from_mut(&mut back));
        assert_eq!(*effect, back);
        let length = bytes.len();
        assert!(length < 100, "{} takes {length}", back.model().kind());
    }
    assert!(attached > 10);
}

/// Bytes of every sample, values 0.5, 1, 1.5, ... as they have been since layout 1.
#[test]
fn effects_are_stored_as_they_always_were() {
    let mut text = String::new();
    for mut effect in one_of_each() {
        for (k, value) in effect.model_mut().values_mut().iter_mut().enumerate() {
            *value = 0.5 * (k + 1) as f64;
        }
        let mut buffer = [0; 512];
        let bytes = postcard::to_slice(&effect, &mut buffer).unwrap();
        let hex: String = bytes.iter().map(|b| format!("{b:02x}")).collect();
        text += &format!("{} {hex}\n", effect.model().kind());
    }
    let golden = include_str!("golden/effects.txt");
    assert_eq!(text, golden, "found:\n{text}");
}

#[test]
fn unsound_effects_are_told_from_sound_ones() {
    let mut random = Random(18);
    let arm = arm(&mut random, 0);
    let mut effects = one_of_each();
    arm.bake(&mut effects);
    for effect in &effects {
        assert!(effect.is_sound(JOINTS));
        if effect.model().joint().is_some() {
            assert!(!effect.is_sound(0));
        }
        for bad in [f64::NAN, f64::INFINITY] {
            for k in 0..effect.model().values().len() {
                let mut broken = *effect;
                broken.model_mut().values_mut()[k] = bad;
                assert!(!broken.is_sound(JOINTS));
            }
            for k in 0..effect.model().constants().len() {
                let mut broken = *effect;
                broken.model_mut().constants_mut()[k] = bad;
                assert!(!broken.is_sound(JOINTS));
            }
        }
    }
}

#[test]
fn names_and_parameters_match() {
    for effect in one_of_each() {
        let model = effect.model();
        assert_eq!(model.parameters().len(), model.values().len());
        assert_eq!(model.constant_names().len(), model.constants().len());
        if let Effect::Unnamed(_) = effect {
            assert!(Effect::<f64>::named(model.kind(), &model.selector()).is_none());
            continue;
        }
        let found = Effect::<f64>::named(model.kind(), &model.selector()).unwrap();
        assert_eq!(found.model().kind(), model.kind());
        assert_eq!(found.model().selector(), model.selector());
        assert_eq!(
            std::mem::discriminant(&found),
            std::mem::discriminant(&effect)
        );
    }
}

#[test]
fn every_kind_is_found_by_its_name_and_only_with_what_it_wants() {
    let sampled: Vec<&str> = one_of_each().iter().map(|e| e.model().kind()).collect();
    for kind in KINDS {
        assert!(sampled.contains(&kind.name), "{}", kind.name);
        let all = Selector {
            joint: Some(2),
            order: Some(7.0),
            from: (kind.from != Wish::No).then_some(1),
            component: None,
            sensor: None,
        };
        assert!(Effect::<f64>::named(kind.name, &all).is_some());
        let without = |selector: Selector| Effect::<f64>::named(kind.name, &selector).is_some();
        assert_eq!(without(Selector { joint: None, ..all }), kind.base);
        assert_eq!(
            without(Selector { order: None, ..all }),
            kind.order != Wish::Must
        );
        assert_eq!(
            without(Selector { from: None, ..all }),
            kind.from != Wish::Must
        );
        let component = Some(AXES.len() as u8);
        assert!(!without(Selector { component, ..all }));
    }
    assert!(Effect::<f64>::named("early-reading", &Selector::default()).is_none());
}

/// Two nearly equal arms whose baked frames differ by a quarter turn or more must feel their
/// effects alike: what is fixed in a link does not follow the baked frames.
#[test]
fn effects_do_not_notice_how_the_frames_were_baked() {
    let mut random = Random(19);
    let effects = one_of_each();
    let mut jumps = 0;
    for case in 0..60 {
        let mut near = arm(&mut random, case);
        for joint in &mut near.joints {
            if joint.convention == Convention::Dh {
                joint.alpha = 1e-7;
                joint.beta = 0.0;
            }
        }
        let mut far = near.clone();
        for joint in &mut far.joints {
            if joint.convention == Convention::Dh {
                joint.alpha = -1e-7;
                joint.beta = 1e-7;
            }
        }
        let given = given(&mut random, near.joints.len());
        let bakes = [&near, &far].map(|arm| {
            let mut attached = effects.clone();
            let baked = arm.bake(&mut attached);
            (baked, attached)
        });
        let turned = bakes[0].0.joints.iter().zip(&bakes[1].0.joints);
        jumps += turned
            .filter(|(a, b)| (a.tx - b.tx).hypot(a.ty - b.ty) > 0.01)
            .count();
        for (i, effect) in effects.iter().enumerate() {
            for k in 0..effect.model().values().len() {
                let [a, b] = [0, 1].map(|n| {
                    let (baked, attached) = &bakes[n];
                    partial(baked, &attached[i], k, &given)
                });
                let scale = norm(&a) + 1.0;
                for (a, b) in a.iter().zip(b) {
                    // 1e-7 rad at up to 7 joints; orders, beams' L^3 and levers multiply it
                    assert!(
                        (a - b).abs() < 1e-4 * scale,
                        "{} {k}: {a} {b}",
                        effect.model().kind()
                    );
                }
            }
        }
    }
    assert!(jumps > 20, "no baked frame turned: {jumps}");
}
