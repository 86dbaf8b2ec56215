//! How large the residual is, by kind of measurement, and whether it looks like noise.

use super::arm::ArmModel;
use super::linearize::{linearize, residuals};
use super::observation::{Kind, Observation, Sigmas};
use super::problem::Problem;
use super::solve::BLOCK;
use super::{Calibration, Stage};

/// Residual of one kind of measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Component {
    /// Sum of squares over sigma squared.
    pub sum: f64,
    /// Equations less what the fit has used up of them.
    pub freedom: f64,
    /// Equations.
    pub equations: usize,
}

impl Component {
    /// Size of the residual over the declared noise; `None` where nothing was measured or
    /// nothing is left over.
    pub fn ratio(&self) -> Option<f64> {
        (self.freedom >= 1.0).then(|| (self.sum / self.freedom).sqrt())
    }

    fn add(&mut self, residuals: &[f64], leverages: &[f64]) {
        self.sum += residuals.iter().map(|r| r * r).sum::<f64>();
        self.freedom += residuals.len() as f64 - leverages.iter().sum::<f64>();
        self.equations += residuals.len();
    }
}

/// Residuals of all kinds, whitened by the noise that the fit was weighted with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Components {
    /// Positions of the tool point and further targets.
    pub position: Component,
    /// Orientations.
    pub orientation: Component,
    /// Lengths.
    pub length: Component,
    /// Distances between two poses.
    pub distance: Component,
    /// Touches of points and planes.
    pub contact: Component,
    /// Bearings.
    pub bearing: Component,
}

impl Components {
    fn of_mut(&mut self, kind: Kind) -> &mut Component {
        match kind {
            Kind::Position => &mut self.position,
            Kind::Orientation => &mut self.orientation,
            Kind::Length => &mut self.length,
            Kind::Distance => &mut self.distance,
            Kind::Contact => &mut self.contact,
            Kind::Bearing => &mut self.bearing,
        }
    }

    fn add(&mut self, o: &Observation, residuals: &[f64], leverages: &[f64]) {
        let mut from = 0;
        for (kind, count) in o.kinds() {
            let to = from + count;
            if let (Some(r), Some(h)) = (residuals.get(from..to), leverages.get(from..to)) {
                self.of_mut(kind).add(r, h);
            }
            from = to;
        }
    }
}

/// Rows of the fit that were not left out as gross.
pub fn fitted<'p>(problem: &'p Problem, calibration: &Calibration) -> Vec<&'p Observation> {
    let kept = |o: &&Observation| !calibration.rejected.contains(&o.row);
    problem.identify.iter().filter(kept).collect()
}

/// Rows that no fit has seen and that were not left out as gross.
pub fn unseen<'p>(problem: &'p Problem, calibration: &Calibration) -> Vec<&'p Observation> {
    let kept = |o: &&Observation| !calibration.rejected.contains(&o.row);
    problem.verify.iter().filter(kept).collect()
}

/// Variance components of the rows that `stage` was fitted to: sums of squares over sums of one
/// less leverage. `sigmas`: what residuals are whitened by, whatever the fit was weighted with.
pub fn of_fitted(stage: &Stage, observations: &[&Observation], sigmas: Sigmas) -> Components {
    let Stage { arm, fit, .. } = stage;
    let mut components = Components::default();
    let ones = vec![1.0; fit.unknowns.len()];
    // covariance = F Fᵀ; the leverage of an equation is |row of J F|²
    let symmetric = fit.covariance.clone().symmetric_eigen();
    let mut factor = symmetric.eigenvectors;
    for (mut column, value) in factor.column_iter_mut().zip(symmetric.eigenvalues.iter()) {
        column *= value.max(0.0).sqrt();
    }
    for block in observations.chunks(BLOCK) {
        // leverages by the weights that the covariance is of
        let linear = linearize(arm, &fit.unknowns, &ones, block, stage.sigmas);
        let residual = residuals(arm, block, sigmas);
        let spread = linear.jacobian * &factor;
        let leverages: Vec<f64> = spread.row_iter().map(|row| row.norm_squared()).collect();
        let mut start = 0;
        for o in block {
            let end = start + o.equations();
            if let Some(leverages) = leverages.get(start..end) {
                components.add(o, &residual.as_slice()[start..end], leverages);
            }
            start = end;
        }
    }
    components
}

/// The same of rows that no fit has seen.
pub fn of_unseen(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> Components {
    let all = residuals(arm, observations, sigmas);
    let mut components = Components::default();
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        let none = vec![0.0; end - start];
        components.add(o, &all.as_slice()[start..end], &none);
        start = end;
    }
    components
}

/// Rows that a look for structure compares with all others, at most.
const COMPARED: usize = 1000;

/// Whether neighbouring poses have like residuals, as standard deviations from what
/// independent noise would show; needs no declared noise.
///
/// Each row is paired with its nearest neighbour in joint space, joints weighted by how far
/// they move the tool. Under independent noise the sign of each pair's product is a coin's.
pub fn neighbour_likeness(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> f64 {
    let all = residuals(arm, observations, sigmas);
    let mut starts = Vec::with_capacity(observations.len());
    let mut start = 0;
    for o in observations {
        starts.push(start);
        start += o.equations();
    }
    let levers = super::gross::levers(arm, observations, sigmas);
    let step = observations.len().div_ceil(COMPARED).max(1);
    let mut pairs: Vec<(usize, usize)> = (0..observations.len())
        .step_by(step)
        .filter_map(|i| nearest(i, observations, &levers).map(|k| (i.min(k), i.max(k))))
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let (mut sum, mut squares) = (0.0, 0.0);
    for (i, k) in pairs {
        let of = |i: usize| {
            let (o, start): (&&Observation, usize) = (&observations[i], starts[i]);
            &all.as_slice()[start..start + o.equations()]
        };
        let product: f64 = of(i).iter().zip(of(k)).map(|(a, b)| a * b).sum();
        sum += product;
        squares += product * product;
    }
    if squares > 0.0 {
        sum / squares.sqrt()
    } else {
        0.0
    }
}

/// Nearest row that measured the same things.
fn nearest(i: usize, observations: &[&Observation], levers: &[f64]) -> Option<usize> {
    let here = observations.get(i)?;
    let mut best: Option<(f64, usize)> = None;
    for (k, o) in observations.iter().enumerate() {
        if k == i || o.equations() != here.equations() {
            continue;
        }
        let each = here.q.iter().zip(&o.q).zip(levers);
        let distance: f64 = each.map(|((a, b), l)| ((a - b) * l).powi(2)).sum();
        if best.is_none_or(|(d, _)| distance < d) {
            best = Some((distance, k));
        }
    }
    best.map(|(_, k)| k)
}
