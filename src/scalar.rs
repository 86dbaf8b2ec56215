//! The number type: `f32` on the controller, `f64` on the host.

use nalgebra::RealField;

/// A real number that the whole model is written in, implemented for `f32` and `f64`.
///
/// Everything here uses additions, multiplications, divisions and exactly rounded square
/// roots in a fixed order and never a fused multiply-add, so host and target agree in every
/// bit for the same type.
pub trait Scalar: RealField + Copy {
    /// Distance from 1 to the next number above it.
    const EPSILON: Self;

    /// Nearest value of this type to `x`.
    fn of(x: f64) -> Self;

    /// The value as `f64`, exact.
    fn widen(self) -> f64;

    /// Sine and cosine of an angle in rad.
    ///
    /// Absolute error below 1.0e-7 (`f32`, |x| <= 100) and 3e-16 (`f64`, |x| <= 1000); grows
    /// with |x| beyond, where NaN and infinity give NaN. See `tests/sine_and_cosine.rs`.
    fn sincos(self) -> (Self, Self);

    /// Sine and cosine of `self + offset`, |offset| <= pi/2. The sum is not rounded at its
    /// full size: an angle of several turns loses nothing to a small offset. Absolute error
    /// below 1.7e-7 (`f32`, |self| <= 7). Cost: `sine_and_cosine` in `docs/COST.md`.
    fn sincos_beside(self, offset: Self) -> (Self, Self);

    /// Angle of the point (`x`, `self`) in (-pi, pi], rad, the same bits on every core.
    fn arctangent2(self, x: Self) -> Self;

    /// `e^x`, the same bits on every core.
    fn exponential(self) -> Self;

    /// Square root, exactly rounded, NaN below zero.
    fn root(self) -> Self;

    /// False for NaN and infinities.
    fn finite(self) -> bool;

    /// Largest integer not above `self`, and what is left, in [0, 1]. Both 0 for NaN; beyond
    /// the integers' range the nearest of them and a rest of 0 or 1.
    fn split(self) -> (i32, Self);

    /// A small integer as a number, exact.
    fn count(x: i16) -> Self;
}

/// [`Scalar::split`] for a primitive type: `as` truncates, saturates and takes NaN to 0.
macro_rules! split {
    ($x:expr, $float:ty) => {{
        let x = $x;
        let toward_zero = x as i32;
        let whole = if toward_zero as $float > x {
            toward_zero.saturating_sub(1)
        } else {
            toward_zero
        };
        let rest = x - whole as $float;
        let rest = if rest >= 1.0 {
            1.0
        } else if rest > 0.0 {
            rest
        } else {
            0.0
        };
        (whole, rest)
    }};
}

/// Turns a sine and cosine by `quarter` quarter turns. With a table there is nothing to
/// decide, and the products with 0 and +-1 are exact.
macro_rules! quarter_turns {
    ($sine:expr, $cosine:expr, $quarter:expr) => {{
        const TURNS: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]];
        let [s, c] = TURNS[($quarter & 3) as usize].map(Self::from);
        let (sine, cosine) = ($sine, $cosine);
        (sine * c + cosine * s, cosine * c - sine * s)
    }};
}

impl Scalar for f32 {
    const EPSILON: Self = f32::EPSILON;

    #[inline]
    fn of(x: f64) -> Self {
        x as f32
    }

    #[inline]
    fn widen(self) -> f64 {
        f64::from(self)
    }

    #[inline]
    fn sincos(self) -> (Self, Self) {
        self.sincos_beside(0.0)
    }

    #[inline]
    fn sincos_beside(self, offset: Self) -> (Self, Self) {
        // Adding and taking away 1.5 * 2^23 rounds to the nearest integer; its low bits are
        // the quadrant.
        const ROUND: f32 = 12_582_912.0;
        let shifted = (self + offset) * core::f32::consts::FRAC_2_PI + ROUND;
        let quarter = shifted.to_bits();
        let k = shifted - ROUND;
        // pi/2 in two parts, the first with few enough bits for k times it to be exact. The
        // offset comes in between, where the angle is small already.
        let r = ((self - k * 1.570_312_5) + offset) - k * 4.838_268e-4;
        let z = r * r;
        // Minimax on |r| <= pi/4, Cephes' single precision coefficients (Moshier 1989).
        let sine = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * r + r;
        let cosine =
            (((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z - 0.5) * z + 1.0;
        quarter_turns!(sine, cosine, quarter)
    }

    fn arctangent2(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }

    fn exponential(self) -> Self {
        libm::expf(self)
    }

    #[inline]
    fn root(self) -> Self {
        libm::sqrtf(self)
    }

    #[inline]
    fn finite(self) -> bool {
        self.is_finite()
    }

    #[inline]
    fn split(self) -> (i32, Self) {
        split!(self, Self)
    }

    #[inline]
    fn count(x: i16) -> Self {
        Self::from(x)
    }
}

impl Scalar for f64 {
    const EPSILON: Self = f64::EPSILON;

    #[inline]
    fn of(x: f64) -> Self {
        x
    }

    #[inline]
    fn widen(self) -> f64 {
        self
    }

    #[inline]
    fn sincos(self) -> (Self, Self) {
        self.sincos_beside(0.0)
    }

    #[inline]
    fn sincos_beside(self, offset: Self) -> (Self, Self) {
        const ROUND: f64 = 6_755_399_441_055_744.0;
        let shifted = (self + offset) * core::f64::consts::FRAC_2_PI + ROUND;
        let quarter = shifted.to_bits();
        let k = shifted - ROUND;
        // Three parts of 33, 33 and 53 bits of pi/2: exact products for |k| < 2^20.
        let r = (((self - k * f64::from_bits(0x3FF9_21FB_5440_0000)) + offset)
            - k * f64::from_bits(0x3DD0_B461_1A60_0000))
            - k * f64::from_bits(0x3BA3_198A_2E03_7073);
        let z = r * r;
        // Minimax on |r| <= pi/4, degree 13 and 14 (the coefficients of FreeBSD's msun).
        let sine = (((((1.589_690_995_211_55e-10 * z - 2.505_076_025_340_686_3e-8) * z
            + 2.755_731_370_707_006_8e-6)
            * z
            - 1.984_126_982_985_795e-4)
            * z
            + 8.333_333_333_322_49e-3)
            * z
            - 1.666_666_666_666_663_2e-1)
            * z
            * r
            + r;
        let cosine = (((((-1.135_964_755_778_819_5e-11 * z + 2.087_572_321_298_175e-9) * z
            - 2.755_731_435_139_066_3e-7)
            * z
            + 2.480_158_728_947_673e-5)
            * z
            - 1.388_888_888_887_411e-3)
            * z
            + 4.166_666_666_666_66e-2)
            * z
            * z
            - 0.5 * z
            + 1.0;
        quarter_turns!(sine, cosine, quarter)
    }

    fn arctangent2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }

    fn exponential(self) -> Self {
        libm::exp(self)
    }

    #[inline]
    fn root(self) -> Self {
        libm::sqrt(self)
    }

    #[inline]
    fn finite(self) -> bool {
        self.is_finite()
    }

    #[inline]
    fn split(self) -> (i32, Self) {
        split!(self, Self)
    }

    #[inline]
    fn count(x: i16) -> Self {
        Self::from(x)
    }
}
