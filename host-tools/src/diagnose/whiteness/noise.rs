//! How large the noise is, by the residual itself.

use super::projected::Projected;
use crate::diagnose::chance::ln_chi_square;
use crate::identify::observation::{Observation, Sigmas};

/// One kind of measured number.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// What the residuals were weighted by, m or rad.
    pub assumed: f64,
    /// From the sum of squares over the sum of one minus leverage, m or rad.
    pub estimated: f64,
    /// From the median, which gross rows and tails do not reach, m or rad.
    pub robust: f64,
    /// `estimated` along each world axis (one entry for lengths), m or rad.
    pub axes: Vec<f64>,
    /// From rows that repeat a pose, m or rad: noise alone, whatever the model lacks.
    pub pure: Option<f64>,
    /// Degrees of freedom of `estimated`.
    pub freedom: f64,
    /// Chance that noise as assumed makes residuals of this size or larger.
    pub p_value: f64,
}

/// Noise by kind of measured number; `None` where nothing of the kind was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Noise {
    /// Tool point and further targets.
    pub position: Option<Component>,
    /// Orientations.
    pub orientation: Option<Component>,
    /// Lengths.
    pub length: Option<Component>,
}

impl Noise {
    /// Sigmas by which residuals are alike in all kinds; `assumed` where too little is known.
    pub(super) fn weights(&self, assumed: Sigmas) -> Sigmas {
        let of = |component: &Option<Component>, assumed: f64| {
            let known = component.as_ref().filter(|c| c.freedom > 10.0);
            known.map_or(assumed, |c| c.estimated.max(1e-3 * assumed))
        };
        Sigmas {
            position: of(&self.position, assumed.position),
            orientation: of(&self.orientation, assumed.orientation),
            length: of(&self.length, assumed.length),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Position,
    Orientation,
    Length,
}

/// Kind and axis of every equation of an observation, in the order of its residual.
fn kinds(o: &Observation) -> Vec<(Kind, usize)> {
    let three = |kind| (0..3).map(move |axis| (kind, axis));
    let mut kinds = Vec::with_capacity(o.equations());
    if o.position.is_some() {
        kinds.extend(three(Kind::Position));
    }
    if o.rotation.is_some() {
        kinds.extend(three(Kind::Orientation));
    }
    for _ in o.targets.iter().flatten() {
        kinds.extend(three(Kind::Position));
    }
    if o.length.is_some() {
        kinds.push((Kind::Length, 0));
    }
    kinds
}

/// Variance components of a projected residual. `repeats`: rows of one pose each.
pub(super) fn noise(
    projected: &Projected,
    observations: &[&Observation],
    sigmas: Sigmas,
    repeats: &[Vec<usize>],
) -> Noise {
    let labels: Vec<Vec<(Kind, usize)>> = observations.iter().map(|o| kinds(o)).collect();
    let component = |kind: Kind, assumed: f64, axes: usize| -> Option<Component> {
        let mut sums = vec![[0.0; 2]; axes];
        let mut sizes = Vec::new();
        for (i, labels) in labels.iter().enumerate() {
            let (r, kept) = (projected.row(i), projected.kept(i));
            for ((&(k, axis), r), kept) in labels.iter().zip(r).zip(kept) {
                if k == kind {
                    sums[axis][0] += r * r;
                    sums[axis][1] += kept;
                    sizes.push(r.abs() / kept.max(1e-3).sqrt());
                }
            }
        }
        let (square, freedom) = sums
            .iter()
            .fold((0.0, 0.0), |(s, f), [a, b]| (s + a, f + b));
        if sizes.is_empty() || freedom <= 0.0 {
            return None;
        }
        sizes.sort_by(f64::total_cmp);
        let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        let root = |square: f64, freedom: f64| assumed * (square / freedom.max(1e-9)).sqrt();
        Some(Component {
            assumed,
            estimated: root(square, freedom),
            // 0.6745: upper quartile of the standard normal
            robust: assumed * median / 0.674_489_75,
            axes: sums.iter().map(|&[s, f]| root(s, f)).collect(),
            pure: pure(projected, &labels, kind, repeats).map(|x| assumed * x),
            freedom,
            p_value: ln_chi_square(square, freedom).exp(),
        })
    };
    Noise {
        position: component(Kind::Position, sigmas.position, 3),
        orientation: component(Kind::Orientation, sigmas.orientation, 3),
        length: component(Kind::Length, sigmas.length, 1),
    }
}

/// Scatter of rows about the mean of their pose.
fn pure(
    projected: &Projected,
    labels: &[Vec<(Kind, usize)>],
    kind: Kind,
    repeats: &[Vec<usize>],
) -> Option<f64> {
    let (mut square, mut freedom) = (0.0, 0.0);
    for group in repeats {
        let Some(first) = group.first() else { continue };
        if group.iter().any(|&i| labels[i] != labels[*first]) {
            continue;
        }
        for (e, label) in labels[*first].iter().enumerate() {
            if label.0 == kind {
                let values = group.iter().map(|&i| projected.row(i)[e]);
                let mean = values.clone().sum::<f64>() / group.len() as f64;
                square += values.map(|x| (x - mean) * (x - mean)).sum::<f64>();
                freedom += group.len() as f64 - 1.0;
            }
        }
    }
    (freedom > 0.0).then(|| (square / freedom).sqrt())
}
