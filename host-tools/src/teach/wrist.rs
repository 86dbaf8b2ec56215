//! Positions only, with far fewer terms: the first three joints by polynomials of themselves,
//! and the wrist by a translation of the tool. MRD 5.196 to 5.198.
//!
//! Taught with the wrist in the middle of its region first, then with the arm in the middle of
//! its own; the book says that the second has to be done again at other places of the arm, so
//! what is left grows with the region.

use nalgebra::{Matrix3, Vector3};
use truepose::Model;
use truepose::effects::Conditions;
use truepose::params::{Blob, BlobError};

use super::{Lessons, points, polynomial};
use crate::joints::with_joints;

/// Joints that the arm itself has; the others are the wrist's.
pub const ARM: usize = 3;

/// Tables of the arm and of the wrist, one after the other.
pub(super) fn teach(
    blob: &Blob<'_>,
    region: &[[f64; 2]],
    degree: u8,
) -> Result<[Vec<u8>; 2], &'static str> {
    with_joints!(blob.joints(), N => sized::<N>(blob, region, degree))
        .unwrap_or(Err("too many joints"))
}

fn sized<const N: usize>(
    blob: &Blob<'_>,
    region: &[[f64; 2]],
    degree: u8,
) -> Result<[Vec<u8>; 2], &'static str> {
    if N <= ARM {
        return Err("an arm of three joints has no wrist");
    }
    let model: Result<Model<'_, f64, N>, BlobError> = blob.model();
    let model = model.map_err(|_| "the parameters have no model")?;
    let (arm, wrist) = region.split_at(ARM);
    let mut middle = [0.0; N];
    for (q, [low, high]) in middle.iter_mut().zip(region) {
        *q = 0.5 * (low + high);
    }
    let grid = usize::from(degree);
    let with = |from: usize, values: &[f64]| {
        let mut q = middle;
        for (q, value) in q.iter_mut().skip(from).zip(values) {
            *q = *value;
        }
        q
    };
    let lessons = |region: &[[f64; 2]], teach: &dyn Fn(&[f64]) -> Vec<f64>| {
        let q = points::chebyshev(region, grid);
        let corrections = q.iter().map(|q| teach(q)).collect();
        let region = region.to_vec();
        Lessons {
            region,
            q,
            corrections,
        }
    };
    let of_arm = lessons(arm, &|q| correction(&model, &with(0, q)));
    // X_d⁻¹ X_a at the same values of the first three joints, these corrected.
    let of_wrist = lessons(wrist, &|q| {
        let q = with(ARM, q);
        let mut corrected = q;
        for (q, p) in corrected.iter_mut().zip(correction(&model, &middle)) {
            *q += p;
        }
        let desired = model.nominal_pose(&q);
        let actual = model.predict(&corrected, &Conditions::default());
        let miss = desired.inverse().then(&actual).translation;
        miss.as_slice().to_vec()
    });
    Ok([
        polynomial::fit(&of_arm, degree)?,
        polynomial::fit(&of_wrist, degree)?,
    ])
}

/// What the first three joints have to be moved by for the tool point to be where it nominally
/// is; nothing for the others.
fn correction<const N: usize>(model: &Model<'_, f64, N>, q: &[f64; N]) -> Vec<f64> {
    const STEP: f64 = 1e-6;
    let at = |q: &[f64; N]| model.predict(q, &Conditions::default()).translation;
    let desired = model.nominal_pose(q).translation;
    let mut corrected = *q;
    for _ in 0..6 {
        let error = desired - at(&corrected);
        let columns = [0, 1, 2].map(|j| {
            let [back, forth] = [-STEP, STEP].map(|step| {
                let mut moved = corrected;
                moved[j] += step;
                at(&moved)
            });
            (forth - back) * (0.5 / STEP)
        });
        let jacobian = Matrix3::from_columns(&columns);
        // Damped, for an arm stretched out.
        let normal = jacobian.tr_mul(&jacobian) + Matrix3::identity() * 1e-9;
        let step: Vector3<f64> = match normal.cholesky() {
            Some(factor) => factor.solve(&jacobian.tr_mul(&error)),
            None => break,
        };
        for (q, p) in corrected.iter_mut().zip(step.iter()) {
            *q += p;
        }
    }
    corrected
        .iter()
        .zip(q)
        .map(|(to, from)| to - from)
        .collect()
}
