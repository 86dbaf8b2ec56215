//! What a residual may follow: simple functions of the joints and of each condition, and
//! how an error of a joint or of the base that follows them would look.

use nalgebra::{DMatrix, DVector, Vector3};
use truepose::effects::MAX_SENSORS;
use truepose::{JointKind, Parameter, Twist};

use super::Subject;
use crate::identify::arm::ArmModel;
use crate::identify::evaluator::Evaluator;
use crate::identify::linearize::linearize;
use crate::identify::observation::{Observation, Sigmas};
use crate::identify::unknown::Unknown;

/// A displacement of the tool that is multiplied by a function of the row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mover {
    /// Error of a joint's angle (travel).
    Joint(usize),
    /// Displacement of the base: 0 to 2 along, 3 to 5 about the world's axes.
    Base(usize),
    /// All joints together, each by its share of the last move.
    LastMove,
    /// Length of a link.
    Length(usize),
}

impl Mover {
    pub(super) fn name(self) -> String {
        match self {
            Self::Joint(j) => format!("joint {}", j + 1),
            Self::Base(axis) => {
                let kind = if axis < 3 {
                    "shift along"
                } else {
                    "turn about"
                };
                format!("the base, {kind} {},", ["x", "y", "z"][axis % 3])
            }
            Self::LastMove => "all joints together".to_owned(),
            Self::Length(j) => format!("the length of link {}", j + 1),
        }
    }
}

/// One column of the design: an error of `mover` in proportion to a function of the row.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    pub(super) subject: Subject,
    pub(super) mover: Mover,
    /// As it stands in a statement.
    pub(super) function: String,
}

/// Whitened unit displacements and the functions of every row.
pub(super) struct Design {
    pub(super) shapes: Vec<Shape>,
    /// Equations x shapes.
    pub(super) columns: DMatrix<f64>,
    /// Joint errors by each row on its own, whitened: joints x equations, one a row.
    pub(super) solvers: Vec<DMatrix<f64>>,
    /// Root mean square way of the tool per unit of each joint, m.
    pub(super) levers: Vec<f64>,
}

/// One function of the row, with a value at each of its postures.
struct Function {
    subject: Subject,
    name: String,
    values: Vec<f64>,
    movers: Vec<Mover>,
}

/// The first four Legendre polynomials of values spread over [-1, 1].
fn legendre(values: &[f64], degrees: usize) -> Vec<Vec<f64>> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let spread = (high - low).max(f64::MIN_POSITIVE);
    let of = |degree: usize, v: f64| {
        let x = 2.0 * (v - low) / spread - 1.0;
        match degree {
            1 => x,
            2 => 0.5 * (3.0 * x * x - 1.0),
            3 => 0.5 * (5.0 * x * x - 3.0) * x,
            _ => 0.125 * ((35.0 * x * x - 30.0) * x * x + 3.0),
        }
    };
    (1..=degrees)
        .map(|d| values.iter().map(|&v| of(d, v)).collect())
        .collect()
}

fn varies(values: &[f64]) -> bool {
    let first = values.first().copied().unwrap_or(0.0);
    values.iter().all(|v| v.is_finite()) && values.iter().any(|v| (v - first).abs() > 1e-9)
}

fn functions(arm: &ArmModel, observations: &[&Observation]) -> Vec<Function> {
    let n = arm.joint_count();
    let all: Vec<Mover> = (0..n)
        .map(Mover::Joint)
        .chain((0..6).map(Mover::Base))
        .collect();
    let mut found = Vec::new();
    let mut push = |subject, name: String, values: Vec<f64>, movers: &[Mover]| {
        if varies(&values) {
            found.push(Function {
                subject,
                name,
                values,
                movers: movers.to_vec(),
            });
        }
    };
    let column = |value: &dyn Fn(&Observation) -> f64| -> Vec<f64> {
        observations.iter().map(|o| value(o)).collect()
    };
    for (k, joint) in arm.joints.iter().enumerate() {
        let q = column(&|o| o.q[k]);
        let number = k + 1;
        match joint.kind {
            JointKind::Revolute => {
                push(Subject::Joint(k), format!("q{number}"), q.clone(), &all);
                for order in 1..=3 {
                    let times = if order == 1 {
                        String::new()
                    } else {
                        format!("{order} ")
                    };
                    let angle = |q: &f64| f64::from(order) * q;
                    let sine = q.iter().map(|q| angle(q).sin()).collect();
                    push(
                        Subject::Joint(k),
                        format!("sin {times}q{number}"),
                        sine,
                        &all,
                    );
                    let cosine = q.iter().map(|q| angle(q).cos()).collect();
                    push(
                        Subject::Joint(k),
                        format!("cos {times}q{number}"),
                        cosine,
                        &all,
                    );
                }
            }
            JointKind::Prismatic => {
                for (d, values) in (1..).zip(legendre(&q, 4)) {
                    push(
                        Subject::Joint(k),
                        power(&format!("q{number}"), d),
                        values,
                        &all,
                    );
                }
            }
        }
        let direction = column(&|o| o.direction[k]);
        push(
            Subject::Direction,
            format!("its direction (dir{number})"),
            direction,
            &[Mover::Joint(k)],
        );
    }
    let payload = column(&|o| o.ambient.payload);
    push(Subject::Payload, "the payload".to_owned(), payload, &all);
    for sensor in 0..MAX_SENSORS {
        let values = column(&|o| o.ambient.temperature[sensor]);
        let name = "the temperature".to_owned();
        push(Subject::Temperature(sensor), name, values, &all);
    }
    let time = column(&|o| o.ambient.time);
    let (subject, name, values) = if varies(&time) {
        (Subject::Time, "the time", time)
    } else {
        let row = column(&|o| o.row as f64);
        (Subject::Order, "the row's number", row)
    };
    for (d, values) in (1..).zip(legendre(&values, 4)) {
        push(subject, power(name, d), values, &all);
    }
    if observations
        .iter()
        .any(|o| o.travel.iter().any(|d| d.abs() > 0.0))
    {
        // the mover itself carries the moves
        found.push(Function {
            subject: Subject::LastMove,
            name: "their last move".to_owned(),
            values: vec![1.0; observations.len()],
            movers: vec![Mover::LastMove],
        });
    }
    found
}

