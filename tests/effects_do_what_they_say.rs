//! Effects against closed formulas on arms simple enough to have one.

use crate::described::{Described, Given};
use crate::random::Random;
use nalgebra::Vector3;
use truepose::effects::{
    Ambient, AxisWobble, BaseFlex, Bends, CrossAxisCompliance, Effect, Factor, GravityLever, Grows,
    JointCompliance, JointCurve, LinkBending, ONE, Place, Reading, Shape, StepChange,
    ThermalGrowth, ToolLoad, UNMEASURED, Unnamed, Variable, WarmUp, Wobble, encode, hat,
};
use truepose::{Joint, JointKind, LinkMass, Pose, Twist};

const G: f64 = 9.81;
/// One rounding or a few of numbers up to 1.
const EXACT: f64 = 1e-15;

/// An arm of parallel horizontal axes (along -y of the world), links of 0.5 m, straight out
/// along x at zero reading.
fn planar(count: usize) -> Described {
    let link = Joint::dh(JointKind::Revolute, 0.0, 0.0, 0.5, 0.0);
    Described {
        base: Pose::rotate_x(std::f64::consts::FRAC_PI_2),
        joints: vec![link; count],
        masses: vec![LinkMass::none(); count],
        tool: Pose::identity(),
        gravity: Vector3::new(0.0, 0.0, -G),
    }
}

fn resting(q: &[f64], payload: f64) -> Given<f64> {
    Given {
        q: q.to_vec(),
        direction: vec![0.0; q.len()],
        ambient: Ambient {
            payload,
            ..Ambient::default()
        },
    }
}

fn twist(
    arm: &Described,
    effect: Effect<'_, f64>,
    values: &[f64],
    given: &Given<f64>,
) -> Twist<f64> {
    let mut effects = [effect];
    let baked = arm.bake(&mut effects);
    effects[0].model_mut().values_mut().copy_from_slice(values);
    let with = baked.predict(&effects, given, |_| {});
    let without = baked.predict(&[], given, |_| {});
    without.rigid.twist_to(&with.rigid).plus(&with.twist)
}

fn assert_twist(found: &Twist<f64>, linear: [f64; 3], angular: [f64; 3], tolerance: f64) {
    let expected = Twist::new(Vector3::from(linear), Vector3::from(angular));
    let off = (found.linear - expected.linear).norm() + (found.angular - expected.angular).norm();
    assert!(off < tolerance, "{found:?} is not {expected:?}");
}

#[test]
fn a_cantilever_sags_by_a_third_of_its_cube() {
    let arm = planar(1);
    // 1/EI, first axis the joint's own
    let c = 1e-4;
    let f = 2.0 * G;
    let sag = c * f * 0.125 / 3.0;
    let slope = c * f * 0.25 / 2.0;
    let bent = twist(
        &arm,
        Effect::LinkBending(LinkBending::new(0, Bends::Beam)),
        &[c, 0.0],
        &resting(&[0.0], 2.0),
    );
    // the end turns downward: about +y
    assert_twist(&bent, [0.0, 0.0, -sag], [0.0, slope, 0.0], EXACT);
    // soft at its end it only turns there, and an end load has no lever
    let end = |payload_com| {
        let mut given = resting(&[0.0], 2.0);
        given.ambient.payload_com = payload_com;
        let soft = Effect::LinkBending(LinkBending::new(0, Bends::AtEnd));
        twist(&arm, soft, &[c, 0.0], &given)
    };
    assert_twist(&end(Vector3::zeros()), [0.0; 3], [0.0; 3], EXACT);
    let turn = c * f * 0.2;
    assert_twist(&end(Vector3::x() * 0.2), [0.0; 3], [0.0, turn, 0.0], EXACT);
    // no lateral load, no lateral bending
    let other = twist(
        &arm,
        Effect::LinkBending(LinkBending::new(0, Bends::Beam)),
        &[0.0, c],
        &resting(&[0.0], 2.0),
    );
    assert_twist(&other, [0.0; 3], [0.0; 3], EXACT);
}

#[test]
fn a_soft_joint_turns_by_its_torque_and_an_unknown_tool_is_one_at_its_point() {
    let arm = planar(2);
    let c = 1e-5;
    let torque = 3.0 * G * 1.0;
    // small angles: the pose turns by c * torque about +y through the first joint
    let turn = c * torque;
    let soft = twist(
        &arm,
        Effect::JointCompliance(JointCompliance::new(0)),
        &[c],
        &resting(&[0.0, 0.0], 3.0),
    );
    assert_twist(&soft, [0.0, 0.0, -turn], [0.0, turn, 0.0], EXACT);
    let tool = twist(
        &arm,
        Effect::ToolLoad(ToolLoad::new(0)),
        &[3.0 * c],
        &resting(&[0.0, 0.0], 0.0),
    );
    assert_twist(&tool, [0.0, 0.0, -turn], [0.0, turn, 0.0], EXACT);
}

