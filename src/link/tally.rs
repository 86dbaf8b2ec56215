//! What the loop did, counted.

use serde::{Deserialize, Serialize};

use crate::Scalar;
use crate::compensate::{Outcome, Status};

/// Statuses that there are.
const STATUSES: usize = 10;

/// What the loop did since the parameters came into use. Counters stay at their end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tally {
    /// Requests answered.
    pub answered: u32,
    /// Cycles without a command, as the controller counts them.
    pub missed: u32,
    /// How often each [`Status`] came, in the order of its variants.
    pub statuses: [u32; STATUSES],
    /// Commands with a joint at a limit or at the correction bound.
    pub clamped: u32,
    /// The last answer.
    pub last: Last,
    /// Largest predicted error left, m and rad.
    pub largest_error: [f32; 2],
    /// Most cycles that an answer took, by the budget's clock.
    pub most_cycles: u32,
}

/// The last answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Last {
    /// Its status, by its place among the variants.
    pub status: u8,
    /// Steps that were evaluated.
    pub iterations: u8,
    /// Joints that stand at a limit or at the correction bound: bit 0 is joint 1.
    pub clamped: u16,
    /// Predicted error left, m and rad, where it was computed.
    pub error: Option<[f32; 2]>,
    /// Cycles that it took.
    pub cycles: u32,
}

/// A status by its place among the variants.
fn place(status: Status) -> u8 {
    match status {
        Status::Converged => 0,
        Status::Settled => 1,
        Status::IterationLimit => 2,
        Status::OutOfBudget => 3,
        Status::ConditionsNotFinite => 4,
        Status::NotAPose => 5,
        Status::PredictionNotFinite => 6,
        Status::JointsNotFinite => 7,
        Status::OutsideRegion => 8,
        Status::NotTaught => 9,
    }
}

impl Tally {
    /// Counts an answer of the compensator.
    pub fn count<T: Scalar, const N: usize>(&mut self, outcome: &Outcome<T, N>) {
        let status = place(outcome.status);
        self.answered = self.answered.saturating_add(1);
        if let Some(count) = self.statuses.get_mut(usize::from(status)) {
            *count = count.saturating_add(1);
        }
        let mut clamped = 0;
        for (joint, _) in outcome.clamped.iter().enumerate().filter(|(_, at)| **at) {
            clamped |= 1_u16.checked_shl(joint as u32).unwrap_or(0);
        }
        self.clamped = self.clamped.saturating_add(u32::from(clamped != 0));
        let error = outcome
            .remaining
            .map(|e| [e.position.widen() as f32, e.orientation.widen() as f32]);
        for (largest, error) in self
            .largest_error
            .iter_mut()
            .zip(error.into_iter().flatten())
        {
            *largest = largest.max(error);
        }
        self.most_cycles = self.most_cycles.max(outcome.cycles);
        self.last = Last {
            status,
            iterations: outcome.iterations,
            clamped,
            error,
            cycles: outcome.cycles,
        };
    }

    /// Counts a cycle without a command.
    pub fn miss(&mut self) {
        self.missed = self.missed.saturating_add(1);
    }
}
