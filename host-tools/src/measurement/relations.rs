//! Pairs of rows, fixed points and planes, bearings: whether they count, and whether they
//! hang together.

use std::collections::BTreeMap;

use super::{Dataset, Measured, Row};
use crate::error::{Error, Place};
use crate::warning::Warning;

/// Leaves out relations that were not meant, and refuses those that cannot be.
///
/// Beside positions or lengths a column `point` may well be a running number: relations count
/// there only where the sidecar says how sure they are.
pub(super) fn check(dataset: &mut Dataset) -> Result<(), Error> {
    let beside = matches!(
        dataset.measured,
        Measured::Position | Measured::Pose | Measured::Length
    );
    let noise = dataset.noise;
    let mut unused: Vec<&'static str> = Vec::new();
    let mut drop = |kind: &'static str, has: bool| {
        if has && !unused.contains(&kind) {
            unused.push(kind);
        }
    };
    for row in dataset.rows.iter_mut().filter(|_| beside) {
        let r = &mut row.relations;
        if noise.distance.is_none() {
            drop("pair, distance", r.pair.is_some());
            (r.pair, r.distance) = (None, None);
        }
        if noise.contact.is_none() {
            drop("point", r.point.is_some());
            drop("plane", r.plane.is_some());
            (r.point, r.plane) = (None, None);
        }
        if noise.bearing.is_none() {
            drop("azimuth, elevation", r.bearings.iter().any(Option::is_some));
            r.bearings.fill(None);
        }
    }
    if !unused.is_empty() {
        dataset.warnings.push(Warning::RelationsUnused {
            file: dataset.file.clone(),
            columns: unused.join(", "),
        });
    }
    check_pairs(dataset)
}

/// Rows of `dataset` (places) by the pair that they belong to.
pub(super) fn pairs(rows: &[Row]) -> BTreeMap<i64, Vec<usize>> {
    let mut pairs: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
    for (i, row) in rows.iter().enumerate() {
        if let Some(pair) = row.relations.pair {
            pairs.entry(pair).or_default().push(i);
        }
    }
    pairs
}

/// Both rows of a pair are on one side of the split.
pub(super) fn check_sets(dataset: &Dataset) -> Result<(), Error> {
    for members in pairs(&dataset.rows).into_values() {
        let rows: Vec<&Row> = members
            .iter()
            .filter_map(|&i| dataset.rows.get(i))
            .collect();
        if let [a, b] = rows.as_slice()
            && a.set != b.set
        {
            return Err(place(dataset, b).column("set").bad(
                format!("a set other than row {}'s of the same pair", a.number),
                "both rows of a pair in one set",
                "give both the same set, or leave both blank",
            ));
        }
    }
    Ok(())
}

fn place(dataset: &Dataset, row: &Row) -> Place {
    Place {
        row: Some(row.number),
        ..Place::line(&dataset.file, row.line)
    }
}

fn check_pairs(dataset: &Dataset) -> Result<(), Error> {
    for row in &dataset.rows {
        if row.relations.distance.is_some() && row.relations.pair.is_none() {
            return Err(place(dataset, row).column("pair").bad(
                "a blank cell beside a distance",
                "the number of the pair of rows that it is between",
                "fill it in, or blank the distance",
            ));
        }
    }
    for (number, members) in pairs(&dataset.rows) {
        let rows: Vec<&Row> = members
            .iter()
            .filter_map(|&i| dataset.rows.get(i))
            .collect();
        let [a, b] = rows.as_slice() else {
            let Some(first) = rows.first() else { continue };
            let numbers: Vec<String> = rows.iter().map(|r| r.number.to_string()).collect();
            return Err(place(dataset, first).column("pair").bad(
                format!(
                    "pair {number} on {} rows ({})",
                    rows.len(),
                    numbers.join(", ")
                ),
                "two rows with joints",
                "number each pair of poses on its own, or blank the cells",
            ));
        };
        let at = |column: &str| place(dataset, b).column(column);
        let (da, db) = (a.relations.distance, b.relations.distance);
        match (da, db) {
            (None, None) => {
                return Err(at("distance").bad(
                    format!("no distance on either row of pair {number}"),
                    "the distance between the two tool points on one of them",
                    "fill it in, or blank the pair",
                ));
            }
            (Some(da), Some(db)) if (da - db).abs() > 1e-12 * da.abs() => {
                return Err(at("distance").bad(
                    format!("{db} m, and {da} m in row {} of the same pair", a.number),
                    "one distance a pair",
                    "blank one of the two",
                ));
            }
            _ => {}
        }
        if a.session != b.session {
            return Err(at("session").bad(
                format!("a session other than row {}'s of the same pair", a.number),
                "both poses of a pair in one session",
                "correct the session or the pair",
            ));
        }
    }
    Ok(())
}
