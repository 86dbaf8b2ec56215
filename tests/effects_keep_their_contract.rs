//! What every effect promises: zero at zero, exact partials, linear in its values, finite at
//! extreme inputs, the same in f32, through the blob and under its name, and indifferent to
//! how the frames were baked.

#[path = "support/described.rs"]
mod described;
mod support;

use described::{Baked, Described, Given};
use nalgebra::Vector3;
use support::Random;
use truepose::effects::{
    AXES, Ambient, AxisWobble, Backlash, BaseFlex, Bends, CrossAxisCompliance, Effect, Factor,
    GearEccentricity, GearRipple, GravityLever, Grows, JointCompliance, JointCoupling, JointCurve,
    JointGain, KINDS, LinkBending, ONE, Place, PrismaticStraightness, Reading, Selector, Shape,
    Stage, StepChange, ThermalDrift, ThermalGrowth, TimeDrift, ToolLoad, Unnamed, Variable, WarmUp,
    Wish, Wobble,
};
use truepose::jacobian::reading_column;
use truepose::{BakedJoint, Convention, Scalar};

/// Fewest joints of an arm that all samples fit on.
const JOINTS: usize = 4;

const COUNTS: [u8; 12] = [1, 0, 0, 0x80, 7, 1, 200, 255, 30, 1, 5, 0];

/// The first sample (`None`) or the one after `effect`. No wildcard: a new variant does not
/// compile until it has a sample here, and the chain of them ends where it says `None`.
fn next(effect: Option<&Effect<'static, f64>>) -> Option<Effect<'static, f64>> {
    let term = |place, shapes: [Shape; 2]| {
        let factors = [
            Factor {
                variable: Variable::Joint(2),
                shape: shapes[0],
            },
            Factor {
                variable: Variable::Joint(0),
                shape: shapes[1],
            },
        ];
        Effect::Unnamed(Unnamed::new(
            place,
            factors,
            [[2.0, -2.5, 2.0], [0.3, -2.8, 3.0]],
        ))
    };
    let Some(effect) = effect else {
        return Some(Effect::JointGain(JointGain::new(1)));
    };
    Some(match effect {
        Effect::JointGain(_) => Effect::GearEccentricity(GearEccentricity::new(2, 3.0)),
        Effect::GearEccentricity(_) => Effect::JointCompliance(JointCompliance::new(1)),
        Effect::JointCompliance(_) => Effect::JointCurve(JointCurve::turn(1, 0.0, &COUNTS)),
        Effect::JointCurve(_) => Effect::CrossAxisCompliance(CrossAxisCompliance::new(1)),
        Effect::CrossAxisCompliance(_) => {
            Effect::ThermalDrift(ThermalDrift::new(Place::Joint(2), 1))
        }
        Effect::ThermalDrift(e) if e.place == Place::Joint(2) => {
            Effect::ThermalDrift(ThermalDrift::new(Place::base(1), 0))
        }
        Effect::ThermalDrift(_) => Effect::TimeDrift(TimeDrift::new(Place::base(5))),
        Effect::TimeDrift(_) => Effect::WarmUp(WarmUp::new(Place::Joint(0), 100.0)),
        Effect::WarmUp(_) => Effect::StepChange(StepChange::new(Place::Joint(3), 40.0)),
        Effect::StepChange(_) => Effect::GearRipple(GearRipple::new(1, -101.0)),
        Effect::GearRipple(_) => Effect::LinkBending(LinkBending::new(1, Bends::AtEnd)),
        Effect::LinkBending(e) if e.bends == Bends::AtEnd => {
            Effect::LinkBending(LinkBending::new(2, Bends::Beam))
        }
        Effect::LinkBending(_) => Effect::BaseFlex(BaseFlex::default()),
        Effect::BaseFlex(_) => Effect::ToolLoad(ToolLoad::new(1)),
        Effect::ToolLoad(_) => Effect::GravityLever(GravityLever::new(1, 2)),
        Effect::GravityLever(_) => Effect::Backlash(Backlash::new(0)),
        Effect::Backlash(_) => Effect::ThermalGrowth(ThermalGrowth::new(2, Grows::Link, 0)),
        Effect::ThermalGrowth(e) if e.grows == Grows::Link => {
            Effect::ThermalGrowth(ThermalGrowth::new(2, Grows::Travel, 0))
        }
        Effect::ThermalGrowth(_) => Effect::JointCoupling(JointCoupling::new(2, 1)),
        Effect::JointCoupling(_) => Effect::AxisWobble(AxisWobble::new(1, Wobble::ALL[0], 1.5)),
        Effect::AxisWobble(e) => match Wobble::ALL.iter().position(|&w| w == e.motion) {
            Some(i) if i < 3 => Effect::AxisWobble(AxisWobble::new(3, Wobble::ALL[i + 1], 2.0)),
            _ => Effect::PrismaticStraightness(PrismaticStraightness::new(0, 0)),
        },
        Effect::PrismaticStraightness(e) if e.axis < 5 => {
            Effect::PrismaticStraightness(PrismaticStraightness::new(0, e.axis + 1))
        }
        Effect::PrismaticStraightness(_) => {
            term(Place::Joint(1), [Shape::Sine, Shape::Polynomial(3)])
        }
        Effect::Unnamed(e) => match e.factors[0].shape {
            Shape::Sine => term(Place::base(3), [Shape::Cosine, Shape::Sign]),
            Shape::Cosine => Effect::Unnamed(Unnamed::new(
                Place::Joint(0),
                [
                    Factor {
                        variable: Variable::Temperature(0),
                        shape: Shape::Polynomial(2),
                    },
                    ONE,
                ],
                [[0.0, 10.0, 40.0], [0.0; 3]],
            )),
            _ => return None,
        },
    })
}

/// A sample of every variant, all values zero.
fn one_of_each() -> Vec<Effect<'static, f64>> {
    let mut all = Vec::new();
    let mut last = next(None);
    while let Some(effect) = last {
        all.push(effect);
        last = next(Some(&effect));
    }
    all
}

