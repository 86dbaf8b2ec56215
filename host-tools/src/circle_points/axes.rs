//! From a sweep to its joint's axis.

use nalgebra::{Vector2, Vector3};
use truepose::JointKind;

use super::fits::{circle, line, plane};
use super::sweeps::Sweep;
use super::{Failure, at};
use crate::convert::Axis;

/// What a target drew while one joint moved.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The joint, from 0.
    pub joint: usize,
    /// Number of points.
    pub points: usize,
    /// Numbers of the first and the last row.
    pub rows: [usize; 2],
    /// Mean readings of all joints; those before the joint say where its axis is seen.
    pub posture: Vec<f64>,
    /// The axis where it was seen, in the instrument's frame.
    pub axis: Axis,
    /// What was drawn.
    pub drawn: Drawn,
    /// Standard deviation of the points from it, m, per direction.
    pub sigma: f64,
    /// Standard error of the axis' direction in its worst sense, rad.
    pub direction_error: f64,
    /// Standard error of the axis' place across, in its worst sense, m; none for a slide.
    pub point_error: f64,
}

/// Shape of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drawn {
    /// Radius, m.
    Circle(f64),
    /// Length, m.
    Line(f64),
}

/// A reading may be off by so much of what was moved: enough for any gear, too little for a
/// wrong unit.
const SCALE_SLACK: f64 = 0.1;

/// Points on a circle are so many times nearer to it than to a line.
const CURVED: f64 = 3.0;

impl Traced {
    /// Of a sweep; `kind` where it is known.
    pub fn of(sweep: &Sweep<'_>, kind: Option<JointKind>) -> Result<Self, Failure> {
        let positions: Vec<Vector3<f64>> = sweep.points.iter().map(|p| p.position).collect();
        let q: Vec<f64> = sweep
            .points
            .iter()
            .filter_map(|p| p.q.get(sweep.joint).copied())
            .collect();
        let rows = [
            sweep.points.first().map_or(0, |p| p.row),
            sweep.points.last().map_or(0, |p| p.row),
        ];
        let joints = sweep.points.first().map_or(0, |p| p.q.len());
        let count = sweep.points.len();
        let mean = |j: usize| {
            let each = sweep.points.iter().filter_map(|p| p.q.get(j));
            each.sum::<f64>() / count as f64
        };
        let slide = along(&positions, &q);
        let turn = about(&positions, &q);
        let fits = |scale: f64| (scale - 1.0).abs() < SCALE_SLACK;
        let (shape, wanted) = match (slide, turn) {
            (_, Some(turn))
                if fits(turn.scale)
                    && slide.is_none_or(|slide| CURVED * turn.sigma < slide.sigma) =>
            {
                (turn, JointKind::Revolute)
            }
            (Some(slide), _) if fits(slide.scale) => (slide, JointKind::Prismatic),
            (slide, turn) => {
                // Which of the two it is nearer to is not known: the unit says, or the shape.
                let scale = match kind {
                    Some(JointKind::Prismatic) => slide.map(|s| s.scale),
                    _ => turn.map(|t| t.scale),
                };
                return Err(Failure::NoShape(sweep.joint, rows[0], scale));
            }
        };
        if kind.is_some_and(|kind| kind != wanted) {
            return Err(Failure::NoShape(sweep.joint, rows[0], None));
        }
        Ok(Self {
            joint: sweep.joint,
            points: count,
            rows,
            posture: (0..joints).map(mean).collect(),
            axis: Axis {
                kind: wanted,
                direction: shape.direction,
                point: shape.point,
            },
            drawn: shape.drawn,
            sigma: shape.sigma,
            direction_error: shape.direction_error,
            point_error: shape.point_error,
        })
    }
}

#[derive(Clone, Copy)]
struct Shape {
    direction: Vector3<f64>,
    point: Vector3<f64>,
    drawn: Drawn,
    sigma: f64,
    direction_error: f64,
    point_error: f64,
    /// What was moved over what was read.
    scale: f64,
}

