//! A piece of a joint curve while it is being identified.

use serde::{Deserialize, Serialize};

use super::{EffectModel, Reading, Selector, Stage, entry, hat};
use crate::Scalar;

/// Cells of one segment.
pub const SEGMENT: usize = 8;

/// Some neighbouring cells of a joint curve with a value each, so that a solver can identify
/// them like those of any other effect. All segments of a joint together are the curve, with
/// the same interpolation as [`super::JointCurve`], which is the form to store.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurveSegment<T: Scalar> {
    /// Joint, from 0.
    pub joint: u8,
    /// Its first cell.
    pub first: u16,
    /// Cells of the whole periodic table.
    pub cells: u16,
    /// Cells per rad or m.
    pub density: T,
    /// rad or m; those beyond the table's end are not used.
    pub values: [T; SEGMENT],
}

impl<T: Scalar> CurveSegment<T> {
    /// The segments of a curve of `cells` cells that repeats after `period` (rad or m; a turn
    /// for a revolute joint, more than the travel for a prismatic one), all zero, in order.
    pub fn split(joint: u8, cells: u16, period: T) -> impl Iterator<Item = Self> {
        let density = T::of(f64::from(cells)) / period;
        (0..cells).step_by(SEGMENT).map(move |first| Self {
            joint,
            first,
            cells,
            density,
            values: [T::zero(); SEGMENT],
        })
    }

    pub(super) fn cast<U: Scalar>(&self) -> CurveSegment<U> {
        CurveSegment {
            joint: self.joint,
            first: self.first,
            cells: self.cells,
            density: U::of(self.density.widen()),
            values: self.values.map(|x| U::of(x.widen())),
        }
    }

    /// Cells that are not beyond the table's end.
    fn used(&self) -> usize {
        usize::from(self.cells.saturating_sub(self.first)).min(SEGMENT)
    }
}

impl<T: Scalar> EffectModel<T> for CurveSegment<T> {
    fn kind(&self) -> &'static str {
        "joint-curve"
    }

    fn joint(&self) -> Option<usize> {
        Some(usize::from(self.joint))
    }

    /// [`Selector::from`] would be a joint: not enough to find it again.
    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        const NAMES: [(&str, &str); SEGMENT] = [
            ("cell 1", "rad"),
            ("cell 2", "rad"),
            ("cell 3", "rad"),
            ("cell 4", "rad"),
            ("cell 5", "rad"),
            ("cell 6", "rad"),
            ("cell 7", "rad"),
            ("cell 8", "rad"),
        ];
        NAMES.get(..self.used()).unwrap_or(&[])
    }

    fn values(&self) -> &[T] {
        self.values.get(..self.used()).unwrap_or(&[])
    }

    fn values_mut(&mut self) -> &mut [T] {
        let used = self.used();
        self.values.get_mut(..used).unwrap_or(&mut [])
    }

    fn stage(&self) -> Stage {
        Stage::Reading
    }

    #[inline]
    fn reading_partial(&self, k: usize, at: &Reading<'_, T>) -> T {
        let q = entry(at.q, usize::from(self.joint));
        let cell = usize::from(self.first) + k;
        match hat(q, self.density, usize::from(self.cells)) {
            Some(hat) => hat.weight(cell),
            None => T::zero(),
        }
    }
}
