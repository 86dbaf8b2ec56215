//! Normal equations of any number of rows, block by block, and the orthogonal factorisation of
//! the same.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::arm::ArmModel;
use super::factor::{Preconditioner, Selection, Triangle, gram, select, select_by_normal};
use super::linearize::{Linear, linearize};
use super::observation::{Observation, Sigmas};
use super::prior::Prior;
use super::solve::{BLOCK, RELATIVE, VISIBLE, block};
use super::unknown::Unknown;

/// Does `work` on the linearisation of every block and folds the results in their order.
fn over_blocks<R: Send>(
    at: &Linearised<'_>,
    observations: &[&Observation],
    work: impl Fn(Linear) -> R + Sync,
    mut fold: impl FnMut(R),
) {
    let each =
        |block: &[&Observation]| work(linearize(at.arm, at.unknowns, at.scales, block, at.sigmas));
    if observations.len() <= BLOCK {
        fold(each(observations));
        return;
    }
    let results: Vec<R> = observations
        .par_chunks(block(observations.len()))
        .map(each)
        .collect();
    results.into_iter().for_each(fold);
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
    /// The block itself, where there is only one.
    pub(super) only: Option<Linear>,
}

impl Normal {
    pub(super) fn new(at: &Linearised<'_>, observations: &[&Observation]) -> Self {
        let n = at.unknowns.len();
        let mut sum = Self {
            matrix: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            cost: 0.0,
            only: None,
        };
        let single = observations.len() <= BLOCK;
        over_blocks(
            at,
            observations,
            |linear| {
                let matrix = gram(&linear.jacobian);
                let gradient = linear.jacobian.tr_mul(&linear.residual);
                let cost = linear.residual.norm_squared();
                (matrix, gradient, cost, single.then_some(linear))
            },
            |(matrix, gradient, cost, linear)| {
                sum.matrix += matrix;
                sum.gradient += gradient;
                sum.cost += cost;
                sum.only = linear;
            },
        );
        sum
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
            only: self.only.map(|linear| Linear {
                jacobian: linear.jacobian.select_columns(kept),
                residual: linear.residual,
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
        match &self.only {
            Some(linear) => triangle.push(&linear.jacobian, &linear.residual),
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
            let projected = whitened.tr_mul(&linear.residual);
            (gram(&whitened), projected)
        };
        let n = at.unknowns.len();
        let (mut square, mut projected) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut add = |(g, p): (DMatrix<f64>, DVector<f64>)| {
            square += g;
            projected += p;
        };
        match &self.only {
            Some(linear) => add(products(linear)),
            None => over_blocks(at, observations, |linear| products(&linear), &mut add),
        }
        if let Some(rows) = prior {
            add(products(rows));
        }
        first.triangle(&square, &projected)
    }
}
