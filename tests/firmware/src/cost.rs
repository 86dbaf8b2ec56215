//! The functions of the control loop, called so that `tools/cost` can count them.
//!
//! Writes `name: meaning` for each function of [`measured`], `name = a - b: meaning` for what is
//! the difference of two. By the clock, in instructions over those of a rigid arm, `effect KIND:
//! first further prepared` for what a first and a second effect of a kind add to one evaluation
//! of the model, and the first to its preparation; `effects SET: evaluation prepared` likewise
//! for all of a set together.

use core::fmt::{self, Write};
use core::hint::black_box;

use nalgebra::{Matrix6, Vector6};
use truepose::budget::Clock;
use truepose::compensate::{Compensator, Request};
use truepose::effects::{
    Ambient, Backlash, Conditions, Effect, GearEccentricity, GearRipple, Grows, JointCompliance,
    JointCurve, JointGain, KINDS, Selector, ThermalGrowth, Wish,
};
use truepose::jacobian::joint_column;
use truepose::link::Stage;
use truepose::{Frame, Method, Model, PreparedJoint, Room, Settings, forward, params};

use crate::arm::{JOINTS, TRAVEL, baked, offset};
use crate::draws::Draws;
use crate::parameters::{RIGID, SPHERICAL, WITH_EFFECTS};
use crate::transfer::Desk;

/// Calls of each function.
const CALLS: usize = 64;

/// Poses that are compensated, clear of singular ones.
const POSES: usize = 1000;

/// What is counted: each function's whole call, arguments already in place.
pub mod measured {
    use truepose::budget::{Budget, NoClock};
    use truepose::compensate::{Compensator, Outcome, Request};
    use truepose::effects::Conditions;
    use truepose::link::Event;
    use truepose::params::BlobError;
    use truepose::{
        BakedChain, Frame, Model, Pose, Prepared, PreparedJoint, Room, Scalar, forward, params,
    };

    use crate::arm::JOINTS;
    use crate::transfer::Desk;

    /// Sine and cosine of one angle (rad).
    #[inline(never)]
    pub fn sine_and_cosine(angle: f32) -> (f32, f32) {
        angle.sincos()
    }

    /// All frames and the tool pose of a rigid chain.
    #[inline(never)]
    pub fn forward_kinematics(
        chain: &BakedChain<f32, JOINTS>,
        q: &[f32; JOINTS],
        frames: &mut [Frame<f32>; JOINTS],
    ) -> Pose<f32> {
        forward(&chain.base, &chain.joints, q, frames).then(&chain.tool)
    }

    /// The model under conditions.
    #[inline(never)]
    pub fn preparation<'p>(
        model: &'p Model<'_, f32, JOINTS>,
        conditions: &'p Conditions<f32, JOINTS>,
        joints: &'p mut [PreparedJoint<'p, f32>; JOINTS],
    ) -> Prepared<'p, f32> {
        model.prepare(conditions, joints)
    }

    /// Where the model puts the tool.
    #[inline(never)]
    pub fn prediction(
        model: &Prepared<'_, f32>,
        q: &[f32; JOINTS],
        room: &mut Room<f32, JOINTS>,
    ) -> Pose<f32> {
        model.predict(q, &mut room.scratch()).pose()
    }

    /// A pose from its nominal joints.
    #[inline(never)]
    pub fn compensated_pose(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::unlimited())
    }

    /// The same with a compensator that ends after its first iteration. Another budget: two
    /// functions of the same code would become one.
    #[inline(never)]
    pub fn pose_in_one_iteration(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 31))
    }

    /// And with one that ends after its second. Again another budget.
    #[inline(never)]
    pub fn pose_in_two_iterations(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 30))
    }

    /// One step of the linear quadratic regulator. Again another budget.
    #[inline(never)]
    pub fn regulated_pose(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 29))
    }

    /// The same at a price that is felt. Again another budget.
    #[inline(never)]
    pub fn regulated_pose_at_a_price(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 25))
    }

    /// A pose of an arm with effects. Again another budget.
    #[inline(never)]
    pub fn pose_with_effects(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 28))
    }

    /// Nominal joints alone.
    #[inline(never)]
    pub fn compensated_joints(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        q: &[f32; JOINTS],
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(&Request::joints(*q), &mut Budget::unlimited())
    }

    /// A pose of an arm whose wrist's axes meet. Again another budget.
    #[inline(never)]
    pub fn pose_of_spherical_wrist(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 27))
    }

    /// And of one that just is none. Again another budget.
    #[inline(never)]
    pub fn pose_of_other_wrist(
        compensator: &mut Compensator<'_, f32, JOINTS>,
        request: &Request<f32, JOINTS>,
    ) -> Outcome<f32, JOINTS> {
        compensator.correct(request, &mut Budget::cycles(&NoClock, 1 << 26))
    }

    /// The blob of a rigid arm, from bytes to the baked model.
    #[inline(never)]
    pub fn decode<'a>(blob: &'a [u8], model: &mut Model<'a, f32, JOINTS>) -> Result<(), BlobError> {
        params::decode_into(blob, model)
    }

    /// A piece of the link's work.
    #[inline(never)]
    pub fn poll(desk: &mut Desk) -> Event {
        desk.poll()
    }

    /// The piece that checks a blob. The result is hidden: two functions of the same code would
    /// become one.
    #[inline(never)]
    pub fn poll_that_checks(desk: &mut Desk) -> Event {
        core::hint::black_box(desk.poll())
    }

    /// No work at all. Hidden otherwise.
    #[inline(never)]
    pub fn idle_poll(desk: &mut Desk) -> Event {
        core::hint::black_box(desk).poll()
    }
}

