//! Multivariate polynomials of the joint values. MRD 5.4.1.
//!
//! ```text
//! delta_q_k = sum over r + s + .. <= degree of  c_k,rs.. x1^r x2^s ..      MRD 5.175, 5.177
//! ```
//! with every joint scaled to -1 .. 1 over the region. The host finds the coefficients through
//! polynomials that are orthonormal on the points taught (5.182 to 5.189) and writes them
//! down for powers, which Horner's rule takes in one multiplication and one addition each.
//! What single precision loses by that is of the order of `3^degree` roundings of the
//! correction.

use serde::{Deserialize, Serialize};

use super::{MAX_INPUTS, MAX_OUTPUTS, Place, Region};
use crate::Scalar;

/// The highest degree there can be.
pub const MAX_DEGREE: u8 = 10;

/// Instructions of a coefficient, of a row of them, of a polynomial of the last input and of an
/// output in it.
const PER_COEFFICIENT: usize = 7;
const PER_ROW: usize = 17;
const PER_CALL: usize = 70;
const PER_CALL_OUTPUT: usize = 7;
/// Instructions of all else, and in it of an input.
const AROUND: usize = 1000;
const PER_INPUT: usize = 60;

/// Corrections of all joints, and what is left of the position on top.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Polynomial<'a, T: Scalar> {
    /// The correction of each joint, rad or m, from the joints, or from the first of them
    /// with the others as they may be (the book's K = 3).
    #[serde(borrow)]
    pub joints: Block<'a, T>,
    /// Compensation of the wrist: how far the tool still misses, m along x, y, z of the tool
    /// frame, from the joints that `joints` does not depend on. MRD 5.196 to 5.198.
    pub tool: Option<Block<'a, T>>,
}

/// Polynomials of the same inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Block<'a, T: Scalar> {
    /// What they were taught on.
    pub region: Region<T>,
    /// Highest sum of the exponents.
    pub degree: u8,
    /// Little-endian `f32`, in the order of [`exponents`], one an output for each.
    #[serde(borrow)]
    pub coefficients: &'a [u8],
}

/// Number of products of `inputs` powers whose exponents add up to `degree` at most.
pub fn terms(inputs: usize, degree: usize) -> usize {
    let mut count = 1usize;
    for k in 1..=degree {
        // Binomial coefficients one after the other: always whole numbers.
        let product = count.saturating_mul(inputs.saturating_add(k));
        count = product.checked_div(k).unwrap_or(product);
    }
    count
}

/// The exponents of each product in stored order: those of the first input fall from `degree`
/// to 0, and within each the others, which share what is left, the same way.
pub fn exponents(inputs: usize, degree: usize) -> impl Iterator<Item = [u8; MAX_INPUTS]> {
    let inputs = inputs.min(MAX_INPUTS);
    let mut next = Some([0u8; MAX_INPUTS]);
    if let (Some(first), Some(powers)) = (u8::try_from(degree).ok(), next.as_mut())
        && let Some(power) = powers.first_mut().filter(|_| inputs > 0)
    {
        *power = first;
    }
    core::iter::from_fn(move || {
        let present = next?;
        // The last input that can fall gives one to those after it, all to the next.
        let mut following = present;
        let used: usize = present.iter().map(|&p| usize::from(p)).sum();
        let mut left = degree.saturating_sub(used);
        next = None;
        for j in (0..inputs).rev() {
            let Some(power) = following.get_mut(j) else {
                break;
            };
            if *power > 0 {
                *power -= 1;
                left += 1;
                if let Some(after) = following.get_mut(j + 1).filter(|_| j + 1 < inputs) {
                    *after = u8::try_from(left).unwrap_or(u8::MAX);
                }
                next = Some(following);
                break;
            }
        }
        Some(present)
    })
}

impl<'a, T: Scalar> Polynomial<'a, T> {
    pub(crate) fn is_sound(&self, joints: usize) -> bool {
        let inputs = self.joints.region.inputs();
        let rest = joints.saturating_sub(inputs);
        let tool = self.tool.as_ref();
        (1..=joints).contains(&inputs)
            && self.joints.is_sound(inputs, joints)
            && tool.is_none_or(|tool| rest > 0 && tool.is_sound(rest, 3))
    }

    pub(crate) fn cast<U: Scalar>(&self) -> Polynomial<'a, U> {
        Polynomial {
            joints: self.joints.cast(),
            tool: self.tool.as_ref().map(Block::cast),
        }
    }

    /// Coefficients of all polynomials: multiplications of one evaluation, and as many
    /// additions.
    pub fn coefficients(&self) -> usize {
        let tool = self.tool.as_ref().map_or(0, |t| t.coefficients.len());
        (self.joints.coefficients.len() + tool) / 4
    }

    /// Bound on the instructions of [`Polynomial::evaluate`] on a Cortex-M4F, held by
    /// `tests/firmware` (`tests/firmware/tests/budget_bounds_hold.rs`).
    pub fn instructions(&self, joints: usize) -> usize {
        let tool = self.tool.as_ref().map_or(0, |tool| tool.instructions(3));
        self.joints.instructions(joints).saturating_add(tool)
    }

    /// The corrections at the command `q` (rad or m), and the position that the tool still
    /// misses (m, tool frame); `None` outside the region.
    pub fn evaluate<const N: usize>(&self, q: &[T; N]) -> Option<([T; N], [T; 3])> {
        let mut delta = [T::zero(); N];
        let miss = T::polynomial(self, q, &mut delta)?;
        Some((delta, miss))
    }
}