/// Levers of all links beyond a joint make up its compliance under any masses.
#[test]
fn free_levers_span_the_compliance_of_links_with_unknown_masses() {
    let mut random = Random(21);
    let mut arm = planar(3);
    for (joint, mass) in arm.joints.iter_mut().zip(&mut arm.masses) {
        *joint = random.joint();
        joint.kind = JointKind::Revolute;
        *mass = random.mass();
    }
    arm.base = random.pose(1.0);
    let joint = 1;
    let columns = |given: &Given<f64>| -> Vec<f64> {
        let mut effects: Vec<Effect<'_, f64>> = (joint..3)
            .map(|link| Effect::GravityLever(GravityLever::new(joint as u8, link as u8)))
            .collect();
        effects.push(Effect::JointCompliance(JointCompliance::new(joint as u8)));
        let baked = arm.bake(&mut effects);
        let mut row = Vec::new();
        baked.predict(&[], given, |posture| {
            for effect in &effects {
                let model = effect.model();
                for k in 0..model.values().len() {
                    let d = model.posture_partial(k, posture);
                    // the turn about the joint's axis
                    row.push(d.twist.angular.dot(&posture.frames[joint].axis()));
                }
            }
        });
        row
    };
    let rows: Vec<f64> = (0..40)
        .flat_map(|_| {
            let q = [random.within(3.0), random.within(3.0), random.within(3.0)];
            columns(&resting(&q, 0.0))
        })
        .collect();
    let table = nalgebra::DMatrix::from_row_slice(40, 5, &rows);
    let levers = table.columns(0, 4).into_owned();
    let torque = table.column(4).into_owned();
    let svd = levers.clone().svd(true, true);
    assert!(svd.singular_values.min() > 1e-2);
    let found = svd.solve(&torque, 1e-12).unwrap();
    // rounding times the conditioning of four columns
    assert!((levers * found - &torque).norm() < 1e-11 * torque.norm());
}

#[test]
fn a_tilting_bearing_leans_across_its_axis_only() {
    // A vertical first axis with an arm of 0.5 m: the whole moment is across it.
    let mut arm = planar(1);
    arm.base = Pose::translate(0.0, 0.0, 0.4);
    let c = 1e-5;
    let tilt = c * 2.0 * G * 0.5;
    let lean = twist(
        &arm,
        Effect::CrossAxisCompliance(CrossAxisCompliance::new(0)),
        &[c],
        &resting(&[0.0], 2.0),
    );
    assert_twist(&lean, [0.0, 0.0, -0.5 * tilt], [0.0, tilt, 0.0], EXACT);
    // About a horizontal axis it is all torque, nothing across.
    let none = twist(
        &planar(1),
        Effect::CrossAxisCompliance(CrossAxisCompliance::new(0)),
        &[c],
        &resting(&[0.3], 2.0),
    );
    assert_twist(&none, [0.0; 3], [0.0; 3], EXACT);
}

#[test]
fn a_soft_base_tilts_about_its_own_axes_and_origin() {
    // The base stands 0.3 m below the shoulder, turned by a quarter about the vertical: its x
    // is the world's y.
    let mut arm = planar(1);
    arm.base = Pose::rotate_z(std::f64::consts::FRAC_PI_2);
    let shoulder = Joint::dh(
        JointKind::Revolute,
        -std::f64::consts::FRAC_PI_2,
        0.3,
        0.5,
        0.0,
    );
    arm.joints = vec![shoulder];
    let c = 1e-5;
    let tilt = c * 2.0 * G * 0.5;
    let given = resting(&[0.0], 2.0);
    let flex =
        |values: [f64; 2]| twist(&arm, Effect::BaseFlex(BaseFlex::default()), &values, &given);
    let linear = [0.3 * tilt, 0.0, -0.5 * tilt];
    assert_twist(&flex([c, 0.0]), linear, [0.0, tilt, 0.0], EXACT);
    assert_twist(&flex([0.0, c]), [0.0; 3], [0.0; 3], EXACT);
}