fn joints(draws: &mut Draws) -> [f32; JOINTS] {
    TRAVEL.map(|travel| travel * draws.symmetric())
}

/// Calls each function and writes what it is.
pub fn print(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    let model = params::decode::<f32, JOINTS>(RIGID).map_err(|_| fmt::Error)?;
    kinematics(out, &model)?;
    compensation(out, &model)?;
    writeln!(
        out,
        "decode: a rigid arm's blob, checked and rounded into a model that is there"
    )?;
    let mut decoded = Model::empty();
    measured::decode(black_box(RIGID), &mut decoded).map_err(|_| fmt::Error)?;
    black_box(&decoded);
    link(out)?;
    effects(out, &model, clock)
}

fn link(out: &mut dyn Write) -> fmt::Result {
    writeln!(
        out,
        "poll: a piece of the link's work, a blob coming and being kept in a flash that never waits"
    )?;
    writeln!(
        out,
        "poll_that_checks: the one piece that checks the blob that came"
    )?;
    writeln!(out, "idle_poll: nothing to do")?;
    let mut desk = Desk::new()?;
    desk.send(|desk, stage| match stage {
        Stage::Checking => measured::poll_that_checks(black_box(desk)),
        _ => measured::poll(black_box(desk)),
    })?;
    for _ in 0..CALLS {
        black_box(measured::idle_poll(black_box(&mut desk)));
    }
    Ok(())
}

fn kinematics(out: &mut dyn Write, model: &Model<'_, f32, JOINTS>) -> fmt::Result {
    let mut draws = Draws::seeded(2);
    writeln!(out, "sine_and_cosine: of one angle, both")?;
    for _ in 0..CALLS {
        black_box(measured::sine_and_cosine(black_box(
            6.3 * draws.symmetric(),
        )));
    }
    writeln!(
        out,
        "forward_kinematics: all frames and the tool pose; 6 revolute joints, base and tool"
    )?;
    let mut frames = [Frame::identity(); JOINTS];
    for _ in 0..CALLS {
        let q = joints(&mut draws);
        black_box(&measured::forward_kinematics(
            black_box(&model.calibrated),
            black_box(&q),
            &mut frames,
        ));
        black_box(&frames);
    }
    Ok(())
}

