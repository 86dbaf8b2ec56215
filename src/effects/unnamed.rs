//! What has structure but no name.

use serde::{Deserialize, Serialize};

use super::{
    Ambient, Description, Displacement, EffectModel, Place, Posture, Reading, Selector, Stage,
    entry,
};
use crate::Scalar;

/// One unnamed term: a product of two functions of one variable each, on a joint's reading or
/// on the base. MRD 5.4.1.
///
/// Each function lives on the range that its variable had in the fit and fades to zero within
/// [`FADE`] of half that range beyond it, smoothly; zero where the variable is not known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unnamed<T: Scalar> {
    /// What it moves.
    pub place: Place<T>,
    /// The two functions.
    pub factors: [Factor; 2],
    /// rad or m.
    pub amplitude: [T; 1],
    /// For either function: order or threshold, then the range of its variable. In the order
    /// of [`EffectModel::constant_names`].
    pub limits: [T; 6],
}

/// Share of half the range over which a function fades out beyond it.
pub const FADE: f64 = 0.2;

/// Share of half the range over which a sign goes from 0 to 1, so that the term is
/// continuous.
pub const RAMP: f64 = 0.02;

/// A function of one variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Factor {
    /// Of what.
    pub variable: Variable,
    /// Which function.
    pub shape: Shape,
}

/// What a function may depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Variable {
    /// Reading of a joint, from 0, rad or m.
    Joint(u8),
    /// Direction of a joint's last move, from 0.
    Direction(u8),
    /// s.
    Time,
    /// Of a sensor, from 0, degC.
    Temperature(u8),
    /// kg.
    Payload,
}

/// A function of `x`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shape {
    /// 1, everywhere.
    One,
    /// `sin(order x)`.
    Sine,
    /// `cos(order x)`.
    Cosine,
    /// -1 below the threshold, 1 above, linear within [`RAMP`] of it.
    Sign,
    /// Legendre polynomial of this degree, the range scaled to -1 to 1.
    Polynomial(u8),
}

/// The function that is 1 everywhere.
pub const ONE: Factor = Factor {
    variable: Variable::Time,
    shape: Shape::One,
};

impl<T: Scalar> Unnamed<T> {
    /// The product of `factors`, amplitude zero. `limits`: for either of them order (sine,
    /// cosine) or threshold (sign), lowest and highest value of its variable in the fit.
    pub fn new(place: Place<T>, factors: [Factor; 2], limits: [[T; 3]; 2]) -> Self {
        let [[a, b, c], [d, e, f]] = limits;
        Self {
            place,
            factors,
            amplitude: [T::zero()],
            limits: [a, b, c, d, e, f],
        }
    }

    pub(super) fn cast<U: Scalar>(&self) -> Unnamed<U> {
        Unnamed {
            place: self.place.cast(),
            factors: self.factors,
            amplitude: self.amplitude.map(|x| U::of(x.widen())),
            limits: self.limits.map(|x| U::of(x.widen())),
        }
    }
}

/// The product of a term's functions.
pub(crate) fn product<T: Scalar>(
    term: &Unnamed<T>,
    q: &[T],
    direction: &[T],
    ambient: &Ambient<T>,
) -> T {
    let [a, b, c, d, e, f] = term.limits;
    let mut product = T::one();
    for (factor, limits) in term.factors.iter().zip([[a, b, c], [d, e, f]]) {
        let x = match factor.variable {
            Variable::Joint(j) => entry(q, usize::from(j)),
            Variable::Direction(j) => entry(direction, usize::from(j)),
            Variable::Time => ambient.time,
            Variable::Temperature(sensor) => entry(&ambient.temperature, usize::from(sensor)),
            Variable::Payload => ambient.payload,
        };
        product *= factor.shape.at(x, limits);
    }
    product
}

impl Shape {
    /// Value at `x`, faded out beyond the range.
    fn at<T: Scalar>(self, x: T, [parameter, low, high]: [T; 3]) -> T {
        let (o, i) = (T::zero(), T::one());
        if self == Self::One {
            return i;
        }
        let half = (high - low) * T::of(0.5);
        if !x.finite() || half <= o {
            return o;
        }
        let u = (x - low) / half - i;
        let beyond = (u.abs() - i) * T::of(1.0 / FADE);
        if beyond >= i {
            return o;
        }
        let value = match self {
            Self::One => i,
            Self::Sine | Self::Cosine => {
                let (sine, cosine) = (parameter * x).sincos();
                if self == Self::Sine { sine } else { cosine }
            }
            Self::Sign => ((x - parameter) / (half * T::of(RAMP))).max(-i).min(i),
            Self::Polynomial(degree) => legendre(degree, u.max(-i).min(i)),
        };
        if beyond <= o {
            return value;
        }
        // Third-order step from 1 to 0, flat at both ends.
        let rest = i - beyond;
        value * rest * rest * (T::of(3.0) - rest - rest)
    }
}

/// Legendre polynomial by Bonnet's recursion, `(n + 1) P(n+1) = (2n + 1) u P(n) - n P(n-1)`.
fn legendre<T: Scalar>(degree: u8, u: T) -> T {
    let (mut before, mut value) = (T::zero(), T::one());
    for n in 0..i16::from(degree) {
        let n = T::count(n);
        let next = ((n + n + T::one()) * u * value - n * before) / (n + T::one());
        before = value;
        value = next;
    }
    value
}

impl<T: Scalar> EffectModel<T> for Unnamed<T> {
    fn kind(&self) -> &'static str {
        "unnamed"
    }

    fn joint(&self) -> Option<usize> {
        self.place.joint()
    }

    /// Not enough to find it again: [`super::Effect::named`] knows no unnamed terms.
    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            component: self.place.axis(),
            ..Selector::default()
        }
    }

    fn parameters(&self) -> &'static [(&'static str, &'static str)] {
        &[("amplitude", "rad")]
    }

    fn values(&self) -> &[T] {
        &self.amplitude
    }

    fn values_mut(&mut self) -> &mut [T] {
        &mut self.amplitude
    }

    fn constant_names(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("first", "1"),
            ("first low", "rad"),
            ("first high", "rad"),
            ("second", "1"),
            ("second low", "rad"),
            ("second high", "rad"),
        ]
    }

    fn constants(&self) -> &[T] {
        &self.limits
    }

    fn constants_mut(&mut self) -> &mut [T] {
        &mut self.limits
    }

    fn attach(&mut self, to: &Description<'_>) {
        self.place.attach(to);
    }

    fn fixed_mut(&mut self) -> &mut [T] {
        self.place.fixed_mut()
    }

    fn stage(&self) -> Stage {
        self.place.stage()
    }

    #[inline]
    fn reading_partial(&self, _k: usize, at: &Reading<'_, T>) -> T {
        T::product(self, at.q, at.direction, at.ambient)
    }

    #[inline]
    fn posture_partial(&self, _k: usize, at: &Posture<'_, T>) -> Displacement<T> {
        let factor = T::product(self, at.q, at.direction, at.ambient);
        self.place.displaced(at, factor)
    }
}
