//! A joint that measures its own angle wrongly, in an irregular but fixed way.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

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
    table: Table<'a>,
}

/// A curve's bytes. What can be told from them is told once.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Table<'a> {
    bytes: &'a [u8],
    /// Whether a cell was not measured.
    gaps: bool,
}

impl<'a> From<&'a [u8]> for Table<'a> {
    fn from(bytes: &'a [u8]) -> Self {
        let (cells, _) = bytes.as_chunks::<2>();
        let gaps = cells.contains(&UNMEASURED.to_le_bytes());
        Self { bytes, gaps }
    }
}

impl Serialize for Table<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.bytes.serialize(serializer)
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Table<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <&[u8]>::deserialize(deserializer).map(Self::from)
    }
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
            table: Table::from(table),
        }
    }

    /// Number of cells.
    #[inline]
    pub fn cells(&self) -> usize {
        self.table.bytes.len() / 2
    }

    /// Entry of cell `i` in units of the scale; `None` where nothing was measured.
    #[inline]
    pub fn cell(&self, i: usize) -> Option<T> {
        let (cells, _) = self.table.bytes.as_chunks::<2>();
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

impl<'a, T: Scalar> JointCurve<'a, T> {
    /// As the control loop reads it.
    pub(crate) fn prepared(&self) -> PreparedCurve<'a, T> {
        let (cells, _) = self.table.bytes.as_chunks::<2>();
        let [pace, scale] = T::pace(self.density, cells.len(), self.scale[0]);
        PreparedCurve {
            cells,
            pace,
            scale,
            gaps: self.table.gaps,
        }
    }

    /// Counts of the table at the reading `q`.
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

/// A curve with its constants in the form that a number type looks it up by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedCurve<'a, T> {
    cells: &'a [[u8; 2]],
    pace: T,
    scale: T,
    gaps: bool,
}

impl<T: Scalar> PreparedCurve<'_, T> {
    /// None at all.
    pub(crate) fn none() -> Self {
        Self {
            cells: &[],
            pace: T::zero(),
            scale: T::zero(),
            gaps: false,
        }
    }

    /// Whether a cell was not measured.
    pub(crate) fn gaps(&self) -> bool {
        self.gaps
    }

    /// Addition to the reading `q`, rad or m.
    #[inline(always)]
    pub(crate) fn at(&self, q: T) -> T {
        q.look_up(self.pace, self.cells, count) * self.scale
    }

    /// The same of a curve without gaps.
    #[inline(always)]
    pub(crate) fn of_measured(&self, q: T) -> T {
        let count = |cell| i32::from(i16::from_le_bytes(cell));
        q.look_up(self.pace, self.cells, count) * self.scale
    }
}

/// A number type that tables can be looked up in.
pub trait LookUp: Sized {
    /// From cells per rad or m, the number of cells, and rad or m a count: what to look a
    /// reading up by, and what to scale the result by.
    fn pace(density: Self, cells: usize, scale: Self) -> [Self; 2];

    /// Value of the periodic table `cells` at a reading, linear between the cells, whose counts
    /// are `count` of them.
    fn look_up(self, pace: Self, cells: &[[u8; 2]], count: impl Fn([u8; 2]) -> i32) -> Self;
}

/// The count in a cell, zero where nothing was measured.
#[inline(always)]
fn count(cell: [u8; 2]) -> i32 {
    match i16::from_le_bytes(cell) {
        UNMEASURED => 0,
        count => i32::from(count),
    }
}

/// By integers, without a comparison with the ends: in units of 2^-24 of the period the
/// reading is below 2^31 for 128 periods either way, and its upper 8 bits, the periods, are
/// shifted out. The table's entry is then the upper half of a product, what lies between it and
/// the next the lower one, of which the result, in units of 2^-15 counts, takes 15 bits.
/// Further away than 128 periods the entry at zero is taken.
impl LookUp for f32 {
    fn pace(density: Self, cells: usize, scale: Self) -> [Self; 2] {
        let cells = i16::try_from(cells).map_or(Self::INFINITY, Self::count);
        [density / cells * 16_777_216.0, scale * (1.0 / 32_768.0)]
    }

    #[inline(always)]
    fn look_up(self, pace: Self, cells: &[[u8; 2]], count: impl Fn([u8; 2]) -> i32) -> Self {
        let part = ((self * pace) as i32).cast_unsigned() << 8;
        let place = u64::from(part) * cells.len() as u64;
        let fraction = (place as u32 >> 17).cast_signed();
        let index = (place >> 32) as usize;
        let Some(&low) = cells.get(index) else {
            return nothing();
        };
        let next = index + 1;
        let next = if next < cells.len() { next } else { 0 };
        let Some(&high) = cells.get(next) else {
            return nothing();
        };
        let [low, high] = [count(low), count(high)];
        ((low << 15) + (high - low) * fraction) as Self
    }
}

/// Of a table without cells.
#[cold]
#[inline(never)]
fn nothing() -> f32 {
    0.0
}

impl LookUp for f64 {
    fn pace(density: Self, _: usize, scale: Self) -> [Self; 2] {
        [density, scale]
    }

    #[inline]
    fn look_up(self, pace: Self, cells: &[[u8; 2]], count: impl Fn([u8; 2]) -> i32) -> Self {
        let Some(hat) = hat(self, pace, cells.len()) else {
            return 0.0;
        };
        let cell = |i: usize| cells.get(i).map_or(0.0, |&cell| Self::from(count(cell)));
        let low = cell(hat.index);
        low + (cell(hat.next) - low) * hat.fraction
    }
}