fn compensation(out: &mut dyn Write, model: &Model<'_, f32, JOINTS>) -> fmt::Result {
    writeln!(
        out,
        "compensated_pose: a pose given, from its nominal joints; limits, checks and report included"
    )?;
    writeln!(
        out,
        "pose_in_one_iteration: the same, stopped after one iteration"
    )?;
    writeln!(
        out,
        "pose_in_two_iterations: the same, stopped after two iterations"
    )?;
    writeln!(
        out,
        "iteration = pose_in_two_iterations - pose_in_one_iteration: a step and its evaluation, where the step's bound does not save it"
    )?;
    writeln!(
        out,
        "compensated_joints: the same from the nominal joints alone, whose pose is computed first"
    )?;
    writeln!(
        out,
        "regulated_pose: a pose given, one step of the linear quadratic regulator, its end bounded"
    )?;
    writeln!(
        out,
        "regulated_pose_at_a_price: the same, 1e-5 asked of corrections in place of 1e-7, which is felt"
    )?;
    writeln!(
        out,
        "pose_with_effects: a pose given, the model with six effects: a gain, two harmonics, three compliances"
    )?;
    writeln!(
        out,
        "pose_of_spherical_wrist: a pose given, calibrated are joint offsets and tool alone: closed-form steps (MRD 5.45)"
    )?;
    writeln!(
        out,
        "pose_of_other_wrist: the same, axes 2 and 3 off parallel by 10 urad: the steps of any arm"
    )?;
    let with_effects = params::decode::<f32, JOINTS>(WITH_EFFECTS).map_err(|_| fmt::Error)?;
    let mut draws = Draws::seeded(4);
    let mut bent = Compensator::new(&with_effects);
    let mut regulator = Compensator::new(model).with_settings(Settings {
        method: Method::Lqr,
        max_iterations: 1,
        ..model.settings
    });
    let mut dear = regulator.clone().with_settings(Settings {
        effort: 1e-5,
        ..*regulator.settings()
    });
    let mut compensator = Compensator::new(model);
    let mut once = Compensator::new(model).with_settings(Settings {
        max_iterations: 1,
        ..model.settings
    });
    let mut twice = Compensator::new(model).with_settings(Settings {
        max_iterations: 2,
        ..model.settings
    });
    let spherical = params::decode::<f32, JOINTS>(SPHERICAL).map_err(|_| fmt::Error)?;
    let skew = Model {
        calibrated: baked(&offset(1e-5)).cast(),
        ..spherical.clone()
    };
    let mut wrist = Compensator::new(&spherical);
    let mut other = Compensator::new(&skew);
    let mut calls = 0;
    while calls < POSES {
        let q = joints(&mut draws);
        if !clear(model, &q) {
            continue;
        }
        calls += 1;
        let request = Request::pose(model.nominal_pose(&q), q);
        compensator.reset();
        black_box(&measured::compensated_pose(
            black_box(&mut compensator),
            black_box(&request),
        ));
        once.reset();
        black_box(&measured::pose_in_one_iteration(
            black_box(&mut once),
            black_box(&request),
        ));
        twice.reset();
        black_box(&measured::pose_in_two_iterations(
            black_box(&mut twice),
            black_box(&request),
        ));
        regulator.reset();
        black_box(&measured::regulated_pose(
            black_box(&mut regulator),
            black_box(&request),
        ));
        wrist.reset();
        black_box(&measured::pose_of_spherical_wrist(
            black_box(&mut wrist),
            black_box(&request),
        ));
        other.reset();
        black_box(&measured::pose_of_other_wrist(
            black_box(&mut other),
            black_box(&request),
        ));
        dear.reset();
        black_box(&measured::regulated_pose_at_a_price(
            black_box(&mut dear),
            black_box(&request),
        ));
        bent.reset();
        black_box(&measured::pose_with_effects(
            black_box(&mut bent),
            black_box(&request),
        ));
        compensator.reset();
        black_box(&measured::compensated_joints(
            black_box(&mut compensator),
            black_box(&q),
        ));
    }
    Ok(())
}

/// Whether no singular value of the joint Jacobian (m and rad per rad) is below 0.05: all
/// squares are larger where the matrix less them is positive definite.
fn clear(model: &Model<'_, f32, JOINTS>, q: &[f32; JOINTS]) -> bool {
    let chain = &model.calibrated;
    let mut frames = [Frame::identity(); JOINTS];
    let tool = forward(&chain.base, &chain.joints, q, &mut frames).then(&chain.tool);
    let mut normal = Matrix6::identity() * (-0.05 * 0.05);
    for (joint, frame) in chain.joints.iter().zip(&frames) {
        let column = Vector6::from(joint_column(joint.kind, frame, &tool.translation).rows());
        normal += column * column.transpose();
    }
    normal.cholesky().is_some()
}

/// Most instructions of one evaluation over a few poses, and of the preparation for it.
fn evaluation(model: &Model<'_, f32, JOINTS>, clock: &impl Clock) -> [u32; 2] {
    let mut draws = Draws::seeded(5);
    let mut conditions = Conditions {
        direction: [1.0; JOINTS],
        ambient: Ambient {
            payload: 3.0,
            time: 60.0,
            ..Ambient::default()
        },
    };
    conditions.ambient.temperature.fill(30.0);
    let mut places = [PreparedJoint::empty(); JOINTS];
    let began = clock.now();
    let prepared = measured::preparation(black_box(model), black_box(&conditions), &mut places);
    let preparation = clock.elapsed(began);
    let mut room = Room::default();
    let mut most = 0;
    for _ in 0..CALLS {
        let q = joints(&mut draws);
        let began = clock.now();
        black_box(&measured::prediction(
            black_box(&prepared),
            black_box(&q),
            &mut room,
        ));
        most = most.max(clock.elapsed(began));
    }
    [most, preparation]
}

