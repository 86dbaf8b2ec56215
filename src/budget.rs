//! Cycles: the clock, what is left of a budget, and whether another iteration still fits.
//!
//! ```
//! use truepose::budget::{Budget, Counter};
//!
//! let cycle_counter = Counter::up(|| 0 /* e.g. DWT::cycle_count() */);
//! let mut budget = Budget::cycles(&cycle_counter, 20_000);
//! ```

use crate::Scalar;
use crate::effects::{Effect, Grows, Stage};

/// A wrapping counter of cycles.
pub trait Clock {
    /// Its present reading.
    fn now(&self) -> u32;

    /// Cycles from an earlier reading `since` to now. Right as long as the counter has not
    /// gone round completely in between.
    fn elapsed(&self, since: u32) -> u32;
}

/// A free-running hardware counter behind a function that reads it.
///
/// - Cortex-M cycle counter: `Counter::up(cortex_m::peripheral::DWT::cycle_count)`, 32 bits;
/// - SysTick: `Counter::down(cortex_m::peripheral::SYST::get_current, reload)`, which counts
///   from its reload value to 0: a budget must be shorter than that;
/// - any timer that counts up over all 32 bits: [`Counter::up`].
#[derive(Clone, Copy, Debug)]
pub struct Counter<F> {
    read: F,
    direction: Direction,
}

#[derive(Clone, Copy, Debug)]
enum Direction {
    Up,
    Down { reload: u32 },
}

impl<F: Fn() -> u32> Counter<F> {
    /// Counts up and wraps at 32 bits.
    pub fn up(read: F) -> Self {
        Self {
            read,
            direction: Direction::Up,
        }
    }

    /// Counts down to 0 and starts again from `reload`.
    pub fn down(read: F, reload: u32) -> Self {
        Self {
            read,
            direction: Direction::Down { reload },
        }
    }
}

impl<F: Fn() -> u32> Clock for Counter<F> {
    fn now(&self) -> u32 {
        (self.read)()
    }

    fn elapsed(&self, since: u32) -> u32 {
        let now = self.now();
        match self.direction {
            Direction::Up => now.wrapping_sub(since),
            Direction::Down { .. } if now <= since => since - now,
            // Through zero: down to 0, one cycle to reload, down to where it is.
            Direction::Down { reload } => since
                .saturating_add(reload.saturating_sub(now))
                .saturating_add(1),
        }
    }
}

/// A clock that stands still: for callers without a deadline.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> u32 {
        0
    }

    fn elapsed(&self, _since: u32) -> u32 {
        0
    }
}

/// What one call may spend.
#[derive(Debug)]
pub struct Budget<'c, C> {
    clock: &'c C,
    start: u32,
    limit: u32,
}

impl<'c, C: Clock> Budget<'c, C> {
    /// `limit` cycles of `clock`, from now on.
    pub fn cycles(clock: &'c C, limit: u32) -> Self {
        Self {
            clock,
            start: clock.now(),
            limit,
        }
    }

    /// Cycles spent so far.
    pub fn spent(&self) -> u32 {
        self.clock.elapsed(self.start)
    }

    /// Whether `cost` more cycles still fit.
    #[inline]
    pub fn fits(&self, cost: u32) -> bool {
        self.moment().fits(cost)
    }

    #[inline]
    pub(crate) fn moment(&self) -> Moment {
        Moment {
            spent: self.spent(),
            limit: self.limit,
        }
    }
}

/// A budget as it is at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    pub(crate) spent: u32,
    limit: u32,
}

impl Moment {
    /// Whether `cost` more cycles still fit.
    #[inline]
    pub fn fits(&self, cost: u32) -> bool {
        self.spent
            .checked_add(cost)
            .is_some_and(|end| end <= self.limit)
    }
}

impl Budget<'static, NoClock> {
    /// As long as it takes.
    pub fn unlimited() -> Self {
        Self::cycles(&NoClock, u32::MAX)
    }
}

/// What the parts of a compensation cost at worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cost {
    /// Around the iterations: the poses that the request and the answer nominally mean, where
    /// the nominal and the remembered command lead, how near a singularity is.
    pub start: u32,
    /// One iteration: a step and its evaluation, limits and singularities included.
    pub iteration: u32,
}

/// Iterations after which the plain case is given up.
pub const PLAIN_ITERATIONS: u32 = 4;

/// Most cycles an instruction takes, averaged over any function of the loop. `tools/cost`
/// measures it, writes it into `docs/COST.md` and fails where it is more.
pub(crate) const CYCLES: u32 = 3;

/// Most cycles that two instructions take over compensations that are not plain, which have more
/// branches and fewer multiplications: measured and held likewise.
const CYCLES_OF_TWO: u32 = 5;

