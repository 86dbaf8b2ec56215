//! Joint curves: many cells with a prior, identified together with everything else.
//!
//! A curve has no single order, and a list of harmonics goes wild in angles that were not
//! measured. A table whose second differences and values are held near zero by a prior goes
//! quietly to zero there. Every row touches two cells of each curve, so the normal equations
//! are gathered row by row and the prior keeps them well conditioned.

use nalgebra::{DMatrix, DVector};

use crate::identify::arm::{ArmModel, Curve};
use crate::identify::evaluator::Evaluator;
use crate::identify::linearize::linearize;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::unknown::{Unknown, apply};

/// A curve that a posture touches, the cells with their shares, and the joint's column.
type Touched = (usize, [(usize, f64); 2], Vec<f64>);

/// Cells of a turn: 2 degrees each.
pub const CELLS: usize = 180;

/// Functions that stand for a curve while it is one of many candidates: sine and cosine of
/// every order to 24.
pub const COARSE: usize = 48;

/// What each of them may plausibly have, rad.
const WAVE: f64 = 4e-4;

/// What a cell of a curve may plausibly have, rad.
const VALUE: f64 = 7e-4;

/// Orders that a curve is made of while its smoothness is chosen; of higher ones every prior
/// that is tried leaves next to nothing.
const ORDERS: usize = 36;

/// How large and how smooth a curve is expected to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothness {
    /// Standard deviation of a cell's value, rad.
    pub value: f64,
    /// Order up to which value and not smoothness holds the curve back, periods a turn.
    pub order: f64,
}

impl Smoothness {
    /// Where the search for the best starts.
    pub const FIRST: Self = Self {
        value: VALUE,
        order: 12.0,
    };

    /// Those next to this one, by these factors.
    pub fn neighbours(self, value: f64, order: f64) -> [Self; 4] {
        let of = |value: f64, order: f64| Self {
            value: (self.value * value).clamp(VALUE / 64.0, VALUE * 16.0),
            order: (self.order * order).clamp(4.0, 27.0),
        };
        [
            of(value, 1.0),
            of(1.0 / value, 1.0),
            of(1.0, order),
            of(1.0, 1.0 / order),
        ]
    }

    /// Standard deviation of second differences of the cells, rad.
    pub fn bend(self) -> f64 {
        self.value * second_difference(self.order)
    }
}

/// Of a wave of height one and `order` periods a turn.
fn second_difference(order: f64) -> f64 {
    2.0 - 2.0 * (order * std::f64::consts::TAU / CELLS as f64).cos()
}

/// A cell farther than this many cells from any reading was not measured.
const REACH: usize = 3;

/// A curve that is zero so far.
pub fn flat(joint: usize) -> Curve {
    Curve {
        joint,
        values: vec![0.0; CELLS],
    }
}

/// What the functions that stand for a curve have at a reading, rad, each of its plausible
/// height.
pub(super) fn stand_ins(q: f64) -> [f64; COARSE] {
    std::array::from_fn(|k| {
        let (sine, cosine) = ((k / 2 + 1) as f64 * q).sin_cos();
        WAVE * if k % 2 == 0 { sine } else { cosine }
    })
}

/// Sines and cosines of the cells, orthonormal, cells x functions: in these the prior is
/// diagonal.
pub fn waves() -> DMatrix<f64> {
    let step = std::f64::consts::TAU / CELLS as f64;
    let height = (2.0 / CELLS as f64).sqrt();
    DMatrix::from_fn(CELLS, 1 + 2 * ORDERS, |cell, k| {
        let angle = k.div_ceil(2) as f64 * cell as f64 * step;
        match k {
            0 => height / 2.0_f64.sqrt(),
            k if k % 2 == 1 => height * angle.cos(),
            _ => height * angle.sin(),
        }
    })
}

/// Inverse covariance of the amplitudes of [`waves`].
pub fn precision_of_waves(smoothness: Smoothness) -> DMatrix<f64> {
    let of = |k: usize| {
        let bend = second_difference(k.div_ceil(2) as f64) / smoothness.bend();
        smoothness.value.powi(-2) + bend * bend
    };
    DMatrix::from_diagonal(&DVector::from_fn(1 + 2 * ORDERS, |k, _| of(k)))
}

/// Inverse covariance of the cells of one curve.
pub fn precision(smoothness: Smoothness) -> DMatrix<f64> {
    let mut p = DMatrix::identity(CELLS, CELLS) / smoothness.value.powi(2);
    let weight = smoothness.bend().powi(-2);
    for i in 0..CELLS {
        let cells = [(i + CELLS - 1) % CELLS, i, (i + 1) % CELLS];
        let difference = [1.0, -2.0, 1.0];
        for (a, x) in cells.iter().zip(difference) {
            for (b, y) in cells.iter().zip(difference) {
                p[(*a, *b)] += weight * x * y;
            }
        }
    }
    p
}

