//! Pose accuracy and repeatability of poses that were measured more than once, as ISO 9283
//! defines them.

use nalgebra::Vector3;

use super::Residual;
use crate::measurement::Row;

/// Rows whose joints all agree within this are one command, rad or m.
const SAME: f64 = 1e-3;

/// Figures of one pose, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseFigures {
    /// Number of its first row in the file, from 1.
    pub row: usize,
    /// How often it was measured.
    pub repeats: usize,
    /// AP: from where it was sent to the middle of where it went, m. ISO 9283, 7.2.1.
    pub accuracy: f64,
    /// RP: mean distance from that middle plus three standard deviations of the distance, m.
    /// ISO 9283, 7.2.2.
    pub repeatability: f64,
    /// The same of the orientation, rad: angle to the mean orientation, and three standard
    /// deviations of the worst of three axes.
    pub orientation: Option<[f64; 2]>,
}

/// Figures of all repeated poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Iso9283 {
    /// One a pose, in the order of the file.
    pub poses: Vec<PoseFigures>,
}

impl Iso9283 {
    /// The worst accuracy, m.
    pub fn accuracy(&self) -> f64 {
        self.poses.iter().map(|p| p.accuracy).fold(0.0, f64::max)
    }

    /// The worst repeatability, m.
    pub fn repeatability(&self) -> f64 {
        self.poses
            .iter()
            .map(|p| p.repeatability)
            .fold(0.0, f64::max)
    }
}

/// `None` where no pose was measured twice.
pub(super) fn figures(rows: &[Row], residuals: &[Residual]) -> Option<Iso9283> {
    let mut groups: Vec<(&Row, Vec<&Residual>)> = Vec::new();
    for (row, residual) in rows.iter().zip(residuals) {
        if residual.position.is_none() {
            continue;
        }
        let same = |other: &Row| {
            let apart = row.q.iter().zip(&other.q).map(|(a, b)| (a - b).abs());
            apart.fold(0.0, f64::max) <= SAME
        };
        match groups.iter_mut().find(|(first, _)| same(first)) {
            Some((_, group)) => group.push(residual),
            None => groups.push((row, vec![residual])),
        }
    }
    let poses: Vec<PoseFigures> = groups
        .into_iter()
        .filter(|(_, group)| group.len() > 1)
        .map(|(row, group)| of_pose(row.number, &group))
        .collect();
    (!poses.is_empty()).then_some(Iso9283 { poses })
}

fn of_pose(row: usize, group: &[&Residual]) -> PoseFigures {
    let positions: Vec<Vector3<f64>> = group.iter().filter_map(|r| r.position).collect();
    let turns: Vec<Vector3<f64>> = group.iter().filter_map(|r| r.orientation).collect();
    let middle = mean(&positions);
    let distances: Vec<f64> = positions.iter().map(|p| (p - middle).norm()).collect();
    let average = distances.iter().sum::<f64>() / distances.len() as f64;
    PoseFigures {
        row,
        repeats: group.len(),
        accuracy: middle.norm(),
        repeatability: average + 3.0 * deviation(&distances),
        orientation: (turns.len() > 1).then(|| {
            let axis = |c: usize| -> Vec<f64> { turns.iter().map(|t| t[c]).collect() };
            let worst = (0..3).map(|c| deviation(&axis(c))).fold(0.0, f64::max);
            [mean(&turns).norm(), 3.0 * worst]
        }),
    }
}

fn mean(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    let sum: Vector3<f64> = vectors.iter().sum();
    sum / vectors.len() as f64
}

/// Standard deviation, over the number less one.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    (squares / (count - 1.0).max(1.0)).sqrt()
}
