//! Where to teach.

use std::f64::consts::FRAC_PI_2;

use truepose::taught::polynomial::terms;

use crate::random::Random;

/// Points for each coefficient of a polynomial, where a whole grid would have more.
const PER_TERM: usize = 8;

/// The zeros of the Chebyshev polynomial of degree `count`, moved onto `[low, high]`: where to
/// measure for the polynomial through `count` points to stay nearest to the function. MRD
/// 5.195.
pub fn spacing([low, high]: [f64; 2], count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| {
        let angle = (2 * k + 1) as f64 / count as f64 * FRAC_PI_2;
        0.5 * ((high - low) * angle.cos() + low + high)
    })
}

/// Points for polynomials up to `degree`: the grid of Chebyshev points, one more along each
/// joint than the degree; of a grid with many more points than coefficients, a random part.
pub fn chebyshev(region: &[[f64; 2]], degree: usize) -> Vec<Vec<f64>> {
    let axes: Vec<Vec<f64>> = region
        .iter()
        .map(|&range| spacing(range, degree + 1).collect())
        .collect();
    let enough = PER_TERM * terms(region.len(), degree);
    let grid = u32::try_from(region.len())
        .ok()
        .and_then(|inputs| (degree + 1).checked_pow(inputs))
        .filter(|&count| count <= enough);
    match grid {
        Some(count) => (0..count)
            .map(|mut k| {
                let coordinate = |axis: &Vec<f64>| {
                    let x = axis.get(k % axis.len()).copied().unwrap_or_default();
                    k /= axis.len();
                    x
                };
                axes.iter().map(coordinate).collect()
            })
            .collect(),
        None => {
            let mut random = Random::new(5195, 0);
            let mut pick = |axis: &Vec<f64>| {
                let k = random.below(axis.len());
                axis.get(k).copied().unwrap_or_default()
            };
            (0..enough)
                .map(|_| axes.iter().map(&mut pick).collect())
                .collect()
        }
    }
}

/// `count` random points of the region.
pub fn scattered(region: &[[f64; 2]], count: usize) -> Vec<Vec<f64>> {
    let mut random = Random::new(5200, 0);
    let mut draw = |&[low, high]: &[f64; 2]| random.between(low, high);
    (0..count)
        .map(|_| region.iter().map(&mut draw).collect())
        .collect()
}
