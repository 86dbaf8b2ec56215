//! What only shows behind a geometric fit: joints that were read early, commands that fit
//! better than readings, an instrument that moved.

use nalgebra::{DMatrix, DVector, Vector3};
use truepose::Twist;

use super::placing::middle;
use super::{Finding, Kind};
use crate::diagnose::chance::ln_chi_square;
use crate::diagnose::validate::APART;
use crate::diagnose::whiteness::projected::Projected;
use crate::diagnose::whiteness::shapes::own_functions;
use crate::identify::Stage;
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::Observation;
use crate::identify::problem::Problem;
use crate::measurement::Dataset;

/// Chance below which something is found: 1e-8 after all trials.
const LN_LEVEL: f64 = -18.4;
/// Rows looked at.
const ROWS: usize = 600;
/// A row whose mean square is this many times the typical one is left out.
const GROSS: f64 = 16.0;
/// Times that rows are left out and the rest is fitted again.
const GROSS_PASSES: usize = 4;
/// Rows needed.
const LEAST_ROWS: usize = 20;
/// Part of what each joint's own share of the last move explains, that one common share has
/// to explain as well.
const COMMON: f64 = 0.6;
/// The root mean square residual sinks at least by this factor where joints were read early.
const FACTOR: f64 = 1.1;
/// Likewise where the instrument moved.
const MOVED_FACTOR: f64 = 1.2;
/// Rows on either side of a move of the instrument.
const LEAST_SIDE: usize = 8;

/// Looks for all three. `wrong`: rows that are known to be wrong.
pub(super) fn check(
    problem: &Problem,
    data: &Dataset,
    stage: &Stage,
    wrong: &[usize],
    findings: &mut Vec<Finding>,
) {
    let mut rows: Vec<&Observation> = problem.identify.iter().collect();
    rows.retain(|o| !wrong.contains(&o.row));
    rows.sort_by_key(|o| o.row);
    let stride = rows.len().div_ceil(ROWS).max(1);
    let mut rows: Vec<&Observation> = rows.into_iter().step_by(stride).collect();
    let project = |rows: &[&Observation]| {
        Projected::new(&stage.arm, &stage.fit.unknowns, rows, problem.sigmas)
    };
    let mut fitted = project(&rows);
    for _ in 0..GROSS_PASSES {
        // gross errors say nothing of what all rows do, and spoil the fit that shows them
        let squares: Vec<f64> = (0..rows.len()).map(|i| fitted.row_square(i)).collect();
        let typical = middle(&squares);
        let mut each = squares.iter();
        let before = rows.len();
        rows.retain(|_| each.next().is_none_or(|square| *square < GROSS * typical));
        if rows.len() == before {
            break;
        }
        fitted = project(&rows);
    }
    if rows.len() < LEAST_ROWS {
        return;
    }
    let joints = Columns::new(problem, stage, &rows);
    let by_commands = commands(data, &fitted, &joints, &rows);
    let nuisance = || own_functions(&stage.arm, &rows, problem.sigmas);
    let early = early(&fitted, &joints, &rows, nuisance);
    let moved = instrument(problem, &fitted, &joints, &rows);
    findings.extend(early);
    findings.extend(by_commands);
    findings.extend(moved);
}

/// Whitened displacements of every row by each joint and by the base.
struct Columns {
    /// Equations x joints.
    joints: DMatrix<f64>,
    /// Equations x 6.
    base: DMatrix<f64>,
    starts: Vec<usize>,
}

impl Columns {
    fn new(problem: &Problem, stage: &Stage, rows: &[&Observation]) -> Self {
        let arm = &stage.arm;
        let n = arm.joint_count();
        let mut starts = vec![0];
        for o in rows {
            starts.push(starts.last().copied().unwrap_or(0) + o.equations());
        }
        let equations = starts.last().copied().unwrap_or(0);
        let mut joints = DMatrix::zeros(equations, n);
        let mut base = DMatrix::zeros(equations, 6);
        let mut evaluator = Evaluator::new(arm, problem.sigmas);
        for (o, pair) in rows.iter().zip(starts.windows(2)) {
            let (from, to) = (pair[0], pair[1]);
            evaluator.each_posture(o, |evaluator, posture| {
                for j in 0..n {
                    let out = &mut joints.as_mut_slice()[j * equations + from..j * equations + to];
                    posture.spread(evaluator, &evaluator.joint_twist(j), out);
                }
                let origin = arm
                    .bases
                    .get(o.session)
                    .map_or_else(Vector3::zeros, |b| b.translation);
                for axis in 0..6 {
                    let mut unit = Vector3::zeros();
                    unit[axis % 3] = 1.0;
                    let twist = if axis < 3 {
                        Twist::new(unit, Vector3::zeros())
                    } else {
                        let lever = evaluator.tool_point() - origin;
                        Twist::new(Vector3::zeros(), unit).at(&lever)
                    };
                    let out =
                        &mut base.as_mut_slice()[axis * equations + from..axis * equations + to];
                    posture.spread(evaluator, &twist, out);
                }
            });
        }
        Self {
            joints,
            base,
            starts,
        }
    }

