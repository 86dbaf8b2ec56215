//! Faults of single rows: duplicates, swaps, a shift from some row on.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::placing::{Flanges, LEVER, Placing, angle, middle};
use super::{Finding, Kind, millimetres};
use crate::identify::arm::ArmModel;
use crate::identify::evaluator::Evaluator;
use crate::identify::observation::Observation;
use crate::identify::problem::Problem;

/// A row does not fit where its misfit is this many times the typical one.
const APART: f64 = 10.0;
/// It fits another row's joints where the misfit there is this many times smaller.
const FACTOR: f64 = 8.0;
/// Misfitting rows looked at, worst first.
const LOOKED_AT: usize = 200;
/// Consecutive rows that make a shift.
const LEAST_SHIFTED: usize = 3;
/// Rows apart at which a shift is looked for.
const FARTHEST_SHIFT: usize = 3;

/// Everything that a row measured, to the last bit.
fn measured(o: &Observation) -> Vec<u64> {
    let mut bits: Vec<u64> = Vec::new();
    let mut point = |p: &Vector3<f64>| bits.extend(p.iter().map(|x| x.to_bits()));
    o.position.iter().for_each(&mut point);
    o.targets.iter().flatten().for_each(&mut point);
    if let Some(r) = &o.rotation {
        bits.extend(r.iter().map(|x| x.to_bits()));
    }
    bits.extend(o.length.iter().map(|x| x.to_bits()));
    bits
}

/// Rows that measured the same to the last digit, which noise never does. Also returns all
/// rows but the first of each such group, which are accounted for.
pub(super) fn duplicates(all: &[&Observation]) -> (Vec<Finding>, Vec<usize>) {
    let mut groups: BTreeMap<Vec<u64>, Vec<&Observation>> = BTreeMap::new();
    for o in all {
        groups.entry(measured(o)).or_default().push(o);
    }
    let mut groups: Vec<Vec<&Observation>> = groups
        .into_iter()
        .filter(|(bits, group)| bits.len() >= 3 && group.len() > 1)
        .map(|(_, group)| group)
        .collect();
    groups.sort_by_key(|g| g.first().map(|o| o.row));
    let mut findings = Vec::new();
    let mut known = Vec::new();
    for group in groups {
        let rows: Vec<usize> = group.iter().map(|o| o.row).collect();
        let same = |a: &Observation, b: &Observation| {
            a.q.iter()
                .zip(&b.q)
                .all(|(a, b)| a.to_bits() == b.to_bits())
        };
        let alike = group.windows(2).all(|w| same(w[0], w[1]));
        known.extend(rows.iter().skip(1));
        let list = rows.iter().map(ToString::to_string).collect::<Vec<_>>();
        findings.push(Finding {
            kind: Kind::DuplicatedRows,
            columns: Vec::new(),
            saw: if alike {
                format!(
                    "rows {} are the same to the last digit: one measurement counts several times",
                    list.join(", ")
                )
            } else {
                format!(
                    "rows {} have different joints and the same measured values to the last \
                     digit: all but one were copied",
                    list.join(", ")
                )
            },
            advice: if alike {
                "keep one of them".to_owned()
            } else {
                "delete those whose joints the values do not belong to".to_owned()
            },
            rows,
            misfit: [0.0; 2],
            p_value: None,
        });
    }
    (findings, known)
}

/// A row with where the model has it.
struct Placed<'a> {
    o: &'a Observation,
    predicted: truepose::Pose<f64>,
}

/// Misfit of what `a` measured against where `b`'s joints put the tool, m.
fn misfit(a: &Placed<'_>, b: &Placed<'_>) -> f64 {
    let Some(p) = a.o.position else { return 0.0 };
    let distance = (p - b.predicted.translation).norm();
    let turn =
        a.o.rotation
            .map_or(0.0, |r| angle(&(r * b.predicted.rotation.transpose())));
    distance + LEVER * turn
}