/// What a compensation costs at worst, in general and in the plain case. `iteration`: what one
/// takes, where the caller has said so.
pub(crate) fn costs<T: Scalar>(
    joints: usize,
    effects: &[Effect<'_, T>],
    iteration: Option<u32>,
) -> [Cost; 2] {
    match iteration {
        // Three evaluations and a factor take less than three iterations; what is around the
        // plain case, a pose among it, less than two of its own, which are the shorter ones.
        Some(iteration) => [3, 2].map(|start| Cost {
            start: iteration.saturating_mul(start),
            iteration,
        }),
        None => [Cost::worst(joints, effects), Cost::plain(joints)],
    }
}

impl Cost {
    pub(crate) const NOTHING: Self = Self {
        start: 0,
        iteration: 0,
    };

    /// Cycles of a Cortex-M4F with memory that never waits. On other cores, or with a clock
    /// that does not count core cycles, set [`crate::Settings::iteration_cycles`].
    pub fn worst<T: Scalar>(joints: usize, effects: &[Effect<'_, T>]) -> Self {
        Self::instructions(joints, effects).halves(CYCLES_OF_TWO)
    }

    /// As [`Cost::worst`], of the plain case: a rigid arm of turns, clear of singularities and
    /// limits. If it turns out not to be plain, what was spent is lost.
    pub fn plain(joints: usize) -> Self {
        Self::plain_instructions(joints).halves(2 * CYCLES)
    }

    /// Bound on the instructions of an emulated Cortex-M4F, held by `tests/firmware` against
    /// more than ten thousand adversarial requests (`tests/firmware/tests/budget_bounds_hold.rs`).
    pub fn instructions<T: Scalar>(joints: usize, effects: &[Effect<'_, T>]) -> Self {
        // Fewer than six joints cost as five: their equations have five rows.
        let n = count(joints).max(5);
        let mut evaluation = 420u32.saturating_add(n.saturating_mul(135));
        let mut preparation = 300u32.saturating_add(n.saturating_mul(80));
        let mut needs = Needs::default();
        for effect in effects {
            let [once, each] = needs.of(effect);
            preparation = preparation.saturating_add(once);
            evaluation = evaluation.saturating_add(each);
        }
        let of_joints = |needed: bool, fixed: u32, each: u32| match needed {
            true => n.saturating_mul(each).saturating_add(fixed),
            false => 0,
        };
        for more in [
            of_joints(needs.readings, 70, 0),
            of_joints(needs.postures, 300, 0),
            of_joints(needs.growth, 20, 12),
            of_joints(needs.gravity, 40, 60),
            of_joints(needs.loads, 60, 80),
        ] {
            evaluation = evaluation.saturating_add(more);
        }
        preparation = preparation.saturating_add(of_joints(needs.growth || needs.gravity, 60, 50));
        let rows = if n < 6 { 2350 } else { 1450 };
        let factor = n.saturating_mul(80).saturating_add(rows);
        // Coordinate descent along the limits.
        let along = n.saturating_mul(880);
        Self {
            start: evaluation
                .saturating_mul(3)
                .saturating_add(preparation)
                .saturating_add(factor)
                .saturating_add(n.saturating_mul(600))
                .saturating_add(900),
            iteration: evaluation
                .saturating_add(factor)
                .saturating_add(along)
                .saturating_add(400),
        }
    }

    /// As [`Cost::instructions`], of [`Cost::plain`].
    pub fn plain_instructions(joints: usize) -> Self {
        let n = count(joints);
        Self {
            start: 800u32.saturating_add(n.saturating_mul(160)),
            iteration: 540u32.saturating_add(n.saturating_mul(165)),
        }
    }

    fn halves(self, factor: u32) -> Self {
        let scaled = |cost: u32| cost.saturating_mul(factor) / 2;
        Self {
            start: scaled(self.start),
            iteration: scaled(self.iteration),
        }
    }
}

/// What some effects of a set need besides their own share.
#[derive(Clone, Copy, Debug, Default)]
struct Needs {
    /// Additions to the readings by the contract.
    readings: bool,
    /// Displacements by the contract.
    postures: bool,
    /// Growing links.
    growth: bool,
    /// Joints that give way.
    gravity: bool,
    /// Gravity's loads for the contract.
    loads: bool,
}

impl Needs {
    /// Instructions of `effect` in the preparation and in an evaluation; takes note of what it
    /// needs besides.
    fn of<T: Scalar>(&mut self, effect: &Effect<'_, T>) -> [u32; 2] {
        let mut by_contract = |once, each| {
            match effect.stage() {
                Stage::Reading => self.readings = true,
                Stage::Posture => self.postures = true,
            }
            [once, each]
        };
        match effect {
            Effect::JointGain(_) | Effect::Backlash(_) => [60, 10],
            Effect::ThermalDrift(_)
            | Effect::TimeDrift(_)
            | Effect::WarmUp(_)
            | Effect::StepChange(_) => {
                self.postures |= effect.stage() == Stage::Posture;
                [150, 10]
            }
            // Of an order that is not worked in, or a second curve of a joint, at worst.
            Effect::GearEccentricity(_) | Effect::GearRipple(_) => by_contract(200, 120),
            Effect::JointCurve(_) => by_contract(60, 180),
            Effect::JointCoupling(_) => by_contract(60, 60),
            Effect::JointCompliance(_) => {
                self.gravity = true;
                self.postures = true;
                [40, 0]
            }
            Effect::ThermalGrowth(e) if e.grows == Grows::Link => {
                self.growth = true;
                self.postures = true;
                [80, 0]
            }
            Effect::ThermalGrowth(_) | Effect::ToolLoad(_) => by_contract(40, 130),
            Effect::GravityLever(_) => by_contract(40, 180),
            Effect::AxisWobble(_) | Effect::PrismaticStraightness(_) | Effect::Unnamed(_) => {
                by_contract(40, 330)
            }
            Effect::CrossAxisCompliance(_) | Effect::LinkBending(_) | Effect::BaseFlex(_) => {
                self.loads = true;
                self.postures = true;
                [40, 240]
            }
        }
    }
}

fn count(joints: usize) -> u32 {
    u32::try_from(joints).unwrap_or(u32::MAX)
}