fn power(name: &str, degree: usize) -> String {
    match degree {
        1 => name.to_owned(),
        d => format!("a polynomial of degree {d} in {name}"),
    }
}

fn base_twist(arm: &ArmModel, o: &Observation, at: &Vector3<f64>, axis: usize) -> Twist<f64> {
    let mut unit = Vector3::zeros();
    unit[axis % 3] = 1.0;
    if axis < 3 {
        Twist::new(unit, Vector3::zeros())
    } else {
        let base = arm.bases.get(o.session).or(arm.bases.first());
        let origin = base.map_or_else(Vector3::zeros, |b| b.translation);
        Twist::new(Vector3::zeros(), unit).at(&(at - origin))
    }
}

/// Columns of every joint that errs by a function of its own reading, or by the lever of a
/// weight at the tool: most of what an arm does.
pub(crate) fn own_functions(
    arm: &ArmModel,
    observations: &[&Observation],
    sigmas: Sigmas,
) -> DMatrix<f64> {
    let design = design(arm, observations, sigmas);
    let own = |shape: &Shape| match (shape.subject, shape.mover) {
        (Subject::Joint(k), Mover::Joint(j)) => k == j,
        (Subject::Gravity, _) => true,
        _ => false,
    };
    let kept: Vec<usize> = (0..design.shapes.len())
        .filter(|&k| design.shapes.get(k).is_some_and(own))
        .collect();
    design.columns.select_columns(&kept)
}

