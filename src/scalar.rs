//! The number type: `f32` on the controller, `f64` on the host.

use nalgebra::RealField;

use crate::aside::Aside;
use crate::effects::LookUp;
use crate::params::Load;

/// A real number that the whole model is written in, implemented for `f32` and `f64`.
///
/// Everything here uses additions, multiplications, divisions and exactly rounded square
/// roots in a fixed order and never a fused multiply-add, so host and target agree in every
/// bit for the same type.
pub trait Scalar: RealField + Copy + Aside + Load + LookUp {
    /// Distance from 1 to the next number above it.
    const EPSILON: Self;

    /// Largest turn of [`Scalar::turned_a_little`], rad.
    const LITTLE: Self;

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

    /// Sine and cosine of an angle after a turn by `by` rad, from those before it: error as of
    /// [`Scalar::sincos`], on top of theirs.
    #[inline]
    fn turned(sine: Self, cosine: Self, by: Self) -> (Self, Self) {
        let (s, c) = by.sincos();
        (sine * c + cosine * s, cosine * c - sine * s)
    }

    /// [`Scalar::turned`] by not more than [`Scalar::LITTLE`] either way.
    #[inline]
    fn turned_a_little(sine: Self, cosine: Self, by: Self) -> (Self, Self) {
        Self::turned(sine, cosine, by)
    }

    /// [`Scalar::turned`] by 0.12 rad at most.
    #[inline]
    fn turned_by_step(sine: Self, cosine: Self, by: Self) -> (Self, Self) {
        Self::turned(sine, cosine, by)
    }

    /// Angle of the point (`x`, `self`) in (-pi, pi], rad, the same bits on every core.
    fn arctangent2(self, x: Self) -> Self;

    /// Angle in (-pi, pi], rad, whose sine and cosine these are: [`Scalar::arctangent2`] where
    /// the squares of both add up to one, in fewer bytes.
    fn angle(sine: Self, cosine: Self) -> Self;

    /// `e^x`, the same bits on every core.
    fn exponential(self) -> Self;

    /// Square root, exactly rounded, NaN below zero.
    fn root(self) -> Self;

    /// Square root of a finite number from zero up, in a few multiplications: relative error
    /// below 5e-6 (`f32`), exact (`f64`).
    fn rough_root(self) -> Self;

    /// False for NaN and infinities.
    fn finite(self) -> bool;

    /// Largest integer not above `self`, and what is left, in [0, 1]. Both 0 for NaN; beyond
    /// the integers' range the nearest of them and a rest of 0 or 1.
    fn split(self) -> (i32, Self);

    /// Largest integer not above `self`, exact.
    fn whole(self) -> Self;

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

/// Places of [`TABLE`] in a turn.
const STEPS: u32 = 128;

/// Sines and cosines of the whole multiples of pi/64 over a turn, each rounded once.
static TABLE: [[f32; 2]; STEPS as usize] = table();

/// Taylor's series, to the last bit of `f64` up to pi/2, turned by quarters.
const fn table() -> [[f32; 2]; STEPS as usize] {
    let mut table = [[0.0; 2]; STEPS as usize];
    let mut place = 0;
    while place < table.len() {
        let angle = (place % 32) as f64 * (core::f64::consts::PI / 64.0);
        let (mut sine, mut cosine, mut term, mut n) = (0.0, 0.0, 1.0, 0);
        while n < 24 {
            match n % 4 {
                0 => cosine += term,
                1 => sine += term,
                2 => cosine -= term,
                _ => sine -= term,
            }
            n += 1;
            term *= angle / n as f64;
        }
        table[place] = match place / 32 {
            0 => [sine as f32, cosine as f32],
            1 => [cosine as f32, -sine as f32],
            2 => [-sine as f32, -cosine as f32],
            _ => [-cosine as f32, sine as f32],
        };
        place += 1;
    }
    table
}

impl Scalar for f32 {
    const EPSILON: Self = f32::EPSILON;
    const LITTLE: Self = 3e-3;

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
        // the place in the table.
        const ROUND: f32 = 12_582_912.0;
        let shifted = (self + offset) * 20.371_833 + ROUND;
        let [sine, cosine] = TABLE[(shifted.to_bits() % STEPS) as usize];
        let k = shifted - ROUND;
        // pi/64 in two parts, the first with few enough bits for k times it to be exact. The
        // offset comes in between, where the angle is small already.
        let r = ((self - k * 4.908_752_4e-2) + offset) - k * -1.392_017_2e-7;
        // What is left is below pi/128: the next term of the series is below 1e-10, and what the
        // versine lacks, minimax, below 3e-9.
        let z = r * r;
        let s = r + r * (z * (-1.0 / 6.0));
        let versine = z * -0.499_979_2;
        (
            (sine * versine + cosine * s) + sine,
            (cosine * versine - sine * s) + cosine,
        )
    }

    #[inline]
    fn turned(sine: Self, cosine: Self, by: Self) -> (Self, Self) {
        if by.abs() > 0.02 {
            let (s, c) = by.sincos();
            return (sine * c + cosine * s, cosine * c - sine * s);
        }
        // The next terms of the series are below 7e-9.
        let versine = by * by * 0.5;
        let s = by - by * versine * (1.0 / 3.0);
        (
            (cosine * s - sine * versine) + sine,
            cosine - (sine * s + cosine * versine),
        )
    }

    #[inline(always)]
    fn turned_a_little(sine: Self, cosine: Self, by: Self) -> (Self, Self) {
        // The next term of the series is below 5e-9.
        let half = by * 0.5;
        (
            sine + (cosine - sine * half) * by,
            cosine - (sine + cosine * half) * by,
        )
    }

