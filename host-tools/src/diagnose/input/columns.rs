//! Faults of whole columns: units, signs, order, coupling, conventions, a shift of all rows.

use nalgebra::Vector3;
use truepose::JointKind;

use super::placing::{Flanges, Placing, Reading, Sample};
use super::{Finding, Kind, millimetres};
use crate::description::Robot;
use crate::identify::observation::Observation;
use crate::identify::problem::Problem;

/// A fault makes the misfit this many times what it is without.
pub(super) const FACTOR: f64 = 4.0;
/// Without the fault the arm fits within this share of its reach.
pub(super) const PLAUSIBLE: f64 = 0.03;
/// Rows looked at.
const ROWS: usize = 80;
/// Rows needed for a judgement.
pub(super) const LEAST_ROWS: usize = 12;
/// Faults that one table may have at once.
const FAULTS: usize = 3;

/// What may be wrong with columns, and how it is undone.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Sign(usize),
    Exchange(usize, usize),
    /// Joint, the other joint, sign.
    Coupled(usize, usize, f64),
    /// Joint (all turning ones: `None`), factor to be applied.
    JointUnit(Option<usize>, f64),
    /// Axis (all: `None`), factor to be applied.
    PointUnit(Option<usize>, f64),
    Mirrored,
    /// Measured values stand so many rows below their joints.
    Shift(isize),
}

/// The table as it would be without some faults.
struct Table<'a> {
    flanges: Flanges,
    /// Identify rows in file order.
    rows: Vec<&'a Observation>,
    tool: Vector3<f64>,
    turning: Vec<bool>,
}

impl Table<'_> {
    fn samples(&self, faults: &[Fault], stride: usize) -> Vec<Sample> {
        let shift: isize = faults
            .iter()
            .map(|f| if let Fault::Shift(by) = f { *by } else { 0 })
            .sum();
        let mut samples = Vec::new();
        for o in self.rows.iter().step_by(stride) {
            let measured = if shift == 0 {
                Some(o)
            } else {
                let wanted = o.row as isize + shift;
                self.rows
                    .binary_search_by_key(&wanted, |o| o.row as isize)
                    .ok()
                    .and_then(|i| self.rows.get(i))
            };
            let Some((measured, point)) = measured.and_then(|m| Some((m, m.position?))) else {
                continue;
            };
            let (mut q, mut point) = (o.q.clone(), point);
            for fault in faults {
                self.undo(*fault, &mut q, &mut point);
            }
            samples.push(Sample {
                flange: self.flanges.at(&q),
                point,
                rotation: measured.rotation,
            });
        }
        samples
    }

    fn undo(&self, fault: Fault, q: &mut [f64], point: &mut Vector3<f64>) {
        match fault {
            Fault::Sign(j) => q[j] = -q[j],
            Fault::Exchange(j, k) => q.swap(j, k),
            Fault::Coupled(j, k, sign) => q[j] += sign * q[k],
            Fault::JointUnit(Some(j), factor) => q[j] *= factor,
            Fault::JointUnit(None, factor) => {
                for (q, turning) in q.iter_mut().zip(&self.turning) {
                    if *turning {
                        *q *= factor;
                    }
                }
            }
            Fault::PointUnit(Some(axis), factor) => point[axis] *= factor,
            Fault::PointUnit(None, factor) => *point *= factor,
            Fault::Mirrored => point.z = -point.z,
            Fault::Shift(_) => {}
        }
    }

    fn place(&self, faults: &[Fault], stride: usize) -> Option<Placing> {
        Placing::find(&self.samples(faults, stride), self.tool)
    }

    fn suspicions(&self) -> Vec<Fault> {
        let n = self.turning.len();
        let mut faults: Vec<Fault> = (0..n).map(Fault::Sign).collect();
        let degree = std::f64::consts::PI / 180.0;
        for j in 0..n {
            for k in (0..n).filter(|&k| k != j && self.turning[j] == self.turning[k]) {
                if k > j {
                    faults.push(Fault::Exchange(j, k));
                }
                if self.turning[j] {
                    faults.push(Fault::Coupled(j, k, 1.0));
                    faults.push(Fault::Coupled(j, k, -1.0));
                }
            }
            let factor = if self.turning[j] { degree } else { 1e-3 };
            faults.push(Fault::JointUnit(Some(j), factor));
            faults.push(Fault::JointUnit(Some(j), 1.0 / factor));
        }
        for factor in [degree, 1.0 / degree] {
            faults.push(Fault::JointUnit(None, factor));
        }
        for factor in [1e3, 1e-3, 10.0, 0.1, 1e2, 1e-2, 25.4, 1.0 / 25.4, 0.0254] {
            faults.push(Fault::PointUnit(None, factor));
        }
        for axis in 0..3 {
            faults.push(Fault::PointUnit(Some(axis), 1e3));
            faults.push(Fault::PointUnit(Some(axis), 1e-3));
        }
        faults.push(Fault::Mirrored);
        faults.extend([1, -1, 2, -2, 3, -3].map(Fault::Shift));
        faults
    }
}

