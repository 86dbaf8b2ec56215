//! What gave an effect away: the residual of the held-back rows against the effect's own
//! covariate, without it and with it; who else stood for election; the periodogram.

use truepose::effects::Effect;

use super::diagnosed::alternative;
use super::schema::Alternative;
use super::words::words;
use crate::diagnose::control::Control;
use crate::diagnose::hypothesis::Members;
use crate::diagnose::search::Ranked;
use crate::diagnose::{Diagnosis, Named};
use crate::identify::arm::ArmModel;
use crate::identify::evaluator::Evaluator;
use crate::identify::noise::{fitted, unseen};
use crate::identify::observation::{Kind, Observation, Sigmas};

/// Rows whose tool a joint moves less than this share of its typical way say little of it.
const LEVER: f64 = 0.3;

/// Panels of one effect at most: of a group, those that move the tool most.
const PANELS: usize = 6;

/// Lowest order of a periodogram, periods a turn.
const LOWEST: f64 = 0.5;

/// Residuals in metres.
const UNIT: Sigmas = Sigmas::UNIT;

/// What is shown of one effect that was added.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// The effect, as a person says it.
    pub label: String,
    /// The same as an engineer would put it.
    pub words: String,
    /// Rms of the verify rows without it and with it, in the order of addition, mm.
    pub rms_mm: [f64; 2],
    /// Held-back rms error with over without it: random folds, blocks in time, in joint space.
    pub held_back: Option<[f64; 3]>,
    /// Logarithm of the probability by chance, all candidates considered.
    pub ln_p: f64,
    /// What else it could have been.
    pub rivals: Vec<Alternative>,
    /// Itself with what it depends on shuffled.
    pub control: Option<Control>,
    /// Why its name is no more than what it looks like.
    pub doubt: Option<String>,
    /// Residual against the covariate, a panel an effect of the group.
    pub panels: Vec<Panel>,
    /// The best candidates at the step that added it.
    pub ranking: Vec<Ranked>,
    /// Periods a turn and the share of the joint's squared error that they take, in percent;
    /// empty for effects without an order.
    pub periodogram: Vec<[f64; 2]>,
}

/// One plot: a point a held-back row.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What the effect depends on, with unit.
    pub x: String,
    /// What it shows in, with unit.
    pub y: String,
    /// Covariate, residual without the effect, residual of the complete model.
    pub points: Vec<[f64; 3]>,
}

/// Of everything that `diagnosis` found, in its order.
pub(super) fn evidence(diagnosis: &Diagnosis) -> Vec<Evidence> {
    let identified = &diagnosis.identified;
    let sigmas = identified.problem.sigmas;
    let complete = &identified.calibration.complete.arm;
    let verify = unseen(&identified.problem, &identified.calibration);
    let fitted = fitted(&identified.problem, &identified.calibration);
    diagnosis
        .named
        .iter()
        .map(|named| {
            let mut parts = parts(named, complete);
            let size = |part: &Part| moved(&part.without, complete, &verify);
            parts.sort_by(|a, b| size(b).total_cmp(&size(a)));
            parts.truncate(PANELS);
            let periodogram = match (&named.step.hypothesis.order, parts.first()) {
                (Some(order), Some(part)) => periodogram(part, complete, sigmas, &fitted, *order),
                _ => Vec::new(),
            };
            Evidence {
                label: named.step.hypothesis.label(),
                words: words(named, &identified.calibration.complete),
                rms_mm: named.rms.map(|rms| 1e3 * rms),
                held_back: named.step.held_back,
                ln_p: named.step.ln_p,
                rivals: named.rivals.iter().map(alternative).collect(),
                control: named.control,
                doubt: named.doubt.clone(),
                panels: parts
                    .iter()
                    .map(|part| panel(part, complete, sigmas, &verify))
                    .filter(|panel| !panel.points.is_empty())
                    .collect(),
                ranking: named.step.ranking.clone(),
                periodogram,
            }
        })
        .collect()
}

/// One effect of a group, and the complete model without it.
struct Part {
    kind: &'static str,
    joint: Option<usize>,
    from: Option<usize>,
    sensor: usize,
    without: ArmModel,
}