#[test]
fn a_link_grows_along_itself_and_a_slide_with_its_way() {
    let mut arm = planar(2);
    arm.joints[0].d = 0.2;
    let mut given = resting(&[0.0, 1.0], 0.0);
    given.ambient.temperature[1] = 30.0;
    let grown = twist(
        &arm,
        Effect::ThermalGrowth(ThermalGrowth::new(0, Grows::Link, 1)),
        &[2e-5],
        &given,
    );
    // 10 K above 20 degC; d lies along -y of the world
    assert_twist(&grown, [1e-4, -4e-5, 0.0], [0.0; 3], EXACT);
    let rail = Described {
        joints: vec![Joint::dh(JointKind::Prismatic, 0.0, 0.1, 0.0, 0.0)],
        ..planar(1)
    };
    given.q = vec![0.7];
    let grow = |grows| {
        let growth = Effect::ThermalGrowth(ThermalGrowth::new(0, grows, 1));
        twist(&rail, growth, &[2e-5], &given)
    };
    assert_twist(&grow(Grows::Link), [0.0, -2e-5, 0.0], [0.0; 3], EXACT);
    assert_twist(&grow(Grows::Travel), [0.0, -1.4e-4, 0.0], [0.0; 3], EXACT);
}

#[test]
fn a_wobbling_axis_leans_in_the_directions_of_its_standing_or_its_turning_ring() {
    let mut arm = planar(1);
    arm.base = Pose::identity();
    for q in [0.4, -1.3, 2.9_f64] {
        let given = resting(&[q], 0.0);
        let wobble = |motion, values: [f64; 4]| {
            twist(
                &arm,
                Effect::AxisWobble(AxisWobble::new(0, motion, 2.0)),
                &values,
                &given,
            )
        };
        let (x, y) = (0.5 * q.cos(), 0.5 * q.sin());
        let (s, c) = (1e-4 * (2.0 * q).sin(), 1e-4 * ((2.0 * q).cos() - 1.0));
        // tilt about the fixed x axis: a point at (x, y, 0) goes up by y
        let tilt = wobble(Wobble::Tilt, [1e-4, 0.0, 0.0, 0.0]);
        assert_twist(&tilt, [0.0, 0.0, s * y], [s, 0.0, 0.0], EXACT);
        let tilt = wobble(Wobble::Tilt, [0.0, 0.0, 0.0, 1e-4]);
        assert_twist(&tilt, [0.0, 0.0, -c * x], [0.0, c, 0.0], EXACT);
        let shift = wobble(Wobble::Shift, [0.0, 1e-4, 1e-4, 0.0]);
        assert_twist(&shift, [c, s, 0.0], [0.0; 3], EXACT);
        // tilt about the turning y axis: the end of the link along x goes down
        let tilt = wobble(Wobble::TurningTilt, [0.0, 0.0, 1e-4, 0.0]);
        let across = [-s * q.sin(), s * q.cos(), 0.0];
        assert_twist(&tilt, [0.0, 0.0, -0.5 * s], across, EXACT);
        let shift = wobble(Wobble::TurningShift, [1e-4, 0.0, 0.0, 0.0]);
        assert_twist(&shift, [s * q.cos(), s * q.sin(), 0.0], [0.0; 3], EXACT);
    }
}

#[test]
fn a_warm_up_dies_away_and_a_step_stays() {
    let arm = planar(1);
    let at = |effect: Effect<'_, f64>, time: f64| {
        let mut given = resting(&[0.0], 0.0);
        given.ambient.time = time;
        // about -y of the world
        -twist(&arm, effect, &[1e-3], &given).angular.y
    };
    let warm = Effect::WarmUp(WarmUp::new(Place::Joint(0), 100.0));
    for (time, share) in [
        (-5.0, 1.0),
        (0.0, 1.0),
        (100.0, (-1.0_f64).exp()),
        (1e6, 0.0),
    ] {
        // angles out of a rotation vector of 1e-3 rad
        assert!((at(warm, time) - 1e-3 * share).abs() < EXACT);
    }
    let step = Effect::StepChange(StepChange::new(Place::Joint(0), 40.0));
    for (time, share) in [(0.0, 0.0), (39.9, 0.0), (40.0, 1.0), (1e6, 1.0)] {
        assert!((at(step, time) - 1e-3 * share).abs() < EXACT);
    }
}