impl<T: Scalar> Given<T> {
    fn cast<U: Scalar>(&self) -> Given<U> {
        let c = |x: &T| U::of(x.widen());
        Given {
            q: self.q.iter().map(c).collect(),
            direction: self.direction.iter().map(c).collect(),
            ambient: Ambient {
                payload: c(&self.ambient.payload),
                payload_com: self.ambient.payload_com.map(|x| c(&x)),
                temperature: self.ambient.temperature.each_ref().map(c),
                time: c(&self.ambient.time),
            },
        }
    }
}

impl<T: Scalar> Baked<T> {
    fn cast<U: Scalar>(&self) -> Baked<U> {
        Baked {
            base: self.base.cast(),
            joints: self.joints.iter().map(BakedJoint::cast).collect(),
            tool: self.tool.cast(),
            gravity: self.gravity.map(|x| U::of(x.widen())),
        }
    }
}

fn arm(random: &mut Random, case: usize) -> Described {
    let count = JOINTS + case % 4;
    Described {
        base: random.pose(1.0),
        joints: (0..count).map(|_| random.joint()).collect(),
        masses: (0..count).map(|_| random.mass()).collect(),
        tool: random.pose(0.3),
        gravity: random.vector(9.81),
    }
}

fn given(random: &mut Random, count: usize) -> Given<f64> {
    let mut ambient = Ambient {
        payload: random.within(1.0) + 2.0,
        payload_com: random.vector(0.1),
        time: random.within(50.0) + 50.0,
        ..Ambient::default()
    };
    for t in &mut ambient.temperature {
        *t = random.within(10.0) + 25.0;
    }
    Given {
        q: (0..count).map(|_| random.within(3.3)).collect(),
        direction: (0..count).map(|_| random.within(1.0).signum()).collect(),
        ambient,
    }
}

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
    let golden = include_str!("golden/effects_layout_1.txt");
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
