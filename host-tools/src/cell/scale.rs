//! How large an effect has to be to show.
//!
//! A geometric fit takes up part of every effect. What it leaves on rows that it has not seen
//! decides how much an effect raises the verification error; here that part is computed to
//! first order, and the effect scaled to raise the error by a wanted ratio. Likewise what is
//! left where a fit is told what the arm hides.

use nalgebra::Vector3;

use super::campaign::Visit;
use super::hidden::Hidden;
use super::instrument::{Instrument, Row, Seen};
use super::physics::{Body, Placed, early};
use super::solid::{Solid, axes, origin, place, quaternion};

/// Why an effect cannot be made to show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invisible {
    /// The effect.
    pub hidden: Hidden,
    /// Size that it would need, in its unit; infinite where no size is enough.
    pub needed: f64,
    /// The largest size that a real arm would show.
    pub plausible: f64,
}

impl std::fmt::Display for Invisible {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} {:?} would need a size of {:.1e} to show in these poses; more than {:.1e} is \
             not plausible",
            self.hidden.kind(),
            self.hidden.joint().map(|j| j + 1),
            self.needed,
            self.plausible
        )
    }
}

impl std::error::Error for Invisible {}

/// A deviation that is to be expected of a link, m and rad: scales the geometry's columns.
const EXPECTED: [f64; 6] = [1e-3, 1e-3, 1e-3, 3e-3, 3e-3, 3e-3];

/// Size of `placed` at which a geometric fit to the identify rows misses the verify rows by
/// `ratio` times what it misses without the effect.
pub(crate) fn size_for_ratio(
    body: &Body,
    placed: &Placed,
    ratio: f64,
    visits: &[Visit],
    instrument: &Instrument,
    anchor: &Vector3<f64>,
) -> Result<f64, Invisible> {
    let plausible = placed.hidden.plausible();
    let trial = Placed {
        size: 0.1 * plausible,
        ..*placed
    };
    let invisible = |needed: f64| Invisible {
        hidden: placed.hidden,
        needed,
        plausible,
    };
    let sigma = instrument.position_sigma.max(1e-6);
    let sigmas = [sigma, instrument.orientation_sigma.max(1e-6)];
    // A placement that is written down is fitted anew; one that is not is the effect itself.
    let placements = match placed.hidden {
        Hidden::InstrumentMoved => 1,
        _ => visits.iter().map(|v| v.session + 1).max().unwrap_or(1),
    };
    let rows: Vec<Vec<Line>> = visits
        .iter()
        .map(|visit| {
            let mut lines = lines(body, &trial, visit, instrument, &sigmas, anchor);
            for line in &mut lines {
                line.place_again(visit.session, placements);
            }
            lines
        })
        .collect();
    let width = rows
        .iter()
        .flatten()
        .next()
        .map_or(0, |line| line.columns.len());
    // Normal equations with a wide prior (one expected deviation): the fit is never singular,
    // and what it cannot see stays at zero.
    let mut normal = Normal::new(width);
    let mut count = 0_usize;
    for (row, visit) in rows.iter().zip(visits) {
        if !visit.verify {
            row.iter().for_each(|line| normal.add(line));
            count += row.len();
        }
    }
    let fit = normal.solve();
    let (mut left, mut seen) = (0.0, 0_usize);
    for (row, visit) in rows.iter().zip(visits) {
        if visit.verify || visits.iter().all(|v| !v.verify) {
            for line in row.iter().filter(|line| line.is_length) {
                let predicted: f64 = line.columns.iter().zip(&fit).map(|(a, b)| a * b).sum();
                left += (line.effect - predicted) * (line.effect - predicted);
                seen += 1;
            }
        }
    }
    // In units of sigma squared a coordinate; the fit's own scatter counts as noise too.
    let left = left / seen.max(1) as f64;
    let parameters = normal.rank.min(count) as f64;
    let noise = 1.0 + parameters / (count.max(1) as f64);
    if left <= 1e-12 {
        return Err(invisible(f64::INFINITY));
    }
    let size = trial.size * libm::sqrt((ratio * ratio - 1.0).max(0.0) * noise / left);
    if size > plausible {
        return Err(invisible(size));
    }
    Ok(size)
}

