//! How the predicted tool's error falls with the number of measured poses.

use nalgebra::DMatrix;

use super::design::{Blocks, Covariance, gain};

/// Standard deviation of the predicted tool point over the workspace, by the instrument's
/// noise alone, when the first `poses` of a plan are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Number of poses, those measured already not counted.
    pub poses: usize,
    /// Root mean square over the workspace, m.
    pub rms: f64,
    /// Largest over the workspace, m.
    pub max: f64,
}

/// The blocks in the order in which each adds most to those before it.
pub(super) fn order(blocks: &Blocks, fixed: &DMatrix<f64>) -> Vec<usize> {
    let (width, height) = (blocks.width, blocks.height);
    let size: f64 = blocks.numbers.iter().map(|x| x * x).sum();
    let hint = 1e-9 * size / width.max(1) as f64 + f64::MIN_POSITIVE;
    let mut information = fixed + DMatrix::identity(width, width) * hint;
    let mut left: Vec<usize> = (0..blocks.len()).collect();
    let mut order = Vec::with_capacity(left.len());
    while !left.is_empty() {
        let best = Covariance::of(information.clone()).and_then(|covariance| {
            let gains = left
                .iter()
                .map(|&i| gain(&covariance.spread(blocks.get(i)), height));
            gains.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
        });
        let next = left.remove(best.map_or(0, |(k, _)| k));
        blocks.inform(next, &mut information);
        order.push(next);
    }
    order
}

/// From the first number of poses that shows all parameters, in steps of a tenth.
pub(super) fn forecast(
    chosen: &Blocks,
    order: &[usize],
    before: &Blocks,
    places: &Blocks,
) -> Vec<Forecast> {
    let (width, total) = (chosen.width, order.len());
    let step = total.div_ceil(10).max(1);
    let mut information = DMatrix::zeros(width, width);
    (0..before.len()).for_each(|i| before.inform(i, &mut information));
    let mut forecasts = Vec::new();
    for (k, &i) in order.iter().enumerate() {
        chosen.inform(i, &mut information);
        let poses = k + 1;
        let rows = (before.len() + poses) * chosen.height;
        if rows < width || (poses % step != 0 && poses != total) {
            continue;
        }
        if let Some(covariance) = Covariance::of(information.clone()) {
            let variances = (0..places.len()).map(|p| covariance.variance(places.get(p)));
            let (sum, max) = variances.fold((0.0, 0.0_f64), |(s, m), v| (s + v, m.max(v)));
            forecasts.push(Forecast {
                poses,
                rms: (sum / places.len().max(1) as f64).sqrt(),
                max: max.sqrt(),
            });
        }
    }
    forecasts
}
