//! How sure the calibrated model is of where the tool is, anywhere.
//!
//! The parameters' covariance C, carried to the tool by the identification Jacobian J of a full
//! pose there: `J C Jᵀ`. It grows away from where poses were measured; the instrument's noise
//! is not in it, nor what the model lacks.

use std::path::Path;

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3};
use serde::{Deserialize, Serialize};

use super::Stage;
use super::arm::ArmModel;
use super::linearize::linearize;
use super::observation::{Observation, Sigmas};
use super::solve::BLOCK;
use super::unknown::Unknown;
use crate::error::{Error, Place};

/// Covariance of the identified parameters, SI units. Turns of base, tool and stations are
/// about fixed axes: world axes for base and stations, the last link's for the tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Covariance {
    /// Names as in the report's `parameters`.
    pub parameters: Vec<String>,
    /// Symmetric, in the same order.
    pub matrix: Vec<Vec<f64>>,
}

impl Covariance {
    /// Of a fit, by the residual's own size.
    pub fn of(stage: &Stage) -> Self {
        let variance = stage.fit.variance();
        let c = &stage.fit.covariance;
        Self {
            parameters: stage
                .fit
                .unknowns
                .iter()
                .map(|u| u.name(&stage.arm))
                .collect(),
            matrix: c
                .row_iter()
                .map(|row| row.iter().map(|x| x * variance).collect())
                .collect(),
        }
    }

    /// From the `covariance` of a report that `--json` wrote.
    pub fn read(file: &Path) -> Result<Self, Error> {
        #[derive(Deserialize)]
        struct Report {
            covariance: Option<Covariance>,
        }
        let text = crate::error::read_text(file)?;
        let report: Report = serde_json::from_str(&text).map_err(|e| {
            Place::line(file, e.line()).bad(
                format!("text that is not a report ({e})"),
                "what identify or diagnose wrote with --json",
                "check that it is the right file",
            )
        })?;
        let Some(covariance) = report.covariance else {
            return Err(Place::file(file).column("covariance").bad(
                "a report without a covariance",
                "one of identify or diagnose",
                "identify again with --json",
            ));
        };
        let n = covariance.parameters.len();
        let whole = covariance.matrix.len() == n
            && covariance.matrix.iter().all(|row| row.len() == n)
            && covariance.matrix.iter().flatten().all(|x| x.is_finite());
        match whole {
            true => Ok(covariance),
            false => Err(Place::file(file).column("covariance, matrix").bad(
                format!("a matrix that is not {n} by {n} finite numbers"),
                "one row and one column a parameter",
                "identify again with --json",
            )),
        }
    }
}

/// The part of a covariance that moves the tool of one arm.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    unknowns: Vec<Unknown>,
    covariance: DMatrix<f64>,
}

impl Uncertainty {
    /// Of a fit.
    pub fn of(stage: &Stage) -> Self {
        Self {
            unknowns: stage.fit.unknowns.clone(),
            covariance: &stage.fit.covariance * stage.fit.variance(),
        }
    }

    /// Of `covariance` for `arm`; the name of a parameter that the arm does not have is an
    /// error. What stands around the arm is left out: it does not move the tool.
    pub fn new(covariance: &Covariance, arm: &ArmModel) -> Result<Self, String> {
        let known = every_unknown(arm);
        let mut unknowns = Vec::new();
        let mut places = Vec::new();
        const AROUND: [&str; 6] = [
            "anchor ", "point ", "plane ", "station ", "target ", "early-",
        ];
        for (place, name) in covariance.parameters.iter().enumerate() {
            let other_base = name.contains(" of placement ");
            if other_base || AROUND.iter().any(|start| name.starts_with(start)) {
                continue;
            }
            let found = known.iter().find(|(n, _)| n == name);
            let (_, unknown) = found.ok_or_else(|| name.clone())?;
            unknowns.push(*unknown);
            places.push(place);
        }
        let at = |i: usize, k: usize| covariance.matrix[places[i]][places[k]];
        Ok(Self {
            covariance: DMatrix::from_fn(places.len(), places.len(), at),
            unknowns,
        })
    }

    /// Covariance of the tool pose at each observation's joints and conditions: x, y, z of the
    /// tool point in m, then turns about world axes in rad.
    pub fn at(&self, arm: &ArmModel, observations: &[&Observation]) -> Vec<Matrix6<f64>> {
        let unit = Sigmas::UNIT;
        let ones = vec![1.0; self.unknowns.len()];
        let posed = |o: &Observation| Observation {
            position: Some(Vector3::zeros()),
            rotation: Some(Matrix3::identity()),
            targets: Vec::new(),
            length: None,
            relations: Vec::new(),
            weight: 1.0,
            ..o.clone()
        };
        let mut all = Vec::with_capacity(observations.len());
        for block in observations.chunks(BLOCK) {
            let poses: Vec<Observation> = block.iter().map(|o| posed(o)).collect();
            let poses: Vec<&Observation> = poses.iter().collect();
            let j = linearize(arm, &self.unknowns, &ones, &poses, unit).jacobian;
            let carried = &j * &self.covariance;
            for i in (0..j.nrows()).step_by(6) {
                let (j, carried) = (j.rows(i, 6), carried.rows(i, 6));
                let of = |i: usize, k: usize| carried.row(i).dot(&j.row(k));
                all.push(Matrix6::from_fn(of));
            }
        }
        all
    }
}

/// Every unknown that moves the tool of an arm, by its name.
fn every_unknown(arm: &ArmModel) -> Vec<(String, Unknown)> {
    let mut all: Vec<Unknown> = Vec::new();
    all.extend((0..6).map(|axis| Unknown::Base { session: 0, axis }));
    all.extend((0..6).map(|axis| Unknown::Tool { axis }));
    for (j, joint) in arm.joints.iter().enumerate() {
        all.extend(joint.parameters().iter().map(|p| Unknown::Joint(j, *p)));
    }
    for (effect, e) in arm.effects.iter().enumerate() {
        let count = e.model().values().len();
        all.extend((0..count).map(|value| Unknown::Effect { effect, value }));
    }
    all.into_iter().map(|u| (u.name(arm), u)).collect()
}
