//! The residual, and what candidates can take from it once everything that the model already
//! has is allowed to readjust.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use truepose::Twist;
use truepose::effects::{Effect, ONE, Place, Unnamed};

use super::chance::ln_p_of_f;
use super::curve;
use super::hypothesis::{Hypothesis, Members};
use crate::identify::arm::ArmModel;
use crate::identify::evaluator::Evaluator;
use crate::identify::linearize::Linear;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::product::{across, gradient, gram_of};

/// A plausible effect moves the tool by this much, root mean square over the rows, m.
const PLAUSIBLE: f64 = 2e-3;

/// Plausible amplitudes of a direction that would show by fewer standard deviations than
/// this could not be seen in these poses: the direction is dropped.
pub(super) const SHOWS: f64 = 3.0;

/// The linear problem after a fit: its residual and an orthonormal basis of what the fitted
/// columns can express.
pub struct Space {
    /// Residual, orthogonal to the basis.
    pub residual: DVector<f64>,
    /// Orthonormal, equations x fitted unknowns.
    pub basis: DMatrix<f64>,
    /// Squared norm of the residual.
    pub rss: f64,
    /// Independent equations left for judging.
    pub freedom: f64,
    /// Equations that count as independent.
    pub effective: f64,
}

/// Candidate columns, side by side.
pub struct Columns {
    /// Equations x all values of all candidates, each scaled to a plausible amplitude.
    pub matrix: DMatrix<f64>,
    /// First column and number of columns of each candidate.
    pub groups: Vec<(usize, usize)>,
}

impl Columns {
    /// Those of some candidates.
    pub fn select(&self, candidates: &[usize]) -> Self {
        let mut groups = Vec::with_capacity(candidates.len());
        let mut all = Vec::new();
        for &(start, len) in candidates.iter().map(|&i| &self.groups[i]) {
            groups.push((all.len(), len));
            all.extend(start..start + len);
        }
        Self {
            matrix: self.matrix.select_columns(&all),
            groups,
        }
    }
}

/// What one candidate would do.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// Reduction of the squared residual.
    pub reduction: f64,
    /// Directions that it does so with.
    pub directions: f64,
    /// Logarithm of the probability of that reduction by chance.
    pub ln_p: f64,
    /// Gain in N ln RSS less k ln N (BIC), without prior weights.
    pub gain: f64,
}

impl Space {
    /// After a fit with the columns of `linear`. Errors of several targets at one pose move
    /// together, so a pose counts as at most six equations.
    pub fn new(linear: &Linear, observations: &[&Observation]) -> Self {
        let basis = linear.jacobian.clone().qr().q();
        Self::on(basis, &linear.residual, observations)
    }

    fn on(basis: DMatrix<f64>, residual: &DVector<f64>, observations: &[&Observation]) -> Self {
        let along = basis.tr_mul(residual);
        let residual = residual - &basis * along;
        let effective: usize = observations.iter().map(|o| o.equations().min(6)).sum();
        let effective = effective as f64;
        Self {
            rss: residual.norm_squared(),
            residual,
            freedom: (effective - basis.ncols() as f64).max(1.0),
            effective,
            basis,
        }
    }

    /// Scores of all candidates.
    pub fn scores(&self, columns: &Columns) -> Vec<Score> {
        let along = across(&self.basis, &columns.matrix);
        let with_residual = gradient(&columns.matrix, &self.residual);
        columns
            .groups
            .iter()
            .map(|&(start, len)| {
                let gram = gram_of(&columns.matrix, start, len) - gram_of(&along, start, len);
                let z = with_residual.rows(start, len).into_owned();
                let (reduction, directions) = reduction(gram, &z);
                self.judge(reduction, directions)
            })
            .collect()
    }

    /// Probability and gain of a reduction of the squared residual by `directions` columns.
    pub fn judge(&self, reduction: f64, directions: f64) -> Score {
        self.judge_from(self.rss, reduction, directions)
    }

    /// The same from another squared residual than the one that is left here.
    pub(super) fn judge_from(&self, rss: f64, reduction: f64, directions: f64) -> Score {
        let left = (rss - reduction).max(rss * 1e-12).max(1e-300);
        let denominator = (self.freedom - directions).max(1.0);
        let f = (reduction / directions.max(1.0)) / (left / denominator);
        let ln_p = if directions > 0.0 {
            ln_p_of_f(f, directions, denominator)
        } else {
            0.0
        };
        Score {
            reduction,
            directions,
            ln_p,
            gain: self.effective * (rss / left).ln() - directions * self.effective.ln(),
        }
    }

