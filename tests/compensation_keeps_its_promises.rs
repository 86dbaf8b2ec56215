//! Whatever comes in, what goes out is safe to send: random arms of one to seven joints,
//! random blobs, requests, conditions and budgets.

use std::cell::Cell;

use crate::blobs;
use crate::random::Random;
use crate::tables;
use truepose::budget::{Budget, Counter};
use truepose::compensate::{Compensator, Outcome, Request, Status};
use truepose::effects::Conditions;
use truepose::params::Blob;
use truepose::{Joint, JointKind, Method, Model, Pose, Scalar, Settings, Twist};

/// Cases for each number of joints and number type: 14 x 8000 = 112 000.
const ARMS: usize = 160;
const REQUESTS: usize = 50;
const _: () = assert!(14 * ARMS * REQUESTS >= 100_000);

/// Cases of one method: converged, otherwise compensated, refused.
type Seen = [[usize; 3]; Method::ALL.len()];

/// A blob of an arm of `joints` turns without effects; `meeting`: of six, whose second and third
/// axes are parallel and whose last three meet in a point, before as after calibration.
fn rigid(random: &mut Random, joints: usize, meeting: bool) -> Blob<'static> {
    let mut blob = blobs::blob(random, joints);
    blob.effects.clear();
    let Blob {
        nominal,
        calibrated,
        ..
    } = &mut blob;
    for (j, (drawn, found)) in nominal
        .joints
        .iter_mut()
        .zip(&mut calibrated.joints)
        .enumerate()
    {
        let kind = JointKind::Revolute;
        let (theta, alpha) = (random.within(3.0), 1.5 + random.within(0.6));
        let (d, a) = (random.within(0.3), random.within(0.5));
        *drawn = Joint::dh(kind, theta, d, a, alpha);
        *found = *drawn;
        found.theta += random.within(2e-3);
        if meeting {
            for joint in [drawn, found] {
                if j == 1 {
                    joint.alpha = 0.0;
                }
                if j == 4 {
                    joint.d = 0.0;
                }
                if j == 3 || j == 4 {
                    joint.a = 0.0;
                }
            }
        } else {
            for parameter in [&mut found.d, &mut found.a, &mut found.alpha] {
                *parameter += random.within(1e-3);
            }
        }
    }
    for limit in &mut blob.limits {
        *limit = [-2.5 - random.unit().abs(), 2.5 + random.unit().abs()];
    }
    blob
}

/// A number that is seldom sane.
fn wild(random: &mut Random) -> f64 {
    match random.below(6) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::NEG_INFINITY,
        3 => random.within(1e30),
        4 => 1e-310,
        _ => random.within(10.0),
    }
}

fn settings(random: &mut Random) -> Settings<f64> {
    let mut settings = Settings {
        method: Method::ALL[random.below(Method::ALL.len())],
        ..Settings::default()
    };
    if random.below(2) == 0 {
        settings.max_iterations = u8::try_from(random.below(12)).unwrap();
        settings.correction_bound = [random.unit().abs() * 0.3, random.unit().abs() * 0.1];
        settings.singular_value = random.unit().abs() * 0.2;
        settings.position_weight = random.below(3) as f64;
        settings.orientation_weight = 1.0;
    }
    settings
}

fn conditions<T: Scalar, const N: usize>(random: &mut Random) -> Conditions<T, N> {
    let mut conditions = Conditions::default();
    for direction in &mut conditions.direction {
        *direction = T::of(random.below(3) as f64 - 1.0);
    }
    conditions.ambient.payload = T::of(random.unit().abs() * 5.0);
    conditions.ambient.payload_com = random.vector(0.2).map(T::of);
    if random.below(20) == 0 {
        conditions.ambient.payload = T::of(wild(random));
    }
    if random.below(20) == 0 {
        conditions.ambient.time = T::of(wild(random));
        conditions.ambient.temperature[0] = T::of(wild(random));
    }
    conditions
}

