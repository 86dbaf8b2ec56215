//! A simulated robot cell: an arm that is not as it is drawn, and an instrument beside it.
//!
//! The arm has small errors in every link, in its base and its tool, and whatever hidden
//! effects it is given; it is sent to joint commands and measured with noise. The cell has a
//! forward model of its own, the product of 4 x 4 transforms with exact rotations, and nothing
//! of the identification may look into it: only its files and its measured numbers go out.
//! All numbers come from a seed, the same on every machine.
//!
//! ```
//! use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};
//!
//! let plain = Cell::new(Arm::Puma560, 7);
//! let visits = plain.schedule(&Conditions::default(), 120, 0);
//! let instrument = Instrument::new(Seen::Position);
//! let gear = Hidden::GearEccentricity { joint: 1, order: 1 };
//! let cell = plain.showing(gear, 1.8, &visits, &instrument)?;
//! let measured = cell.measure(&visits, &Conditions::default(), &instrument, 0);
//! let files = cell.files(&measured);
//! assert!(files.data.starts_with("q1,q2,q3,q4,q5,q6,x,y,z,set\n"));
//! # Ok::<(), truepose_host::cell::Invisible>(())
//! ```

mod campaign;
mod drawing;
mod files;
mod handover;
mod hidden;
mod instrument;
mod physics;

mod scale;
mod solid;

use nalgebra::Vector3;

pub use campaign::{Conditions, Visit};
pub use drawing::Arm;
pub use files::Files;
pub use hidden::Hidden;
pub use instrument::{Instrument, Measured, Row, Seen};
pub use scale::Invisible;
pub use solid::Solid;

use crate::random::Random;
use drawing::Drawing;
use hidden::Shape;
use instrument::{SetUp, observe};
use physics::{Body, Placed, early};
use solid::{origin, xyz_rpy};

/// An arm, its hidden effects and its surroundings.
#[derive(Clone, Debug)]
pub struct Cell {
    seed: u64,
    drawing: Drawing,
    body: Body,
    set_up: SetUp,
    hidden: Vec<Placed>,
}

/// Streams of random numbers, one a purpose (1 chooses joints and orders of effects).
const BUILD: u64 = 2;
const PLACE: u64 = 3;
const TORQUES: u64 = 4;
const SHAPES: u64 = 1 << 16;
const SCHEDULES: u64 = 1 << 32;
const NOISE: u64 = 1 << 48;

/// Further targets whose offsets are drawn.
const TARGETS: usize = 8;

impl Cell {
    /// An arm as built and placed by `seed`, with no effect beyond its geometry. It stands up
    /// to 3 m away from the instrument, turned any way about the vertical, level to a degree.
    pub fn new(arm: Arm, seed: u64) -> Self {
        let drawing = Drawing::of(arm);
        let built = drawing.as_built(&mut Random::new(seed, BUILD));
        let mut random = Random::new(seed, PLACE);
        let level = 0.017;
        let base = xyz_rpy(
            [
                random.between(-3.0, 3.0),
                random.between(-3.0, 3.0),
                random.between(-1.0, 1.0),
            ],
            [
                random.between(-level, level),
                random.between(-level, level),
                random.between(-3.1, 3.1),
            ],
        );
        let away = Vector3::from(random.direction()) * random.between(1.5, 2.5);
        let set_up = SetUp {
            anchor: origin(&base) + away,
            target_errors: (0..TARGETS)
                .map(|_| [(); 3].map(|()| random.deviation(3e-4)))
                .collect(),
        };
        let mut body = Body {
            built,
            base,
            torque_scale: Vec::new(),
        };
        let range = Conditions::default();
        let mut random = Random::new(seed, TORQUES);
        body.torque_scale =
            body.largest_torques(&campaign::schedule(&drawing, &range, 200, &mut random));
        Self {
            seed,
            drawing,
            body,
            set_up,
            hidden: Vec::new(),
        }
    }