    /// Largest cosine between directions of two candidates, beyond what the model has.
    pub fn similarity(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
        self.cosines(a, b).first().copied().unwrap_or(0.0)
    }

    /// Cosines of the principal angles between two candidates, beyond what the model has, the
    /// largest first.
    pub fn cosines(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> Vec<f64> {
        let orthonormal = |m: &DMatrix<f64>| {
            let rest = m - &self.basis * self.basis.tr_mul(m);
            let svd = rest.svd(true, false);
            let largest = svd.singular_values.max();
            let kept: Vec<usize> = (0..svd.singular_values.len())
                .filter(|&i| svd.singular_values[i] > 1e-6 * largest.max(1e-12))
                .collect();
            svd.u.map(|u| u.select_columns(&kept))
        };
        match (orthonormal(a), orthonormal(b)) {
            (Some(a), Some(b)) if a.ncols() > 0 && b.ncols() > 0 => {
                let cosines = a.tr_mul(&b).singular_values();
                cosines.iter().map(|c| c.min(1.0)).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// Reduction of the squared residual, and the directions that show, from a candidate's
/// projected Gram matrix and its products with the residual.
pub(super) fn reduction(gram: DMatrix<f64>, z: &DVector<f64>) -> (f64, f64) {
    if gram.ncols() == 1 {
        return match gram[(0, 0)] {
            g if g > SHOWS * SHOWS => (z[0] * z[0] / g, 1.0),
            _ => (0.0, 0.0),
        };
    }
    let (mut reduction, mut directions) = (0.0, 0.0);
    let eigen = SymmetricEigen::new(gram);
    for (value, vector) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value > SHOWS * SHOWS {
            let along = vector.dot(z);
            reduction += along * along / value;
            directions += 1.0;
        }
    }
    (reduction, directions)
}

/// What any function of the row times one motion of the arm could do: all that is needed of
/// each row. A row that depends on several postures counts as one a posture here.
pub struct Moving {
    /// Coordinates of the motion's column in the fitted space, fitted unknowns x rows.
    pub(super) along: DMatrix<f64>,
    /// Squared length of the column, product with the residual, squared motion of the tool.
    pub(super) rows: DMatrix<f64>,
    /// Two postures of one row, and the product of their columns.
    pub(super) shared: Vec<(usize, usize, f64)>,
}

/// Every posture of every row: what a function of the row is evaluated at.
pub(super) fn postures<'o>(observations: &[&'o Observation]) -> Vec<&'o Observation> {
    observations.iter().flat_map(|o| o.postures()).collect()
}

impl Moving {
    /// Of what `place` moves.
    pub fn new(
        arm: &ArmModel,
        place: Place<f64>,
        space: &Space,
        observations: &[&Observation],
        sigmas: Sigmas,
    ) -> Self {
        let mut unit = Effect::Unnamed(Unnamed::new(place, [ONE; 2], [[0.0; 3]; 2]));
        arm.attach(&mut unit);
        let p = space.basis.ncols();
        let count: usize = observations.iter().map(|o| o.postures().count()).sum();
        let mut along = DMatrix::zeros(p, count);
        let mut rows = DMatrix::zeros(count, 3);
        let mut shared = Vec::new();
        let mut evaluator = Evaluator::new(arm, sigmas);
        let (mut i, mut start) = (0, 0);
        for o in observations {
            let count = o.equations();
            let first = i;
            let mut own = Vec::new();
            evaluator.each_posture(o, |evaluator, posture| {
                let mut twist = Twist::zero();
                evaluator.effect_twists(posture.at, &unit, |_, found| twist = found);
                let mut column = vec![0.0; count];
                posture.spread(evaluator, &twist, &mut column);
                for (row, x) in column.iter().enumerate() {
                    rows[(i, 0)] += x * x;
                    rows[(i, 1)] += x * space.residual[start + row];
                }
                rows[(i, 2)] = twist.linear.norm_squared();
                for k in 0..p {
                    let basis = &space.basis.as_slice()[k * space.basis.nrows() + start..][..count];
                    along[(k, i)] = basis.iter().zip(&column).map(|(a, b)| a * b).sum();
                }
                if i == first {
                    own = column;
                } else {
                    let product = own.iter().zip(&column).map(|(a, b)| a * b).sum();
                    shared.push((first, i, product));
                }
                i += 1;
            });
            start += count;
        }
        Self {
            along,
            rows,
            shared,
        }
    }

