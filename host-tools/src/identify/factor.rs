//! Orthogonal factorisation of a tall Jacobian: the last step of a fit, its covariance, and
//! what the data cannot tell apart.

use nalgebra::{DMatrix, DVector};

/// Triangular factor of stacked `[J r]`, built block by block: memory does not grow with
/// the number of rows (Golub and Van Loan, 5.2; Householder QR of `[R; block]`).
#[derive(Clone, Debug)]
pub struct Triangle {
    /// Upper triangle of J, unknowns x unknowns.
    pub r: DMatrix<f64>,
    /// First unknowns of Qᵀ r.
    pub z: DVector<f64>,
    /// Sum of squares of what no step can take away.
    pub remainder: f64,
    augmented: DMatrix<f64>,
}

impl Triangle {
    /// Nothing yet, for `unknowns` columns.
    pub fn new(unknowns: usize) -> Self {
        Self {
            r: DMatrix::zeros(unknowns, unknowns),
            z: DVector::zeros(unknowns),
            remainder: 0.0,
            augmented: DMatrix::zeros(0, unknowns + 1),
        }
    }

    /// Takes a block of rows in.
    pub fn push(&mut self, jacobian: &DMatrix<f64>, residual: &DVector<f64>) {
        let n = self.z.len();
        let (old, new) = (self.augmented.nrows(), jacobian.nrows());
        let mut stacked = DMatrix::zeros(old + new, n + 1);
        stacked
            .view_mut((0, 0), (old, n + 1))
            .copy_from(&self.augmented);
        stacked.view_mut((old, 0), (new, n)).copy_from(jacobian);
        stacked.view_mut((old, n), (new, 1)).copy_from(residual);
        self.augmented = if stacked.nrows() > n + 1 {
            stacked.qr().unpack_r()
        } else {
            stacked
        };
        if self.augmented.nrows() >= n {
            let square = if self.augmented.nrows() > n + 1 || new == 0 {
                self.augmented.clone()
            } else {
                self.augmented.clone().qr().unpack_r()
            };
            self.r = square.view((0, 0), (n, n)).upper_triangle();
            self.z = square.view((0, n), (n, 1)).column(0).into_owned();
            self.remainder = if square.nrows() > n {
                square[(n, n)] * square[(n, n)]
            } else {
                0.0
            };
        }
    }

    /// Least-squares step; `None` where a diagonal entry is zero.
    pub fn step(&self) -> Option<DVector<f64>> {
        self.r.solve_upper_triangular(&self.z)
    }

    /// (JᵀJ)⁻¹, by the triangle's inverse.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let n = self.z.len();
        let inverse = self.r.solve_upper_triangular(&DMatrix::identity(n, n))?;
        Some(&inverse * inverse.transpose())
    }
}

/// Why a column is not fitted.
#[derive(Clone, Debug, PartialEq)]
pub enum Dropped {
    /// Not even a large change shows in the data.
    Invisible,
    /// A combination of the kept columns (index, weight), largest weight first.
    Dependent(Vec<(usize, f64)>),
}

/// Columns in order of priority, sorted into those that the data can tell apart and those
/// that they cannot.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Indices of fitted columns, ascending.
    pub kept: Vec<usize>,
    /// Index and reason of the others.
    pub dropped: Vec<(usize, Dropped)>,
}

/// Goes through the columns in order; a column whose part orthogonal to those kept so far is
/// shorter than `visible`, or than `relative` times itself, is dropped. Gram-Schmidt with
/// reorthogonalisation, so orthogonal to rounding.
pub fn select(jacobian: &DMatrix<f64>, visible: f64, relative: f64) -> Selection {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let mut triangle: Vec<Vec<f64>> = Vec::new();
    let mut selection = Selection::default();
    for k in 0..jacobian.ncols() {
        let mut column = jacobian.column(k).into_owned();
        let length = column.norm();
        if length <= visible {
            selection.dropped.push((k, Dropped::Invisible));
            continue;
        }
        let mut coefficients = vec![0.0; basis.len()];
        for _ in 0..2 {
            for (c, q) in coefficients.iter_mut().zip(&basis) {
                let along = q.dot(&column);
                column.axpy(-along, q, 1.0);
                *c += along;
            }
        }
        let rest = column.norm();
        if rest <= visible || rest <= relative * length {
            // back substitution: the column as a combination of the kept ones
            let mut weights = coefficients;
            for i in (0..weights.len()).rev() {
                let mut w = weights[i];
                for j in i + 1..weights.len() {
                    w -= triangle[j][i] * weights[j];
                }
                weights[i] = w / triangle[i][i];
            }
            let mut combination: Vec<(usize, f64)> = selection
                .kept
                .iter()
                .copied()
                .zip(weights)
                .filter(|(_, w)| w.abs() > 1e-6)
                .collect();
            combination.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            selection.dropped.push((k, Dropped::Dependent(combination)));
        } else {
            coefficients.push(rest);
            triangle.push(coefficients);
            basis.push(column / rest);
            selection.kept.push(k);
        }
    }
    selection
}
