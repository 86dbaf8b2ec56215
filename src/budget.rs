//! Cycles: the clock, what is left of a budget, and whether another iteration still fits.
//!
//! ```
//! use truepose::budget::{Budget, Counter};
//!
//! let cycle_counter = Counter::up(|| 0 /* e.g. DWT::cycle_count() */);
//! let mut budget = Budget::cycles(&cycle_counter, 20_000);
//! ```

use crate::Scalar;
use crate::effects::{Effect, Stage};

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
        self.spent()
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

/// Most cycles an instruction takes, averaged over any function of the loop
/// (`docs/COST.md`: 2.4 where it is most, an iteration).
pub(crate) const CYCLES: u32 = 3;

impl Cost {
    /// Cycles of a Cortex-M4F with memory that never waits. On other cores, or with a clock
    /// that does not count core cycles, set [`crate::Settings::iteration_cycles`].
    pub fn worst<T: Scalar>(joints: usize, effects: &[Effect<'_, T>]) -> Self {
        Self::instructions(joints, effects).times(CYCLES)
    }

    /// As [`Cost::worst`], of the plain case: a rigid arm of turns, clear of singularities and
    /// limits. If it turns out not to be plain, what was spent is lost.
    pub fn plain(joints: usize) -> Self {
        Self::plain_instructions(joints).times(CYCLES)
    }

    /// Bound on the instructions of an emulated Cortex-M4F, held by `tests/firmware` against
    /// more than ten thousand adversarial requests (`tests/firmware/tests/budget_bounds_hold.rs`).
    pub fn instructions<T: Scalar>(joints: usize, effects: &[Effect<'_, T>]) -> Self {
        let n = count(joints);
        let mut evaluation = 420u32.saturating_add(n.saturating_mul(135));
        let (mut posture, mut loaded) = (false, false);
        for effect in effects {
            let own = match effect.stage() {
                Stage::Reading => READING,
                Stage::Posture => POSTURE,
            };
            posture |= effect.stage() == Stage::Posture;
            loaded |= effect.loaded();
            evaluation = evaluation.saturating_add(own);
        }
        if posture {
            evaluation = evaluation.saturating_add(300);
        }
        if loaded {
            evaluation = evaluation.saturating_add(60 + n.saturating_mul(80));
        }
        // Below six joints the normal matrix has their number of rows.
        let rows = n.min(6);
        let factor = rows
            .saturating_mul(rows)
            .saturating_mul(rows.saturating_mul(2).saturating_add(20))
            .saturating_add(n.saturating_mul(80))
            .saturating_add(300);
        // Coordinate descent along the limits.
        let along = n.saturating_mul(700);
        Self {
            start: evaluation
                .saturating_mul(4)
                .saturating_add(factor)
                .saturating_add(n.saturating_mul(600))
                .saturating_add(900),
            iteration: evaluation
                .saturating_add(factor)
                .saturating_add(along)
                .saturating_add(200),
        }
    }

    /// As [`Cost::instructions`], of [`Cost::plain`].
    pub fn plain_instructions(joints: usize) -> Self {
        let n = count(joints);
        Self {
            start: 800u32.saturating_add(n.saturating_mul(160)),
            iteration: 450u32.saturating_add(n.saturating_mul(110)),
        }
    }

    fn times(self, factor: u32) -> Self {
        Self {
            start: self.start.saturating_mul(factor),
            iteration: self.iteration.saturating_mul(factor),
        }
    }
}

/// Instructions of the dearest effect of each stage.
const READING: u32 = 130;
const POSTURE: u32 = 330;

fn count(joints: usize) -> u32 {
    u32::try_from(joints).unwrap_or(u32::MAX)
}
