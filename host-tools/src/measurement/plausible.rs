//! Numbers that can be read but cannot be meant.

use truepose::JointKind;

use super::columns::{self, Columns, Field};
use super::rows::Parsed;
use super::{Dataset, Expected, Measured, Row, Seen, Set};
use crate::error::{Error, Place};
use crate::units::Quantity;
use crate::warning::Warning;

/// A joint without limits does not wind up further, rad: four turns.
const LARGEST_TURN: f64 = 8.0 * std::f64::consts::PI;
/// A joint without limits does not slide further, and no instrument measures further, m.
const LARGEST_LENGTH: f64 = 100.0;
/// Joints in degrees that all stay below this are suspected to be in radians, rad.
const SMALLEST_TURN: f64 = 7.0 * std::f64::consts::PI / 180.0;

/// Checks units and limits of all rows.
pub(super) fn check(parsed: &mut Parsed, expected: &Expected) -> Result<(), Error> {
    let Parsed {
        dataset, columns, ..
    } = parsed;
    if dataset.rows.is_empty() {
        return Err(Place::file(&dataset.file).bad(
            "no row with joints and a measured value",
            "at least one",
            "fill in the blank cells",
        ));
    }
    check_sessions(dataset)?;
    check_joints(dataset, columns, expected)?;
    check_positions(dataset, columns, expected)?;
    check_lengths(dataset, columns)?;
    check_seen(dataset, columns)?;
    warn_of_limits(dataset, expected);
    warn_of_radians(dataset, columns, expected);
    Ok(())
}

/// The rows that a fit may use must give more equations than a rigid arm has unknowns:
/// 4 a revolute joint, 2 a prismatic one and 6, MRD 2.5.
pub(super) fn check_enough(dataset: &Dataset, expected: &Expected) -> Result<(), Error> {
    let unknowns = 6 + expected
        .kinds
        .iter()
        .map(|kind| match kind {
            JointKind::Revolute => 4,
            JointKind::Prismatic => 2,
        })
        .sum::<usize>();
    let equations = |row: &Row| {
        let points = row.targets.iter().flatten().count() + usize::from(row.position.is_some());
        // Three points fix a pose; more of them only repeat it.
        let point = (3 * points).min(6);
        let turn = if row.orientation.is_some() { 3 } else { 0 };
        let r = &row.relations;
        let related = usize::from(r.distance.is_some())
            + 3 * usize::from(r.point.is_some())
            + usize::from(r.plane.is_some())
            + 2 * r.bearings.iter().flatten().count();
        let related = related.min(if row.orientation.is_some() { 6 } else { 3 });
        let thing =
            |s: &Seen| 3 * usize::from(s.position.is_some()) + 2 * usize::from(s.bearing.is_some());
        let seen = r.seen.iter().map(thing).sum::<usize>();
        let seen = seen + 3 * usize::from(r.seen_turn.is_some());
        (point + turn)
            .max(seen)
            .min(6)
            .max(usize::from(row.length.is_some()))
            .max(related)
    };
    let have: usize = dataset.set(Set::Identify).map(equations).sum();
    if have >= unknowns {
        return Ok(());
    }
    let rows = dataset.set(Set::Identify).count();
    let noun = if rows == 1 { "row" } else { "rows" };
    Err(Place::file(&dataset.file).bad(
        format!(
            "{rows} {noun} to fit ({have} equations; {} held back, {} left out)",
            dataset.set(Set::Verify).count(),
            dataset.left_out.len()
        ),
        format!(
            "at least {unknowns} equations: a robot of {} joints has so many unknowns",
            expected.kinds.len()
        ),
        "measure more poses",
    ))
}

/// A row belongs to some placement of the instrument or to none like all others.
fn check_sessions(dataset: &Dataset) -> Result<(), Error> {
    let lacking = dataset.rows.iter().find(|row| row.session.is_none());
    match lacking {
        Some(row) if dataset.available.session => {
            let place = Place {
                row: Some(row.number),
                ..Place::line(&dataset.file, row.line)
            };
            Err(place.column("session").bad(
                "a blank cell",
                "the number of the instrument's placement",
                "fill it in, or blank the row if it is not known",
            ))
        }
        _ => Ok(()),
    }
}

fn check_joints(dataset: &Dataset, columns: &Columns, expected: &Expected) -> Result<(), Error> {
    for (k, (kind, limits)) in expected.kinds.iter().zip(&expected.limits).enumerate() {
        let quantity = match kind {
            JointKind::Revolute => Quantity::Angle,
            JointKind::Prismatic => Quantity::Length,
        };
        // Half as far again as the limits allow, and a little: nothing mechanical does that.
        let bound = match (limits, kind) {
            (Some([low, high]), _) => 1.5 * low.abs().max(high.abs()) + 0.5,
            (None, JointKind::Revolute) => LARGEST_TURN,
            (None, JointKind::Prismatic) => LARGEST_LENGTH,
        };
        for row in &dataset.rows {
            let command = row.q_command.as_ref().and_then(|q| q.get(k)).copied();
            let readings = [
                (Field::Joint(k), row.q.get(k).copied()),
                (Field::Command(k), command),
            ];
            for (field, value) in readings {
                let (Some(value), Some(column)) = (value, columns.get(field)) else {
                    continue;
                };
                if value.abs() <= bound {
                    continue;
                }
                let (unit, suffix, other) = match quantity {
                    Quantity::Angle => ("rad", "_deg", "degrees"),
                    _ => ("m", "_mm", "millimetres"),
                };
                let within = match limits {
                    Some([low, high]) => format!("joint limits {low:.3} to {high:.3} {unit}"),
                    None => format!("at most {bound:.0} {unit}"),
                };
                let plain = (column.factor - 1.0).abs() < f64::EPSILON;
                let advice = if plain {
                    format!(
                        "if the column is in {other}, name it {}{suffix}",
                        column.name
                    )
                } else {
                    format!(
                        "correct the reading, or the unit in the name {}",
                        column.name
                    )
                };
                let place = Place {
                    row: Some(row.number),
                    ..Place::line(&dataset.file, row.line)
                };
                return Err(place.column(&column.name).bad(
                    format!("{value:.6} {unit}"),
                    within,
                    advice,
                ));
            }
        }
    }
    Ok(())
}