/// Verify rms, m, of a fit to `rows` that is told the structure of everything hidden: to first
/// order what least squares leave of the noise, when it has the columns of geometry, of each
/// effect's size and, of a curve, all its harmonics, each expected at its share of the curve.
/// Grossly wrong rows are left out. Positions and poses only.
pub(crate) fn told(
    body: &Body,
    hidden: &[Placed],
    rows: &[Row],
    instrument: &Instrument,
    anchor: &Vector3<f64>,
) -> f64 {
    let sigmas = [
        instrument.position_sigma.max(1e-6),
        instrument.orientation_sigma.max(1e-6),
    ];
    let placements = rows.iter().map(|r| r.visit.session + 1).max().unwrap_or(1);
    // What is free of each effect, at its expected height, and what of it the fit has to find.
    let mut free: Vec<(Placed, f64)> = Vec::new();
    for placed in hidden {
        let of_curve = placed.shape.curve.as_flattened();
        for (k, &height) in of_curve.iter().enumerate() {
            let share = libm::sqrt(1.0 / 24.0);
            let mut one = *placed;
            one.shape.curve = Default::default();
            one.shape.curve.as_flattened_mut()[k] = share;
            match placed.hidden {
                Hidden::JointCurve { .. } => free.push((one, height / share)),
                // least squares find an unbiased size whatever it is
                _ if k == 0 => free.push((*placed, 0.0)),
                _ => {}
            }
        }
    }
    let lines_of = |row: &Row| {
        let of = |placed: &Placed| lines(body, placed, &row.visit, instrument, &sigmas, anchor);
        let noise = noise(row, &sigmas);
        let mut all: Vec<Line> = match hidden.first() {
            Some(first) => of(first),
            None => Vec::new(),
        };
        for (line, noise) in all.iter_mut().zip(noise) {
            line.place_again(row.visit.session, placements);
            line.effect = noise;
        }
        for (placed, share) in &free {
            for (line, of_it) in all.iter_mut().zip(of(placed)) {
                line.columns.push(of_it.effect);
                line.effect += share * of_it.effect;
            }
        }
        all
    };
    let kept = rows.iter().filter(|r| !r.outlier);
    let (verify, identify): (Vec<&Row>, Vec<&Row>) = kept.partition(|r| r.visit.verify);
    let width = identify
        .first()
        .and_then(|r| lines_of(r).first().map(|l| l.columns.len()));
    let mut normal = Normal::new(width.unwrap_or(0));
    for row in &identify {
        lines_of(row).iter().for_each(|line| normal.add(line));
    }
    let fit = normal.solve();
    let mut sum = 0.0;
    for row in &verify {
        for line in lines_of(row).iter().filter(|l| l.is_length) {
            let predicted: f64 = line.columns.iter().zip(&fit).map(|(a, b)| a * b).sum();
            sum += (line.effect - predicted) * (line.effect - predicted);
        }
    }
    sigmas[0] * libm::sqrt(sum / verify.len().max(1) as f64)
}

/// What the instrument added to the truth, in sigmas: position, then rotation.
fn noise(row: &Row, sigmas: &[f64; 2]) -> Vec<f64> {
    let tool = origin(&row.truth);
    let mut noise: Vec<f64> = (row.values.iter().zip(tool.iter()))
        .map(|(seen, there)| (seen - there) / sigmas[0])
        .collect();
    if let [_, _, _, w, x, y, z] = row.values[..] {
        let [a, b, c, d] = quaternion(&row.truth);
        // twice the vector part of seen times truth turned back
        let turn = [
            -w * b + x * a - y * d + z * c,
            -w * c + x * d + y * a - z * b,
            -w * d - x * c + y * b + z * a,
        ];
        let sign = (w * a + x * b + y * c + z * d).signum();
        noise.extend(turn.map(|v| 2.0 * sign * v / sigmas[1]));
    }
    noise
}

/// One measured number: how the effect and every geometric deviation move it, in sigmas.
struct Line {
    effect: f64,
    columns: Vec<f64>,
    is_length: bool,
}

impl Line {
    /// Adds columns for every placement after the first: those of the base, in its own rows.
    fn place_again(&mut self, session: u32, placements: u32) {
        let base: Vec<f64> = self.columns.iter().take(EXPECTED.len()).copied().collect();
        for placement in 1..placements {
            let own = |x: &f64| if placement == session { *x } else { 0.0 };
            self.columns.extend(base.iter().map(own));
        }
    }
}

/// One way in which a frame may be misplaced: along, about, the frame's origin, by how much.
type Misplacement = (Vector3<f64>, Vector3<f64>, Vector3<f64>, f64);

