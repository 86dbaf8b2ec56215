//! Corrections from what was taught, polynomials or tables, made safe to send. MRD 5.4.
//!
//! Needs tables in the blob, taught for the pose that the joints nominally mean: what a
//! requested pose is off from that is not corrected, and neither is what the conditions change.
//! Cost: two evaluations of the model and one of the table; a third where it does not fit.
//!
//! The approximation knows no limits and no model. So its correction `p` is confined to the
//! limits and the correction bound, both ends are evaluated, and of the way between them only
//! as much is taken as leads nearer:
//!
//! ```text
//! q = q_n + s p,   s = min(1, 3/2 s*),   s* = e0 · (e0 - e1) / |e0 - e1|²
//! ```
//! with e0 and e1 the weighted errors at both ends and s* where their line comes nearest to
//! zero. A correction that at least halves the error counts in full; one that does not help is
//! not taken; and s is continuous in both errors.

use super::descent::{Next, Search, Tried};
use super::step::{advance, damped_step};
use super::{Status, step};
use crate::budget::{CYCLES, Moment};
use crate::taught::{Taught, cmac, polynomial};
use crate::vector::{times, turned};
use crate::{Method, Scalar, Twist};

/// Looks the correction of the start up, in the tables of the method that the settings name.
pub(super) fn begin<T: Scalar, const FEW: bool>(search: &mut Search<'_, T>, now: &Moment) -> Next {
    let (taught, method) = (search.taught, search.settings.method);
    // Two evaluations.
    search.cost = search
        .cost
        .saturating_add(lookup_cycles(taught, method, search.start.len()))
        .saturating_mul(2);
    if let Some(status) = search.halt(now) {
        return Next::Done(status);
    }
    let there = match (method, &taught.polynomial, &taught.cmac) {
        (Method::Polynomial, Some(taught), _) => {
            let miss = polynomial::corrections(taught, search.start, search.step);
            if let (Some(miss), Some(_)) = (miss, &taught.tool) {
                let back = turned(&search.desired.rotation, &miss.map(|x| -x).into());
                give_back::<T, FEW>(search, &Twist::new(back, times(&back, T::zero())));
            }
            miss.is_some()
        }
        (Method::Cmac, _, Some(taught)) => match cmac::cells(taught, search.start) {
            Some(cells) => {
                step::copy(search.step, &cells);
                true
            }
            None => false,
        },
        _ => return Next::Done(Status::NotTaught),
    };
    if !there {
        return Next::Done(Status::OutsideRegion);
    }
    let Search {
        start, step, reach, ..
    } = search;
    advance(start, step, T::one(), reach, search.trial);
    search.course.tried = Tried::Taught;
    Next::Evaluate
}

/// Adds what the joints do for a small displacement `back` of the tool at the start.
fn give_back<T: Scalar, const FEW: bool>(search: &mut Search<'_, T>, back: &Twist<T>) {
    search.set_columns();
    let back = search.weighted(back);
    let Search {
        columns,
        effort,
        start,
        settings,
        step,
        trial,
        ..
    } = search;
    damped_step::<T, FEW>(
        columns,
        &back,
        effort,
        [start, start],
        settings.damping,
        trial,
    );
    for (step, &moved) in step.iter_mut().zip(&**trial) {
        *step += moved;
    }
}

/// Takes less of the correction, where all of it leads too far; false where it does not.
pub(super) fn shorten<T: Scalar>(search: &mut Search<'_, T>) -> bool {
    let course = &search.course;
    let ends = [&course.best, &course.trial].map(|point| search.weighted(&point.twist));
    let share = way(&ends[0], &ends[1]);
    if share >= T::one() {
        return false;
    }
    for (q, &start) in search.trial.iter_mut().zip(&*search.start) {
        *q = start + (*q - start) * share;
    }
    search.course.tried = Tried::Part;
    true
}

/// What looking up takes at worst, cycles of a Cortex-M4F.
fn lookup_cycles<T: Scalar>(taught: &Taught<'_, T>, method: Method, joints: usize) -> u32 {
    let instructions = match (method, &taught.polynomial, &taught.cmac) {
        (Method::Polynomial, Some(polynomial), _) => polynomial.instructions(joints),
        (Method::Cmac, _, Some(cmac)) => cmac.instructions(joints),
        _ => 0,
    };
    u32::try_from(instructions)
        .unwrap_or(u32::MAX)
        .saturating_mul(CYCLES)
}

/// How much of the way from the error `from` to the error `to` is taken, 0 to 1.
fn way<T: Scalar>(from: &[T; 6], to: &[T; 6]) -> T {
    let (mut along, mut square) = (T::zero(), T::zero());
    for (&from, &to) in from.iter().zip(to) {
        let change = from - to;
        along += from * change;
        square += change * change;
    }
    let along = along * T::of(1.5);
    if along >= square {
        T::one()
    } else if along > T::zero() {
        along / square
    } else {
        T::zero()
    }
}