    fn of_row(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i]..self.starts[i + 1]
    }

    /// Columns of `of` times a function of the row.
    fn times(
        &self,
        of: &DMatrix<f64>,
        rows: usize,
        value: impl Fn(usize, usize) -> f64,
    ) -> DMatrix<f64> {
        let mut product = of.clone();
        for k in 0..of.ncols() {
            for i in 0..rows {
                let factor = value(i, k);
                for e in self.of_row(i) {
                    product[(e, k)] *= factor;
                }
            }
        }
        product
    }
}

/// Logarithm of the chance that columns with `freedom` degrees explain `gain` of a sum of
/// squares `total` with `left` degrees in noise of any size (likelihood ratio).
fn ln_chance(total: f64, gain: f64, left: usize, freedom: usize) -> f64 {
    let rest = (total - gain).max(f64::MIN_POSITIVE);
    let twice = left as f64 * (total / rest).ln();
    ln_chi_square(twice, freedom as f64)
}

fn early(
    fitted: &Projected,
    joints: &Columns,
    rows: &[&Observation],
    nuisance: impl Fn() -> DMatrix<f64>,
) -> Option<Finding> {
    let n = joints.joints.ncols();
    let travel = |i: usize, j: usize| rows[i].travel.get(j).copied().unwrap_or(0.0);
    if (0..rows.len()).all(|i| (0..n).all(|j| travel(i, j).abs() <= 0.0)) {
        return None;
    }
    // The last move goes with the joint that it ended at: what follows the joint is not its.
    let free = fitted.beyond(&nuisance());
    if free.freedom() < 4 * n + LEAST_ROWS {
        return None;
    }
    let each = joints.times(&joints.joints, rows.len(), travel);
    let mut all = DMatrix::zeros(each.nrows(), 1);
    for column in each.column_iter() {
        let mut sum = all.column_mut(0);
        sum += column;
    }
    let signs = joints.times(&joints.joints, rows.len(), |i, j| {
        let dir = rows[i].direction.get(j).copied().unwrap_or(0.0);
        if rows
            .iter()
            .any(|o| o.direction.iter().any(|d| d.abs() > 0.5))
        {
            dir
        } else {
            let d = travel(i, j);
            if d.abs() > 0.0 { d.signum() } else { 0.0 }
        }
    });
    let (gain, size) = free.explained_by_one(&all);
    let total = free.square();
    let ln_p = ln_chance(total, gain, free.freedom(), 1);
    let after = (total - gain).max(0.0);
    let factor = (total / after.max(f64::MIN_POSITIVE)).sqrt();
    let by_each = free.explained(&each);
    let by_signs = free.explained(&signs);
    let sign_is_right = size > 0.0;
    if ln_p > LN_LEVEL
        || factor < FACTOR
        || gain < COMMON * by_each
        || gain < by_signs
        || !sign_is_right
    {
        return None;
    }
    // the same with the moves of another row
    let half = rows.len() / 2;
    let strange = joints.times(&joints.joints, rows.len(), |i, j| {
        travel((i + half) % rows.len(), j)
    });
    let mut control = DMatrix::zeros(each.nrows(), 1);
    for column in strange.column_iter() {
        let mut sum = control.column_mut(0);
        sum += column;
    }
    let (by_strange, _) = free.explained_by_one(&control);
    let deviation = |square: f64| (square / free.freedom() as f64).sqrt();
    Some(Finding {
        kind: Kind::EarlyReading,
        rows: Vec::new(),
        columns: (1..=n).map(|j| format!("q{j}")).collect(),
        saw: format!(
            "the joints lack {:.2} mrad of their last move, all in the same proportion: they \
             were probably read before the arm had settled. This one number explains {:.0} % of \
             what the geometry leaves, the signs of the moves (backlash) {:.0} %, the moves of \
             other rows {:.1} %",
            size * 1e3,
            100.0 * gain / total,
            100.0 * by_signs / total,
            100.0 * by_strange / total
        ),
        advice: "use the commanded joints, or wait before reading".to_owned(),
        misfit: [deviation(total), deviation(after)],
        p_value: Some(ln_p.exp()),
    })
}