/// The lines of one row. Geometry is complete: any small misplacement of the base, of every
/// link's end, of the tool and of the targets.
fn lines(
    body: &Body,
    trial: &Placed,
    visit: &Visit,
    instrument: &Instrument,
    sigmas: &[f64; 2],
    anchor: &Vector3<f64>,
) -> Vec<Line> {
    let frames = body.frames(&visit.q);
    let still = &frames.tool;
    let placed = std::slice::from_ref(trial);
    let displaced = if trial.hidden == Hidden::EarlyReading {
        // The file says `q + missing`; the arm is at `q`.
        let q: Vec<f64> = visit
            .q
            .iter()
            .zip(early(placed, visit))
            .map(|(q, e)| q - e)
            .collect();
        body.frames(&q).tool
    } else {
        body.pose(placed, visit)
    };
    let bodies: Vec<&Solid> = std::iter::once(&body.base).chain(&frames.ends).collect();
    let twists: Vec<Misplacement> = bodies
        .iter()
        .flat_map(|frame| {
            let (r, o) = (axes(frame), origin(frame));
            (0..6).map(move |k| {
                let axis = r.column(k % 3).into_owned();
                let zero = Vector3::zeros();
                let expected = EXPECTED.get(k).copied().unwrap_or(1e-3);
                if k < 3 {
                    (axis, zero, o, expected)
                } else {
                    (zero, axis, o, expected)
                }
            })
        })
        .collect();
    let offsets: Vec<[f64; 3]> = match &instrument.seen {
        Seen::Targets(offsets) => std::iter::once([0.0; 3])
            .chain(offsets.iter().copied())
            .collect(),
        _ => vec![[0.0; 3]],
    };
    let mut lines = Vec::new();
    for (number, &offset) in offsets.iter().enumerate() {
        let point = place(still, offset);
        let effect = place(&displaced, offset) - point;
        let moves: Vec<Vector3<f64>> = twists
            .iter()
            .map(|(v, w, o, expected)| (v + w.cross(&(point - o))) * *expected)
            .collect();
        // Further targets are identified too: three columns each.
        let own: Vec<Vector3<f64>> = (1..offsets.len())
            .flat_map(|k| {
                let r = axes(still) * EXPECTED[0];
                (0..3).map(move |c| {
                    if k == number {
                        r.column(c).into_owned()
                    } else {
                        Vector3::zeros()
                    }
                })
            })
            .collect();
        let along: Vec<Vector3<f64>> = if instrument.seen == Seen::Length {
            let wire = point - anchor;
            vec![wire / wire.norm().max(1e-9)]
        } else {
            (0..3).map(|c| Vector3::ith(c, 1.0)).collect()
        };
        for u in &along {
            lines.push(Line {
                effect: u.dot(&effect) / sigmas[0],
                columns: moves
                    .iter()
                    .chain(&own)
                    .map(|m| u.dot(m) / sigmas[0])
                    .collect(),
                is_length: true,
            });
        }
    }
    if instrument.seen == Seen::Pose {
        let turn = axes(&displaced) * axes(still).transpose();
        let w = Vector3::new(
            turn[(2, 1)] - turn[(1, 2)],
            turn[(0, 2)] - turn[(2, 0)],
            turn[(1, 0)] - turn[(0, 1)],
        ) * 0.5;
        for c in 0..3 {
            lines.push(Line {
                effect: w[c] / sigmas[1],
                columns: twists
                    .iter()
                    .map(|(_, w, _, e)| w[c] * *e / sigmas[1])
                    .collect(),
                is_length: false,
            });
        }
    }
    lines
}

/// Normal equations, lower triangle by rows.
struct Normal {
    matrix: Vec<Vec<f64>>,
    right: Vec<f64>,
    /// Directions that the rows see better than the prior.
    rank: usize,
}

impl Normal {
    fn new(width: usize) -> Self {
        Self {
            matrix: (0..width).map(|i| vec![0.0; i + 1]).collect(),
            right: vec![0.0; width],
            rank: 0,
        }
    }

    fn add(&mut self, line: &Line) {
        for (i, (row, right)) in self.matrix.iter_mut().zip(&mut self.right).enumerate() {
            let x = line.columns[i];
            if x != 0.0 {
                for (entry, y) in row.iter_mut().zip(&line.columns) {
                    *entry += x * y;
                }
                *right += x * line.effect;
            }
        }
    }

    /// Cholesky's method after adding one to the diagonal.
    fn solve(&mut self) -> Vec<f64> {
        let width = self.right.len();
        let mut x = self.right.clone();
        for i in 0..width {
            let (done, rest) = self.matrix.split_at_mut(i);
            let row = &mut rest[0];
            row[i] += 1.0;
            for (j, other) in done.iter().enumerate() {
                let dot: f64 = row[..j].iter().zip(&other[..j]).map(|(a, b)| a * b).sum();
                row[j] = (row[j] - dot) / other[j];
            }
            let square: f64 = row[..i].iter().map(|a| a * a).sum();
            let pivot = (row[i] - square).max(1.0);
            if pivot > 10.0 {
                self.rank += 1;
            }
            row[i] = libm::sqrt(pivot);
            let dot: f64 = row[..i].iter().zip(&x[..i]).map(|(a, b)| a * b).sum();
            x[i] = (x[i] - dot) / row[i];
        }
        for i in (0..width).rev() {
            let later: f64 = (i + 1..width).map(|k| self.matrix[k][i] * x[k]).sum();
            x[i] = (x[i] - later) / self.matrix[i][i];
        }
        x
    }
}
