//! Albus' tables (cerebellar model articulation controller, CMAC). MRD 5.4.2.
//!
//! Each of Q quantising functions divides every input into cells, each of them a little
//! displaced against the others, and has one weight for each combination of cells. An input
//! selects one weight of each (5.209, 5.210), and the output is made of the Q selected:
//!
//! ```text
//! delta_q_k = sum of f_K w_K,k / sum of f_K        K = 1 .. Q
//! ```
//! In the book (5.211) every selected weight counts the same, and the output jumps from one
//! cell to the next. Here it counts less towards the border of its cell and nothing there, so
//! the output is continuous. The displacements of one input are all different: with more
//! quantising functions than inputs there is always one far from every border.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::{MAX_INPUTS, MAX_OUTPUTS, Outputs, Place, Region};
use crate::Scalar;

/// How many cells there are, and where an input lies in them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layout {
    /// Number of quantising functions, Q.
    pub layers: u8,
    /// Width of the region in cells: resolution divided by Q in the book. Displaced against
    /// each other, the quantising functions need one cell more.
    pub cells: u8,
}

/// A cell that an input selects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selected<T> {
    /// Its number among all cells of all quantising functions.
    pub index: usize,
    /// How much it counts: 1 in its middle, 0 at its border.
    pub field: T,
}

impl Layout {
    /// Cells of all quantising functions together: what has to be stored for each output.
    /// `None` beyond what can be counted.
    pub fn words(&self, inputs: usize) -> Option<usize> {
        let side = usize::from(self.cells) + 1;
        let cells = side.checked_pow(u32::try_from(inputs).ok()?)?;
        cells.checked_mul(usize::from(self.layers))
    }

    /// The cell of quantising function `layer`, from 0, that is selected. `at`: each input, in
    /// cells from the lowest, 0 to [`Layout::cells`].
    ///
    /// `int((i + Q - K) / Q)` of MRD 5.209 with `i` in units of 1/Q cell and `layer = Q - K`.
    #[inline]
    pub fn select<T: Scalar>(&self, layer: u8, at: &[T]) -> Selected<T> {
        let shift = T::count(i16::from(layer)) / T::count(i16::from(self.layers));
        let side = usize::from(self.cells) + 1;
        let mut selected = Selected {
            index: usize::from(layer),
            field: T::one(),
        };
        for &x in at {
            let (cell, rest) = (x + shift).split();
            let cell = usize::try_from(cell).unwrap_or(0);
            let cell = if cell < side { cell } else { side - 1 };
            selected.index = selected.index.wrapping_mul(side).wrapping_add(cell);
            // A tent over the cell.
            let other = T::one() - rest;
            let tent = if rest < other { rest } else { other };
            let tent = tent + tent;
            if tent < selected.field {
                selected.field = tent;
            }
        }
        selected
    }
}

/// Instructions of a quantising function, and in it of an input and its output.
const PER_LAYER: usize = 60;
const PER_INPUT: usize = 50;
/// Instructions of all else, and in it of an input and its output.
const AROUND: usize = 560;
const AROUND_INPUT: usize = 60;

/// Corrections of all joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cmac<'a, T: Scalar> {
    /// What it was taught on.
    pub region: Region<T>,
    /// Its cells.
    pub layout: Layout,
    /// rad or m a count, one a joint.
    pub scale: Vec<T, MAX_INPUTS>,
    /// Little-endian `i16` counts, cell by cell, one a joint for each.
    #[serde(borrow)]
    pub table: &'a [u8],
}

impl<'a, T: Scalar> Cmac<'a, T> {
    pub(crate) fn is_sound(&self, joints: usize) -> bool {
        let words = self.layout.words(joints);
        let bytes = words.and_then(|w| w.checked_mul(2 * joints));
        self.region.is_sound(joints)
            && usize::from(self.layout.layers) > joints
            && self.layout.cells > 0
            && self.scale.len() == joints
            && bytes == Some(self.table.len())
    }

    pub(crate) fn cast<U: Scalar>(&self) -> Cmac<'a, U> {
        Cmac {
            region: self.region.cast(),
            layout: self.layout,
            scale: super::listed(self.scale.iter().map(|x| U::of(x.widen()))),
            table: self.table,
        }
    }

    /// Bound on the instructions of [`Cmac::evaluate`] on a Cortex-M4F, held by
    /// `tests/firmware` (`tests/firmware/tests/budget_bounds_hold.rs`).
    pub fn instructions(&self, joints: usize) -> usize {
        let layer = PER_LAYER + joints * PER_INPUT;
        usize::from(self.layout.layers) * layer + AROUND + joints * AROUND_INPUT
    }

    /// The corrections at the command `q` (rad or m); `None` outside the region, and
    /// of more than [`MAX_OUTPUTS`] joints.
    pub fn evaluate<const N: usize>(&self, q: &[T; N]) -> Option<[T; N]> {
        T::cells(self, q)?.first_chunk().copied()
    }
}

/// [`Cmac::evaluate`] of any number of joints.
pub(crate) fn cells<T: Scalar>(cmac: &Cmac<'_, T>, q: &[T]) -> Option<Outputs<T>> {
    let Place { x: mut at, share } = cmac.region.place(q)?;
    let half = T::count(i16::from(cmac.layout.cells)) / T::of(2.0);
    let at = at.get_mut(..q.len())?;
    for at in at.iter_mut() {
        *at = (*at + T::one()) * half;
    }
    let (counts, _) = cmac.table.as_chunks::<2>();
    let mut sum = [T::zero(); MAX_OUTPUTS];
    let mut total = T::zero();
    for layer in 0..cmac.layout.layers {
        let selected = cmac.layout.select(layer, at);
        let first = selected.index.wrapping_mul(q.len());
        let weights = counts
            .get(first..first.wrapping_add(q.len()))
            .unwrap_or(&[]);
        total += selected.field;
        for (sum, &weight) in sum.iter_mut().zip(weights) {
            *sum += selected.field * T::count(i16::from_le_bytes(weight));
        }
    }
    let share = share / total;
    for (sum, &scale) in sum.iter_mut().zip(&cmac.scale) {
        *sum *= scale * share;
    }
    Some(sum)
}
