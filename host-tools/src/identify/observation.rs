//! What the solver sees of one measured row.

use nalgebra::{Matrix3, Vector3};
use truepose::effects::Ambient;

/// One measured pose, in SI units and the instrument's frame.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Data row in the file, from 1.
    pub row: usize,
    /// Joint readings, rad or m.
    pub q: Vec<f64>,
    /// Sign of the last move of each joint.
    pub direction: Vec<f64>,
    /// Move from the row before in the file, of every joint over that of the joint that
    /// moved farthest; zero for the first row.
    pub travel: Vec<f64>,
    /// Payload, temperatures, time.
    pub ambient: Ambient<f64>,
    /// Placement of the instrument, an index from 0.
    pub session: usize,
    /// Tool point, m.
    pub position: Option<Vector3<f64>>,
    /// Tool orientation.
    pub rotation: Option<Matrix3<f64>>,
    /// Further targets carried by the tool, m.
    pub targets: Vec<Option<Vector3<f64>>>,
    /// Distance from the anchor to the tool point, m.
    pub length: Option<f64>,
}

impl Observation {
    /// Scalar equations that this row gives.
    pub fn equations(&self) -> usize {
        let targets = self.targets.iter().flatten().count();
        3 * usize::from(self.position.is_some())
            + 3 * usize::from(self.rotation.is_some())
            + 3 * targets
            + usize::from(self.length.is_some())
    }
}

/// Noise of the instrument, one standard deviation per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigmas {
    /// m.
    pub position: f64,
    /// rad.
    pub orientation: f64,
    /// m.
    pub length: f64,
}