#[test]
fn a_curve_passes_through_its_cells_and_is_silent_where_nothing_was_measured() {
    let cells = [
        1e-3,
        -2e-3,
        f64::NAN,
        0.5e-3,
        0.0,
        1.5e-3,
        1.2e-3,
        0.9e-3,
        -0.1e-3,
        -1.1e-3,
    ];
    let mut bytes = [0; 20];
    let scale = encode(&cells, &mut bytes).unwrap();
    let stored = Effect::JointCurve(JointCurve::turn(0, scale, &bytes));
    let whole_turn = std::f64::consts::TAU;
    let angle = |cell: f64| cell * whole_turn / 10.0;
    let at = |curve: &[Effect<'_, f64>], q: f64| -> f64 {
        let reading = Reading {
            q: &[q],
            direction: &[0.0],
            ambient: &Ambient::default(),
        };
        curve.iter().map(|e| e.addition(&reading).1).sum()
    };
    for turn in [-2.0, 0.0, 1.0] {
        for i in 0..100 {
            let cell = f64::from(i) / 10.0;
            let q = angle(cell + 10.0 * turn);
            let (low, high) = (cells[i as usize / 10], cells[(i as usize / 10 + 1) % 10]);
            let quiet = |x: f64| if x.is_nan() { 0.0 } else { x };
            let f = cell.fract();
            let expected = quiet(low) * (1.0 - f) + quiet(high) * f;
            let hat = hat(q, 10.0 / whole_turn, 10).unwrap();
            let between = quiet(cells[hat.index]) * (1.0 - hat.fraction)
                + quiet(cells[hat.next]) * hat.fraction;
            // rounding of a turn or two, times the slope of the table
            assert!((between - expected).abs() < 3e-3 * 50.0 * f64::EPSILON);
            // half a count
            assert!((at(&[stored], q) - expected).abs() <= 0.5001 * scale);
        }
    }
    let curve: JointCurve<'_, f64> = JointCurve::turn(0, scale, &bytes);
    assert_eq!(curve.cell(2), None);
    assert_eq!(bytes[4..6], UNMEASURED.to_le_bytes());
    assert!(curve.cell(3).is_some());
    assert_eq!(curve.cell(10), None);
    // without cells it is nothing
    let empty = Effect::JointCurve(JointCurve::turn(0, 1.0, &[]));
    assert!(at(&[empty], 1.0).abs() < EXACT);
    assert!(encode(&cells, &mut [0; 19]).is_none());
    assert_eq!(encode(&[0.0, 0.0], &mut [0; 4]), Some(0.0));
}

#[test]
fn hats_hold_at_both_ends_of_the_table() {
    let density = 180.0 / std::f64::consts::TAU;
    for q in [
        -1e9,
        -7.0,
        -1e-18,
        0.0,
        1e-18,
        std::f64::consts::TAU,
        6.3,
        1e9,
        f64::NAN,
        f64::MAX,
    ] {
        let hat = hat(q, density, 180).unwrap();
        assert!(hat.index < 180 && hat.next == (hat.index + 1) % 180);
        assert!((0.0..=1.0).contains(&hat.fraction), "{q}: {hat:?}");
    }
    assert!(hat(1.0, density, 0).is_none());
}

#[test]
fn unnamed_terms_fade_to_zero_beyond_what_was_seen() {
    let seen = |shape, parameter| {
        let variable = Variable::Joint(0);
        let factor = Factor { variable, shape };
        let limits = [[parameter, -1.0, 2.0], [0.0; 3]];
        let mut term = Unnamed::new(Place::Joint(0), [factor, ONE], limits);
        term.amplitude = [1.0];
        move |q: f64| {
            Effect::Unnamed(term)
                .addition(&Reading {
                    q: &[q],
                    direction: &[0.0],
                    ambient: &Ambient::default(),
                })
                .1
        }
    };
    let u = |q: f64| (q - 0.5) / 1.5;
    type Case = (Shape, f64, fn(f64, f64) -> f64);
    let cases: [Case; 5] = [
        (Shape::Sine, 3.0, |q, _| (3.0 * q).sin()),
        (Shape::Cosine, 0.5, |q, _| (0.5 * q).cos()),
        (Shape::Sign, 0.25, |q, _| (q - 0.25).signum()),
        (Shape::Polynomial(2), 0.0, |_, u| 1.5 * u * u - 0.5),
        (Shape::Polynomial(3), 0.0, |_, u| 2.5 * u * u * u - 1.5 * u),
    ];
    for (shape, parameter, expected) in cases {
        let term = seen(shape, parameter);
        for q in [-1.0, -0.3, 0.1, 1.0, 2.0] {
            assert!((term(q) - expected(q, u(q))).abs() < 1e-14, "{shape:?} {q}");
        }
        // half the range is 1.5, so it is over 0.3 beyond either end
        for q in [-1.31, 2.31, 1e6, -1e6] {
            assert!(term(q).abs() < EXACT);
        }
        // no jump anywhere, and at the ends no kink
        let mut last = term(-1.5);
        for i in 0..40_000 {
            let now = term(-1.5 + f64::from(i) * 1e-4);
            assert!((now - last).abs() < 1e-2, "{shape:?}");
            last = now;
        }
        let slope = |q: f64| (term(q + 1e-5) - term(q)) / 1e-5;
        assert!(slope(2.3 - 1e-5).abs() < 1e-2);
    }
}