fn parts(named: &Named, complete: &ArmModel) -> Vec<Part> {
    let hypothesis = &named.step.hypothesis;
    let without = |leave: &dyn Fn(&Effect<'static, f64>) -> bool| {
        let mut arm = complete.clone();
        arm.effects.retain(|e| !leave(e));
        arm.bake();
        arm
    };
    let sensor = named
        .effects
        .first()
        .and_then(|e| e.model().selector().sensor);
    let part = |joint, without| Part {
        kind: hypothesis.kind,
        joint,
        from: hypothesis.from,
        sensor: sensor.map_or(0, usize::from),
        without,
    };
    match &hypothesis.members {
        Members::EarlyReading => {
            let mut arm = complete.clone();
            arm.early_reading = 0.0;
            vec![part(None, arm)]
        }
        Members::Curve(_) => {
            let joint = hypothesis.joint;
            let own = |e: &Effect<'static, f64>| match e {
                Effect::JointCurve(c) => Some(usize::from(c.joint)) == joint,
                _ => false,
            };
            vec![part(joint, without(&own))]
        }
        Members::Effects(_) => {
            // effects of one joint act together: levers, harmonics, components
            let mut joints: Vec<Option<usize>> =
                named.effects.iter().map(|e| e.model().joint()).collect();
            joints.sort_unstable();
            joints.dedup();
            joints
                .into_iter()
                .map(|joint| {
                    let leave = |e: &Effect<'static, f64>| {
                        e.model().joint() == joint && named.effects.contains(e)
                    };
                    part(joint, without(&leave))
                })
                .collect()
        }
    }
}

/// Root of the sum of squares of what the effect does to the predictions.
fn moved(without: &ArmModel, complete: &ArmModel, observations: &[&Observation]) -> f64 {
    let (mut a, mut b) = (
        Evaluator::new(without, UNIT),
        Evaluator::new(complete, UNIT),
    );
    observations
        .iter()
        .map(|o| (b.observe(o).translation - a.observe(o).translation).norm_squared())
        .sum::<f64>()
        .sqrt()
}

/// Measured minus predicted, one an equation.
fn residual(evaluator: &mut Evaluator<'_>, o: &Observation) -> Vec<f64> {
    let mut out = vec![0.0; o.equations()];
    evaluator.observe(o);
    evaluator.residual(o, &mut out);
    out
}

/// The same of what is a length, and of bearings as lengths across the line of sight, m.
fn lengths(evaluator: &mut Evaluator<'_>, o: &Observation) -> Vec<f64> {
    let all = residual(evaluator, o);
    let kinds = o
        .kinds()
        .flat_map(|(kind, count)| std::iter::repeat_n(kind, count));
    let ways = evaluator.ways(o);
    all.into_iter()
        .zip(kinds)
        .zip(ways)
        .filter(|((_, kind), _)| *kind != Kind::Orientation)
        .map(|((x, _), way)| x * way)
        .collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn panel(part: &Part, complete: &ArmModel, sigmas: Sigmas, observations: &[&Observation]) -> Panel {
    let single = of_one_posture(observations);
    match part.joint {
        Some(joint) if turns_the_joint(part.kind) && !single.is_empty() => {
            joint_panel(part, joint, complete, sigmas, &single)
        }
        _ => tool_panel(part, complete, observations),
    }
}

/// Rows that show an error of a joint at one reading: a distance has it at two.
fn of_one_posture<'o>(observations: &[&'o Observation]) -> Vec<&'o Observation> {
    let single = |o: &&Observation| o.postures().count() == 1;
    observations.iter().copied().filter(single).collect()
}

/// Effects that add to a joint's own reading: their residual is an angle (or way) of it.
fn turns_the_joint(kind: &str) -> bool {
    matches!(
        kind,
        "joint-gain"
            | "gear-eccentricity"
            | "gear-ripple"
            | "joint-curve"
            | "joint-compliance"
            | "tool-load"
            | "backlash"
            | "thermal-drift"
            | "time-drift"
            | "warm-up"
            | "step-change"
            | "instrument-moved"
            | "joint-coupling"
    )
}

