//! What the solver sees of one measured row.

use nalgebra::{Matrix3, Vector3};
use truepose::effects::Ambient;

use super::relation::Relation;
use super::view::View;

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

    /// Kind and number of its equations, in the order of the residual.
    pub fn kinds(&self) -> impl Iterator<Item = (Kind, usize)> {
        let three = |is: bool| 3 * usize::from(is);
        let own = [
            (Kind::Position, three(self.position.is_some())),
            (Kind::Orientation, three(self.rotation.is_some())),
            (Kind::Position, 3 * self.targets.iter().flatten().count()),
            (Kind::Length, usize::from(self.length.is_some())),
        ];
        let relations = self.relations.iter().map(|r| (r.kind(), r.equations()));
        own.into_iter()
            .chain(relations)
            .filter(|&(_, count)| count > 0)
    }

    /// Itself, and the other postures of its distances.
    pub fn postures(&self) -> impl Iterator<Item = &Self> {
        let others = self.relations.iter().filter_map(|r| match r {
            Relation::Distance { to, .. } => Some(to.as_ref()),
            _ => None,
        });
        std::iter::once(self).chain(others)
    }

    /// True if it is measured by an instrument on the tool.
    pub fn is_view(&self) -> bool {
        let view = |r: &Relation| matches!(r, Relation::View(_));
        self.relations.iter().any(view)
    }

    /// True if it says how large anything is: bearings, fixed points and planes do not.
    pub fn has_scale(&self) -> bool {
        let distance = |r: &Relation| {
            matches!(
                r,
                Relation::Distance { .. } | Relation::View(View::At { .. })
            )
        };
        let points = self.targets.iter().flatten().count();
        self.position.is_some()
            || points > 0
            || self.length.is_some()
            || self.relations.iter().any(distance)
    }

    /// True if it says where the arm stands in the world: distances, fixed points and planes
    /// do not, nor does what is seen from the tool, unless it is a board, which is the world.
    pub fn is_placed(&self) -> bool {
        let points = self.targets.iter().flatten().count();
        let placed = |r: &Relation| {
            matches!(
                r,
                Relation::Bearing { .. } | Relation::View(View::Turn { .. })
            )
        };
        self.position.is_some() || points > 0 || self.relations.iter().any(placed)
    }
}

/// What a measured number is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Tool point and further targets.
    Position,
    /// Orientation.
    Orientation,
    /// Length of a wire or bar.
    Length,
    /// Distance between two poses.
    Distance,
    /// Touch of a point or plane.
    Contact,
    /// Bearing.
    Bearing,
}

impl Kind {
    /// All of them, in the order of [`Sigmas::per_kind`].
    pub const ALL: [Self; 6] = [
        Self::Position,
        Self::Orientation,
        Self::Length,
        Self::Distance,
        Self::Contact,
        Self::Bearing,
    ];
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
    /// Of a distance between two poses, m.
    pub distance: f64,
    /// Of a touch of a point or plane, m.
    pub contact: f64,
    /// Of a bearing, rad.
    pub bearing: f64,
}

impl Sigmas {
    /// One of each unit.
    pub const UNIT: Self = Self::alike(1.0);

    /// The same number for all kinds, m and rad.
    pub const fn alike(sigma: f64) -> Self {
        Self {
            position: sigma,
            orientation: sigma,
            length: sigma,
            distance: sigma,
            contact: sigma,
            bearing: sigma,
        }
    }

    /// That of one kind.
    pub fn of(&self, kind: Kind) -> f64 {
        match kind {
            Kind::Position => self.position,
            Kind::Orientation => self.orientation,
            Kind::Length => self.length,
            Kind::Distance => self.distance,
            Kind::Contact => self.contact,
            Kind::Bearing => self.bearing,
        }
    }

    /// From that of every kind.
    pub fn per_kind(sigma: impl Fn(Kind) -> f64) -> Self {
        let [position, orientation, length, distance, contact, bearing] = Kind::ALL.map(sigma);
        Self {
            position,
            orientation,
            length,
            distance,
            contact,
            bearing,
        }
    }
}
