//! What stays of one joint: its reading worked into a few numbers.

use nalgebra::Vector3;

use crate::effects::PreparedCurve;
use crate::{JointKind, Scalar};

/// Orders of a joint's harmonics that are worked in.
const ORDERS: usize = 4;

/// What is worked into one joint. `'m`: whoever holds the tables of joint curves.
#[derive(Clone, Copy, Debug)]
pub struct PreparedJoint<'m, T: Scalar> {
    pub(super) motion: Motion,
    /// Addition to the reading where it is zero, rad or m.
    pub(super) zero: T,
    /// The same per unit of the reading.
    pub(super) gain: T,
    pub(super) curve: PreparedCurve<'m, T>,
    /// Whether it has one.
    pub(super) curved: bool,
    /// Highest order of its harmonics.
    pub(super) highest: u8,
    /// Bound of the sum of the harmonics and their constants, rad.
    pub(super) swing: T,
    /// Factors of the cosine of `order (q + theta)` and, negative, of the sine, from order 1.
    pub(super) harmonics: [[T; 2]; ORDERS],
    /// Displacement of all beyond, axes of the frame, m. Along z nothing is left.
    pub(super) growth: Vector3<T>,
    /// rad/(N m) or m/N.
    pub(super) compliance: T,
    /// `w` along x and y of the frame, kg m.
    pub(super) moment: [T; 2],
    /// Of this link and all beyond, kg.
    pub(super) mass: T,
}

/// How a joint gets from its reading to its motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// Turns by its reading.
    Exact,
    /// Turns by its reading and a curve without gaps.
    Curve,
    /// Turns by its reading and a line over it.
    Line,
    /// Turns by its reading, a line, a curve and what is left to the contract.
    Bend,
    /// Turns by its reading and small harmonics.
    Wave,
    /// Turns by its reading, all of that and any harmonics.
    All,
    /// Slides by its reading, a line, a curve and what is left to the contract.
    Slide,
}

impl Motion {
    /// The same with everything that it can have.
    pub(super) fn with_all(self) -> Self {
        match self {
            Self::Exact | Self::Curve | Self::Line | Self::Bend => Self::Bend,
            Self::Wave | Self::All => Self::All,
            Self::Slide => Self::Slide,
        }
    }
}

impl<'m, T: Scalar> PreparedJoint<'m, T> {
    /// Place for one joint.
    #[inline(never)]
    pub fn empty() -> Self {
        let o = T::zero();
        Self {
            motion: Motion::Exact,
            zero: o,
            gain: o,
            curve: PreparedCurve::none(),
            curved: false,
            highest: 0,
            swing: o,
            harmonics: [[o; 2]; ORDERS],
            growth: Vector3::zeros(),
            compliance: o,
            moment: [o; 2],
            mass: o,
        }
    }

    /// Takes everything out. What nothing looks at then stays as it is: the curve, the harmonics,
    /// and what only gravity sets and looks at.
    pub(super) fn clear(&mut self, kind: JointKind) {
        let o = T::zero();
        self.motion = match kind {
            JointKind::Revolute => Motion::Exact,
            JointKind::Prismatic => Motion::Slide,
        };
        self.zero = o;
        self.gain = o;
        self.curved = false;
        self.highest = 0;
        self.swing = o;
        self.growth = Vector3::zeros();
        self.compliance = o;
    }

    pub(super) fn add_to_reading(&mut self, zero: T, gain: T) {
        self.zero += zero;
        self.gain += gain;
        self.motion = match self.motion {
            Motion::Exact | Motion::Line => Motion::Line,
            other => other.with_all(),
        };
    }

    /// Takes `a sin(order q) + b (cos(order q) - 1)` in, where `theta` is added to q; false if
    /// it cannot.
    pub(super) fn add_harmonic(
        &mut self,
        order: T,
        [a, b]: [T; 2],
        [sine, cosine]: [T; 2],
    ) -> bool {
        if self.motion == Motion::Slide {
            return false;
        }
        if self.highest == 0 {
            self.harmonics = [[T::zero(); 2]; ORDERS];
        }
        // (b - i a) turned back by theta once an order.
        let (mut x, mut y) = (b, -a);
        let mut rest = order;
        for (k, place) in (1..).zip(&mut self.harmonics) {
            rest -= T::one();
            (x, y) = (x * cosine + y * sine, y * cosine - x * sine);
            if rest.is_zero() {
                *place = [place[0] + x, place[1] + y];
                self.highest = self.highest.max(k);
                self.zero -= b;
                self.swing += x.abs() + y.abs() + b.abs();
                self.motion = match self.motion {
                    // NaN is not little.
                    Motion::Exact | Motion::Wave if self.swing <= T::LITTLE => Motion::Wave,
                    _ => Motion::All,
                };
                return true;
            }
        }
        false
    }

    /// Takes a curve in; false if there is one.
    pub(super) fn add_curve(&mut self, curve: PreparedCurve<'m, T>) -> bool {
        if self.curved {
            return false;
        }
        self.curve = curve;
        self.curved = true;
        self.motion = match self.motion {
            Motion::Exact if !curve.gaps() => Motion::Curve,
            other => other.with_all(),
        };
        true
    }

    /// Sum of the harmonics, their constants left out, where these are sine and cosine of
    /// `q + theta`.
    #[inline(always)]
    pub(super) fn harmonics(&self, s: T, c: T) -> T {
        let &[[mut x, mut y], ref second, ref third, ref fourth] = &self.harmonics;
        let before = |[x, y]: [T; 2], [cosine, sine]: &[T; 2]| {
            [*cosine + x * c - y * s, *sine + x * s + y * c]
        };
        if self.highest > 1 {
            let mut sum = *second;
            if self.highest > 2 {
                sum = before(before(*fourth, third), second);
            }
            [x, y] = before(sum, &[x, y]);
        }
        x * c - y * s
    }
}
