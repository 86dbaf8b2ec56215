//! Recursive identification: one equation after the other, MRD 4.3.4.
//!
//! The model is linearised once, the filter runs through all equations (4.104 to 4.106, with
//! parameters that wander 4.110 to 4.112), the model is linearised again where it came to,
//! until the estimate stays: an iterated Kalman filter. The covariance is carried as its square
//! root (Potter 1963): the drawing says a metre, the data microns, and the difference of
//! squares would lose the half of the digits that tells them apart.

use nalgebra::{DMatrix, DVector};

use super::arm::ArmModel;
use super::linearize::linearize;
use super::observation::{Observation, Sigmas};
use super::prior::Prior;
use super::solve::{BLOCK, Solved, scales};
use super::uncertainty::chi_square_tail;
use super::unknown::{Unknown, apply};

/// Deviation of what the drawing does not say, m and rad: a placement may be anywhere.
const ANYWHERE: f64 = 1.0;

/// A pass that moves no parameter by more than this share of its standard error is the last.
const STAYS: f64 = 1e-5;

const MAX_PASSES: usize = 40;

/// Chance below which innovations are not white.
const LEVEL: f64 = 0.01;

/// Rows apart up to which innovations are compared.
const LAGS: usize = 10;

/// What the filter did not expect, equation by equation, each over its own standard
/// deviation: white and of size one where model and noise are right (MRD 4.3.4). Counted from
/// where the measurement is surer than the prediction no longer, that is, once the parameters
/// have been learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovations {
    /// Number.
    pub count: usize,
    /// Their mean over its standard error.
    pub mean: f64,
    /// Root mean square; 1 where the declared noise is right.
    pub size: f64,
    /// Chance that white innovations of any size would have a mean as large.
    pub p_mean: f64,
    /// Chance that white innovations would hang together as much from row to row (Ljung and
    /// Box 1978, over up to ten rows).
    pub p_correlation: f64,
    /// Chance that white innovations would lean as much towards what any one parameter does,
    /// all parameters paid for.
    pub p_drift: f64,
    /// That parameter; `None` where nothing was learnt.
    pub drifts: Option<Unknown>,
}

/// Sums over the rows of what the innovations have of each parameter's own doing.
struct Leaning {
    sums: DVector<f64>,
    squares: DVector<f64>,
}

impl Leaning {
    fn new(unknowns: usize) -> Self {
        Self {
            sums: DVector::zeros(unknowns),
            squares: DVector::zeros(unknowns),
        }
    }

    /// Takes one row's in.
    fn add(&mut self, row: &DVector<f64>) {
        self.sums += row;
        self.squares += row.component_mul(row);
    }

    /// The parameter that leans most, and its chance.
    fn most(&self) -> Option<(usize, f64)> {
        let each = self.sums.iter().zip(self.squares.iter()).enumerate();
        let (k, z) = each
            .filter(|(_, (_, square))| **square > 0.0)
            .map(|(k, (sum, square))| (k, sum.abs() / square.sqrt()))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let chance = libm::erfc(z / std::f64::consts::SQRT_2);
        Some((k, (chance * self.sums.len() as f64).min(1.0)))
    }
}

impl Innovations {
    /// No test speaks against white noise; `None` where there are too few to say.
    pub fn white(&self) -> Option<bool> {
        (self.count > 4 * LAGS)
            .then_some(self.p_mean.min(self.p_correlation).min(self.p_drift) * 3.0 > LEVEL)
    }

    fn of(rows: &[Vec<f64>], leaning: &Leaning, unknowns: &[Unknown]) -> Self {
        let all = || rows.iter().flatten();
        let count = all().count();
        let n = count.max(1) as f64;
        let squares: f64 = all().map(|x| x * x).sum();
        let size = (squares / n).sqrt();
        let unit = size.max(f64::MIN_POSITIVE);
        let mean = all().sum::<f64>() / (unit * n.sqrt());
        // The same equation of rows that follow one another.
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let (mut statistic, mut freedom) = (0.0, 0);
        for equation in 0..width {
            let series: Vec<f64> = rows
                .iter()
                .filter_map(|r| r.get(equation).copied())
                .collect();
            let m = series.len();
            if m <= 2 * LAGS {
                continue;
            }
            let power: f64 = series.iter().map(|x| x * x).sum();
            for lag in 1..=LAGS {
                let pairs = series.iter().zip(series.iter().skip(lag));
                let r = pairs.map(|(a, b)| a * b).sum::<f64>() / power.max(f64::MIN_POSITIVE);
                statistic += (m * (m + 2)) as f64 * r * r / (m - lag) as f64;
                freedom += 1;
            }
        }
        Self {
            count,
            mean,
            size,
            p_mean: libm::erfc(mean.abs() / std::f64::consts::SQRT_2),
            p_correlation: chi_square_tail(statistic, freedom.max(1)),
            p_drift: leaning.most().map_or(1.0, |m| m.1),
            drifts: leaning.most().and_then(|m| unknowns.get(m.0).copied()),
        }
    }
}

