//! What is measured of the arm, and how well.

use nalgebra::Vector3;

use super::campaign::{Conditions, Visit};
use super::solid::{Solid, moved, origin, place, quaternion};
use crate::random::Random;

/// What the instrument sees.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// The tool point.
    Position,
    /// The tool's full pose.
    Pose,
    /// The tool point and further targets at these nominal offsets, tool frame, m.
    Targets(Vec<[f64; 3]>),
    /// The length of a wire from a fixed point to the tool point.
    Length,
}

/// An instrument and its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Instrument {
    /// What it sees.
    pub seen: Seen,
    /// One standard deviation per axis, m.
    pub position_sigma: f64,
    /// One standard deviation per axis, rad.
    pub orientation_sigma: f64,
    /// Degrees of freedom of Student's t, scaled to the sigmas; `None`: normal.
    pub student: Option<u32>,
    /// Share of rows that are grossly wrong, and by how much per axis, m (one sigma).
    pub outliers: Option<(f64, f64)>,
    /// What it declares: factors on both sigmas; `None`: nothing.
    pub declared: Option<[f64; 2]>,
}

impl Instrument {
    /// Sees `seen` with 0.02 mm and 0.004 deg of normal noise, truly declared.
    pub fn new(seen: Seen) -> Self {
        Self {
            seen,
            position_sigma: 2e-5,
            orientation_sigma: 7e-5,
            student: None,
            outliers: None,
            declared: Some([1.0; 2]),
        }
    }

    /// Without noise.
    pub fn perfect(seen: Seen) -> Self {
        Self {
            position_sigma: 0.0,
            orientation_sigma: 0.0,
            declared: None,
            ..Self::new(seen)
        }
    }
}

/// One measured row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What the arm was sent to, and the conditions.
    pub visit: Visit,
    /// Joint readings, rad or m.
    pub reading: Vec<f64>,
    /// Measured numbers in the order of [`Measured::columns`], m or quaternion.
    pub values: Vec<f64>,
    /// Where the tool really was, world frame. In no file.
    pub truth: Solid,
    /// True where the instrument was grossly wrong. In no file.
    pub outlier: bool,
}

/// A measured series.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// In the order of measuring.
    pub rows: Vec<Row>,
    /// What measured it.
    pub instrument: Instrument,
    /// What is written down.
    pub conditions: Conditions,
}

impl Measured {
    /// Names of the measured columns, in the order of [`Row::values`].
    pub fn columns(&self) -> Vec<String> {
        let name = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        match &self.instrument.seen {
            Seen::Position => name(&["x", "y", "z"]),
            Seen::Pose => name(&["x", "y", "z", "qw", "qx", "qy", "qz"]),
            Seen::Length => name(&["length"]),
            Seen::Targets(offsets) => {
                let mut columns = name(&["x", "y", "z"]);
                for k in 0..offsets.len() {
                    columns.extend(["x", "y", "z"].map(|axis| format!("{axis}{}", k + 2)));
                }
                columns
            }
        }
    }
}

/// Fixed things of the measuring set-up that nobody knows exactly.
#[derive(Clone, Debug)]
pub(crate) struct SetUp {
    /// Where the wire comes from, world, m.
    pub(crate) anchor: Vector3<f64>,
    /// How far the further targets are from their nominal offsets, m.
    pub(crate) target_errors: Vec<[f64; 3]>,
}

impl SetUp {
    /// Offsets as they are.
    pub(crate) fn offsets(&self, nominal: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let at = |k: usize| self.target_errors.get(k).copied().unwrap_or([0.0; 3]);
        (nominal.iter().enumerate())
            .map(|(k, offset)| [0, 1, 2].map(|c| offset[c] + at(k)[c]))
            .collect()
    }
}

/// Measures the tool at `truth`. Returns the values and whether they are grossly wrong.
pub(crate) fn observe(
    instrument: &Instrument,
    set_up: &SetUp,
    truth: &Solid,
    random: &mut Random,
) -> (Vec<f64>, bool) {
    let outlier = match instrument.outliers {
        Some((share, _)) => random.unit() < share,
        None => false,
    };
    let gross = match (outlier, instrument.outliers) {
        (true, Some((_, size))) => size,
        _ => 0.0,
    };
    let mut draw = |sigma: f64| match instrument.student {
        Some(freedom) => sigma * random.student(freedom),
        None => sigma * random.normal(),
    };
    let sigma = instrument.position_sigma;
    let mut point = |p: Vector3<f64>| -> [f64; 3] {
        [p.x, p.y, p.z].map(|x| x + draw(sigma) + if outlier { draw(gross) } else { 0.0 })
    };
    let tool = origin(truth);
    let values = match &instrument.seen {
        Seen::Position => point(tool).to_vec(),
        Seen::Targets(nominal) => {
            let mut values = point(tool).to_vec();
            for offset in set_up.offsets(nominal) {
                values.extend(point(place(truth, offset)));
            }
            values
        }
        Seen::Length => {
            let wire = libm::sqrt((tool - set_up.anchor).norm_squared());
            let [length, _, _] = point(Vector3::new(wire, 0.0, 0.0));
            vec![length]
        }
        Seen::Pose => {
            let mut values = point(tool).to_vec();
            let turn = [(); 3].map(|()| draw(instrument.orientation_sigma));
            let turned = moved(&[0.0, 0.0, 0.0, turn[0], turn[1], turn[2]]) * truth;
            values.extend(quaternion(&turned));
            values
        }
    };
    (values, outlier)
}
