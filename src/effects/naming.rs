//! Effects by the kinds that reports and the command line name.

use super::{
    AXES, AxisWobble, Backlash, BaseFlex, Bends, CrossAxisCompliance, Effect, GearEccentricity,
    GearRipple, GravityLever, Grows, JointCompliance, JointCoupling, JointCurve, JointGain,
    LinkBending, Place, PrismaticStraightness, StepChange, ThermalDrift, ThermalGrowth, TimeDrift,
    ToolLoad, WarmUp, Wobble,
};
use crate::{JointKind, Scalar};

/// Time constant that a warm-up starts from, s: a quarter of the 20 min of MRD 7.6.
const TAU: f64 = 300.0;

/// Which effect of its kind. What a kind does not use stays `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Selector {
    /// Joint, counted from 0; `None` for the base.
    pub joint: Option<usize>,
    /// Periods per joint turn.
    pub order: Option<f64>,
    /// The other joint or link, counted from 0.
    pub from: Option<usize>,
    /// Number of the component in [`Kind::components`]; the first if not given.
    pub component: Option<u8>,
    /// Temperature sensor, counted from 0; the first if not given.
    pub sensor: Option<u8>,
}

/// What a kind needs in the data to be seen at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Joint readings only.
    Joints,
    /// Gravity's direction.
    Gravity,
    /// Gravity, and link masses or a payload.
    Masses,
    /// The direction of the last move.
    Direction,
    /// A temperature.
    Temperature,
    /// The time.
    Time,
}

/// Whether a kind wants an order or another joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// It has none.
    No,
    /// May be given.
    May,
    /// Has to be given.
    Must,
}

/// A kind of effect: what to try, and what for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// As it stands in reports.
    pub name: &'static str,
    /// What it needs in the data.
    pub needs: Needs,
    /// It acts on (or through) a joint.
    pub joint: bool,
    /// It acts on the base, if no joint is given.
    pub base: bool,
    /// The kind of joint that it is for; `None`: any.
    pub only: Option<JointKind>,
    /// [`Selector::order`].
    pub order: Wish,
    /// [`Selector::from`].
    pub from: Wish,
    /// Names of its components, where one effect is one of several; where it may act on a
    /// joint or the base, those of the base.
    pub components: &'static [&'static str],
    /// The components are parts of one explanation, to be tried together; otherwise each is
    /// an explanation of its own.
    pub together: bool,
}

const JOINT: Kind = Kind {
    name: "",
    needs: Needs::Joints,
    joint: true,
    base: false,
    only: None,
    order: Wish::No,
    from: Wish::No,
    components: &[],
    together: false,
};

impl Kind {
    const fn joint(name: &'static str, needs: Needs) -> Self {
        Self {
            name,
            needs,
            ..JOINT
        }
    }

    const fn drift(name: &'static str, needs: Needs) -> Self {
        Self {
            base: true,
            components: &AXES,
            together: true,
            ..Self::joint(name, needs)
        }
    }

    /// The kind of that name.
    pub fn of(name: &str) -> Option<&'static Self> {
        KINDS.iter().find(|kind| kind.name == name)
    }
}

/// Every kind that the controller can evaluate and that has a name. The faults of a recording
/// (`early-reading`, `instrument-moved`) are not here: they only exist where it is read.
pub const KINDS: &[Kind] = &[
    Kind::joint("joint-gain", Needs::Joints),
    Kind {
        order: Wish::Must,
        ..Kind::joint("gear-eccentricity", Needs::Joints)
    },
    Kind::joint("joint-curve", Needs::Joints),
    Kind {
        order: Wish::Must,
        ..Kind::joint("gear-ripple", Needs::Joints)
    },
    // With `from`: a free gravity lever, which needs no masses.
    Kind {
        from: Wish::May,
        ..Kind::joint("joint-compliance", Needs::Masses)
    },
    Kind::joint("cross-axis-compliance", Needs::Masses),
    Kind::joint("tool-load", Needs::Gravity),
    Kind {
        components: &Bends::NAMES,
        ..Kind::joint("link-bending", Needs::Masses)
    },
    Kind {
        joint: false,
        base: true,
        ..Kind::joint("base-flex", Needs::Masses)
    },
    Kind::joint("backlash", Needs::Direction),
    Kind {
        components: &Grows::NAMES,
        ..Kind::joint("thermal-growth", Needs::Temperature)
    },
    Kind::drift("thermal-drift", Needs::Temperature),
    Kind::drift("time-drift", Needs::Time),
    Kind::drift("warm-up", Needs::Time),
    Kind::drift("step-change", Needs::Time),
    Kind {
        from: Wish::Must,
        ..Kind::joint("joint-coupling", Needs::Joints)
    },
    Kind {
        order: Wish::Must,
        only: Some(JointKind::Revolute),
        components: &Wobble::NAMES,
        ..Kind::joint("axis-wobble", Needs::Joints)
    },
    Kind {
        only: Some(JointKind::Prismatic),
        components: &AXES,
        together: true,
        ..Kind::joint("prismatic-straightness", Needs::Joints)
    },
];