fn request<T: Scalar, const N: usize>(
    random: &mut Random,
    model: &Model<'_, T, N>,
) -> Request<T, N> {
    let mut q = [T::zero(); N];
    for (q, [low, high]) in q.iter_mut().zip(model.limits) {
        // Sometimes on a limit, sometimes beyond it.
        *q = match random.below(24) {
            0 => low,
            1 => high,
            2 => high * T::of(1.5),
            _ => low + (high - low) * T::of(random.unit().abs()),
        };
        if random.below(60) == 0 {
            *q = T::of(wild(random));
        }
    }
    let conditions = conditions(random);
    if random.below(2) == 0 {
        return Request::joints(q).conditions(conditions);
    }
    let off = Twist::new(
        random.vector(0.01).map(T::of),
        random.vector(0.01).map(T::of),
    );
    let mut pose = model.nominal_pose(&q).displaced(&off);
    match random.below(20) {
        0 => pose.translation.x = T::of(wild(random)),
        1 => pose.rotation[(1, 2)] = T::of(wild(random)),
        2 => pose = random.pose(3.0).cast(),
        _ => {}
    }
    Request::pose(pose, q).conditions(conditions)
}

/// Weighted square of what is left to `desired` at `q`, in double precision.
fn left<T: Scalar, const N: usize>(
    model: &Model<'_, T, N>,
    settings: &Settings<T>,
    q: &[T; N],
    desired: &Pose<T>,
    conditions: &Conditions<T, N>,
) -> (f64, f64) {
    let twist = model.predict(q, conditions).twist_to(desired);
    let (p, o) = (
        settings.position_weight.widen(),
        settings.orientation_weight.widen(),
    );
    let scale = desired
        .translation
        .iter()
        .map(|x| x.widen().abs())
        .sum::<f64>()
        + model
            .predict(q, conditions)
            .translation
            .iter()
            .map(|x| x.widen().abs())
            .sum::<f64>();
    let position = twist.linear.map(|x| x.widen()).norm() * p;
    let orientation = twist.angular.map(|x| x.widen()).norm() * o;
    (position.hypot(orientation), 1.0 + scale * p + o)
}

/// A rigid arm of six or more joints, a plain case where it is clear of singularities, has the
/// last half of the turns: every other one with a spherical wrist, if there are six.
fn check<T: Scalar, const N: usize>(seed: u64) -> Seen {
    let mut random = Random(seed);
    let mut seen = Seen::default();
    for arm in 0..ARMS {
        let mut blob = match arm % 4 {
            2 if N >= 6 => rigid(&mut random, N, false),
            3 if N >= 6 => rigid(&mut random, N, N == 6),
            _ => blobs::blob(&mut random, N),
        };
        tables::teach_nonsense(&mut random, &mut blob);
        let model = blob.model::<T, N>().unwrap();
        let settings = settings(&mut random).cast::<T>();
        let mut compensator = Compensator::new(&model).with_settings(settings);
        for _ in 0..REQUESTS {
            let request = request(&mut random, &model);
            // A clock that moves on by as much as an iteration's worst case allows: it is
            // read at most four times in one.
            let tick = 1 + u32::try_from(random.below(400)).unwrap();
            let now = Cell::new(0u32.wrapping_sub(u32::try_from(random.below(9000)).unwrap()));
            let clock = Counter::up(|| {
                now.set(now.get().wrapping_add(tick));
                now.get()
            });
            let limit = u32::try_from(random.below(60_000)).unwrap();
            let before = compensator.clone();
            let outcome = match random.below(2) {
                0 => compensator.correct(&request, &mut Budget::unlimited()),
                _ => {
                    let outcome = compensator.correct(&request, &mut Budget::cycles(&clock, limit));
                    assert!(outcome.cycles <= limit || outcome.iterations == 0);
                    outcome
                }
            };
            promises(&model, &settings, &request, &outcome);
            let mut again = before.clone();
            let free = again.correct(&request, &mut Budget::unlimited());
            let mut twice = before;
            let same = twice.correct(&request, &mut Budget::unlimited());
            assert_eq!(format!("{free:?}"), format!("{same:?}"));
            let answer = match outcome.status {
                Status::Converged => 0,
                status if status.compensated() => 1,
                _ => 2,
            };
            let method = Method::ALL.iter().position(|m| *m == settings.method);
            seen[method.unwrap()][answer] += 1;
        }
    }
    seen
}

