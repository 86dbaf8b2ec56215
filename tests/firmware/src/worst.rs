//! The dearest requests that can be thought of, held against [`Cost::worst`].
//!
//! For arms of one to seven joints and sets of effects from none to many, writes how many
//! requests were tried, the most instructions that an iteration and all around the iterations
//! took, and the bounds; and `exceeded` where a bound does not hold. An iteration's cost is
//! the difference between an answer that may take one more iteration and one that may not.

use core::fmt::{self, Write};
use core::hint::black_box;

use truepose::budget::{Budget, Clock, Cost, PLAIN_ITERATIONS};
use truepose::compensate::{Compensator, Request};
use truepose::effects::{Ambient, Conditions, Effect, KINDS, Selector, Wish};
use truepose::model::{BakedChain, Model};
use truepose::taught::polynomial::{Block, MAX_DEGREE, terms};
use truepose::taught::{Cmac, Polynomial, Region, cmac};
use truepose::{BakedJoint, Joint, JointKind, LinkMass, Method, Pose, Settings, Twist, bake};

use crate::draws::Draws;

/// Arms of each number of joints and set of effects.
const ARMS: usize = 14;
/// Requests an arm.
const REQUESTS: usize = 36;
/// Effects in the sets.
const SETS: [usize; 3] = [0, 3, 24];
/// Iterations at most.
const ITERATIONS: u8 = 6;

struct Random(Draws);

impl Random {
    fn within(&mut self, range: f64) -> f64 {
        f64::from(self.0.symmetric()) * range
    }

    fn below(&mut self, count: u8) -> u8 {
        let share = (f64::from(self.0.symmetric()) + 1.0) * 0.5;
        (share * f64::from(count)) as u8
    }

    fn vector(&mut self, range: f64) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::new(self.within(range), self.within(range), self.within(range))
    }
}

fn chain<const N: usize>(
    joints: &[Joint<f64>; N],
    masses: &[LinkMass<f64>; N],
    base: &Pose<f64>,
    tool: &Pose<f64>,
) -> BakedChain<f32, N> {
    let mut baked = [BakedJoint::identity(); N];
    let mut gauges = [Pose::identity(); N];
    let (base, tool) = bake(base, joints, masses, tool, &mut baked, &mut gauges);
    BakedChain {
        base,
        joints: baked,
        tool,
        gravity: nalgebra::Vector3::new(0.5, -0.3, -9.8),
    }
    .cast()
}

/// Any effect on any joint that it can act on.
fn effect<const N: usize>(random: &mut Random) -> Effect<'static, f32> {
    loop {
        let kinds = u8::try_from(KINDS.len()).unwrap_or(u8::MAX);
        let joint = random.below(u8::try_from(N).unwrap_or(u8::MAX));
        let Some(kind) = KINDS.get(usize::from(random.below(kinds))) else {
            continue;
        };
        let joint = Selector {
            joint: Some(usize::from(joint)),
            order: Some(2.0),
            from: (kind.from == Wish::Must).then_some(0),
            ..Selector::default()
        };
        let base = Selector {
            joint: None,
            ..joint
        };
        let named = Effect::named(kind.name, &joint).or_else(|| Effect::named(kind.name, &base));
        if let Some(mut effect) = named {
            for value in effect.model_mut().values_mut() {
                *value = 2e-5 * random.0.symmetric();
            }
            return effect;
        }
    }
}

/// An arm that is a little off its nominal self, with `count` effects.
fn arm<const N: usize>(random: &mut Random, count: usize) -> Model<'static, f32, N> {
    // Half of them all turns, for which there is a shorter way.
    let slides = random.below(2) == 0;
    let mut nominal = [Joint::dh(JointKind::Revolute, 0.0, 0.0, 0.0, 0.0); N];
    let mut masses = [LinkMass::none(); N];
    for (joint, mass) in nominal.iter_mut().zip(&mut masses) {
        if slides && random.below(4) == 0 {
            joint.kind = JointKind::Prismatic;
        }
        joint.theta = random.within(1.0);
        joint.d = random.within(0.4);
        joint.a = random.within(0.4);
        joint.alpha = match random.below(3) {
            0 => 0.0,
            1 => core::f64::consts::FRAC_PI_2,
            _ => random.within(1.5),
        };
        mass.mass = 1.5 + random.within(1.0);
        mass.com = random.vector(0.2);
    }
    let mut built = nominal;
    for joint in &mut built {
        joint.theta += random.within(5e-3);
        joint.d += random.within(1e-3);
        joint.a += random.within(1e-3);
        joint.alpha += random.within(5e-3);
        joint.beta += random.within(5e-3);
    }
    let base = Pose::from_xyz_rpy(random.vector(0.5), random.vector(0.5));
    let tool = Pose::from_xyz_rpy(random.vector(0.2), random.vector(0.5));
    let none = [LinkMass::none(); N];
    let effects = core::iter::from_fn(|| Some(effect::<N>(random)))
        .take(count)
        .collect();
    Model {
        nominal: chain(&nominal, &none, &base, &tool),
        calibrated: chain(&built, &masses, &base, &tool),
        effects,
        limits: [[-2.5, 2.5]; N],
        resolution: [0.0; N],
        settings: Settings::default(),
        taught: Default::default(),
    }
}