/// Slope of `y` over `x`, least squares. MRD 4.232.
fn slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().max(1) as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, y) in x.iter().zip(y) {
        xy += (x - mx) * (y - my);
        xx += (x - mx).powi(2);
    }
    xy / xx
}

fn along(positions: &[Vector3<f64>], q: &[f64]) -> Option<Shape> {
    let fit = line(positions)?;
    let way: Vec<f64> = positions
        .iter()
        .map(|p| (p - fit.point).dot(&fit.direction))
        .collect();
    let scale = slope(q, &way);
    let sense = scale.signum();
    let (low, high) = way
        .iter()
        .fold((0.0_f64, 0.0_f64), |(l, h), w| (l.min(*w), h.max(*w)));
    Some(Shape {
        direction: fit.direction * sense,
        point: fit.point,
        drawn: Drawn::Line(high - low),
        sigma: fit.sigma,
        direction_error: fit.direction_error,
        point_error: 0.0,
        scale: scale.abs(),
    })
}

fn about(positions: &[Vector3<f64>], q: &[f64]) -> Option<Shape> {
    let flat = plane(positions)?;
    let [x, y] = flat.axes;
    let inside: Vec<Vector2<f64>> = positions
        .iter()
        .map(|p| Vector2::new((p - flat.point).dot(&x), (p - flat.point).dot(&y)))
        .collect();
    let fit = circle(&inside)?;
    // Angle from point to point, added up: a sweep may go round more than once, but not from
    // one point to the next.
    let mut angles = vec![0.0];
    for pair in inside.windows(2) {
        let [from, to] = pair else { break };
        let (a, b) = (from - fit.center, to - fit.center);
        let turn = (a.x * b.y - a.y * b.x).atan2(a.dot(&b));
        angles.push(angles.last().copied().unwrap_or(0.0) + turn);
    }
    let scale = slope(q, &angles);
    let n = positions.len() as f64;
    // The plane's and the circle's residuals together, 2 n numbers for 6.
    let squares = flat.sigma.powi(2) * (n - 3.0) + fit.sigma.powi(2) * (n - 3.0);
    let sigma = (squares / (2.0 * n - 6.0)).sqrt();
    let spread = fit.cofactor.symmetric_eigenvalues().max().max(0.0);
    let tilt = if flat.sigma > 0.0 {
        flat.normal_errors[1] / flat.sigma
    } else {
        0.0
    };
    Some(Shape {
        direction: flat.normal * scale.signum(),
        point: flat.point + x * fit.center.x + y * fit.center.y,
        drawn: Drawn::Circle(fit.radius),
        sigma,
        direction_error: sigma * tilt,
        point_error: sigma * spread.sqrt(),
        scale: scale.abs(),
    })
}

/// The axis of one joint with all joints at zero, from all its sweeps; `before`: the axes of
/// the joints before it, at zero. `None` without a sweep.
pub(super) fn at_zero(before: &[Axis], seen: &[Traced]) -> Option<Axis> {
    let carried: Vec<(Axis, &Traced)> = seen
        .iter()
        .map(|t| (t.axis.moved(&at(before, &t.posture).inverse()), t))
        .collect();
    let (first, _) = carried.first()?;
    let weight = |error: f64| 1.0 / error.max(1e-15).powi(2);
    let mut direction = Vector3::zeros();
    for (axis, traced) in &carried {
        // Two ways to see a joint must agree on its kind.
        if axis.kind != first.kind {
            return None;
        }
        direction += axis.direction * weight(traced.direction_error);
    }
    let direction = direction.normalize();
    // Points of one line: only where they are across counts.
    let (mut across, mut sum) = (Vector3::zeros(), 0.0);
    for (axis, traced) in &carried {
        let way = axis.point - first.point;
        let weight = weight(traced.point_error);
        across += (way - direction * way.dot(&direction)) * weight;
        sum += weight;
    }
    Some(Axis {
        kind: first.kind,
        direction,
        point: first.point + across / sum,
    })
}
