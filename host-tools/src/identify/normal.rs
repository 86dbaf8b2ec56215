//! Normal equations of any number of rows, block by block, and the orthogonal factorisation of
//! the same.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::arm::ArmModel;
use super::factor::{Preconditioner, Selection, Triangle, select, select_by_normal};
use super::linearize::{Linear, linearize, residuals_of_block};
use super::observation::{Observation, Sigmas};
use super::prior::Prior;
use super::product::{gradient, gram};
use super::solve::{BLOCK, RELATIVE, VISIBLE, block};
use super::unknown::Unknown;

/// Numbers that the Jacobians of all blocks may have to be kept, 64 MB: those of forty thousand
/// full poses of six joints.
const KEPT: usize = 1 << 23;

/// Does `work` on every one of `blocks`, several by several threads; the results in their order.
fn each<B: Send, R: Send>(blocks: Vec<B>, work: impl Fn(B) -> R + Sync + Send) -> Vec<R> {
    match blocks.len() {
        0 | 1 => blocks.into_iter().map(work).collect(),
        _ => blocks.into_par_iter().map(work).collect(),
    }
}

/// The same on the linearisation of every block of the observations.
fn each_linear<R: Send>(
    at: &Linearised<'_>,
    observations: &[&Observation],
    work: impl Fn(Linear) -> R + Sync + Send,
) -> Vec<R> {
    let blocks = observations.chunks(block(observations.len())).collect();
    each(blocks, |block: &[&Observation]| {
        work(linearize(at.arm, at.unknowns, at.scales, block, at.sigmas))
    })
}

/// What is linearised, and where.
#[derive(Clone, Copy)]
pub(super) struct Linearised<'a> {
    pub(super) arm: &'a ArmModel,
    pub(super) unknowns: &'a [Unknown],
    pub(super) scales: &'a [f64],
    pub(super) sigmas: Sigmas,
}

/// Normal equations of all blocks, for the iterations only.
pub(super) struct Normal {
    pub(super) matrix: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
    pub(super) cost: f64,
    /// The blocks themselves; `None` where they are too large to be kept.
    blocks: Option<Vec<Linear>>,
}

impl Normal {
    pub(super) fn new(at: &Linearised<'_>, observations: &[&Observation]) -> Self {
        let n = at.unknowns.len();
        let equations: usize = observations.iter().map(|o| o.equations()).sum();
        let keep = equations * n <= KEPT;
        let sums = each_linear(at, observations, |linear| {
            let matrix = gram(&linear.jacobian);
            let gradient = gradient(&linear.jacobian, &linear.residual);
            let cost = linear.residual.norm_squared();
            (matrix, gradient, cost, keep.then_some(linear))
        });
        let mut all = Self {
            matrix: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            cost: 0.0,
            blocks: keep.then(Vec::new),
        };
        for (matrix, gradient, cost, linear) in sums {
            all.matrix += matrix;
            all.gradient += gradient;
            all.cost += cost;
            if let Some(blocks) = &mut all.blocks {
                blocks.extend(linear);
            }
        }
        all
    }

    /// Gives the blocks' memory back: what needs them linearises anew.
    pub(super) fn forget(&mut self) {
        self.blocks = None;
    }

    /// Cost of another arm's residuals, and their gradient with this Jacobian; `None` where that
    /// was too large to be kept.
    pub(super) fn elsewhere(
        &self,
        arm: &ArmModel,
        observations: &[&Observation],
        sigmas: Sigmas,
    ) -> Option<(f64, DVector<f64>)> {
        let blocks = self.blocks.as_ref()?;
        let rows = observations.chunks(block(observations.len()));
        let both = blocks.iter().zip(rows).collect();
        let sums = each(both, |(linear, rows): (&Linear, &[&Observation])| {
            let residual = residuals_of_block(arm, rows, sigmas);
            let gradient = gradient(&linear.jacobian, &residual);
            (residual.norm_squared(), gradient)
        });
        let none = (0.0, DVector::zeros(self.gradient.len()));
        Some(
            sums.into_iter()
                .fold(none, |sum, x| (sum.0 + x.0, sum.1 + x.1)),
        )
    }

    /// Which columns the observations can tell apart: orthogonal columns decide where the
    /// normal equations cannot.
    pub(super) fn selection(
        &self,
        at: &Linearised<'_>,
        observations: &[&Observation],
    ) -> Selection {
        let equations = observations.iter().map(|o| o.equations()).sum();
        if let Some(decided) = select_by_normal(&self.matrix, equations, VISIBLE, RELATIVE) {
            return decided;
        }
        select(
            &self.triangle(at, observations, Prior::None).r,
            VISIBLE,
            RELATIVE,
        )
    }

    /// The same for some of the unknowns.
    pub(super) fn of(self, kept: &[usize]) -> Self {
        if kept.len() == self.gradient.len() {
            return self;
        }
        Self {
            matrix: self.matrix.select_rows(kept).select_columns(kept),
            gradient: self.gradient.select_rows(kept),
            cost: self.cost,
            blocks: self.blocks.map(|blocks| {
                each(blocks, |linear| Linear {
                    jacobian: linear.jacobian.select_columns(kept),
                    residual: linear.residual,
                })
            }),
        }
    }

    /// Orthogonal factorisation of the same Jacobian, `prior` being what has been added.
    pub(super) fn triangle(
        &self,
        at: &Linearised<'_>,
        observations: &[&Observation],
        prior: Prior<'_>,
    ) -> Triangle {
        let prior = prior.rows(at.arm, at.unknowns, at.scales);
        if let Some(first) = Preconditioner::new(&self.matrix)
            && let Some(triangle) = self.second_round(&first, at, observations, prior.as_ref())
        {
            return triangle;
        }
        let mut triangle = Triangle::new(at.unknowns.len());
        match &self.blocks {
            Some(blocks) => {
                for linear in blocks {
                    triangle.push(&linear.jacobian, &linear.residual);
                }
            }
            None => {
                for block in observations.chunks(BLOCK) {
                    let linear = linearize(at.arm, at.unknowns, at.scales, block, at.sigmas);
                    triangle.push(&linear.jacobian, &linear.residual);
                }
            }
        }
        if let Some(rows) = &prior {
            triangle.push(&rows.jacobian, &rows.residual);
        }
        triangle
    }

    /// Adds what is expected of the unknowns.
    pub(super) fn add(&mut self, at: &Linearised<'_>, prior: Prior<'_>) {
        if let Some(rows) = prior.rows(at.arm, at.unknowns, at.scales) {
            let transposed = rows.jacobian.transpose();
            self.matrix += &transposed * &rows.jacobian;
            self.gradient += transposed * &rows.residual;
            self.cost += rows.residual.norm_squared();
        }
    }

    fn second_round(
        &self,
        first: &Preconditioner,
        at: &Linearised<'_>,
        observations: &[&Observation],
        prior: Option<&Linear>,
    ) -> Option<Triangle> {
        let products = |linear: &Linear| {
            let whitened = first.whitened(&linear.jacobian);
            let projected = gradient(&whitened, &linear.residual);
            (gram(&whitened), projected)
        };
        let mut sums = match &self.blocks {
            Some(blocks) => each(blocks.iter().collect(), products),
            None => each_linear(at, observations, |linear| products(&linear)),
        };
        sums.extend(prior.map(products));
        let n = at.unknowns.len();
        let (mut square, mut projected) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (g, p) in sums {
            square += g;
            projected += p;
        }
        first.triangle(&square, &projected)
    }
}
