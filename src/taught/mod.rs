//! Corrections of the joints that were taught: approximations of the joints' own functions, in
//! tables that are read where the blob lies. MRD 5.4.
//!
//! They know nothing of what they approximate. What makes them safe to send, a test of each
//! answer against the model, is in [`crate::compensate`].

pub mod cmac;
pub mod polynomial;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::{Method, Scalar};
pub use cmac::Cmac;
pub use polynomial::Polynomial;

/// Joints that an approximation can depend on.
pub const MAX_INPUTS: usize = 12;

/// Joints that an approximation can correct.
pub const MAX_OUTPUTS: usize = 12;

/// One value an output, and zeros.
pub(crate) type Outputs<T> = [T; MAX_OUTPUTS];

/// What a blob can carry besides the model. `'a`: the blob.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Taught<'a, T: Scalar> {
    /// MRD 5.4.1.
    #[serde(borrow)]
    pub polynomial: Option<Polynomial<'a, T>>,
    /// MRD 5.4.2.
    #[serde(borrow)]
    pub cmac: Option<Cmac<'a, T>>,
}

/// The box of joint values that an approximation was taught on: lowest and highest of each
/// input, rad or m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region<T: Scalar>(pub Vec<[T; 2], MAX_INPUTS>);

/// Where a command lies in a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place<T> {
    /// Each input from -1 at the lowest to 1 at the highest, moved onto the nearest of them
    /// from beyond.
    pub x: [T; MAX_INPUTS],
    /// How much of the correction counts: 1 inside, falling to 0 over [`MARGIN`] of half the
    /// region's width outside, continuously.
    pub share: T,
}

/// Share of half a region's width over which corrections fade out beyond it.
pub const MARGIN: f64 = 0.1;

impl<T: Scalar> Default for Taught<'_, T> {
    fn default() -> Self {
        Self {
            polynomial: None,
            cmac: None,
        }
    }
}

impl<'a, T: Scalar> Taught<'a, T> {
    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.polynomial.is_none() && self.cmac.is_none()
    }

    /// Whether `method` finds what it needs.
    pub fn has(&self, method: Method) -> bool {
        suffices(method, self.polynomial.is_some(), self.cmac.is_some())
    }

    /// The same in another number type, rounded once; the tables stay where they are.
    pub fn cast<U: Scalar>(&self) -> Taught<'a, U> {
        Taught {
            polynomial: self.polynomial.as_ref().map(Polynomial::cast),
            cmac: self.cmac.as_ref().map(Cmac::cast),
        }
    }
}

/// Whether `method` finds what it needs where there are polynomials or a CMAC, or neither.
pub(crate) fn suffices(method: Method, polynomial: bool, cmac: bool) -> bool {
    match method {
        Method::InverseJacobian | Method::Lqr | Method::TaskPoint => true,
        Method::Polynomial => polynomial,
        Method::Cmac => cmac,
    }
}

/// A list of what there is room for. The list's own `collect` would panic on more.
fn listed<V, const K: usize>(items: impl Iterator<Item = V>) -> Vec<V, K> {
    let mut list = Vec::new();
    for item in items.take(K) {
        if list.push(item).is_err() {
            break;
        }
    }
    list
}

impl<T: Scalar> Region<T> {
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.0.len()
    }

    /// Where the inputs `q` (rad or m) lie; `None` where nothing counts, which NaN does not
    /// either.
    pub fn place(&self, q: &[T]) -> Option<Place<T>> {
        T::place(self, q)
    }

    /// Each input has a width, and there are as many as expected.
    fn is_sound(&self, inputs: usize) -> bool {
        let wide = |&[low, high]: &[T; 2]| high - low >= T::of(1e-6);
        self.0.len() == inputs && self.0.iter().all(wide)
    }

    fn cast<U: Scalar>(&self) -> Region<U> {
        let one = |range: &[T; 2]| range.map(|x| U::of(x.widen()));
        Region(listed(self.0.iter().map(one)))
    }
}

/// [`Region::place`].
pub(crate) fn place<T: Scalar>(region: &Region<T>, q: &[T]) -> Option<Place<T>> {
    let mut place = Place {
        x: [T::zero(); MAX_INPUTS],
        share: T::one(),
    };
    for ((x, &q), &[low, high]) in place.x.iter_mut().zip(q).zip(&region.0) {
        let y = (q + q - low - high) / (high - low);
        let beyond = y.abs() - T::one();
        if beyond > T::zero() {
            let share = T::one() - beyond / T::of(MARGIN);
            if share < place.share {
                place.share = share;
            }
            *x = if y > T::zero() { T::one() } else { -T::one() };
        } else {
            *x = y;
        }
        if !y.finite() {
            return None;
        }
    }
    (place.share > T::zero()).then_some(place)
}