/// The design of all functions at `observations`.
pub(super) fn design(arm: &ArmModel, observations: &[&Observation], sigmas: Sigmas) -> Design {
    let n = arm.joint_count();
    let postures: Vec<&Observation> = observations.iter().flat_map(|o| o.postures()).collect();
    let functions = functions(arm, &postures);
    let mut shapes: Vec<Shape> = Vec::new();
    for f in &functions {
        shapes.extend(f.movers.iter().map(|&mover| Shape {
            subject: f.subject,
            mover,
            function: f.name.clone(),
        }));
    }
    let levers_from = shapes.len();
    for subject in [Subject::Gravity, Subject::Payload] {
        let loaded = observations.iter().any(|o| o.ambient.payload > 0.0);
        if subject == Subject::Gravity || loaded {
            let load = if subject == Subject::Gravity {
                "the lever of a weight at the tool"
            } else {
                "the payload's torque"
            };
            shapes.extend((0..n).map(|j| Shape {
                subject,
                mover: Mover::Joint(j),
                function: load.to_owned(),
            }));
        }
    }
    let equations: usize = observations.iter().map(|o| o.equations()).sum();
    let mut columns = DMatrix::zeros(equations, shapes.len());
    let mut solvers = Vec::with_capacity(observations.len());
    let mut squares = vec![0.0; n];
    let mut evaluator = Evaluator::new(arm, sigmas);
    let gravity = arm.bases.first().map(|b| b.rotation * arm.gravity);
    let down = gravity.filter(|g| g.norm() > 0.0).map(|g| g.normalize());
    let mut start = 0;
    let mut i = 0;
    for o in observations {
        let count = o.equations();
        evaluator.each_posture(o, |evaluator, posture| {
            let tool = evaluator.tool_point();
            let mut units = DMatrix::zeros(count, n + 6);
            let mut lift = vec![0.0; n];
            for j in 0..n {
                let twist = evaluator.joint_twist(j);
                squares[j] += twist.linear.norm_squared();
                lift[j] = down.map_or(0.0, |d| d.dot(&twist.linear));
                let out = &mut units.as_mut_slice()[j * count..(j + 1) * count];
                posture.spread(evaluator, &twist, out);
            }
            for axis in 0..6 {
                let twist = base_twist(arm, posture.at, &tool, axis);
                let at = (n + axis) * count;
                posture.spread(evaluator, &twist, &mut units.as_mut_slice()[at..at + count]);
            }
            let mut early = DVector::zeros(count);
            posture.spread(
                evaluator,
                &evaluator.early_twist(posture.at),
                early.as_mut_slice(),
            );
            let mut k = 0;
            for f in &functions {
                let value = f.values[i];
                for mover in &f.movers {
                    let mut column = columns.view_mut((start, k), (count, 1));
                    match *mover {
                        Mover::Joint(j) => column += units.column(j) * value,
                        Mover::Base(axis) => column += units.column(n + axis) * value,
                        Mover::LastMove => column += &early,
                        Mover::Length(_) => {}
                    }
                    k += 1;
                }
            }
            for (at, shape) in shapes.iter().enumerate().skip(levers_from) {
                let Mover::Joint(j) = shape.mover else {
                    continue;
                };
                let load = match shape.subject {
                    Subject::Payload => posture.at.ambient.payload,
                    _ => 1.0,
                };
                let mut column = columns.view_mut((start, at), (count, 1));
                column += units.column(j) * (lift[j] * load);
            }
            if posture.is_own() {
                solvers.push(solver(&units.columns(0, n).into_owned()));
            }
            i += 1;
        });
        start += count;
    }
    let lengths = lengths(arm, observations, sigmas, &mut shapes);
    let before = columns.ncols();
    let mut columns = columns.resize_horizontally(before + lengths.ncols(), 0.0);
    columns
        .columns_mut(before, lengths.ncols())
        .copy_from(&lengths);
    let rows = postures.len().max(1) as f64;
    Design {
        shapes,
        columns,
        solvers,
        levers: squares.into_iter().map(|s| (s / rows).sqrt()).collect(),
    }
}

/// Lengths of links in proportion to each temperature that varies.
fn lengths(
    arm: &ArmModel,
    observations: &[&Observation],
    sigmas: Sigmas,
    shapes: &mut Vec<Shape>,
) -> DMatrix<f64> {
    let mut unknowns = Vec::new();
    for (j, joint) in arm.joints.iter().enumerate() {
        for p in joint.parameters() {
            if matches!(p, Parameter::A | Parameter::D) {
                unknowns.push((j, Unknown::Joint(j, *p)));
            }
        }
    }
    let of: Vec<Unknown> = unknowns.iter().map(|u| u.1).collect();
    let equations: usize = observations.iter().map(|o| o.equations()).sum();
    let mut all = DMatrix::zeros(equations, 0);
    let mut unit: Option<DMatrix<f64>> = None;
    for sensor in 0..MAX_SENSORS {
        let warm: Vec<f64> = (observations.iter())
            .map(|o| o.ambient.temperature[sensor])
            .collect();
        if !varies(&warm) {
            continue;
        }
        let scales = vec![1.0; of.len()];
        let mut columns = unit
            .get_or_insert_with(|| linearize(arm, &of, &scales, observations, sigmas).jacobian)
            .clone();
        let mut start = 0;
        for (o, warm) in observations.iter().zip(&warm) {
            let count = o.equations();
            columns.rows_mut(start, count).scale_mut(*warm);
            start += count;
        }
        shapes.extend(unknowns.iter().map(|&(j, _)| Shape {
            subject: Subject::Temperature(sensor),
            mover: Mover::Length(j),
            function: "the temperature".to_owned(),
        }));
        let before = all.ncols();
        all = all.resize_horizontally(before + of.len(), 0.0);
        all.columns_mut(before, of.len()).copy_from(&columns);
    }
    all
}

/// Joint errors from one row's residual, each over its own standard deviation:
/// `(JᵀJ + λ I)⁻¹ Jᵀ` with joints in units of their own column, which a row of fewer than six
/// numbers needs and near a singular posture any.
fn solver(columns: &DMatrix<f64>) -> DMatrix<f64> {
    const DAMPING: f64 = 0.03;
    let n = columns.ncols();
    let mut scaled = columns.clone();
    for mut column in scaled.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column /= length;
        }
    }
    let normal = scaled.tr_mul(&scaled) + DMatrix::identity(n, n) * DAMPING;
    let Some(factor) = normal.cholesky() else {
        return DMatrix::zeros(n, columns.nrows());
    };
    let mut solver = factor.solve(&scaled.transpose());
    for mut row in solver.row_iter_mut() {
        let length = row.norm();
        if length > 0.0 {
            row /= length;
        }
    }
    solver
}