/// Degrees or mm of a joint, with the factor from SI.
fn unit(arm: &ArmModel, joint: usize) -> (&'static str, f64) {
    match arm.joints[joint].kind {
        truepose::JointKind::Revolute => ("deg", 1.0_f64.to_degrees()),
        truepose::JointKind::Prismatic => ("mm", 1e3),
    }
}

/// A row's own measure of a joint's error (the least-squares one), without and with the
/// effect, and the squared way that the joint moves the tool per unit.
fn apparent(
    without: &mut Evaluator<'_>,
    complete: &mut Evaluator<'_>,
    joint: usize,
    o: &Observation,
) -> [f64; 3] {
    let before = residual(without, o);
    let after = residual(complete, o);
    let mut column = vec![0.0; o.equations()];
    complete.spread(o, &complete.joint_twist(joint), &mut column);
    let length = dot(&column, &column);
    if length > 0.0 {
        [
            dot(&column, &before) / length,
            dot(&column, &after) / length,
            length,
        ]
    } else {
        [0.0, 0.0, 0.0]
    }
}

fn joint_panel(
    part: &Part,
    joint: usize,
    complete: &ArmModel,
    sigmas: Sigmas,
    observations: &[&Observation],
) -> Panel {
    let (mut without, mut with) = (
        Evaluator::new(&part.without, sigmas),
        Evaluator::new(complete, sigmas),
    );
    let rows: Vec<(&Observation, [f64; 3])> = observations
        .iter()
        .map(|o| (*o, apparent(&mut without, &mut with, joint, o)))
        .collect();
    let mut lengths: Vec<f64> = rows.iter().map(|(_, [_, _, length])| *length).collect();
    lengths.sort_by(f64::total_cmp);
    let typical = lengths.get(lengths.len() / 2).copied().unwrap_or(0.0);
    let (name, factor) = unit(complete, joint);
    let own = format!("joint {}, {name}", joint + 1);
    let covariate = |o: &Observation, fitted: f64| match part.kind {
        "joint-compliance" | "tool-load" => fitted * factor,
        "backlash" => o.direction[joint],
        "joint-coupling" => {
            let from = part.from.unwrap_or(joint);
            o.q[from] * unit(complete, from).1
        }
        kind => ambient(kind, part.sensor, o, complete).unwrap_or(o.q[joint] * factor),
    };
    let x = match part.kind {
        "joint-compliance" | "tool-load" => format!("fitted deflection under load, {name}"),
        "backlash" => "sign of the last move".to_owned(),
        "joint-coupling" => {
            let from = part.from.unwrap_or(joint);
            format!("joint {}, {}", from + 1, unit(complete, from).0)
        }
        kind => ambient_name(kind, complete).map_or(own, str::to_owned),
    };
    Panel {
        x,
        y: format!("joint {} error, {name}", joint + 1),
        points: rows
            .into_iter()
            .filter(|(_, [_, _, length])| *length > LEVER * LEVER * typical)
            .map(|(o, [before, after, _])| {
                let fitted = before - after;
                [covariate(o, fitted), before * factor, after * factor]
            })
            .collect(),
    }
}

/// Temperature or time, for effects of those.
fn ambient(kind: &str, sensor: usize, o: &Observation, arm: &ArmModel) -> Option<f64> {
    match kind {
        "thermal-growth" | "thermal-drift" => o.ambient.temperature.get(sensor).copied(),
        "time-drift" | "warm-up" | "step-change" | "instrument-moved" => {
            let unit = if arm.counts_rows { 1.0 } else { 60.0 };
            Some(o.ambient.time / unit)
        }
        _ => None,
    }
}

fn ambient_name(kind: &str, arm: &ArmModel) -> Option<&'static str> {
    match kind {
        "thermal-growth" | "thermal-drift" => Some("temperature, degC"),
        "time-drift" | "warm-up" | "step-change" | "instrument-moved" => Some(if arm.counts_rows {
            "row of the file"
        } else {
            "time, min"
        }),
        _ => None,
    }
}

