//! Sizes of a pose error without their roots.

use crate::compensate::error::PoseError;
use crate::vector::square;
use crate::{Scalar, Twist};

/// Squares of position and orientation error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Squares<T> {
    pub(super) position: T,
    pub(super) orientation: T,
}

impl<T: Scalar> Squares<T> {
    #[inline(always)]
    pub(super) fn of(e: &Twist<T>) -> Self {
        Self {
            position: square(&e.linear),
            orientation: square(&e.angular),
        }
    }

    #[inline(always)]
    pub(super) fn of_error(e: &PoseError<T>) -> Self {
        Self {
            position: e.position * e.position,
            orientation: e.orientation * e.orientation,
        }
    }

    #[inline(always)]
    pub(super) fn below(&self, tolerance: &Self) -> bool {
        self.position <= tolerance.position && self.orientation <= tolerance.orientation
    }

    #[inline(always)]
    pub(super) fn weighted(&self, [position, orientation]: [T; 2]) -> T {
        self.position * position + self.orientation * orientation
    }

    #[inline(always)]
    pub(super) fn error(&self) -> PoseError<T> {
        PoseError {
            position: self.position.rough_root(),
            orientation: self.orientation.rough_root(),
        }
    }
}

/// Tangents of the two square roots at the squares of the tolerances: never below the root,
/// and little above it there, in two operations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tangent<T> {
    /// Half the tolerances,
    half: PoseError<T>,
    /// and half their reciprocals.
    slope: PoseError<T>,
}

impl<T: Scalar> Tangent<T> {
    pub(super) fn at(tolerance: &PoseError<T>) -> Self {
        let half = T::of(0.5);
        Self {
            half: PoseError {
                position: tolerance.position * half,
                orientation: tolerance.orientation * half,
            },
            slope: PoseError {
                position: half / tolerance.position,
                orientation: half / tolerance.orientation,
            },
        }
    }

    #[inline(always)]
    pub(super) fn of(&self, squares: &Squares<T>) -> PoseError<T> {
        PoseError {
            position: self.half.position + squares.position * self.slope.position,
            orientation: self.half.orientation + squares.orientation * self.slope.orientation,
        }
    }
}
