//! Which rows no fit ever sees.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::{Dataset, Row, Set};
use crate::warning::Warning;

/// Share of the rows that is held back where the table does not say.
const SHARE: f64 = 0.3;
/// Rows whose joints all agree within this are the same pose measured again, rad or m.
const SAME: f64 = 1e-3;

/// Sets every row's side of the split. `sets`: what the table says of each row.
///
/// Rows that say nothing are grouped by pose; whole groups are held back, in an order that
/// depends on nothing but the rows' order, until their share is reached. A row that repeats a
/// verify row's pose is held back with it.
pub(super) fn hold_back(dataset: &mut Dataset, sets: &[Option<Set>]) {
    let mut undecided = 0_usize;
    for (row, set) in dataset.rows.iter_mut().zip(sets) {
        match set {
            Some(set) => row.set = *set,
            None => undecided += 1,
        }
    }
    if undecided > 0 {
        let groups = with_pairs(&dataset.rows, poses(&dataset.rows));
        let held = choose(&groups, sets, undecided);
        for ((row, group), set) in dataset.rows.iter_mut().zip(&groups).zip(sets) {
            if set.is_none() && held.contains(group) {
                row.set = Set::Verify;
                dataset.held_back.push(row.number);
            }
        }
        dataset.warnings.push(Warning::HeldBack {
            file: dataset.file.clone(),
            of: undecided,
            rows: dataset.held_back.clone(),
        });
    }
    if dataset.rows.iter().all(|row| row.set == Set::Identify) {
        dataset.warnings.push(Warning::NothingHeldBack {
            file: dataset.file.clone(),
        });
    }
}

/// The groups with those of the two rows of every pair made one.
fn with_pairs(rows: &[Row], mut groups: Vec<usize>) -> Vec<usize> {
    let mut joined: Vec<usize> = (0..rows.len()).collect();
    let leader = |joined: &[usize], mut at: usize| {
        while let Some(&next) = joined.get(at)
            && next != at
        {
            at = next;
        }
        at
    };
    let mut any = false;
    for members in super::relations::pairs(rows).into_values() {
        let mut of = members.iter().filter_map(|&i| groups.get(i).copied());
        if let (Some(a), Some(b)) = (of.next(), of.next()) {
            let (a, b) = (leader(&joined, a), leader(&joined, b));
            if let Some(slot) = joined.get_mut(a.max(b)) {
                *slot = a.min(b);
                any = true;
            }
        }
    }
    if any {
        for group in &mut groups {
            *group = leader(&joined, *group);
        }
    }
    groups
}

/// The groups whose undecided rows are held back.
fn choose(groups: &[usize], sets: &[Option<Set>], undecided: usize) -> BTreeSet<usize> {
    let share = (SHARE * undecided as f64).round() as usize;
    let mut sizes = BTreeMap::new();
    let mut held = BTreeSet::new();
    for (group, set) in groups.iter().zip(sets) {
        let size: &mut usize = sizes.entry(*group).or_default();
        match set {
            None => *size += 1,
            Some(Set::Verify) => {
                held.insert(*group);
            }
            Some(Set::Identify) => {}
        }
    }
    let mut count: usize = held.iter().filter_map(|group| sizes.get(group)).sum();
    let mut order: Vec<(u64, usize)> = sizes.keys().map(|&g| (shuffled(g as u64), g)).collect();
    order.sort_unstable();
    for (_, group) in order {
        if count >= share {
            break;
        }
        if held.insert(group) {
            count += sizes.get(&group).copied().unwrap_or(0);
        }
    }
    held
}

/// For each row the first row (place in `rows`) that has the same pose.
///
/// The rows are sorted along one generic direction of joint space, on which equal poses lie
/// closer than `SAME` times the sum of its components: only those neighbours are compared.
fn poses(rows: &[Row]) -> Vec<usize> {
    // Components without common measure: a grid of joint angles does not fold onto itself.
    let weight = |k: usize| (2.0 + k as f64).sqrt();
    let along = |q: &[f64]| -> f64 { q.iter().enumerate().map(|(k, q)| weight(k) * q).sum() };
    let width = rows
        .first()
        .map_or(0.0, |row| SAME * (0..row.q.len()).map(weight).sum::<f64>());
    let mut sorted: Vec<(f64, usize)> = rows
        .iter()
        .enumerate()
        .map(|(i, row)| (along(&row.q), i))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut group: Vec<usize> = (0..rows.len()).collect();
    // Leaders still within reach of the row at hand.
    let mut leaders: VecDeque<(f64, usize)> = VecDeque::new();
    for &(place, i) in &sorted {
        while leaders.front().is_some_and(|(p, _)| place - p > width) {
            leaders.pop_front();
        }
        let same = |a: usize, b: usize| match (rows.get(a), rows.get(b)) {
            (Some(a), Some(b)) => a.q.iter().zip(&b.q).all(|(a, b)| (a - b).abs() <= SAME),
            _ => false,
        };
        match leaders.iter().find(|(_, leader)| same(*leader, i)) {
            Some((_, leader)) => {
                if let Some(slot) = group.get_mut(i) {
                    *slot = *leader;
                }
            }
            None => leaders.push_back((place, i)),
        }
    }
    group
}

/// A fixed shuffle of the integers (SplitMix64's finaliser).
fn shuffled(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