fn effects(out: &mut dyn Write, model: &Model<'_, f32, JOINTS>, clock: &impl Clock) -> fmt::Result {
    writeln!(
        out,
        "preparation: what stays while the conditions do, once a request; all effects below"
    )?;
    writeln!(
        out,
        "prediction: where the model puts the tool, all poses and effects below"
    )?;
    let rigid = evaluation(model, clock);
    let added = |effects: &mut dyn Iterator<Item = Effect<'static, f32>>| {
        let mut loaded = model.clone();
        loaded.effects = effects.collect();
        let [most, preparation] = evaluation(&loaded, clock);
        [
            most.saturating_sub(rigid[0]),
            preparation.saturating_sub(rigid[1]),
        ]
    };
    let selector = Selector {
        joint: Some(2),
        ..Selector::default()
    };
    for kind in KINDS {
        // A second harmonic has another order: those of the same are added up.
        let [first, second] = [2.0, 1.0].map(|order| {
            let selector = Selector {
                from: (kind.from == Wish::Must).then_some(1),
                order: Some(order),
                ..selector
            };
            let mut effect = Effect::<f32>::named(kind.name, &selector)?;
            for value in effect.model_mut().values_mut() {
                *value = 1e-4;
            }
            if let Effect::JointCurve(curve) = &mut effect {
                *curve = JointCurve::turn(curve.joint, 1e-8, &CURVE);
            }
            Some(effect)
        });
        // An effect of the base takes no joint.
        let (Some(first), Some(second)) = (first, second) else {
            continue;
        };
        let [one, preparation] = added(&mut [first].into_iter());
        let [two, _] = added(&mut [first, second].into_iter());
        let further = two.saturating_sub(one);
        writeln!(out, "effect {}: {one} {further} {preparation}", kind.name)?;
    }
    let mut set = |name: &str, effects: &mut dyn Iterator<Item = Effect<'static, f32>>| {
        let [most, preparation] = added(effects);
        writeln!(out, "effects {name}: {most} {preparation}")
    };
    set(
        "joint-compliance on six joints, payload",
        &mut (0..6).map(|j| Effect::JointCompliance(compliance(j))),
    )?;
    set(
        "joint-gain, backlash, thermal-growth on six joints",
        &mut (0..6).flat_map(|j| {
            let mut gain = JointGain::new(j);
            gain.gain = [1e-5];
            let mut backlash = Backlash::new(j);
            backlash.backlash = [1e-4];
            let mut growth = ThermalGrowth::new(j, Grows::Link, 0);
            growth.growth = [1e-5];
            [
                Effect::JointGain(gain),
                Effect::Backlash(backlash),
                Effect::ThermalGrowth(growth),
            ]
        }),
    )?;
    set(
        "joint-curve of 180 cells on six joints",
        &mut (0..6).map(|j| Effect::JointCurve(JointCurve::turn(j, 1e-8, &CURVE))),
    )?;
    set(
        "gear-eccentricity of order 1 on one joint",
        &mut [harmonic(2, 1.0)].into_iter(),
    )?;
    set(
        "gear-eccentricity of orders 1 and 2 on one joint",
        &mut [harmonic(2, 1.0), harmonic(2, 2.0)].into_iter(),
    )?;
    set(
        "gear-eccentricity of orders 1 and 2 on six joints",
        &mut (0..6).flat_map(|j| [harmonic(j, 1.0), harmonic(j, 2.0)]),
    )?;
    let mut ripple = GearRipple::new(2, 160.0);
    ripple.amplitude = [1e-5; 2];
    set(
        "gear-ripple of order 160 on one joint",
        &mut [Effect::GearRipple(ripple)].into_iter(),
    )
}

/// Table of a joint's curve in cells of two degrees.
static CURVE: [u8; 360] = [7; 360];

fn compliance(joint: u8) -> JointCompliance<f32> {
    let mut compliance = JointCompliance::new(joint);
    compliance.compliance = [1e-6];
    compliance
}

fn harmonic(joint: u8, order: f32) -> Effect<'static, f32> {
    let mut harmonic = GearEccentricity::new(joint, order);
    harmonic.amplitude = [1e-4; 2];
    Effect::GearEccentricity(harmonic)
}