    #[inline]
    fn turned_by_step(sine: Self, cosine: Self, by: Self) -> (Self, Self) {
        // Three shears, by the tangent of half the angle and by its sine, both minimax: 1e-8, 3e-8.
        let cube = by * by * by;
        let tangent = by * 0.5 + cube * 0.041_719;
        let s = by - cube * 0.166_562;
        let cosine = cosine - sine * tangent;
        let sine = sine + cosine * s;
        (sine, cosine - sine * tangent)
    }

    #[inline(never)]
    fn arctangent2(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }

    #[inline]
    fn angle(sine: Self, cosine: Self) -> Self {
        sine.arctangent2(cosine)
    }

    fn exponential(self) -> Self {
        libm::expf(self)
    }

    /// In integers what the library's has a table for: a rough root is at most a few units of its
    /// last place off, and what its square lacks says how many.
    #[inline(never)]
    fn root(self) -> Self {
        const UNIT: u32 = 1 << 23;
        const SMALL: f32 = 16_777_216.0;
        if !(self > 0.0 && self < Self::INFINITY) {
            return if self < 0.0 { Self::NAN } else { self };
        }
        // Below the normal numbers 2^24 times as large, and the root 2^12 times.
        let tiny = self < Self::MIN_POSITIVE;
        let bits = if tiny { self * SMALL } else { self }.to_bits();
        // The exponent halved, and a number in [1, 4) with its root's exponent taken out.
        let odd = !(bits >> 23) & 1;
        let halved = ((bits >> 23) + 127 - odd) / 2;
        let mantissa = bits % UNIT + UNIT;
        let x = Self::from_bits(((127 + odd) << 23) | (bits % UNIT));
        let half = x * 0.5;
        let y = Self::from_bits(0x5F37_59DF - (x.to_bits() >> 1));
        let y = y * (1.5 - half * y * y);
        let y = y * (1.5 - half * y * y);
        let y = y * (1.5 - half * y * y);
        let mut root = (x * y * 8_388_608.0) as u32;
        // Both squares are of 46 to 48 bits; their difference is a few times as large as the root.
        let lacks =
            |root: u32| (mantissa << (23 + odd)).wrapping_sub(root.wrapping_mul(root)) as i32;
        while lacks(root) > root as i32 {
            root += 1;
        }
        while lacks(root) <= -(root as i32) {
            root -= 1;
        }
        let root = Self::from_bits((halved << 23) + (root - UNIT));
        if tiny { root * (1.0 / 4096.0) } else { root }
    }

    #[inline]
    fn rough_root(self) -> Self {
        // A reciprocal root to 3 % by halving the exponent, two of Newton's steps.
        let half = self * 0.5;
        let y = Self::from_bits(0x5F37_59DF - (self.to_bits() >> 1));
        let y = y * (1.5 - half * y * y);
        let y = y * (1.5 - half * y * y);
        self * y
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
    fn whole(self) -> Self {
        // From here on all are.
        if self.abs() < 8_388_608.0 {
            self.split().0 as Self
        } else {
            self
        }
    }

    #[inline]
    fn count(x: i16) -> Self {
        Self::from(x)
    }
}

impl Scalar for f64 {
    const EPSILON: Self = f64::EPSILON;
    const LITTLE: Self = f64::MAX;

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
        // Of z^6, z^5, .. in sine / r and cosine: minimax on |r| <= pi/4, degree 13 and 14 (the
        // coefficients of FreeBSD's msun).
        const SERIES: [[f64; 2]; 6] = [
            [1.589_690_995_211_55e-10, -1.135_964_755_778_819_5e-11],
            [-2.505_076_025_340_686_3e-8, 2.087_572_321_298_175e-9],
            [2.755_731_370_707_006_8e-6, -2.755_731_435_139_066_3e-7],
            [-1.984_126_982_985_795e-4, 2.480_158_728_947_673e-5],
            [8.333_333_333_322_49e-3, -1.388_888_888_887_411e-3],
            [-1.666_666_666_666_663_2e-1, 4.166_666_666_666_66e-2],
        ];
        let [mut sine, mut cosine] = [0.0; 2];
        for &[of_sine, of_cosine] in &SERIES {
            sine = sine * z + of_sine;
            cosine = cosine * z + of_cosine;
        }
        let sine = sine * z * r + r;
        let cosine = cosine * z * z - 0.5 * z + 1.0;
        // With a table there is nothing to decide, and the products with 0 and +-1 are exact.
        const TURNS: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]];
        let [s, c] = TURNS[(quarter & 3) as usize].map(Self::from);
        (sine * c + cosine * s, cosine * c - sine * s)
    }

    #[inline(never)]
    fn arctangent2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }

    #[inline(never)]
    fn angle(sine: Self, cosine: Self) -> Self {
        // The rest is below 3e-7, its sine the same to the last bit.
        let rough = Self::from((sine as f32).arctangent2(cosine as f32));
        let (s, c) = rough.sincos();
        rough + (sine * c - cosine * s)
    }

    fn exponential(self) -> Self {
        libm::exp(self)
    }

    #[inline]
    fn root(self) -> Self {
        libm::sqrt(self)
    }

    #[inline]
    fn rough_root(self) -> Self {
        self.root()
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
    fn whole(self) -> Self {
        libm::floor(self)
    }

    #[inline]
    fn count(x: i16) -> Self {
        Self::from(x)
    }
}
