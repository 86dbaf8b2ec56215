//! The rows that no fit has seen, one by one.

use nalgebra::Vector3;

use super::Row;
use super::compose::{MM, joint_unit, scaled};
use crate::identify::Calibration;
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::relation::Relation;
use crate::identify::view::View;

/// Their joints in mm and deg, and what the complete model leaves of them.
pub(super) fn rows(calibration: &Calibration, verify: &[&Observation]) -> Vec<Row> {
    let arm = &calibration.complete.arm;
    let sigmas = Sigmas::UNIT;
    let mut evaluator = Evaluator::new(arm, sigmas);
    let row = |o: &Observation, residual_mm| {
        let q = o.q.iter().zip(&arm.joints);
        Row {
            number: o.row,
            q: q.map(|(q, j)| q * joint_unit(j.kind).1).collect(),
            residual_mm,
        }
    };
    verify
        .iter()
        .filter_map(|o| {
            let pose = evaluator.observe(o);
            let first = o.targets.iter().zip(&arm.targets);
            let measured = o.position.map(|p| p - pose.translation).or_else(|| {
                first
                    .filter_map(|(p, offset)| Some((*p)? - pose.point(offset)))
                    .next()
            });
            let residual = match (measured, o.length) {
                (Some(v), _) => {
                    let base = arm.bases.get(o.session).or(arm.bases.first())?;
                    scaled((base.rotation.transpose() * v).as_slice(), MM)
                }
                (None, Some(length)) => {
                    vec![(length - (pose.translation - arm.anchor).norm()) * MM]
                }
                (None, None) => {
                    let mut residual = vec![0.0; o.equations()];
                    let mut distances = Vec::new();
                    evaluator.residual(o, &mut residual);
                    if let (Some(Relation::View(View::At { .. })), [x, y, z, ..]) =
                        (o.relations.first(), residual.as_slice())
                    {
                        let base = arm.bases.get(o.session).or(arm.bases.first())?;
                        let v = pose.rotation * Vector3::new(*x, *y, *z);
                        return Some(row(
                            o,
                            scaled((base.rotation.transpose() * v).as_slice(), MM),
                        ));
                    }
                    evaluator.distances(o, |d| distances.push(d));
                    let [one] = distances.as_slice() else {
                        return None;
                    };
                    vec![one * residual.first().map_or(1.0, |r| r.signum()) * MM]
                }
            };
            Some(row(o, residual))
        })
        .collect()
}