/// Settings that ask for as much as they can.
fn settings(random: &mut Random) -> Settings<f32> {
    let tight = random.below(2) == 0;
    let tolerance = if tight { 0.0 } else { 1e-6 };
    let bound = match random.below(3) {
        0 => 0.2,
        1 => 2e-3,
        _ => 1e-4,
    };
    Settings {
        method: [Method::InverseJacobian, Method::Lqr, Method::TaskPoint]
            .get(usize::from(random.below(3)))
            .copied()
            .unwrap_or(Method::Lqr),
        position_tolerance: tolerance,
        orientation_tolerance: tolerance,
        correction_bound: [bound, bound],
        singular_value: if random.below(2) == 0 { 0.03 } else { 0.5 },
        ..Settings::default()
    }
}

/// A request near or at a limit, a singular pose, or far from what is asked.
fn request<const N: usize>(random: &mut Random, model: &Model<'_, f32, N>) -> Request<f32, N> {
    let mut q = [0.0; N];
    for q in &mut q {
        *q = match random.below(6) {
            0 => 2.5,
            1 => -2.4999,
            2 => 0.0,
            3 => 3.0,
            _ => 2.5 * random.0.symmetric(),
        };
    }
    let mut conditions = Conditions {
        direction: [1.0; N],
        ambient: Ambient {
            payload: 3.0,
            time: 600.0,
            ..Ambient::default()
        },
    };
    conditions.ambient.temperature.fill(33.0);
    let request = match random.below(3) {
        0 => Request::joints(q),
        1 => Request::pose(model.nominal_pose(&q), q),
        _ => {
            let off = if random.below(2) == 0 { 0.01 } else { 0.3 };
            let twist = Twist::new(random.vector(off), random.vector(off));
            let twist = Twist::new(twist.linear.cast(), twist.angular.cast());
            Request::pose(model.nominal_pose(&q).displaced(&twist), q)
        }
    };
    request.conditions(conditions)
}

/// Instructions of an answer with at most `iterations`, and how many it took.
fn spent<const N: usize>(
    compensator: &Compensator<'_, f32, N>,
    settings: Settings<f32>,
    iterations: u8,
    request: &Request<f32, N>,
    clock: &impl Clock,
) -> (u32, u8) {
    let mut compensator = compensator.clone().with_settings(Settings {
        max_iterations: iterations,
        ..settings
    });
    let mut budget = Budget::cycles(clock, u32::MAX);
    let outcome = black_box(compensator.correct(black_box(request), &mut budget));
    (budget.spent(), outcome.iterations)
}

fn joints<const N: usize>(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    for count in SETS {
        let mut random = Random(Draws::seeded(700 + N as u64 * 31 + count as u64));
        let (mut requests, mut start, mut iteration) = (0, 0, 0);
        let (mut start_share, mut iteration_share) = (0, 0);
        for _ in 0..ARMS {
            let model = arm::<N>(&mut random, count);
            let bound = Cost::instructions(N, &model.effects);
            let plain = Cost::plain_instructions(N);
            let around = bound.start + plain.start + PLAIN_ITERATIONS * plain.iteration;
            let mut compensator = Compensator::new(&model);
            for _ in 0..REQUESTS {
                requests += 1;
                let settings = settings(&mut random);
                let request = request(&mut random, &model);
                let mut before = None;
                for most in 0..=ITERATIONS {
                    let (cycles, taken) = spent(&compensator, settings, most, &request, clock);
                    let allowed = u32::from(taken) * bound.iteration;
                    start = start.max(cycles.saturating_sub(allowed));
                    if cycles > around + allowed {
                        writeln!(
                            out,
                            "exceeded: {N} joints, {count} effects, {taken} iterations, {cycles}"
                        )?;
                    }
                    start_share = start_share.max(cycles.saturating_sub(allowed) * 100 / around);
                    if let Some((cycles_before, taken_before)) = before
                        && taken == taken_before + 1
                        && taken > 1
                    {
                        let one = cycles.saturating_sub(cycles_before);
                        iteration = iteration.max(one);
                        iteration_share = iteration_share.max(one * 100 / bound.iteration);
                        if one > bound.iteration {
                            writeln!(
                                out,
                                "exceeded: {N} joints, {count} effects, an iteration, {one}"
                            )?;
                        }
                    }
                    if taken < most {
                        break;
                    }
                    before = Some((cycles, taken));
                }
                // What is remembered makes the next one dearer.
                let mut budget = Budget::cycles(clock, u32::MAX);
                black_box(compensator.correct(&request, &mut budget));
            }
        }
        writeln!(
            out,
            "{N} joints, {count} effects, {requests} requests: iteration {iteration} \
             ({iteration_share} % of its bound), around {start} ({start_share} %)"
        )?;
    }
    Ok(())
}