fn commands(
    data: &Dataset,
    fitted: &Projected,
    joints: &Columns,
    rows: &[&Observation],
) -> Option<Finding> {
    let command = |o: &Observation| -> Option<Vec<f64>> {
        let at = data.rows.binary_search_by_key(&o.row, |r| r.number).ok()?;
        data.rows.get(at)?.q_command.clone()
    };
    let differences: Vec<Vec<f64>> = rows
        .iter()
        .map(|o| {
            Some(
                command(o)?
                    .iter()
                    .zip(&o.q)
                    .map(|(c, q)| c - q)
                    .collect::<Vec<f64>>(),
            )
        })
        .collect::<Option<_>>()?;
    let mut change = DVector::zeros(joints.joints.nrows());
    for (i, difference) in differences.iter().enumerate() {
        for e in joints.of_row(i) {
            for (j, d) in difference.iter().enumerate() {
                change[e] += joints.joints[(e, j)] * d;
            }
        }
    }
    let with_commands = fitted.shifted(&change);
    let (before, after) = (fitted.square(), with_commands.square());
    let factor = (before / after.max(f64::MIN_POSITIVE)).sqrt();
    // rows that come nearer: a coin would do it for half of them
    let nearer = (0..rows.len())
        .filter(|&i| with_commands.row_square(i) < fitted.row_square(i))
        .count() as f64;
    let count = rows.len() as f64;
    let z = (2.0 * nearer - count) / count.sqrt();
    let ln_p = if z > 0.0 {
        ln_chi_square(z * z, 1.0) - std::f64::consts::LN_2
    } else {
        0.0
    };
    if factor < 1.2 || ln_p > (1e-4_f64).ln() {
        return None;
    }
    let mut sizes: Vec<f64> = differences.iter().flatten().map(|d| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let largest = sizes.get(sizes.len() * 95 / 100).copied().unwrap_or(0.0);
    let deviation = |square: f64| (square / fitted.freedom() as f64).sqrt();
    Some(Finding {
        kind: Kind::CommandsFitBetter,
        rows: Vec::new(),
        columns: (1..=joints.joints.ncols())
            .map(|j| format!("qcmd{j}"))
            .collect(),
        saw: format!(
            "with the commanded joints in place of the readings the residual is {factor:.1} \
             times smaller and {:.0} % of the rows come nearer; the two differ by up to {:.2} \
             mrad (95 % of the rows)",
            100.0 * nearer / count,
            largest * 1e3
        ),
        advice: "identify from the commanded joints".to_owned(),
        misfit: [deviation(before), deviation(after)],
        p_value: Some(ln_p.exp()),
    })
}

/// Whether row `i` lies among the readings of `others`, or beyond them by no more than a fold of
/// rows that are held back may.
fn near(rows: &[&Observation], others: &[usize], i: usize) -> bool {
    rows[i].q.iter().enumerate().all(|(j, q)| {
        let readings = others.iter().map(|&k| rows[k].q[j]);
        let [low, high] = readings.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
            [a.min(x), b.max(x)]
        });
        let margin = APART * (high - low);
        *q >= low - margin && *q <= high + margin
    })
}