/// Square root of a covariance, P = S Sᵀ, and the estimate.
struct State {
    root: DMatrix<f64>,
    estimate: DVector<f64>,
}

impl State {
    /// One equation `h x = z` of unit noise; returns the innovation and its variance. Potter.
    fn update(&mut self, h: &DVector<f64>, z: f64) -> (f64, f64) {
        let f = self.root.tr_mul(h);
        let variance = f.norm_squared() + 1.0;
        let innovation = z - h.dot(&self.estimate);
        let gain = &self.root * &f / variance;
        self.estimate.axpy(innovation, &gain, 1.0);
        let share = 1.0 / (1.0 + (1.0 / variance).sqrt());
        self.root.ger(-share, &gain, &f, 1.0);
        (innovation, variance)
    }

    /// Lets the parameters wander: P + diag(q²), by an orthogonal factorisation of the roots.
    fn wander(&mut self, q: &DVector<f64>) {
        let n = q.len();
        let mut stacked = DMatrix::zeros(2 * n, n);
        stacked.rows_mut(0, n).copy_from(&self.root.transpose());
        stacked.rows_mut(n, n).set_diagonal(q);
        self.root = stacked.qr().unpack_r().transpose();
    }
}

/// Identifies `unknowns`, all of which the observations must be able to tell apart, from one
/// observation after the other. On return `arm` holds the last estimate.
pub(super) fn filter(
    arm: &mut ArmModel,
    unknowns: &[Unknown],
    observations: &[&Observation],
    sigmas: Sigmas,
    prior: Prior<'_>,
    process_noise: f64,
) -> (Solved, Innovations) {
    let n = unknowns.len();
    let scales = scales(arm, unknowns);
    let wanders = DVector::from_fn(n, |k, _| match unknowns[k] {
        Unknown::Joint(..) => process_noise / scales[k],
        _ => 0.0,
    });
    let mut passes = 0;
    let (mut state, mut innovations, mut leaning);
    let converged = loop {
        state = start(arm, unknowns, &scales, prior);
        innovations = Vec::new();
        leaning = Leaning::new(n);
        for block in observations.chunks(BLOCK) {
            let linear = linearize(arm, unknowns, &scales, block, sigmas);
            let mut row = 0;
            for o in block {
                if process_noise > 0.0 {
                    state.wander(&wanders);
                }
                let mut seen = Vec::with_capacity(o.equations());
                let mut learnt = true;
                let mut along = DVector::zeros(n);
                for _ in 0..o.equations() {
                    let h = linear.jacobian.row(row).transpose();
                    let (innovation, variance) = state.update(&h, linear.residual[row]);
                    let unit = innovation / variance.sqrt();
                    along.axpy(unit, &h, 1.0);
                    seen.push(unit);
                    learnt &= variance < 2.0;
                    row += 1;
                }
                if learnt {
                    innovations.push(seen);
                    leaning.add(&along);
                }
            }
        }
        passes += 1;
        let step: Vec<f64> = state
            .estimate
            .iter()
            .zip(&scales)
            .map(|(x, s)| x * s)
            .collect();
        apply(arm, unknowns, &step);
        let errors = state.root.row_iter().map(|row| row.norm());
        let moved = state
            .estimate
            .iter()
            .zip(errors)
            .map(|(x, e)| (x / e).abs());
        let moved = moved.fold(0.0, f64::max);
        if moved < STAYS || passes >= MAX_PASSES || !moved.is_finite() {
            break moved < STAYS;
        }
    };
    let mut covariance = &state.root * state.root.transpose();
    for (column, by) in covariance.column_iter_mut().zip(&scales) {
        for (x, scale) in column.into_iter().zip(&scales) {
            *x *= scale * by;
        }
    }
    // R with RᵀR = P⁻¹, for the singular values of reports.
    let inverse = state.root.clone().try_inverse();
    let triangle = inverse.map_or_else(|| DMatrix::zeros(n, n), |s| s.qr().unpack_r());
    let residual = super::linearize::residuals(arm, observations, sigmas);
    let solved = Solved {
        unknowns: unknowns.to_vec(),
        covariance,
        triangle,
        cost: residual.norm_squared(),
        equations: residual.len(),
        iterations: passes,
        converged,
    };
    (solved, Innovations::of(&innovations, &leaning, unknowns))
}

/// Before any row: the drawing, seen from where the model is linearised.
fn start(arm: &ArmModel, unknowns: &[Unknown], scales: &[f64], prior: Prior<'_>) -> State {
    let n = unknowns.len();
    let mut root = DMatrix::zeros(n, n);
    let mut estimate = DVector::zeros(n);
    for (k, (unknown, scale)) in unknowns.iter().zip(scales).enumerate() {
        let expected = prior.expected(*unknown, arm);
        let (mean, deviation) = expected.unwrap_or((unknown.value(arm), ANYWHERE));
        estimate[k] = (mean - unknown.value(arm)) / scale;
        root[(k, k)] = deviation / scale;
    }
    State { root, estimate }
}
