//! What is known of parameters before any measurement.

use nalgebra::{DMatrix, DVector};

use super::arm::ArmModel;
use super::linearize::Linear;
use super::unknown::{Unknown, largest};

/// Expectations of parameters, each as one more measurement (linear minimum variance, MRD
/// 4.69).
#[derive(Clone, Copy, Debug)]
pub enum Prior<'a> {
    /// Data alone.
    None,
    /// Values of effects are expected within what machines have: what the data do not show
    /// stays small.
    Effects,
    /// Joint parameters are expected as drawn.
    Drawing {
        /// The drawing.
        arm: &'a ArmModel,
        /// One standard deviation, m and rad; infinite where nothing is expected.
        tolerance: [f64; 2],
    },
}

impl Prior<'_> {
    /// True for data alone.
    pub fn is_none(self) -> bool {
        matches!(self, Self::None)
    }

    /// Mean and standard deviation expected of an unknown, in its unit.
    pub(super) fn expected(self, unknown: Unknown, arm: &ArmModel) -> Option<(f64, f64)> {
        match (self, unknown) {
            (Self::Effects, Unknown::Effect { .. } | Unknown::EarlyReading) => {
                Some((0.0, 0.5 * largest(unknown.unit(arm))))
            }
            (
                Self::Drawing {
                    arm: drawing,
                    tolerance: [length, angle],
                },
                Unknown::Joint(..),
            ) => {
                let deviation = match unknown.unit(arm) {
                    "m" => length,
                    _ => angle,
                };
                deviation
                    .is_finite()
                    .then(|| (unknown.value(drawing), deviation))
            }
            _ => None,
        }
    }

    /// As rows of the Jacobian and the residual; `None` where nothing is expected of any
    /// unknown.
    pub(super) fn rows(
        self,
        arm: &ArmModel,
        unknowns: &[Unknown],
        scales: &[f64],
    ) -> Option<Linear> {
        let rows: Vec<(usize, f64, f64)> = unknowns
            .iter()
            .zip(scales)
            .enumerate()
            .filter_map(|(k, (unknown, scale))| {
                let (mean, deviation) = self.expected(*unknown, arm)?;
                let off = (mean - unknown.value(arm)) / deviation;
                Some((k, scale / deviation, off))
            })
            .collect();
        let mut jacobian = DMatrix::zeros(rows.len(), unknowns.len());
        let mut residual = DVector::zeros(rows.len());
        for (i, (k, weight, value)) in rows.iter().enumerate() {
            jacobian[(i, *k)] = *weight;
            residual[i] = *value;
        }
        (!rows.is_empty()).then_some(Linear { jacobian, residual })
    }
}