/// Numbers that mean nothing, as tables.
static TABLE: [u8; 12 * 1024] = table();

const fn table() -> [u8; 12 * 1024] {
    let mut bytes = [0; 12 * 1024];
    let (mut place, mut state) = (0, 7u32);
    while place < bytes.len() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // The upper byte of an f32: its magnitude stays below 2.
        bytes[place] = if place % 4 == 3 {
            0x3F
        } else {
            (state >> 24) as u8
        };
        place += 1;
    }
    bytes
}

/// Look-ups in tables of all sizes, at commands inside and beyond their region.
fn lookups<const N: usize>(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    let mut random = Random(Draws::seeded(900 + N as u64));
    let region = |inputs| Region(core::iter::repeat_n([-1.0, 1.0], inputs).collect());
    let (mut count, mut most) = (0, [0, 0]);
    for _ in 0..ARMS {
        let inputs = 1 + usize::from(random.below(u8::try_from(N).unwrap_or(1)));
        let Some(polynomial) = polynomial::<N>(&mut random, inputs) else {
            continue;
        };
        let side = 1 + random.below(3);
        let layout = cmac::Layout {
            layers: u8::try_from(N).unwrap_or(0) + 1 + random.below(8),
            cells: side,
        };
        let bytes = layout.words(N).unwrap_or(0).saturating_mul(2 * N);
        let cmac = Cmac {
            region: region(N),
            layout,
            scale: core::iter::repeat_n(1e-6, N).collect(),
            // One that is too large reads nothing, and is not looked at.
            table: TABLE.get(..bytes).unwrap_or(&TABLE),
        };
        for _ in 0..REQUESTS {
            count += 1;
            let mut q = [0.0; N];
            for q in &mut q {
                *q = 1.04 * random.0.symmetric();
            }
            let began = clock.now();
            black_box(black_box(&polynomial).evaluate(black_box(&q)));
            let taken = clock.elapsed(began);
            let began = clock.now();
            black_box(black_box(&cmac).evaluate(black_box(&q)));
            let both = [
                (taken, polynomial.instructions(N)),
                (clock.elapsed(began), cmac.instructions(N)),
            ];
            for (most, (taken, bound)) in most.iter_mut().zip(both) {
                let bound = u32::try_from(bound).unwrap_or(u32::MAX);
                *most = (*most).max(taken * 100 / bound);
                if taken > bound {
                    writeln!(
                        out,
                        "exceeded: a look-up of {N} joints, {inputs} inputs, {taken}, bound {bound}"
                    )?;
                }
            }
        }
    }
    let [polynomials, cmacs] = most;
    writeln!(
        out,
        "{N} joints, {count} look-ups: polynomials {polynomials} % of their bound, cells {cmacs} %"
    )
}

/// Polynomials of the first `inputs` joints, and of the others for the tool, as large as there
/// are numbers for.
fn polynomial<const N: usize>(
    random: &mut Random,
    inputs: usize,
) -> Option<Polynomial<'static, f32>> {
    let block = |random: &mut Random, inputs: usize, outputs: usize| {
        let mut degree = random.below(MAX_DEGREE + 1);
        let mut length = usize::MAX;
        while TABLE.len() < length {
            length = terms(inputs, usize::from(degree)) * outputs * 4;
            degree = degree.saturating_sub(u8::from(TABLE.len() < length));
        }
        Some(Block {
            region: Region(core::iter::repeat_n([-1.0, 1.0], inputs).collect()),
            degree,
            coefficients: TABLE.get(..length)?,
        })
    };
    Some(Polynomial {
        joints: block(random, inputs, N)?,
        tool: match N - inputs {
            0 => None,
            rest => Some(block(random, rest, 3)?),
        },
    })
}

/// Tries them all.
pub fn print(out: &mut dyn Write, clock: &impl Clock) -> fmt::Result {
    joints::<1>(out, clock)?;
    joints::<2>(out, clock)?;
    joints::<3>(out, clock)?;
    joints::<4>(out, clock)?;
    joints::<5>(out, clock)?;
    joints::<6>(out, clock)?;
    joints::<7>(out, clock)?;
    lookups::<2>(out, clock)?;
    lookups::<3>(out, clock)?;
    lookups::<6>(out, clock)?;
    lookups::<7>(out, clock)
}