fn instrument(
    problem: &Problem,
    fitted: &Projected,
    joints: &Columns,
    rows: &[&Observation],
) -> Option<Finding> {
    let n = rows.len();
    let total = fitted.square();
    let left = fitted.freedom();
    let mut best: Option<(f64, usize, usize)> = None;
    for session in 0..problem.sessions.len().max(1) {
        let of_session = |i: usize| rows[i].session == session;
        // from the last row back: all rows of the session from `i` on have another base
        let mut gram = DMatrix::zeros(6, 6);
        let mut taken = DMatrix::zeros(fitted.basis.ncols(), 6);
        let mut score = DVector::zeros(6);
        let seen: usize = (0..n).filter(|&i| of_session(i)).count();
        let mut behind = 0;
        for i in (0..n).rev().filter(|&i| of_session(i)) {
            let range = joints.of_row(i);
            let block = joints.base.rows(range.start, range.len());
            gram += block.tr_mul(&block);
            taken += fitted.basis.rows(range.start, range.len()).tr_mul(&block);
            score += block.tr_mul(&fitted.residual.rows(range.start, range.len()));
            behind += 1;
            if behind < LEAST_SIDE || seen - behind < LEAST_SIDE {
                continue;
            }
            let free = &gram - taken.tr_mul(&taken);
            let Some(gain) = gain_of(&free, &score) else {
                continue;
            };
            if best.is_none_or(|b| gain > b.0) {
                best = Some((gain, i, session));
            }
        }
    }
    let (gain, at, session) = best?;
    // what the arm does in poses that nothing before came near is no placement
    let (later, earlier): (Vec<usize>, Vec<usize>) = (0..n)
        .filter(|&i| rows[i].session == session)
        .partition(|&i| i >= at);
    let known = later.iter().filter(|&&i| near(rows, &earlier, i)).count();
    if known < LEAST_SIDE {
        return None;
    }
    let gain = gain.min(total);
    let ln_p = ln_chance(total, gain, left, 6) + (n as f64).ln();
    let factor = (total / (total - gain).max(f64::MIN_POSITIVE)).sqrt();
    if ln_p > LN_LEVEL || factor < MOVED_FACTOR {
        return None;
    }
    let after = |i: usize| f64::from(u8::from(rows[i].session == session && i >= at));
    // A joint that gave way, or a base that drifts, is the arm's.
    let step = joints.times(&joints.joints, n, |i, _| after(i));
    let by_joint = (0..step.ncols())
        .map(|j| fitted.explained_by_one(&step.columns(j, 1).into_owned()).0)
        .fold(0.0, f64::max);
    let place = |i: usize| 2.0 * i as f64 / n.max(2) as f64 - 1.0;
    let jump = joints.times(&joints.base, n, |i, _| after(i));
    let straight = joints.times(&joints.base, n, |i, _| place(i));
    let bent = joints.times(&joints.base, n, |i, _| place(i) * place(i));
    let drift = fitted.explained(&beside(&straight, &bent));
    // a drift with a pause in it jumps as well, and goes on drifting
    let both = fitted.explained(&beside(&jump, &straight));
    if by_joint > 0.8 * gain || drift > 0.95 * gain || both > 1.1 * gain {
        return None;
    }
    let row = rows[at].row;
    let before = at
        .checked_sub(1)
        .and_then(|i| rows.get(i))
        .map_or(row, |o| o.row);
    let deviation = |square: f64| (square.max(0.0) / left as f64).sqrt();
    Some(Finding {
        kind: Kind::InstrumentMoved,
        rows: vec![row],
        columns: Vec::new(),
        saw: format!(
            "between rows {before} and {row} the instrument's frame moved against the robot: a \
             placement of its own from there on makes the residual {factor:.2} times smaller \
             ({:.0} % of its square; a step of one joint {:.0} %)",
            100.0 * gain / total,
            100.0 * by_joint / total
        ),
        advice: format!("give the rows from {row} on another number in a column `session`"),
        misfit: [deviation(total), deviation(total - gain)],
        p_value: Some(ln_p.exp()),
    })
}

/// Two sets of columns as one.
fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut all = a.clone().resize_horizontally(a.ncols() + b.ncols(), 0.0);
    all.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    all
}

/// What columns with Gram matrix `gram` explain, along directions that can be told.
fn gain_of(gram: &DMatrix<f64>, score: &DVector<f64>) -> Option<f64> {
    let scale = gram.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt());
    let mut scaled = gram.clone();
    for i in 0..scaled.nrows() {
        for k in 0..scaled.ncols() {
            scaled[(i, k)] /= scale[i] * scale[k];
        }
        scaled[(i, i)] += 1e-6;
    }
    let score = score.component_div(&scale);
    let solved = scaled.cholesky()?.solve(&score);
    Some(solved.dot(&score))
}
