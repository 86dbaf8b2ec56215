//! Polynomials that are orthonormal on the points taught. MRD 5.4.1.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};
use truepose::taught::MAX_INPUTS;
use truepose::taught::polynomial::exponents;

use super::Lessons;

/// A polynomial that loses all but this share of its length to those before it is not
/// determined by the points.
const DEPENDENT: f64 = 1e-9;

/// A family of multivariate polynomials, orthonormal on a set of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Orthonormal {
    /// Exponents of the powers, in stored order.
    pub exponents: Vec<[u8; MAX_INPUTS]>,
    /// Value of each polynomial (column) at each point (row): the B of MRD 5.178, whose BᵀB
    /// is the identity.
    pub values: DMatrix<f64>,
    /// Coefficient of each power (row) in each polynomial (column).
    pub coefficients: DMatrix<f64>,
}

impl Orthonormal {
    /// By the recursion of MRD 5.183 to 5.189: each polynomial is an earlier one times one of
    /// the variables, less what it shares with all before it.
    ///
    /// ```text
    /// β_j = γ (x_v β_p - sum over i < j of <x_v β_p, β_i> β_i)
    /// ```
    /// over all points from the start, where the book takes one point more for each
    /// polynomial; twice, since once leaves the rounding of the first time. (5.185 lacks a
    /// minus sign, and 5.189 a square: γ² times the sum of squares is 1.)
    ///
    /// `points`: each -1 to 1 in every input. `None` where the points do not determine
    /// polynomials of this degree.
    pub fn on(points: &[Vec<f64>], inputs: usize, degree: u8) -> Option<Self> {
        let exponents: Vec<_> = exponents(inputs, usize::from(degree)).collect();
        let place: HashMap<_, _> = exponents.iter().zip(0..).map(|(&e, k)| (e, k)).collect();
        let count = exponents.len();
        if points.len() < count {
            return None;
        }
        // By increasing degree: example 3.
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&k| exponents[k].iter().map(|&e| u32::from(e)).sum::<u32>());
        let mut values = DMatrix::zeros(points.len(), count);
        let mut coefficients = DMatrix::zeros(count, count);
        let mut column = HashMap::new();
        for (j, &k) in order.iter().enumerate() {
            let (mut value, mut coefficient) = match exponents[k].iter().position(|&e| e > 0) {
                None => {
                    let mut coefficient = DVector::zeros(count);
                    coefficient[k] = 1.0;
                    (DVector::repeat(points.len(), 1.0), coefficient)
                }
                Some(v) => {
                    let mut earlier = exponents[k];
                    earlier[v] -= 1;
                    let parent: usize = *column.get(place.get(&earlier)?)?;
                    let x = DVector::from_iterator(points.len(), points.iter().map(|p| p[v]));
                    let value = values.column(parent).component_mul(&x);
                    let mut coefficient = DVector::zeros(count);
                    for (from, exponents) in exponents.iter().enumerate() {
                        let c: f64 = coefficients[(from, parent)];
                        if c.abs() > 0.0 {
                            let mut higher = *exponents;
                            higher[v] += 1;
                            coefficient[*place.get(&higher)?] = c;
                        }
                    }
                    (value, coefficient)
                }
            };
            let before = value.norm();
            for _ in 0..2 {
                let earlier = values.columns(0, j);
                let shared = earlier.tr_mul(&value);
                value -= earlier * &shared;
                coefficient -= coefficients.columns(0, j) * &shared;
            }
            let norm = value.norm();
            // NaN fails the comparison.
            let independent = norm > DEPENDENT * before;
            if !independent {
                return None;
            }
            values.set_column(j, &(value / norm));
            coefficients.set_column(j, &(coefficient / norm));
            column.insert(k, j);
        }
        Some(Self {
            exponents,
            values,
            coefficients,
        })
    }

    /// Coefficients of the powers of the polynomial that comes nearest to `wanted`, one a
    /// point, in the sense of least squares: MRD 5.181, where BᵀB is the identity.
    pub fn fit(&self, wanted: &DVector<f64>) -> DVector<f64> {
        &self.coefficients * self.values.tr_mul(wanted)
    }
}

/// `q` within `region` as the controller scales it, -1 to 1.
pub fn scaled(q: &[f64], region: &[[f64; 2]]) -> Vec<f64> {
    let one = |(&q, &[low, high]): (&f64, &[f64; 2])| (2.0 * q - low - high) / (high - low);
    q.iter().zip(region).map(one).collect()
}

/// The table of the polynomials up to `degree` that come nearest to what is taught. `Err`: why
/// there is none.
pub(super) fn fit(lessons: &Lessons, degree: u8) -> Result<Vec<u8>, &'static str> {
    let inputs = lessons.region.len();
    let points: Vec<_> = (lessons.q.iter())
        .map(|q| scaled(q, &lessons.region))
        .collect();
    let family = Orthonormal::on(&points, inputs, degree)
        .ok_or("the points do not determine polynomials of this degree")?;
    let outputs = lessons.corrections.first().map_or(0, Vec::len);
    let fits: Vec<_> = (0..outputs)
        .map(|k| {
            let wanted = lessons.corrections.iter().map(|c| c[k]);
            family.fit(&DVector::from_iterator(points.len(), wanted))
        })
        .collect();
    Ok((0..family.exponents.len())
        .flat_map(|term| fits.iter().map(move |fit| fit[term] as f32))
        .flat_map(f32::to_le_bytes)
        .collect())
}