/// Looks for faults of whole columns; returns the placing of the table as it is. `None` where
/// positions are too few to tell anything. `prefix`: of the names of measured columns.
pub(super) fn check(
    problem: &Problem,
    all: &[&Observation],
    robot: &Robot,
    prefix: &str,
    findings: &mut Vec<Finding>,
) -> Option<Placing> {
    let mut rows: Vec<&Observation> = problem.identify.iter().collect();
    rows.retain(|o| o.position.is_some());
    rows.sort_by_key(|o| o.row);
    // one placement of the instrument at a time: the one with most rows
    let sessions = rows.iter().map(|o| o.session);
    let largest = sessions.max_by_key(|s| rows.iter().filter(|o| o.session == *s).count())?;
    rows.retain(|o| o.session == largest);
    if rows.len() < LEAST_ROWS || all.is_empty() {
        return None;
    }
    let table = Table {
        flanges: Flanges::new(&problem.drawing),
        rows,
        tool: problem.drawing.tool.translation,
        turning: (problem.drawing.joints.iter())
            .map(|j| j.kind == JointKind::Revolute)
            .collect(),
    };
    let stride = table.rows.len().div_ceil(ROWS);
    let as_is = table.place(&[], stride)?;
    let reach = robot.reach();
    let (faults, best) = search(&table, &as_is, stride);
    let right = best.misfit() < PLAUSIBLE * reach;
    if right && best.misfit() * FACTOR < as_is.misfit() {
        for fault in &faults {
            let others: Vec<Fault> = faults.iter().copied().filter(|f| f != fault).collect();
            let without = table
                .place(&others, stride)
                .unwrap_or_else(|| as_is.clone());
            findings.push(describe(*fault, prefix, without.misfit(), best.misfit()));
        }
    }
    if right && best.reading != Reading::AsWritten {
        let samples = table.samples(&faults, stride);
        if let Some((angle, _)) = best.orient(&samples, Reading::AsWritten)
            && best.angle * FACTOR < angle
        {
            findings.push(convention(best.reading, angle, best.angle));
        }
    }
    Some(as_is)
}

/// The faults that together make the best fit: one at a time while each helps, all
/// combinations of signs where none does.
fn search(table: &Table<'_>, as_is: &Placing, stride: usize) -> (Vec<Fault>, Placing) {
    let suspicions = table.suspicions();
    let mut faults: Vec<Fault> = Vec::new();
    let mut best = as_is.clone();
    while faults.len() < FAULTS {
        let mut better: Option<(Fault, Placing)> = None;
        for fault in &suspicions {
            let mut tried = faults.clone();
            tried.push(*fault);
            let Some(placing) = table.place(&tried, stride) else {
                continue;
            };
            let least = better.as_ref().map_or(best.misfit(), |b| b.1.misfit());
            if placing.misfit() < least {
                better = Some((*fault, placing));
            }
        }
        match better {
            Some((fault, placing)) if placing.misfit() * 1.3 < best.misfit() => {
                faults.push(fault);
                best = placing;
            }
            _ => break,
        }
    }
    if best.misfit() * FACTOR > as_is.misfit() && as_is.distance > 0.02 {
        let n = table.turning.len().min(7);
        for bits in 1..1_usize << n {
            let signs: Vec<Fault> = (0..n)
                .filter(|j| bits >> j & 1 == 1)
                .map(Fault::Sign)
                .collect();
            if let Some(placing) = table.place(&signs, stride)
                && placing.misfit() * FACTOR < best.misfit()
            {
                (faults, best) = (signs, placing);
            }
        }
    }
    (faults, best)
}

