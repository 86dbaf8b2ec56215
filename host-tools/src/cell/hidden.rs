//! What the cell's arm does beyond its geometry, by name.

use super::Arm;
use super::drawing::{Drawing, Kind};
use crate::random::Random;

/// A physical effect. Joints and links count from 0, base to tool. Its size is one number in
/// the unit given, its shape (phases, mixtures, directions) is drawn from the cell's seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hidden {
    /// A joint turns by more than it reads; rad per rad (m per m).
    JointGain {
        /// Joint.
        joint: usize,
    },
    /// Harmonic error of a joint, once or more a turn; amplitude in rad.
    GearEccentricity {
        /// Joint.
        joint: usize,
        /// Periods a turn.
        order: u32,
    },
    /// Irregular error of a joint as a fixed function of its angle; rms in rad.
    JointCurve {
        /// Joint.
        joint: usize,
    },
    /// Harmonic error of a high order; amplitude in rad.
    GearRipple {
        /// Joint.
        joint: usize,
        /// Periods a turn.
        order: u32,
    },
    /// A joint gives way under gravity's torque; rad/(N m) (m/N).
    JointCompliance {
        /// Joint; `None`: all of them, in a ratio drawn between 0.5 and 1.5.
        joint: Option<usize>,
    },
    /// A joint tilts across its axis under gravity's moment; rad/(N m).
    CrossAxisCompliance {
        /// Joint.
        joint: usize,
    },
    /// A tool that nobody declared hangs on joints that give way; kg rad/(N m).
    ToolLoad,
    /// A link bends under the moment at its far end, about both axes across z; rad/(N m).
    LinkBending {
        /// Link, of the joint of the same number.
        link: usize,
    },
    /// The base tilts under the overturning moment, about both horizontal axes; rad/(N m).
    BaseFlex,
    /// A joint stops short of where it was coming from; half-width in rad (m).
    Backlash {
        /// Joint.
        joint: usize,
    },
    /// A link grows with temperature; per kelvin.
    ThermalGrowth {
        /// Link.
        link: usize,
    },
    /// A joint's zero drifts with temperature; rad (m) per kelvin.
    ThermalDrift {
        /// Joint.
        joint: usize,
    },
    /// A joint's zero drifts with time; rad (m) per hour.
    TimeDrift {
        /// Joint; `None`: the base shifts instead, m per hour.
        joint: Option<usize>,
    },
    /// A joint's zero settles exponentially after the start; rad (m) at the start.
    WarmUp {
        /// Joint.
        joint: usize,
        /// Time constant, s.
        constant: f64,
    },
    /// A joint's zero jumps once; rad (m).
    StepChange {
        /// Joint.
        joint: usize,
        /// When, s.
        time: f64,
    },
    /// The joints were read before the arm stood still: all lack the same share of their last
    /// move; rad for the joint that moved farthest.
    EarlyReading,
    /// One joint's motor leaks into another joint; rad per rad.
    JointCoupling {
        /// Joint that is moved.
        joint: usize,
        /// Joint that moves it.
        from: usize,
    },
    /// A revolute axis tilts as it turns; amplitude in rad.
    AxisWobble {
        /// Joint.
        joint: usize,
        /// Periods a turn.
        order: u32,
    },
    /// A slide is not straight: shifts and turns grow with travel and its square; rad at full
    /// travel, and a tenth of it in m.
    PrismaticStraightness {
        /// Joint.
        joint: usize,
    },
    /// The instrument was moved before the last sessions; shift in m, turn in rad.
    InstrumentMoved,
    /// Not in the catalogue: gravity turns a joint only beyond its friction, 30 % of the
    /// largest torque; rad/(N m).
    StickSlip {
        /// Joint.
        joint: usize,
    },
    /// Not in the catalogue: a cable turns a joint with the product of the wrist's first and
    /// last readings; rad per rad squared.
    CablePull {
        /// Joint.
        joint: usize,
    },
    /// Not in the catalogue: the base rocks to either side by the sign of the first joint; rad.
    RockingBase,
    /// Not in the catalogue: a joint's error saturates with a mixture of the second and third
    /// joints' sines; rad.
    Saturation {
        /// Joint.
        joint: usize,
    },
    /// Not in the catalogue: a bump of the second and third joints' readings, half a radian
    /// wide; rad.
    LocalBump {
        /// Joint.
        joint: usize,
    },
    /// Not in the catalogue: backlash whose width goes with the square root of the torque;
    /// rad at the largest torque.
    LoadedBacklash {
        /// Joint.
        joint: usize,
    },
}