/// Whitened columns of the cells of one curve, per rad.
pub fn columns(
    arm: &ArmModel,
    joint: usize,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> DMatrix<f64> {
    let curve = flat(joint);
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut matrix = DMatrix::zeros(rows, CELLS);
    let mut evaluator = Evaluator::new(arm, sigmas);
    let mut start = 0;
    for o in observations {
        let n = o.equations();
        evaluator.each_posture(o, |evaluator, posture| {
            let mut column = vec![0.0; n];
            posture.spread(evaluator, &evaluator.joint_twist(joint), &mut column);
            for (cell, weight) in curve.cells(posture.at.q[joint]) {
                for (row, x) in column.iter().enumerate() {
                    matrix[(start + row, cell)] += weight * x;
                }
            }
        });
        start += n;
    }
    matrix
}

/// One Gauss-Newton step of `unknowns` and all curves of the arm together. `smoothness`: one
/// a curve. Returns false, and leaves the arm alone, where the equations have no solution.
pub fn step(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    smoothness: &[Smoothness],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> bool {
    let p = unknowns.len();
    let curves = arm.curves.len();
    let total = p + curves * CELLS;
    let scales: Vec<f64> = unknowns.iter().map(|u| u.expected(arm)).collect();
    let mut normal = DMatrix::<f64>::zeros(total, total);
    let mut right = DVector::<f64>::zeros(total);
    for block in observations.chunks(512) {
        let linear = linearize(arm, unknowns, &scales, block, sigmas);
        let rows = linear.residual.len();
        let transposed = linear.jacobian.transpose();
        let dense = &transposed * &linear.jacobian;
        let mut corner = normal.view_mut((0, 0), (p, p));
        corner += dense;
        let mut head = right.rows_mut(0, p);
        head += &transposed * &linear.residual;
        let mut evaluator = Evaluator::new(arm, sigmas);
        let mut start = 0;
        for o in block {
            let n = o.equations();
            // one a curve and posture
            let mut joint_columns: Vec<Touched> = Vec::new();
            evaluator.each_posture(o, |evaluator, posture| {
                for (c, curve) in arm.curves.iter().enumerate() {
                    let mut column = vec![0.0; n];
                    posture.spread(evaluator, &evaluator.joint_twist(curve.joint), &mut column);
                    let cells = curve.cells(posture.at.q[curve.joint]);
                    joint_columns.push((c, cells, column));
                }
            });
            let residual = &linear.residual.as_slice()[start..start + n];
            for (c, cells, own) in &joint_columns {
                let dot =
                    |other: &[f64]| -> f64 { own.iter().zip(other).map(|(a, b)| a * b).sum() };
                for &(cell, weight) in cells {
                    right[p + c * CELLS + cell] += weight * dot(residual);
                }
                for k in 0..p {
                    let column = &linear.jacobian.as_slice()[k * rows + start..][..n];
                    let product = dot(column);
                    for &(cell, weight) in cells {
                        normal[(p + c * CELLS + cell, k)] += weight * product;
                    }
                }
                for (d, other_cells, other) in joint_columns.iter().filter(|(d, ..)| d <= c) {
                    let product = dot(other);
                    for &(cell, weight) in cells {
                        for &(there, weight_there) in other_cells {
                            normal[(p + c * CELLS + cell, p + d * CELLS + there)] +=
                                weight * weight_there * product;
                        }
                    }
                }
            }
            start += n;
        }
    }
    for (c, (curve, &smooth)) in arm.curves.iter().zip(smoothness).enumerate() {
        let prior = precision(smooth);
        let present = DVector::from_iterator(
            CELLS,
            curve
                .values
                .iter()
                .map(|v| if v.is_finite() { *v } else { 0.0 }),
        );
        let pull = &prior * present;
        for i in 0..CELLS {
            right[p + c * CELLS + i] -= pull[i];
            for j in 0..CELLS {
                normal[(p + c * CELLS + i, p + c * CELLS + j)] += prior[(i, j)];
            }
        }
    }
    // the lower triangle is what the factorisation reads
    let Some(factor) = normal.cholesky() else {
        return false;
    };
    let delta = factor.solve(&right);
    let moved: Vec<f64> = (0..p).map(|k| delta[k] * scales[k]).collect();
    for (c, curve) in arm.curves.iter_mut().enumerate() {
        for (cell, value) in curve.values.iter_mut().enumerate() {
            let from = if value.is_finite() { *value } else { 0.0 };
            *value = from + delta[p + c * CELLS + cell];
        }
        forget_unmeasured(curve, observations);
    }
    apply(arm, unknowns, &moved);
    true
}

/// Cells far from every reading carry nothing but the prior: they are marked as not measured.
fn forget_unmeasured(curve: &mut Curve, observations: &[&Observation]) {
    let mut near = vec![false; CELLS];
    for o in observations.iter().flat_map(|o| o.postures()) {
        for (cell, _) in curve.cells(o.q[curve.joint]) {
            for offset in 0..=2 * REACH {
                near[(cell + CELLS + offset - REACH) % CELLS] = true;
            }
        }
    }
    for (value, near) in curve.values.iter_mut().zip(near) {
        if !near {
            *value = f64::NAN;
        }
    }
}