/// [`Polynomial::evaluate`] of any number of joints: sets `delta` and returns what is missed.
pub(crate) fn corrections<T: Scalar>(
    polynomial: &Polynomial<'_, T>,
    q: &[T],
    delta: &mut [T],
) -> Option<[T; 3]> {
    let Polynomial { joints, tool } = polynomial;
    let place = joints.region.place(q)?;
    joints.at(&place, delta);
    let mut miss = [T::zero(); 3];
    let mut share = place.share;
    if let Some(tool) = tool {
        let wrist = tool
            .region
            .place(q.get(joints.region.inputs()..).unwrap_or(&[]))?;
        share *= wrist.share;
        tool.at(&wrist, &mut miss);
        miss = miss.map(|x| x * share);
    }
    for delta in delta {
        *delta *= share;
    }
    Some(miss)
}

impl<'a, T: Scalar> Block<'a, T> {
    fn is_sound(&self, inputs: usize, outputs: usize) -> bool {
        let (coefficients, rest) = self.coefficients.as_chunks::<4>();
        let count = terms(inputs, usize::from(self.degree)).saturating_mul(outputs);
        let finite = |&bytes: &[u8; 4]| {
            // NaN fails the comparison.
            f32::from_le_bytes(bytes).abs() <= 1e9
        };
        self.degree <= MAX_DEGREE
            && self.region.is_sound(inputs)
            && rest.is_empty()
            && coefficients.len() == count
            && coefficients.iter().all(finite)
    }

    fn cast<U: Scalar>(&self) -> Block<'a, U> {
        Block {
            region: self.region.cast(),
            degree: self.degree,
            coefficients: self.coefficients,
        }
    }

    /// See [`Polynomial::instructions`].
    fn instructions(&self, outputs: usize) -> usize {
        let count = self.coefficients.len() / 4;
        instructions(self.region.inputs(), self.degree, count, outputs)
    }

    /// All polynomials at once.
    fn at(&self, place: &Place<T>, outputs: &mut [T]) {
        let (coefficients, _) = self.coefficients.as_chunks::<4>();
        let mut rows = Rows {
            coefficients,
            outputs: outputs.len(),
        };
        let inputs = place.x.get(..self.region.inputs()).unwrap_or(&[]);
        let mut sums = [T::zero(); MAX_INPUTS * MAX_OUTPUTS];
        horner(inputs, usize::from(self.degree), &mut rows, &mut sums);
        for (output, &sum) in outputs.iter_mut().zip(&sums) {
            *output = sum;
        }
    }
}

/// See [`Polynomial::instructions`]. Each polynomial of all inputs but the last is one call,
/// with its terms' coefficients in front.
#[inline(never)]
fn instructions(inputs: usize, degree: u8, coefficients: usize, outputs: usize) -> usize {
    let calls = terms(inputs.saturating_sub(1), usize::from(degree));
    let rows = coefficients.checked_div(outputs).unwrap_or(coefficients);
    coefficients
        .saturating_mul(PER_COEFFICIENT)
        .saturating_add(rows.saturating_mul(PER_ROW))
        .saturating_add(calls.saturating_mul(PER_CALL + outputs * PER_CALL_OUTPUT))
        .saturating_add(AROUND + inputs * PER_INPUT)
}

/// Coefficients that are not used yet: little-endian `f32`, one an output for each product of
/// powers.
struct Rows<'r> {
    coefficients: &'r [[u8; 4]],
    outputs: usize,
}

impl Rows<'_> {
    /// `sums x` and the next row, which is taken away.
    #[inline(always)]
    fn add<T: Scalar>(&mut self, x: T, sums: &mut [T]) {
        let split = self.coefficients.split_at_checked(self.outputs);
        let (row, rest) = split.unwrap_or_default();
        self.coefficients = rest;
        for (sum, &bytes) in sums.iter_mut().zip(row) {
            *sum = *sum * x + T::of(f64::from(f32::from_le_bytes(bytes)));
        }
    }
}

/// Horner's rule in the first input, whose coefficients are polynomials of the others. As deep
/// as there are inputs, less one: the last has a loop. `sums`: finite numbers; the first become
/// the polynomials' values, one an output, those behind them the others'.
fn horner<T: Scalar>(x: &[T], degree: usize, rows: &mut Rows<'_>, sums: &mut [T]) {
    let Some((&first, others)) = x.split_first() else {
        return;
    };
    let split = sums.split_at_mut_checked(rows.outputs);
    let (sums, inner) = split.unwrap_or_default();
    // The highest power comes first, has nothing of the others, and nothing before it.
    rows.add(T::zero(), sums);
    for left in 1..degree + 1 {
        if others.is_empty() {
            rows.add(first, sums);
        } else {
            horner(others, left, rows, inner);
            for (sum, &inner) in sums.iter_mut().zip(&*inner) {
                *sum = *sum * first + inner;
            }
        }
    }
}