impl Hidden {
    /// Kinds of the catalogue, as files and reports name them.
    pub const CATALOGUE: [&'static str; 20] = [
        "joint-gain",
        "gear-eccentricity",
        "joint-curve",
        "gear-ripple",
        "joint-compliance",
        "cross-axis-compliance",
        "tool-load",
        "link-bending",
        "base-flex",
        "backlash",
        "thermal-growth",
        "thermal-drift",
        "time-drift",
        "warm-up",
        "step-change",
        "early-reading",
        "joint-coupling",
        "axis-wobble",
        "prismatic-straightness",
        "instrument-moved",
    ];

    /// Kinds that no catalogue has.
    pub const OUTSIDE: [&'static str; 6] = [
        "stick-slip",
        "cable-pull",
        "rocking-base",
        "saturation",
        "local-bump",
        "loaded-backlash",
    ];

    /// Its kind, as files and reports name it; the cell's own name outside the catalogue.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::JointGain { .. } => "joint-gain",
            Self::GearEccentricity { .. } => "gear-eccentricity",
            Self::JointCurve { .. } => "joint-curve",
            Self::GearRipple { .. } => "gear-ripple",
            Self::JointCompliance { .. } => "joint-compliance",
            Self::CrossAxisCompliance { .. } => "cross-axis-compliance",
            Self::ToolLoad => "tool-load",
            Self::LinkBending { .. } => "link-bending",
            Self::BaseFlex => "base-flex",
            Self::Backlash { .. } => "backlash",
            Self::ThermalGrowth { .. } => "thermal-growth",
            Self::ThermalDrift { .. } => "thermal-drift",
            Self::TimeDrift { .. } => "time-drift",
            Self::WarmUp { .. } => "warm-up",
            Self::StepChange { .. } => "step-change",
            Self::EarlyReading => "early-reading",
            Self::JointCoupling { .. } => "joint-coupling",
            Self::AxisWobble { .. } => "axis-wobble",
            Self::PrismaticStraightness { .. } => "prismatic-straightness",
            Self::InstrumentMoved => "instrument-moved",
            Self::StickSlip { .. } => "stick-slip",
            Self::CablePull { .. } => "cable-pull",
            Self::RockingBase => "rocking-base",
            Self::Saturation { .. } => "saturation",
            Self::LocalBump { .. } => "local-bump",
            Self::LoadedBacklash { .. } => "loaded-backlash",
        }
    }

    /// Joint or link that it acts on, from 0; `None` for the base, the whole arm, the
    /// instrument.
    pub fn joint(&self) -> Option<usize> {
        match *self {
            Self::JointGain { joint }
            | Self::GearEccentricity { joint, .. }
            | Self::JointCurve { joint }
            | Self::GearRipple { joint, .. }
            | Self::CrossAxisCompliance { joint }
            | Self::LinkBending { link: joint }
            | Self::Backlash { joint }
            | Self::ThermalGrowth { link: joint }
            | Self::ThermalDrift { joint }
            | Self::WarmUp { joint, .. }
            | Self::StepChange { joint, .. }
            | Self::JointCoupling { joint, .. }
            | Self::AxisWobble { joint, .. }
            | Self::PrismaticStraightness { joint }
            | Self::StickSlip { joint }
            | Self::CablePull { joint }
            | Self::Saturation { joint }
            | Self::LocalBump { joint }
            | Self::LoadedBacklash { joint } => Some(joint),
            Self::JointCompliance { joint } | Self::TimeDrift { joint } => joint,
            Self::ToolLoad
            | Self::BaseFlex
            | Self::EarlyReading
            | Self::InstrumentMoved
            | Self::RockingBase => None,
        }
    }

    /// Periods a turn, where it has any.
    pub fn order(&self) -> Option<u32> {
        match *self {
            Self::GearEccentricity { order, .. }
            | Self::GearRipple { order, .. }
            | Self::AxisWobble { order, .. } => Some(order),
            _ => None,
        }
    }

    /// The largest size that a real arm would show, in its unit.
    pub fn plausible(&self) -> f64 {
        match self {
            Self::JointGain { .. } | Self::JointCoupling { .. } => 5e-3,
            Self::GearRipple { .. } => 1e-3,
            Self::JointCompliance { .. } | Self::ToolLoad | Self::StickSlip { .. } => 1e-3,
            Self::CrossAxisCompliance { .. } | Self::LinkBending { .. } => 1e-3,
            Self::BaseFlex => 3e-4,
            Self::ThermalGrowth { .. } => 5e-5,
            Self::ThermalDrift { .. } => 2e-4,
            Self::InstrumentMoved => 1e-2,
            _ => 3e-3,
        }
    }

    /// One of the kind named, its joint and order drawn among those that `arm` has; `None`
    /// where it has none (a slide's straightness) or the name is unknown.
    pub fn draw(kind: &str, arm: Arm, seed: u64) -> Option<Self> {
        let drawing = Drawing::of(arm);
        let mut random = Random::new(seed, DRAW);
        let turning: Vec<usize> = of_kind(&drawing, Kind::Revolute);
        let sliding: Vec<usize> = of_kind(&drawing, Kind::Prismatic);
        let count = drawing.links.len();
        let revolute = *turning.get(random.below(turning.len()))?;
        let joint = random.below(count);
        let order = 1 + u32::try_from(random.below(4)).unwrap_or(0);
        Some(match kind {
            "joint-gain" => Self::JointGain { joint },
            "gear-eccentricity" => Self::GearEccentricity {
                joint: revolute,
                order,
            },
            "joint-curve" => Self::JointCurve { joint: revolute },
            "gear-ripple" => Self::GearRipple {
                joint: revolute,
                order: [1, 2, 4][random.below(3)] * 100,
            },
            "joint-compliance" => Self::JointCompliance { joint: Some(joint) },
            "cross-axis-compliance" => Self::CrossAxisCompliance { joint: revolute },
            "tool-load" => Self::ToolLoad,
            "link-bending" => Self::LinkBending { link: joint },
            "base-flex" => Self::BaseFlex,
            "backlash" => Self::Backlash { joint },
            "thermal-growth" => {
                let long: Vec<usize> = (0..count)
                    .filter(|&j| (drawing.links.get(j)).is_some_and(|l| l.a.hypot(l.d) > 0.2))
                    .collect();
                let link = *long.get(random.below(long.len()))?;
                Self::ThermalGrowth { link }
            }
            "thermal-drift" => Self::ThermalDrift { joint },
            "time-drift" => Self::TimeDrift {
                joint: (random.below(3) > 0).then_some(joint),
            },
            "warm-up" => Self::WarmUp {
                joint,
                constant: random.between(400.0, 1500.0),
            },
            "step-change" => Self::StepChange {
                joint,
                time: random.between(600.0, 1400.0),
            },
            "early-reading" => Self::EarlyReading,
            "joint-coupling" => {
                let from = (joint + 1 + random.below(count - 1)) % count;
                Self::JointCoupling { joint, from }
            }
            "axis-wobble" => Self::AxisWobble {
                joint: revolute,
                order,
            },
            "prismatic-straightness" => Self::PrismaticStraightness {
                joint: *sliding.get(random.below(sliding.len()))?,
            },
            "instrument-moved" => Self::InstrumentMoved,
            "stick-slip" => Self::StickSlip { joint: revolute },
            "cable-pull" => Self::CablePull { joint },
            "rocking-base" => Self::RockingBase,
            "saturation" => Self::Saturation { joint },
            "local-bump" => Self::LocalBump { joint },
            "loaded-backlash" => Self::LoadedBacklash { joint: revolute },
            _ => return None,
        })
    }
}