/// The residual along the direction in which the effect moves the tool.
fn tool_panel(part: &Part, complete: &ArmModel, observations: &[&Observation]) -> Panel {
    let (mut without, mut with) = (
        Evaluator::new(&part.without, UNIT),
        Evaluator::new(complete, UNIT),
    );
    let rows: Vec<(&Observation, Vec<f64>, Vec<f64>)> = observations
        .iter()
        .map(|o| (*o, lengths(&mut without, o), lengths(&mut with, o)))
        .collect();
    let way = |before: &[f64], after: &[f64]| -> Vec<f64> {
        before.iter().zip(after).map(|(b, a)| b - a).collect()
    };
    // the side on which the effect counts as positive: that of the row that it moves most
    let largest = rows
        .iter()
        .map(|(_, before, after)| way(before, after))
        .max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))
        .unwrap_or_default();
    let points = rows
        .iter()
        .filter_map(|(o, before, after)| {
            let way = way(before, after);
            let size = dot(&way, &way).sqrt();
            if size <= 0.0 {
                return None;
            }
            let side = if dot(&way, &largest) < 0.0 { -1.0 } else { 1.0 };
            let along = |r: &[f64]| 1e3 * side * dot(r, &way) / size;
            let x = ambient(part.kind, part.sensor, o, complete).unwrap_or(1e3 * side * size);
            Some([x, along(before), along(after)])
        })
        .collect();
    Panel {
        x: ambient_name(part.kind, complete)
            .unwrap_or("what the effect does to the tool, mm")
            .to_owned(),
        y: "residual in its direction, mm".to_owned(),
        points,
    }
}

/// Share of the joint's squared error, of the fitted rows without the effect, that one
/// harmonic beside a mean takes, order by order in steps finer than the range resolves.
fn periodogram(
    part: &Part,
    complete: &ArmModel,
    sigmas: Sigmas,
    observations: &[&Observation],
    found: f64,
) -> Vec<[f64; 2]> {
    let Some(joint) = part.joint else {
        return Vec::new();
    };
    let (mut without, mut with) = (
        Evaluator::new(&part.without, sigmas),
        Evaluator::new(complete, sigmas),
    );
    let rows: Vec<[f64; 3]> = of_one_posture(observations)
        .iter()
        .map(|o| {
            let [before, _, length] = apparent(&mut without, &mut with, joint, o);
            [o.q[joint], before, length]
        })
        .collect();
    let weight: f64 = rows.iter().map(|[_, _, w]| w).sum();
    let mean = rows.iter().map(|[_, e, w]| e * w).sum::<f64>() / weight;
    let total: f64 = rows.iter().map(|[_, e, w]| w * (e - mean).powi(2)).sum();
    let low = rows.iter().fold(f64::INFINITY, |m, r| m.min(r[0]));
    let high = rows.iter().fold(f64::NEG_INFINITY, |m, r| m.max(r[0]));
    let step = (std::f64::consts::TAU / (high - low).max(0.1) / 4.0).clamp(0.05, 2.0);
    let end = (1.5 * found).max(16.0);
    let mut lines = Vec::new();
    let mut order = LOWEST;
    while order <= end && total > 0.0 {
        let share = harmonic(&rows, order) / total;
        lines.push([order, 100.0 * share]);
        order += step;
    }
    lines
}

/// What a weighted fit of mean, sine and cosine takes off the squares about the mean.
fn harmonic(rows: &[[f64; 3]], order: f64) -> f64 {
    let mut normal = nalgebra::Matrix3::<f64>::zeros();
    let mut right = nalgebra::Vector3::<f64>::zeros();
    for [q, e, w] in rows {
        let (s, c) = (order * q).sin_cos();
        let column = nalgebra::Vector3::new(1.0, s, c);
        normal += column * column.transpose() * *w;
        right += column * (e * w);
    }
    let of_mean = right[0] * right[0] / normal[(0, 0)];
    normal.cholesky().map_or(0.0, |factor| {
        (right.dot(&factor.solve(&right)) - of_mean).max(0.0)
    })
}
