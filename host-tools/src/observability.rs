//! How well a set of poses shows the parameters: observability indices, condition numbers and
//! the alphabet of optimal design, all from the singular values of one Jacobian.
//!
//! The indices compare sets of poses; they are numbers to rank by, not errors. They mean
//! something only after task scaling (rows over the instrument's sigma) and column scaling
//! (columns times an expected deviation, or to unit length); only O1 ranks the same whatever
//! the column scaling (SH 44).

use nalgebra::DMatrix;

/// Observability of one identification Jacobian of full column rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Observability {
    /// Singular values, largest first.
    pub singular_values: Vec<f64>,
    /// Number of poses that the rows come from.
    pub poses: usize,
}

/// Why there is no index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unobservable {
    /// Some combination of parameters does not show: rank found, parameters.
    RankDeficient(usize, usize),
    /// An entry is NaN or infinite, or there is nothing at all.
    NotANumber,
}

impl Observability {
    /// Of a whitened, column-scaled Jacobian, equations x parameters, taken at `poses` poses.
    /// Singular values below `epsilon` times the largest times the larger dimension are zero.
    pub fn of(jacobian: &DMatrix<f64>, poses: usize) -> Result<Self, Unobservable> {
        let parameters = jacobian.ncols();
        if parameters == 0 || poses == 0 || jacobian.iter().any(|x| !x.is_finite()) {
            return Err(Unobservable::NotANumber);
        }
        // The triangular factor has the same singular values and is small.
        let small = match jacobian.nrows() > parameters {
            true => jacobian.clone().qr().unpack_r(),
            false => jacobian.clone(),
        };
        let mut values: Vec<f64> = small.singular_values().iter().copied().collect();
        values.sort_by(|a, b| b.total_cmp(a));
        let largest = values.first().copied().unwrap_or(0.0);
        let size = jacobian.nrows().max(parameters) as f64;
        let rank = values
            .iter()
            .filter(|s| **s > f64::EPSILON * size * largest)
            .count();
        if rank < parameters {
            return Err(Unobservable::RankDeficient(rank, parameters));
        }
        Ok(Self {
            singular_values: values,
            poses,
        })
    }

    fn largest(&self) -> f64 {
        self.singular_values.first().copied().unwrap_or(0.0)
    }

    fn smallest(&self) -> f64 {
        self.singular_values.last().copied().unwrap_or(0.0)
    }

    /// Geometric mean of the singular values. SH 34.
    pub fn geometric_mean(&self) -> f64 {
        let logs: f64 = self.singular_values.iter().map(|s| s.ln()).sum();
        (logs / self.singular_values.len() as f64).exp()
    }

    /// O1: geometric mean of the singular values over the square root of the number of poses.
    /// NH 5; SH 6 prints the number of parameters under the root, SH 34 leaves it out.
    pub fn o1(&self) -> f64 {
        self.geometric_mean() / (self.poses as f64).sqrt()
    }

    /// O2: smallest over largest singular value, the inverse of [`Self::cond_j`]. NH 9.
    pub fn o2(&self) -> f64 {
        self.smallest() / self.largest()
    }

    /// O3: smallest singular value. NH 12.
    pub fn o3(&self) -> f64 {
        self.smallest()
    }

    /// O4, the noise amplification index: smallest singular value squared over the largest.
    /// NH 16, SH 9; SH 37 misses the square.
    pub fn o4(&self) -> f64 {
        self.smallest() * self.o2()
    }

    /// O5: 1 over the sum of the inverse singular values. SH 38. It is their harmonic mean over
    /// their number; the chain of inequalities SH 40 holds for the harmonic mean alone.
    pub fn o5(&self) -> f64 {
        1.0 / self.singular_values.iter().map(|s| 1.0 / s).sum::<f64>()
    }

    /// Condition number of the Jacobian, as in NH and SH.
    pub fn cond_j(&self) -> f64 {
        self.largest() / self.smallest()
    }

    /// Condition number of the normal matrix, its square, as in MRD 4.174.
    pub fn cond_jtj(&self) -> f64 {
        self.cond_j().powi(2)
    }

    /// A-optimality: trace of the covariance of the scaled parameters, to be small. SH III.A
    /// (SH 15 prints the sum without the squares).
    pub fn a(&self) -> f64 {
        self.singular_values.iter().map(|s| (s * s).recip()).sum()
    }

    /// D-optimality: log determinant of the normal matrix, to be large. SH 13.
    pub fn d(&self) -> f64 {
        2.0 * self.singular_values.iter().map(|s| s.ln()).sum::<f64>()
    }

    /// E-optimality: smallest eigenvalue of the normal matrix, to be large. SH 14.
    pub fn e(&self) -> f64 {
        self.smallest().powi(2)
    }
}

/// G-optimality: the largest variance of a predicted quantity, to be small. `jacobian`: as for
/// [`Observability::of`]; `predictions`: rows of the quantities' derivatives by the same scaled
/// parameters, a block of rows a place. Returns the largest trace of a block's covariance over
/// all blocks of `height` rows. SH 19.
pub fn g(
    jacobian: &DMatrix<f64>,
    predictions: &DMatrix<f64>,
    height: usize,
) -> Result<f64, Unobservable> {
    let parameters = jacobian.ncols();
    let triangle = jacobian.clone().qr().unpack_r();
    let deficient = Unobservable::RankDeficient(jacobian.nrows().min(parameters), parameters);
    if triangle.nrows() < parameters || predictions.ncols() != parameters {
        return Err(deficient);
    }
    // Rᵀ y = row: the row's variance is |y|².
    let solved = triangle
        .transpose()
        .solve_lower_triangular(&predictions.transpose());
    let solved = solved.ok_or(deficient)?;
    let variances: Vec<f64> = solved.column_iter().map(|y| y.norm_squared()).collect();
    Ok(variances
        .chunks(height.max(1))
        .map(|block| block.iter().sum())
        .fold(0.0, f64::max))
}

/// Scales every column to unit length (SH 45) and returns the lengths; a zero column stays.
pub fn scale_columns(jacobian: &mut DMatrix<f64>) -> Vec<f64> {
    jacobian
        .column_iter_mut()
        .map(|mut column| {
            let length = column.norm();
            if length > 0.0 {
                column /= length;
            }
            length
        })
        .collect()
}