fn describe(fault: Fault, prefix: &str, before: f64, after: f64) -> Finding {
    let xyz = || ["x", "y", "z"].map(|axis| format!("{prefix}{axis}"));
    let q = |j: usize| format!("q{}", j + 1);
    let (kind, columns, what, advice) = match fault {
        Fault::Sign(j) => (
            Kind::WrongSign,
            vec![q(j)],
            format!("{} counts the other way", q(j)),
            format!(
                "change the sign of {0}, or turn the axis of joint {1} in the robot file",
                q(j),
                j + 1
            ),
        ),
        Fault::Exchange(j, k) => (
            Kind::ExchangedJoints,
            vec![q(j), q(k)],
            format!("{} and {} stand in each other's place", q(j), q(k)),
            "exchange the names of the two columns".to_owned(),
        ),
        Fault::Coupled(j, k, sign) => {
            let sign = if sign > 0.0 { '+' } else { '-' };
            (
                Kind::CoupledJoint,
                vec![q(j)],
                format!("joint {} really stands at {} {sign} {}", j + 1, q(j), q(k)),
                format!("write {0} {sign} {1} into {0}", q(j), q(k)),
            )
        }
        Fault::JointUnit(j, factor) => (
            Kind::WrongUnit,
            j.map_or_else(Vec::new, |j| vec![q(j)]),
            format!(
                "{} in another unit: {factor:.6} times as much fits",
                j.map_or_else(|| "the joints are".to_owned(), |j| format!("{} is", q(j)))
            ),
            "give the columns their unit: _deg or none, _mm or none".to_owned(),
        ),
        Fault::PointUnit(axis, factor) => {
            let names: Vec<String> = match axis {
                Some(axis) => vec![xyz()[axis].clone()],
                None => xyz().to_vec(),
            };
            (
                Kind::WrongUnit,
                names.clone(),
                format!(
                    "{} in another unit: {factor:.6} times as much fits",
                    names.join(", ")
                ),
                "give the columns their unit: _mm, _um or none".to_owned(),
            )
        }
        Fault::Mirrored => (
            Kind::MirroredFrame,
            xyz().to_vec(),
            "positions are in a left-handed frame".to_owned(),
            "exchange two of x, y, z, or change the sign of one".to_owned(),
        ),
        Fault::Shift(by) => (
            Kind::ShiftedRows,
            Vec::new(),
            format!(
                "measured values stand {} {} {} their joints",
                by.abs(),
                if by.abs() == 1 { "row" } else { "rows" },
                if by > 0 { "below" } else { "above" }
            ),
            "look for a row that was lost or doubled when joints and measurements were put \
             side by side"
                .to_owned(),
        ),
    };
    Finding {
        kind,
        rows: Vec::new(),
        columns,
        saw: format!(
            "{what}: base and tool placed on the drawing, the typical misfit is {} as the table \
             is and {} so",
            millimetres(before),
            millimetres(after)
        ),
        advice,
        misfit: [before, after],
        p_value: None,
    }
}

fn convention(reading: Reading, before: f64, after: f64) -> Finding {
    let (what, advice) = match reading {
        Reading::AsWritten => ("as they are named", "nothing"),
        Reading::Inverse => (
            "of the inverse rotation (the world seen from the tool)",
            "change the signs of qx, qy, qz",
        ),
        Reading::ScalarLast => (
            "in the order x y z w",
            "name the columns qx, qy, qz, qw in this order",
        ),
        Reading::ScalarLastInverse => (
            "in the order x y z w and of the inverse rotation (the world seen from the tool)",
            "name the columns qx, qy, qz, qw in this order and change the signs of qx, qy, qz",
        ),
    };
    Finding {
        kind: Kind::RotationConvention,
        rows: Vec::new(),
        columns: ["qw", "qx", "qy", "qz"].map(str::to_owned).to_vec(),
        saw: format!(
            "the quaternions are {what}: typically {:.3} deg off as named, {:.3} deg so",
            before.to_degrees(),
            after.to_degrees()
        ),
        advice: advice.to_owned(),
        misfit: [
            super::placing::LEVER * before,
            super::placing::LEVER * after,
        ],
        p_value: None,
    }
}
