//! Runs of rows in which one joint alone moves.

use nalgebra::Vector3;

/// A measured point of the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Number of the data row.
    pub row: usize,
    /// Readings, rad or m.
    pub q: Vec<f64>,
    /// In the instrument's frame, m.
    pub position: Vector3<f64>,
}

/// Points of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep<'a> {
    /// The joint that moves, from 0.
    pub joint: usize,
    /// In the order of the file.
    pub points: Vec<&'a Point>,
}

/// A joint whose reading changes by less is at rest, rad or m: above the jitter of any encoder,
/// below any step of a sweep.
const REST: f64 = 5e-4;

/// Points that a sweep needs: three make a circle, the fourth shows that it is one.
pub const FEWEST: usize = 4;

/// All sweeps of at least [`FEWEST`] points, in the order of the file. Runs may share the row
/// where one ends and the next begins.
pub fn sweeps(points: &[Point]) -> Vec<Sweep<'_>> {
    let mut found = Vec::new();
    let mut start = 0;
    while start < points.len() {
        let mut joint = None;
        let mut end = start + 1;
        while let Some(point) = points.get(end) {
            match (joint, moved(&points[start], point)) {
                (_, Moved::None) => {}
                (None, Moved::One(j)) => joint = Some(j),
                (Some(k), Moved::One(j)) if j == k => {}
                _ => break,
            }
            end += 1;
        }
        if let Some(joint) = joint
            && end - start >= FEWEST
        {
            found.push(Sweep {
                joint,
                points: points[start..end].iter().collect(),
            });
        }
        let last = end - 1;
        let goes_on = points
            .get(end)
            .is_some_and(|next| matches!(moved(&points[last], next), Moved::One(_)));
        start = if goes_on && last > start { last } else { end };
    }
    found
}

enum Moved {
    None,
    One(usize),
    Several,
}

fn moved(from: &Point, to: &Point) -> Moved {
    let mut joints = (from.q.iter().zip(&to.q).enumerate())
        .filter(|(_, (a, b))| (*a - *b).abs() > REST)
        .map(|(joint, _)| joint);
    match (joints.next(), joints.next()) {
        (None, _) => Moved::None,
        (Some(joint), None) => Moved::One(joint),
        _ => Moved::Several,
    }
}