    /// By how much each function (a column of `values`, one entry a posture) would reduce the
    /// squared residual; zero where no plausible amplitude of it would show.
    pub fn reductions(&self, values: &DMatrix<f64>) -> Vec<f64> {
        let squares = values.map(|v| v * v);
        let lengths = across(&squares, &self.rows);
        let products = across(values, &self.rows);
        let along = &self.along * values;
        let n = values.nrows().max(1) as f64;
        (0..values.ncols())
            .map(|k| {
                let both = |&(a, b, product): &(usize, usize, f64)| {
                    2.0 * product * values[(a, k)] * values[(b, k)]
                };
                let length = lengths[(k, 0)] + self.shared.iter().map(both).sum::<f64>();
                let left = length - along.column(k).norm_squared();
                let moved = lengths[(k, 2)] / n;
                // what is left of a column that moves the tool by a plausible amount
                if moved > 1e-24 && left * PLAUSIBLE * PLAUSIBLE / moved > SHOWS * SHOWS {
                    products[(k, 1)].powi(2) / left
                } else {
                    0.0
                }
            })
            .collect()
    }
}

/// Columns of all hypotheses at the arm as it is, whitened, each scaled to a plausible
/// displacement of the tool.
pub fn columns(
    arm: &ArmModel,
    hypotheses: &[&Hypothesis],
    observations: &[&Observation],
    sigmas: Sigmas,
) -> Columns {
    let rows: usize = observations.iter().map(|o| o.equations()).sum();
    let mut groups = Vec::with_capacity(hypotheses.len());
    let mut total = 0;
    for hypothesis in hypotheses {
        groups.push((total, hypothesis.len()));
        total += hypothesis.len();
    }
    let mut matrix = DMatrix::zeros(rows, total);
    let mut squares = vec![0.0; total];
    let mut evaluator = Evaluator::new(arm, sigmas);
    let mut start = 0;
    for o in observations {
        let end = start + o.equations();
        evaluator.each_posture(o, |evaluator, posture| {
            let at = posture.at;
            let mut column = 0;
            for hypothesis in hypotheses {
                let mut spread = |evaluator: &Evaluator<'_>, column: usize, twist: &Twist<f64>| {
                    let cells = column * rows + start..column * rows + end;
                    posture.spread(evaluator, twist, &mut matrix.as_mut_slice()[cells]);
                    squares[column] += twist.linear.norm_squared();
                };
                match &hypothesis.members {
                    Members::Curve(_) => {
                        let joint = hypothesis.joint.unwrap_or(0);
                        let twist = evaluator.joint_twist(joint);
                        for (k, value) in curve::stand_ins(at.q[joint]).into_iter().enumerate() {
                            spread(evaluator, column + k, &twist.scaled(value));
                        }
                        column += curve::COARSE;
                    }
                    Members::EarlyReading => {
                        spread(evaluator, column, &evaluator.early_twist(at));
                        column += 1;
                    }
                    Members::Effects(effects) => {
                        for effect in effects {
                            let mut twists = Vec::with_capacity(4);
                            evaluator.effect_twists(at, effect, |_, twist| twists.push(twist));
                            for twist in twists {
                                spread(evaluator, column, &twist);
                                column += 1;
                            }
                        }
                    }
                }
            }
        });
        start = end;
    }
    for (hypothesis, &(start, len)) in hypotheses.iter().zip(&groups) {
        // what a curve may have is known
        if matches!(hypothesis.members, Members::Curve(_)) {
            continue;
        }
        let squares = squares[start..start + len].iter();
        for (mut column, square) in matrix
            .columns_mut(start, len)
            .column_iter_mut()
            .zip(squares)
        {
            let rms = (square / observations.len().max(1) as f64).sqrt();
            let scale = if rms > 1e-12 { PLAUSIBLE / rms } else { 0.0 };
            column.scale_mut(scale);
        }
    }
    Columns { matrix, groups }
}