    /// An arm exactly as drawn, its base in the world frame's origin.
    pub fn as_drawn(arm: Arm) -> Self {
        let mut cell = Self::new(arm, 0);
        cell.body.built = cell.drawing.clone();
        cell.body.base = Solid::identity();
        cell
    }

    /// The same cell with one more effect, of `size` in the effect's own unit.
    pub fn with(mut self, hidden: Hidden, size: f64) -> Self {
        let placed = self.placed(hidden, size);
        self.hidden.push(placed);
        self
    }

    /// The same cell with one more effect, large enough that a geometric fit to the identify
    /// rows of `visits` misses the verify rows by `ratio` times the noise's share, alone. To
    /// first order; the sign is drawn.
    pub fn showing(
        self,
        hidden: Hidden,
        ratio: f64,
        visits: &[Visit],
        instrument: &Instrument,
    ) -> Result<Self, Invisible> {
        let placed = self.placed(hidden, 1.0);
        let anchor = &self.set_up.anchor;
        let size = scale::size_for_ratio(&self.body, &placed, ratio, visits, instrument, anchor)?;
        // Stiffness and growth have one sign.
        let sign = match hidden {
            Hidden::JointCompliance { .. }
            | Hidden::CrossAxisCompliance { .. }
            | Hidden::ToolLoad
            | Hidden::LinkBending { .. }
            | Hidden::BaseFlex
            | Hidden::StickSlip { .. }
            | Hidden::ThermalGrowth { .. }
            | Hidden::EarlyReading => 1.0,
            _ => placed.shape.sign,
        };
        Ok(self.with(hidden, sign * size))
    }

    fn placed(&self, hidden: Hidden, size: f64) -> Placed {
        let purpose = SHAPES + self.hidden.len() as u64;
        Placed {
            hidden,
            size,
            shape: Shape::draw(&mut Random::new(self.seed, purpose)),
        }
    }

    /// Effects and their sizes, in the order in which they were added.
    pub fn hidden(&self) -> impl Iterator<Item = (Hidden, f64)> + '_ {
        self.hidden.iter().map(|p| (p.hidden, p.size))
    }

    /// The arm as drawn, nothing of the truth.
    pub(crate) fn drawing(&self) -> &Drawing {
        &self.drawing
    }

    /// `count` random stops within the joint limits. `run` chooses among independent series.
    pub fn schedule(&self, conditions: &Conditions, count: usize, run: u64) -> Vec<Visit> {
        let mut random = Random::new(self.seed, SCHEDULES + run);
        campaign::schedule(&self.drawing, conditions, count, &mut random)
    }

    /// Sends the arm to every stop and measures it there. `run` chooses among independent
    /// noise.
    pub fn measure(
        &self,
        visits: &[Visit],
        conditions: &Conditions,
        instrument: &Instrument,
        run: u64,
    ) -> Measured {
        let mut random = Random::new(self.seed, NOISE + run);
        let rows = visits
            .iter()
            .map(|visit| {
                let truth = self.truth(visit);
                let (values, outlier) = observe(instrument, &self.set_up, &truth, &mut random);
                let missing = early(&self.hidden, visit);
                Row {
                    visit: visit.clone(),
                    reading: visit.q.iter().zip(&missing).map(|(q, m)| q + m).collect(),
                    values,
                    truth,
                    outlier,
                }
            })
            .collect();
        Measured {
            rows,
            instrument: instrument.clone(),
            conditions: conditions.clone(),
        }
    }

    /// Verify rms, m, that a fit to these rows has when it is told what the arm hides, to first
    /// order: the least that can be asked of one that has to find out.
    pub fn told(&self, measured: &Measured) -> f64 {
        let anchor = &self.set_up.anchor;
        let instrument = &measured.instrument;
        scale::told(&self.body, &self.hidden, &measured.rows, instrument, anchor)
    }

    /// Where the tool really stands at a stop, world frame. For those who judge a result, not
    /// for those who find it.
    pub fn truth(&self, visit: &Visit) -> Solid {
        self.body.pose(&self.hidden, visit)
    }
}
