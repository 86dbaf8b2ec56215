//! Teaching tables by experience. MRD 5.4.2.2.

use truepose::taught::cmac::{Layout, Selected};

use super::Lessons;
use crate::random::Random;

/// Lessons for each cell.
const PER_CELL: usize = 12;
/// The most lessons.
const MOST: usize = 200_000;
/// Gains of the rounds, each of which goes once through all lessons: quickly at first, then so
/// that neighbouring lessons settle between each other.
const GAINS: [f64; 8] = [1.2, 0.8, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02];

/// Weights that learn.
#[derive(Clone, Debug, PartialEq)]
pub struct Teacher {
    layout: Layout,
    outputs: usize,
    /// Every selected weight counts the same, as in the book (5.211); otherwise as on the
    /// controller.
    steps: bool,
    /// Cell by cell, one an output.
    weights: Vec<f64>,
}

/// Quantising functions for this many inputs: the power of two from twice as many on, which
/// leaves every input some that are far from its borders.
pub fn layers(inputs: usize) -> u8 {
    u8::try_from((2 * inputs).next_power_of_two()).unwrap_or(u8::MAX)
}

/// How many lessons it takes.
pub fn lessons(layout: &Layout, inputs: usize) -> usize {
    let words = layout.words(inputs).unwrap_or(usize::MAX);
    words.saturating_mul(PER_CELL).clamp(2000, MOST)
}

impl Teacher {
    /// Blank tables for this many inputs and outputs. `None` where the memory cannot be
    /// counted.
    pub fn blank(layout: Layout, inputs: usize, outputs: usize, steps: bool) -> Option<Self> {
        let words = layout.words(inputs)?.checked_mul(outputs)?;
        Some(Self {
            layout,
            outputs,
            steps,
            weights: vec![0.0; words],
        })
    }

    fn selected(&self, at: &[f64]) -> Vec<Selected<f64>> {
        (0..self.layout.layers)
            .map(|layer| {
                let mut selected = self.layout.select(layer, at);
                if self.steps {
                    selected.field = 1.0;
                }
                selected
            })
            .collect()
    }

    fn weight(&self, cell: &Selected<f64>, output: usize) -> f64 {
        let place = cell.index * self.outputs + output;
        self.weights.get(place).copied().unwrap_or_default()
    }

    /// What the tables say at `at`, each input in cells.
    pub fn output(&self, at: &[f64]) -> Vec<f64> {
        let selected = self.selected(at);
        let total: f64 = selected.iter().map(|s| s.field).sum();
        let one = |k| {
            selected
                .iter()
                .map(|s| s.field * self.weight(s, k))
                .sum::<f64>()
                / total
        };
        (0..self.outputs).map(one).collect()
    }

    /// One experience: moves the weights that `at` selects so that `gain` of the error goes.
    /// MRD 5.200; with fields, each weight by as much as it counts.
    pub fn teach(&mut self, at: &[f64], wanted: &[f64], gain: f64) {
        let said = self.output(at);
        let selected = self.selected(at);
        let total: f64 = selected.iter().map(|s| s.field).sum();
        let squares: f64 = selected.iter().map(|s| s.field * s.field).sum();
        for cell in &selected {
            let share = gain * cell.field * total / squares;
            for (k, (wanted, said)) in wanted.iter().zip(&said).enumerate() {
                if let Some(weight) = self.weights.get_mut(cell.index * self.outputs + k) {
                    *weight += share * (wanted - said);
                }
            }
        }
    }
}

/// Scale of each output and the table, taught until it settles.
pub(super) fn fit(lessons: &Lessons, layout: Layout) -> (Vec<f64>, Vec<u8>) {
    let outputs = lessons.corrections.first().map_or(0, Vec::len);
    let inputs = lessons.region.len();
    let Some(mut teacher) = Teacher::blank(layout, inputs, outputs, false) else {
        return (Vec::new(), Vec::new());
    };
    let cells = f64::from(layout.cells);
    let places: Vec<Vec<f64>> = (lessons.q.iter())
        .map(|q| {
            let one = |x: f64| ((x + 1.0) * 0.5 * cells).clamp(0.0, cells);
            let scaled = super::polynomial::scaled(q, &lessons.region);
            scaled.into_iter().map(one).collect()
        })
        .collect();
    let mut random = Random::new(5200, 1);
    for gain in GAINS {
        for _ in 0..places.len() {
            let k = random.below(places.len());
            teacher.teach(&places[k], &lessons.corrections[k], gain);
        }
    }
    let largest = |k| {
        let of_output = teacher.weights.iter().skip(k).step_by(outputs);
        of_output.fold(0.0_f64, |m, w| m.max(w.abs()))
    };
    let scale: Vec<f64> = (0..outputs)
        .map(|k| largest(k) / f64::from(i16::MAX))
        .collect();
    let table = (teacher.weights.iter())
        .zip(scale.iter().cycle())
        .map(|(weight, scale)| match *scale > 0.0 {
            // Within the counts by the choice of the scale.
            true => (weight / scale).round() as i16,
            false => 0,
        })
        .flat_map(i16::to_le_bytes)
        .collect();
    (scale, table)
}
