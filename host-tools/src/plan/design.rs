//! A set of chosen blocks of rows, and what adding or removing one does to it.

use nalgebra::DMatrix;

/// Blocks of Jacobian rows, one a pose, all of the same height, row after row.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    /// Parameters.
    pub(crate) width: usize,
    /// Rows a pose.
    pub(crate) height: usize,
    /// `height * width` numbers a pose.
    pub(crate) numbers: Vec<f64>,
}

impl Blocks {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            numbers: Vec::new(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.numbers.len() / (self.width * self.height).max(1)
    }

    pub(crate) fn get(&self, i: usize) -> &[f64] {
        let size = self.width * self.height;
        self.numbers.get(i * size..(i + 1) * size).unwrap_or(&[])
    }

    pub(crate) fn set(&mut self, i: usize, block: &[f64]) {
        let size = self.width * self.height;
        if let Some(old) = self.numbers.get_mut(i * size..(i + 1) * size) {
            old.copy_from_slice(block);
        }
    }

    pub(crate) fn push(&mut self, block: &[f64]) {
        self.numbers.extend_from_slice(block);
    }

    /// Adds the normal matrix of one block to `information`.
    pub(crate) fn inform(&self, i: usize, information: &mut DMatrix<f64>) {
        for row in self.get(i).chunks(self.width) {
            for (a, x) in row.iter().enumerate() {
                for (b, y) in row.iter().enumerate() {
                    information[(a, b)] += x * y;
                }
            }
        }
    }
}

/// Covariance of the scaled parameters, kept up to date block by block.
#[derive(Clone, Debug)]
pub(crate) struct Covariance {
    width: usize,
    /// Row-major, symmetric.
    matrix: Vec<f64>,
    pub(crate) log_det_information: f64,
}

/// A change of covariance: `M' = M - sign U Uᵀ`, columns of U one after the other.
pub(crate) struct Update {
    pub(crate) columns: Vec<Vec<f64>>,
    /// +1 where a block is added, -1 where it is removed.
    pub(crate) sign: f64,
}

impl Covariance {
    /// Inverse of `information`; `None` where that is singular.
    pub(crate) fn of(information: DMatrix<f64>) -> Option<Self> {
        let width = information.nrows();
        let factor = information.cholesky()?;
        let log_det = 2.0
            * factor
                .l_dirty()
                .diagonal()
                .iter()
                .map(|x| x.ln())
                .sum::<f64>();
        let inverse = factor.inverse();
        (log_det.is_finite() && inverse.iter().all(|x| x.is_finite())).then(|| Self {
            width,
            matrix: inverse.as_slice().to_vec(),
            log_det_information: log_det,
        })
    }

    /// `M bᵀ` for every row b of a block.
    pub(crate) fn times(&self, block: &[f64]) -> Vec<Vec<f64>> {
        block
            .chunks(self.width)
            .map(|row| {
                self.matrix
                    .chunks(self.width)
                    .map(|m| dot(m, row))
                    .collect()
            })
            .collect()
    }

    /// Covariance `B M Bᵀ` of what a block predicts, row-major.
    pub(crate) fn spread(&self, block: &[f64]) -> Vec<f64> {
        let carried = self.times(block);
        let rows = || block.chunks(self.width);
        rows()
            .flat_map(|row| carried.iter().map(move |c| dot(row, c)))
            .collect()
    }

    /// Trace of [`Self::spread`].
    pub(crate) fn variance(&self, block: &[f64]) -> f64 {
        let rows = block.chunks(self.width);
        rows.zip(self.times(block))
            .map(|(row, c)| dot(row, &c))
            .sum()
    }

    /// Trace of the product with another symmetric matrix.
    pub(crate) fn trace_with(&self, other: &DMatrix<f64>) -> f64 {
        dot(&self.matrix, other.as_slice())
    }