fn promises<T: Scalar, const N: usize>(
    model: &Model<'_, T, N>,
    settings: &Settings<T>,
    request: &Request<T, N>,
    outcome: &Outcome<T, N>,
) {
    let said = || format!("{request:?}\n{outcome:?}\n{settings:?}");
    for ((q, [low, high]), joint) in outcome.q.iter().zip(model.limits).zip(0..N) {
        assert!(q.finite() && *q >= low && *q <= high, "{}", said());
        let start = request.q[joint];
        if outcome.status != Status::JointsNotFinite {
            let start = if start < low {
                low
            } else if start > high {
                high
            } else {
                start
            };
            let [revolute, prismatic] = settings.correction_bound;
            let bound = match model.calibrated.joints[joint].kind {
                JointKind::Revolute => revolute,
                JointKind::Prismatic => prismatic,
            };
            let off = (*q - start).abs().widen();
            // Rounding of the bound's place.
            let slack = 4.0 * T::EPSILON.widen() * (1.0 + start.widen().abs());
            assert!(off <= bound.widen() + slack, "{}", said());
            assert!(outcome.status.compensated() || off == 0.0, "{}", said());
        }
    }
    let finite_joints = request.q.iter().all(|q| q.finite());
    assert_eq!(
        finite_joints,
        outcome.status != Status::JointsNotFinite,
        "{}",
        said()
    );
    assert!(outcome.iterations <= settings.max_iterations, "{}", said());
    if !outcome.status.compensated() {
        return;
    }
    let mut start = request.q;
    for (q, [low, high]) in start.iter_mut().zip(model.limits) {
        *q = if *q < low {
            low
        } else if *q > high {
            high
        } else {
            *q
        };
    }
    let desired = request
        .pose
        .unwrap_or_else(|| model.nominal_pose(&request.q));
    let (before, _) = left(model, settings, &start, &desired, &request.conditions);
    let (after, scale) = left(model, settings, &outcome.q, &desired, &request.conditions);
    if !before.is_finite() {
        // There was no time to find out.
        assert!(
            outcome.initial.is_none() && outcome.q == start,
            "{}",
            said()
        );
        return;
    }
    // Both predictions are rounded.
    let rounding = 32.0 * T::EPSILON.widen() * scale;
    assert!(
        after <= before + rounding,
        "{before} to {after}\n{}",
        said()
    );
    if let (Some(initial), Some(remaining)) = (outcome.initial, outcome.remaining) {
        for error in [initial, remaining] {
            assert!(error.position.finite() && error.orientation.finite());
        }
    }
    if outcome.status == Status::Converged {
        let tolerance =
            settings.position_tolerance.widen() + settings.orientation_tolerance.widen();
        assert!(after <= 2.0 * tolerance + rounding, "{}", said());
    }
}

macro_rules! promises_hold {
    ($($name:ident: $type:ty, $joints:literal;)+) => {
        $(#[test]
        fn $name() {
            let seen = check::<$type, $joints>(1000 + $joints);
            let all: usize = seen.iter().flatten().sum();
            assert_eq!(all, ARMS * REQUESTS);
            // The cases do reach every kind of answer by every method, taught ones included:
            // those do not iterate, so they never converge.
            for (method, [converged, compensated, refused]) in Method::ALL.iter().zip(seen) {
                let enough = converged + compensated > 30 && refused > 30;
                assert!(enough, "{method:?}: {converged} {compensated} {refused}");
            }
        })+
    };
}

promises_hold! {
    one_joint_single: f32, 1;
    two_joints_single: f32, 2;
    three_joints_single: f32, 3;
    four_joints_single: f32, 4;
    five_joints_single: f32, 5;
    six_joints_single: f32, 6;
    seven_joints_single: f32, 7;
    one_joint_double: f64, 1;
    two_joints_double: f64, 2;
    three_joints_double: f64, 3;
    four_joints_double: f64, 4;
    five_joints_double: f64, 5;
    six_joints_double: f64, 6;
    seven_joints_double: f64, 7;
}