/// Stream of the random numbers that choose among joints and orders.
const DRAW: u64 = 1;

fn of_kind(drawing: &Drawing, kind: Kind) -> Vec<usize> {
    (0..drawing.links.len())
        .filter(|&j| drawing.links.get(j).is_some_and(|l| l.kind == kind))
        .collect()
}

/// The part of an effect that no name tells: phases, mixtures, directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// Phase of a harmonic, rad.
    pub(crate) phase: f64,
    /// -1 or +1.
    pub(crate) sign: f64,
    /// Unit vector.
    pub(crate) direction: [f64; 3],
    /// Amplitudes and phases of an irregular curve, one a harmonic from order 2 on; their
    /// squares sum to one. Also read as mixtures.
    pub(crate) curve: [[f64; 2]; 24],
}

impl Shape {
    pub(crate) fn draw(random: &mut Random) -> Self {
        let mut curve = [[0.0; 2]; 24];
        let mut sum = 0.0;
        for [sine, cosine] in &mut curve {
            (*sine, *cosine) = (random.normal(), random.normal());
            sum += 0.5 * (*sine * *sine + *cosine * *cosine);
        }
        for pair in &mut curve {
            *pair = pair.map(|x| x / libm::sqrt(sum));
        }
        Self {
            phase: random.between(0.0, std::f64::consts::TAU),
            sign: random.sign(),
            direction: random.direction(),
            curve,
        }
    }

    /// Irregular, periodic, root mean square 1 over a turn.
    pub(crate) fn irregular(&self, angle: f64) -> f64 {
        // Harmonics by recurrence: one sine and cosine a call.
        let (s1, c1) = libm::sincos(angle);
        let (mut s, mut c) = (s1, c1);
        let mut sum = 0.0;
        for [sine, cosine] in &self.curve {
            (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
            sum += sine * s + cosine * c;
        }
        sum
    }
}