    /// What adding (`sign` = 1) or removing (-1) a block changes; `None` where the rest would
    /// be singular.
    pub(crate) fn update(&self, block: &[f64], sign: f64) -> Option<(Update, f64)> {
        let height = block.len() / self.width;
        let mut columns = self.times(block);
        let mut inner = vec![0.0; height * height];
        for (a, row) in block.chunks(self.width).enumerate() {
            for (b, column) in columns.iter().enumerate() {
                inner[a * height + b] = sign * dot(row, column) + f64::from(u8::from(a == b));
            }
        }
        let log_det = factor(&mut inner, height)?;
        // U = M Bᵀ L⁻ᵀ with the inner matrix L Lᵀ, column by column.
        for a in 0..height {
            let (done, rest) = columns.split_at_mut(a);
            let Some(column) = rest.first_mut() else {
                break;
            };
            for (b, earlier) in done.iter().enumerate() {
                let l = inner[a * height + b];
                column
                    .iter_mut()
                    .zip(earlier)
                    .for_each(|(x, y)| *x -= l * y);
            }
            let pivot = inner[a * height + a];
            column.iter_mut().for_each(|x| *x /= pivot);
        }
        Some((Update { columns, sign }, log_det))
    }

    pub(crate) fn apply(&mut self, update: &Update, log_det: f64) {
        for u in &update.columns {
            for (row, x) in self.matrix.chunks_mut(self.width).zip(u) {
                let factor = update.sign * x;
                row.iter_mut().zip(u).for_each(|(m, y)| *m -= factor * y);
            }
        }
        self.log_det_information += log_det;
    }
}

impl Update {
    /// What it takes from (negative: adds to) the variance that a block predicts.
    pub(crate) fn of_variance(&self, block: &[f64], width: usize) -> f64 {
        let mut sum = 0.0;
        for row in block.chunks(width) {
            for u in &self.columns {
                let x = dot(row, u);
                sum += x * x;
            }
        }
        self.sign * sum
    }

    /// The same for the whole covariance of a block, subtracted from `spread`.
    pub(crate) fn of_spread(&self, block: &[f64], width: usize, spread: &mut [f64]) {
        let height = block.len() / width;
        let mut seen = vec![0.0; height];
        for u in &self.columns {
            for (x, row) in seen.iter_mut().zip(block.chunks(width)) {
                *x = dot(row, u);
            }
            for (a, x) in seen.iter().enumerate() {
                for (b, y) in seen.iter().enumerate() {
                    spread[a * height + b] -= self.sign * x * y;
                }
            }
        }
    }
}

/// ln det(I + spread): what adding a block of that spread gains.
pub(crate) fn gain(spread: &[f64], height: usize) -> f64 {
    let mut inner = spread.to_vec();
    for a in 0..height {
        inner[a * height + a] += 1.0;
    }
    factor(&mut inner, height).unwrap_or(0.0)
}

/// Cholesky factor in place (lower triangle, row-major); ln of the determinant. `None` where
/// it is not positive definite.
fn factor(matrix: &mut [f64], height: usize) -> Option<f64> {
    let mut log_det = 0.0;
    for a in 0..height {
        for b in 0..=a {
            let mut sum = matrix[a * height + b];
            for k in 0..b {
                sum -= matrix[a * height + k] * matrix[b * height + k];
            }
            if a == b {
                if sum <= 1e-12 {
                    return None;
                }
                log_det += sum.ln();
                matrix[a * height + a] = sum.sqrt();
            } else {
                matrix[a * height + b] = sum / matrix[b * height + b];
            }
        }
    }
    Some(log_det)
}

/// Sum of products, in four strands that the processor can run side by side.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 4];
    let (left, right) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = left
        .remainder()
        .iter()
        .zip(right.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in left.zip(right) {
        for (strand, (x, y)) in strands.iter_mut().zip(x.iter().zip(y)) {
            *strand += x * y;
        }
    }
    strands.iter().sum::<f64>() + rest
}
