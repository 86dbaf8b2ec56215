//! What the solver sees of one measured row.

use nalgebra::{Matrix3, Vector3};
use truepose::effects::Ambient;

use super::relation::Relation;

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
    /// What else binds the tool point.
    pub relations: Vec<Relation>,
    /// What the row's residuals and their derivatives are multiplied by: 1, or less where a
    /// robust loss trusts the row less.
    pub weight: f64,
}

impl Default for Observation {
    /// Of an arm without joints, nothing measured.
    fn default() -> Self {
        Self {
            row: 0,
            q: Vec::new(),
            direction: Vec::new(),
            travel: Vec::new(),
            ambient: Ambient::default(),
            session: 0,
            position: None,
            rotation: None,
            targets: Vec::new(),
            length: None,
            relations: Vec::new(),
            weight: 1.0,
        }
    }
}

impl Observation {
    /// Scalar equations that this row gives.
    pub fn equations(&self) -> usize {
        let targets = self.targets.iter().flatten().count();
        3 * usize::from(self.position.is_some())
            + 3 * usize::from(self.rotation.is_some())
            + 3 * targets
            + usize::from(self.length.is_some())
            + self
                .relations
                .iter()
                .map(Relation::equations)
                .sum::<usize>()
    }

    /// True if it says how large anything is: bearings, fixed points and planes do not.
    pub fn has_scale(&self) -> bool {
        let distance = |r: &Relation| matches!(r, Relation::Distance { .. });
        let points = self.targets.iter().flatten().count();
        self.position.is_some()
            || points > 0
            || self.length.is_some()
            || self.relations.iter().any(distance)
    }

    /// True if it says where the arm stands in the world: distances, fixed points and planes
    /// do not.
    pub fn is_placed(&self) -> bool {
        let points = self.targets.iter().flatten().count();
        let bearing = |r: &Relation| matches!(r, Relation::Bearing { .. });
        self.position.is_some() || points > 0 || self.relations.iter().any(bearing)
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
