//! A joint that measures its own angle wrongly, in an irregular but fixed way.

use serde::{Deserialize, Serialize};

use super::{EffectModel, Reading, Stage, entry};
use crate::Scalar;

/// Joint curve: adds a periodic table of the reading, interpolated linearly. The irregular
/// relative of MRD 4.22.
///
/// ```text
/// delta_q = scale * ((1 - f) c[i] + f c[i + 1]),  i + f = q * density,  i modulo the cells
/// ```
/// Cells that were not measured count as zero, so the curve goes to zero within one cell
/// beyond what was measured. For the contract its one value is `scale`, which is what makes
/// it linear; its cells are identified through [`hat`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointCurve<'a, T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Cells per rad or m.
    pub density: T,
    /// rad or m per unit of the table.
    pub scale: [T; 1],
    /// Little-endian `i16` counts as [`encode`] writes them, cell 0 at zero reading,
    /// [`UNMEASURED`] where nothing was measured.
    #[serde(borrow)]
    pub table: &'a [u8],
}

/// The count that says that a cell was not measured. It acts as zero.
pub const UNMEASURED: i16 = i16::MIN;

/// The two cells that a reading lies between, of a periodic table: cell `index` counts
/// `1 - fraction`, cell `next` counts `fraction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hat<T> {
    /// Cell at or below the reading.
    pub index: usize,
    /// The cell after it.
    pub next: usize,
    /// 0 to 1.
    pub fraction: T,
}

/// Where the reading `q` (rad or m) lies in a table of `cells` cells, `density` a rad or m.
/// `None` without cells. The only interpolation there is: curves that are
/// being identified use it too.
#[inline]
pub fn hat<T: Scalar>(q: T, density: T, cells: usize) -> Option<Hat<T>> {
    let count = i32::try_from(cells).ok().filter(|&n| n > 0)?;
    let (whole, rest) = (q * density).split();
    let index = usize::try_from(whole.rem_euclid(count)).ok()?;
    let next = if index + 1 < cells { index + 1 } else { 0 };
    Some(Hat {
        index,
        next,
        fraction: rest,
    })
}

/// Quantises `values` (rad or m) into `out`, two bytes a cell, and returns the scale, rad or
/// m a count; the error is at most half of it. NaN stands for a cell that was not measured.
/// `None` if `out` has not exactly two bytes a cell.
pub fn encode(values: &[f64], out: &mut [u8]) -> Option<f64> {
    if out.len() != 2 * values.len() {
        return None;
    }
    let largest = values
        .iter()
        .filter(|x| x.is_finite())
        .fold(0.0_f64, |m, x| m.max(x.abs()));
    let scale = largest / f64::from(i16::MAX);
    let (cells, _) = out.as_chunks_mut::<2>();
    for (cell, &value) in cells.iter_mut().zip(values) {
        let count = if !value.is_finite() {
            UNMEASURED
        } else if scale > 0.0 {
            // The quotient is within the counts by the choice of the scale.
            libm::round(value / scale) as i16
        } else {
            0
        };
        *cell = count.to_le_bytes();
    }
    Some(scale)
}

impl<'a, T: Scalar> JointCurve<'a, T> {
    /// A table of one turn of `joint` (from 0).
    pub fn turn(joint: u8, scale: T, table: &'a [u8]) -> Self {
        Self::over(joint, T::two_pi(), scale, table)
    }

    /// A table that repeats after `period`, rad or m. Longer than the travel of a prismatic
    /// joint, so that nothing repeats.
    pub fn over(joint: u8, period: T, scale: T, table: &'a [u8]) -> Self {
        Self {
            joint,
            density: T::of((table.len() / 2) as f64) / period,
            scale: [scale],
            table,
        }
    }

    /// Number of cells.
    #[inline]
    pub fn cells(&self) -> usize {
        self.table.len() / 2
    }

    /// Entry of cell `i` in units of the scale; `None` where nothing was measured.
    #[inline]
    pub fn cell(&self, i: usize) -> Option<T> {
        let (cells, _) = self.table.as_chunks::<2>();
        let count = i16::from_le_bytes(*cells.get(i)?);
        (count != UNMEASURED).then(|| T::count(count))
    }

    pub(super) fn cast<U: Scalar>(&self) -> JointCurve<'a, U> {
        JointCurve {
            joint: self.joint,
            density: U::of(self.density.widen()),
            scale: self.scale.map(|x| U::of(x.widen())),
            table: self.table,
        }
    }
}

impl<T: Scalar> EffectModel<T> for JointCurve<'_, T> {
    fn kind(&self) -> &'static str {
        "joint-curve"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("scale", "rad")]
    }

    fn values(&self) -> &[T] {
        &self.scale
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.scale
    }

    fn stage(&self) -> Stage {
        Stage::Reading
    }

    #[inline]
    fn reading_partial(&self, _k: usize, at: &Reading<'_, T>) -> T {
        self.counts(entry(at.q, usize::from(self.joint)))
    }
}

impl<T: Scalar> JointCurve<'_, T> {
    /// The addition to the reading `q`, rad or m. Within a turn of the table either way it
    /// needs no division.
    #[inline]
    pub(crate) fn at(&self, q: T) -> T {
        let (cells, _) = self.table.as_chunks::<2>();
        let x = q * self.density;
        let count = i16::try_from(cells.len()).unwrap_or(0);
        // NaN is not within.
        if x.abs() < T::count(count) {
            let (whole, fraction) = x.split_near();
            let index = if whole < 0 {
                whole + i32::from(count)
            } else {
                whole
            };
            let next = if index + 1 < i32::from(count) {
                index + 1
            } else {
                0
            };
            let cell = |i| usize::try_from(i).ok().and_then(|i: usize| cells.get(i));
            if let (Some(low), Some(high)) = (cell(index), cell(next)) {
                let (low, high) = (i16::from_le_bytes(*low), i16::from_le_bytes(*high));
                if low != UNMEASURED && high != UNMEASURED {
                    let low = T::count(low);
                    return (low + (T::count(high) - low) * fraction) * self.scale[0];
                }
            }
        }
        self.counts(q) * self.scale[0]
    }

    /// The same in counts of the table.
    #[inline(never)]
    fn counts(&self, q: T) -> T {
        let Some(hat) = hat(q, self.density, self.cells()) else {
            return T::zero();
        };
        let cell = |i| self.cell(i).unwrap_or_else(T::zero);
        let low = cell(hat.index);
        low + (cell(hat.next) - low) * hat.fraction
    }
}