/// Looks for rows whose measured values fit another row's joints. `arm`: the fitted arm,
/// where the columns are right. `known`: rows already accounted for.
pub(super) fn check(
    problem: &Problem,
    all: &[&Observation],
    placing: &Placing,
    arm: Option<&ArmModel>,
    known: &[usize],
    findings: &mut Vec<Finding>,
) {
    if arm.is_none() && findings.iter().any(|f| f.kind != Kind::DuplicatedRows) {
        return; // where the columns are wrong no row fits
    }
    let flanges = Flanges::new(&problem.drawing);
    let with_position = || all.iter().filter(|o| o.position.is_some());
    let mut rows: Vec<Placed<'_>> = with_position()
        .map(|o| Placed {
            predicted: placing.predict(&flanges.at(&o.q)),
            o,
        })
        .collect();
    let each = |rows: &[Placed<'_>]| rows.iter().map(|r| misfit(r, r)).collect::<Vec<f64>>();
    let mut own = each(&rows);
    if let Some(arm) = arm {
        let mut evaluator = Evaluator::new(arm, problem.sigmas);
        let fitted: Vec<Placed<'_>> = with_position()
            .map(|o| Placed {
                predicted: evaluator.observe(o),
                o,
            })
            .collect();
        let of_fit = each(&fitted);
        // many wrong rows spoil a fit more than a robust placing
        if middle(&of_fit) < middle(&own) {
            (rows, own) = (fitted, of_fit);
        }
    }
    let typical = middle(&own).max(1e-9);
    let mut bad: Vec<usize> = (0..rows.len())
        .filter(|&i| own[i] > APART * typical && !known.contains(&rows[i].o.row))
        .collect();
    let shifted = shifts(&rows, &own, typical, &bad, findings);
    bad.retain(|i| !shifted.contains(i));
    bad.sort_by(|&a, &b| own[b].total_cmp(&own[a]).then(a.cmp(&b)));
    bad.truncate(LOOKED_AT);
    bad.sort_unstable();
    swaps(&rows, &own, typical, &bad, findings);
}

/// True where `i`'s values fit `k`'s joints, with room for what noise and the model's own
/// errors leave.
fn fits(rows: &[Placed<'_>], own: &[f64], typical: f64, i: usize, k: usize) -> bool {
    let there = misfit(&rows[i], &rows[k]);
    there * FACTOR < own[i] && there < APART * typical
}

fn swaps(
    rows: &[Placed<'_>],
    own: &[f64],
    typical: f64,
    bad: &[usize],
    findings: &mut Vec<Finding>,
) {
    let mut taken: Vec<usize> = Vec::new();
    for (at, &i) in bad.iter().enumerate() {
        let partner = bad.iter().skip(at + 1).copied().find(|&k| {
            let both = fits(rows, own, typical, i, k) && fits(rows, own, typical, k, i);
            both && !taken.contains(&i) && !taken.contains(&k)
        });
        let Some(k) = partner else { continue };
        taken.extend([i, k]);
        let after = misfit(&rows[i], &rows[k]).max(misfit(&rows[k], &rows[i]));
        let (a, b) = (rows[i].o.row, rows[k].o.row);
        findings.push(Finding {
            kind: Kind::SwappedRows,
            rows: vec![a, b],
            columns: Vec::new(),
            saw: format!(
                "what row {a} measured fits the joints of row {b} and the other way round: off \
                 by {} and {} as they stand, {} exchanged",
                millimetres(own[i]),
                millimetres(own[k]),
                millimetres(after)
            ),
            advice: "exchange the measured values of the two rows, or leave both out".to_owned(),
            misfit: [own[i].min(own[k]), after],
            p_value: None,
        });
    }
}

/// Stretches of rows whose values fit the joints of the row a fixed number away. Returns the
/// rows that are explained.
fn shifts(
    rows: &[Placed<'_>],
    own: &[f64],
    typical: f64,
    bad: &[usize],
    findings: &mut Vec<Finding>,
) -> Vec<usize> {
    let mut explained: Vec<usize> = Vec::new();
    let is_bad = |i: usize| bad.binary_search(&i).is_ok();
    for by in 1..=FARTHEST_SHIFT {
        for below in [true, false] {
            // joints of the row before: what was measured stands below its joints
            let partner = |i: usize| {
                let k = if below {
                    i.checked_sub(by)
                } else {
                    Some(i + by)
                };
                k.filter(|&k| k < rows.len())
            };
            let shifted =
                |i: usize| is_bad(i) && partner(i).is_some_and(|k| fits(rows, own, typical, i, k));
            let marked: Vec<usize> = (0..rows.len())
                .filter(|&i| shifted(i) && !explained.contains(&i))
                .collect();
            for run in marked.chunk_by(|a, b| b - a <= 2) {
                let (Some(&first), Some(&last)) = (run.first(), run.last()) else {
                    continue;
                };
                if run.len() < LEAST_SHIFTED {
                    continue;
                }
                explained.extend(run);
                let before: Vec<f64> = run.iter().map(|&i| own[i]).collect();
                let after: Vec<f64> = run
                    .iter()
                    .filter_map(|&i| Some(misfit(&rows[i], &rows[partner(i)?])))
                    .collect();
                let (before, after) = (middle(&before), middle(&after));
                let noun = if by == 1 { "row" } else { "rows" };
                let side = if below { "below" } else { "above" };
                findings.push(Finding {
                    kind: Kind::ShiftedRows,
                    rows: run.iter().map(|&i| rows[i].o.row).collect(),
                    columns: Vec::new(),
                    saw: format!(
                        "from row {} to row {} measured values stand {by} {noun} {side} their \
                         joints: typically {} off as they stand, {} so",
                        rows[first].o.row,
                        rows[last].o.row,
                        millimetres(before),
                        millimetres(after)
                    ),
                    advice: "look for a row that was lost or doubled where this begins".to_owned(),
                    misfit: [before, after],
                    p_value: None,
                });
            }
        }
    }
    explained.sort_unstable();
    explained
}