/// Positions lie within reach of one another, whatever the world frame. Half of them must: a
/// single blunder is for the fit to find.
fn check_positions(dataset: &Dataset, columns: &Columns, expected: &Expected) -> Result<(), Error> {
    let points: Vec<[f64; 3]> = dataset.rows.iter().filter_map(|r| r.position).collect();
    let mut centre = [0.0; 3];
    for (axis, slot) in centre.iter_mut().enumerate() {
        let of_axis = points.iter().filter_map(|p| p.get(axis)).copied();
        *slot = median(of_axis.collect());
    }
    let from_centre = |p: &[f64; 3]| {
        let squares = p.iter().zip(&centre).map(|(p, c)| (p - c) * (p - c));
        squares.sum::<f64>().sqrt()
    };
    let spread = median(points.iter().map(from_centre).collect());
    let far = median(
        points
            .iter()
            .map(|p| p.iter().map(|x| x * x).sum::<f64>().sqrt())
            .collect(),
    );
    let (found, bound, what) = match expected.reach {
        // The tool in the description is a first guess: allow it to be wrong by a metre.
        Some(reach) => (spread, 2.0 * (reach + 1.0), "apart"),
        None => (far, LARGEST_LENGTH, "away from the world's origin"),
    };
    let Some(column) = columns.get(Field::Position(0, 0)).filter(|_| found > bound) else {
        return Ok(());
    };
    let plain = (column.factor - 1.0).abs() < f64::EPSILON;
    let advice = if plain {
        "if they are in millimetres, name the columns x_mm, y_mm, z_mm"
    } else {
        "correct the unit in the names of the columns"
    };
    Err(Place::line(&dataset.file, columns.line)
        .column(&column.name)
        .bad(
            format!("positions {found:.0} m {what}"),
            format!("at most {bound:.1} m"),
            advice,
        ))
}

fn check_lengths(dataset: &Dataset, columns: &Columns) -> Result<(), Error> {
    if dataset.measured != Measured::Length {
        return Ok(());
    }
    let typical = median(dataset.rows.iter().filter_map(|r| r.length).collect());
    let found = format!("lengths of {typical:.0} m");
    let advice = "if they are in millimetres, name the column length_mm";
    check_distance(dataset, columns, Field::Length, typical, found, advice)
}

/// Nothing is seen from the tool that is farther off.
fn check_seen(dataset: &Dataset, columns: &Columns) -> Result<(), Error> {
    let seen = dataset.rows.iter().flat_map(|row| &row.relations.seen);
    let far = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let typical = median(seen.filter_map(|s| s.position.map(far)).collect());
    let first = Field::Seen(columns::Seen::Position(0, 0));
    let found = format!("fixed things {typical:.0} m from the tool");
    let advice = "if they are in millimetres, name the columns seen_x_mm, seen_y_mm, seen_z_mm";
    check_distance(dataset, columns, first, typical, found, advice)
}

/// Refuses a `typical` distance in the column of `field` that no instrument reaches.
fn check_distance(
    dataset: &Dataset,
    columns: &Columns,
    field: Field,
    typical: f64,
    found: String,
    advice: &str,
) -> Result<(), Error> {
    match columns.get(field) {
        Some(column) if typical > LARGEST_LENGTH => {
            let expected = format!("at most {LARGEST_LENGTH:.0} m");
            let place = Place::line(&dataset.file, columns.line);
            Err(place.column(&column.name).bad(found, expected, advice))
        }
        _ => Ok(()),
    }
}

fn warn_of_limits(dataset: &mut Dataset, expected: &Expected) {
    for (k, limits) in expected.limits.iter().enumerate() {
        let Some([low, high]) = limits else { continue };
        // Encoders read a little beyond a limit that the controller keeps.
        let slack = 1e-3 * (high - low);
        let is_out = |row: &&Row| {
            row.q
                .get(k)
                .is_some_and(|q| *q < low - slack || *q > high + slack)
        };
        let rows: Vec<usize> = dataset
            .rows
            .iter()
            .filter(is_out)
            .map(|r| r.number)
            .collect();
        if !rows.is_empty() {
            dataset.warnings.push(Warning::OutsideLimits {
                file: dataset.file.clone(),
                joint: k + 1,
                rows,
            });
        }
    }
}

fn warn_of_radians(dataset: &mut Dataset, columns: &Columns, expected: &Expected) {
    let mut largest = 0.0_f64;
    for (k, kind) in expected.kinds.iter().enumerate() {
        if *kind != JointKind::Revolute {
            continue;
        }
        let in_degrees = columns.get(Field::Joint(k)).is_some_and(|c| c.factor < 1.0);
        if !in_degrees {
            return;
        }
        let of_joint = dataset.rows.iter().filter_map(|row| row.q.get(k));
        largest = of_joint.fold(largest, |max, q| max.max(q.abs()));
    }
    if largest > 0.0 && largest < SMALLEST_TURN {
        dataset.warnings.push(Warning::LooksLikeRadians {
            file: dataset.file.clone(),
            largest_deg: largest.to_degrees(),
        });
    }
}

/// Upper median; 0 of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    *median
}
