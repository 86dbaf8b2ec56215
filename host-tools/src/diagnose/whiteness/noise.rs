//! How large the noise is, by the residual itself.

use super::projected::Projected;
use crate::diagnose::chance::ln_chi_square;
use crate::identify::observation::{Kind, Observation, Sigmas};

/// One kind of measured number.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// What the residuals were weighted by, m or rad.
    pub assumed: f64,
    /// From the sum of squares over the sum of one minus leverage, m or rad.
    pub estimated: f64,
    /// From the median, which gross rows and tails do not reach, m or rad.
    pub robust: f64,
    /// `estimated` along each axis, world axes for points and orientations (one entry for
    /// lengths, distances and touches of planes, two for bearings), m or rad.
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
    /// Distances between poses.
    pub distance: Option<Component>,
    /// Touches of points and planes.
    pub contact: Option<Component>,
    /// Bearings.
    pub bearing: Option<Component>,
}

impl Noise {
    /// Sigmas by which residuals are alike in all kinds; `assumed` where too little is known.
    pub(super) fn weights(&self, assumed: Sigmas) -> Sigmas {
        Sigmas::per_kind(|kind| {
            let assumed = assumed.of(kind);
            let known = self.of(kind).filter(|c| c.freedom > 10.0);
            known.map_or(assumed, |c| c.estimated.max(1e-3 * assumed))
        })
    }

    /// That of one kind.
    pub fn of(&self, kind: Kind) -> Option<&Component> {
        match kind {
            Kind::Position => self.position.as_ref(),
            Kind::Orientation => self.orientation.as_ref(),
            Kind::Length => self.length.as_ref(),
            Kind::Distance => self.distance.as_ref(),
            Kind::Contact => self.contact.as_ref(),
            Kind::Bearing => self.bearing.as_ref(),
        }
    }
}

/// Kind and axis of every equation of an observation, in the order of its residual.
fn kinds(o: &Observation) -> Vec<(Kind, usize)> {
    // a touch of a point has three axes, one of a plane its normal, a bearing two angles
    let each = |(kind, count)| (0..count).map(move |i| (kind, i % 3));
    o.kinds().flat_map(each).collect()
}

/// Variance components of a projected residual. `repeats`: rows of one pose each.
pub(super) fn noise(
    projected: &Projected,
    observations: &[&Observation],
    sigmas: Sigmas,
    repeats: &[Vec<usize>],
) -> Noise {
    let labels: Vec<Vec<(Kind, usize)>> = observations.iter().map(|o| kinds(o)).collect();
    let component = |kind: Kind| -> Option<Component> {
        let assumed = sigmas.of(kind);
        let mut sums: Vec<[f64; 2]> = Vec::new();
        let mut sizes = Vec::new();
        for (i, labels) in labels.iter().enumerate() {
            let (r, kept) = (projected.row(i), projected.kept(i));
            for ((&(k, axis), r), kept) in labels.iter().zip(r).zip(kept) {
                if k == kind {
                    sums.resize(sums.len().max(axis + 1), [0.0; 2]);
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
        position: component(Kind::Position),
        orientation: component(Kind::Orientation),
        length: component(Kind::Length),
        distance: component(Kind::Distance),
        contact: component(Kind::Contact),
        bearing: component(Kind::Bearing),
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