impl<T: Scalar> Effect<'_, T> {
    /// The effect of this kind that `selector` says, all values zero, not yet attached.
    ///
    /// `None` for an unknown kind, or if the selector lacks what the kind needs or has a
    /// component that there is not. What the kind does not use is ignored. A joint curve comes
    /// without cells and is zero until it gets some; constants that the selector does not
    /// give are first guesses.
    pub fn named(kind: &str, selector: &Selector) -> Option<Self> {
        let components = Kind::of(kind)?.components.len().max(1);
        let component = selector.component.unwrap_or(0);
        if usize::from(component) >= components {
            return None;
        }
        let narrow = |j: Option<usize>| u8::try_from(j?).ok();
        let joint = || narrow(selector.joint);
        let from = || narrow(selector.from);
        let order = || selector.order.map(T::of);
        let sensor = selector.sensor.unwrap_or(0);
        let place = || match selector.joint {
            Some(_) => joint().map(Place::Joint),
            None => Some(Place::base(component)),
        };
        Some(match kind {
            "joint-gain" => Self::JointGain(JointGain::new(joint()?)),
            "gear-eccentricity" => {
                Self::GearEccentricity(GearEccentricity::new(joint()?, order()?))
            }
            "joint-curve" => Self::JointCurve(JointCurve::turn(joint()?, T::zero(), &[])),
            "gear-ripple" => Self::GearRipple(GearRipple::new(joint()?, order()?)),
            "joint-compliance" if selector.from.is_some() => {
                Self::GravityLever(GravityLever::new(joint()?, from()?))
            }
            "joint-compliance" => Self::JointCompliance(JointCompliance::new(joint()?)),
            "cross-axis-compliance" => {
                Self::CrossAxisCompliance(CrossAxisCompliance::new(joint()?))
            }
            "tool-load" => Self::ToolLoad(ToolLoad::new(joint()?)),
            "link-bending" => {
                let bends = if component == 0 {
                    Bends::AtEnd
                } else {
                    Bends::Beam
                };
                Self::LinkBending(LinkBending::new(joint()?, bends))
            }
            "base-flex" => Self::BaseFlex(BaseFlex::default()),
            "backlash" => Self::Backlash(Backlash::new(joint()?)),
            "thermal-growth" => {
                let grows = if component == 0 {
                    Grows::Link
                } else {
                    Grows::Travel
                };
                Self::ThermalGrowth(ThermalGrowth::new(joint()?, grows, sensor))
            }
            "thermal-drift" => Self::ThermalDrift(ThermalDrift::new(place()?, sensor)),
            "time-drift" => Self::TimeDrift(TimeDrift::new(place()?)),
            "warm-up" => Self::WarmUp(WarmUp::new(place()?, T::of(TAU))),
            "step-change" => Self::StepChange(StepChange::new(place()?, T::zero())),
            "joint-coupling" => Self::JointCoupling(JointCoupling::new(joint()?, from()?)),
            "axis-wobble" => {
                let motion = Wobble::ALL.get(usize::from(component))?;
                Self::AxisWobble(AxisWobble::new(joint()?, *motion, order()?))
            }
            "prismatic-straightness" => {
                Self::PrismaticStraightness(PrismaticStraightness::new(joint()?, component))
            }
            _ => return None,
        })
    }
}
