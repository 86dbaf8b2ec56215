//! Effects by the kinds that reports and the command line name.

use super::{
    AXES, CrossAxisCompliance, Effect, GearEccentricity, JointCompliance, JointCurve, JointGain,
    Place, StepChange, Table, ThermalDrift, TimeDrift, WarmUp,
};
use crate::Scalar;

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
    /// Link masses or a payload.
    Masses,
    /// Gravity alone.
    Gravity,
    /// The direction of the last move.
    Direction,
    /// A temperature.
    Temperature,
    /// The time.
    Time,
}

/// A kind of effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// As it stands in reports.
    pub name: &'static str,
    /// What it needs in the data.
    pub needs: Needs,
    /// It acts on a joint; if also on the base, without a joint.
    pub joint: bool,
    /// It acts on the base, or may.
    pub base: bool,
    /// It has an order.
    pub order: bool,
    /// Names of its components, where one effect is one of several; of the base, where it
    /// may act on a joint or on the base.
    pub components: &'static [&'static str],
}

impl Kind {
    const fn of_joint(name: &'static str, needs: Needs) -> Self {
        Self {
            name,
            needs,
            joint: true,
            base: false,
            order: false,
            components: &[],
        }
    }

    const fn drift(name: &'static str, needs: Needs) -> Self {
        Self {
            base: true,
            components: &AXES,
            ..Self::of_joint(name, needs)
        }
    }

    const fn with_order(self) -> Self {
        Self {
            order: true,
            ..self
        }
    }
}

/// Every kind that the model can evaluate, without the unnamed rest. Faults of the recording,
/// which only exist on the host, are not here.
pub const KINDS: &[Kind] = &[
    Kind::of_joint("joint-gain", Needs::Joints),
    Kind::of_joint("gear-eccentricity", Needs::Joints).with_order(),
    Kind::of_joint("joint-compliance", Needs::Masses),
    Kind::of_joint("joint-curve", Needs::Joints),
    Kind::of_joint("cross-axis-compliance", Needs::Masses),
    Kind::drift("thermal-drift", Needs::Temperature),
    Kind::drift("time-drift", Needs::Time),
    Kind::drift("warm-up", Needs::Time),
    Kind::drift("step-change", Needs::Time),
];

impl<T: Scalar> Effect<'_, T> {
    /// The effect of this kind that `selector` says, all values zero, not yet attached.
    /// `None` for an unknown kind or if the selector lacks what the kind needs.
    ///
    /// A joint curve comes without cells and is zero until it gets some.
    pub fn named(kind: &str, selector: &Selector) -> Option<Self> {
        let joint = || selector.joint.and_then(|j| u8::try_from(j).ok());
        let sensor = selector.sensor.unwrap_or(0);
        let place = || match (selector.joint, selector.component.unwrap_or(0)) {
            (Some(j), _) => Some(Place::Joint(u8::try_from(j).ok()?)),
            (None, axis) => (usize::from(axis) < AXES.len()).then(|| Place::base(axis)),
        };
        Some(match kind {
            "joint-gain" => Self::JointGain(JointGain::new(joint()?)),
            "gear-eccentricity" => {
                let order = T::of(selector.order.unwrap_or(1.0));
                Self::GearEccentricity(GearEccentricity::new(joint()?, order))
            }
            "joint-compliance" => Self::JointCompliance(JointCompliance::new(joint()?)),
            "joint-curve" => {
                Self::JointCurve(JointCurve::turn(joint()?, T::zero(), Table::Values(&[])))
            }
            "cross-axis-compliance" => {
                Self::CrossAxisCompliance(CrossAxisCompliance::new(joint()?))
            }
            "thermal-drift" => Self::ThermalDrift(ThermalDrift::new(place()?, sensor)),
            "time-drift" => Self::TimeDrift(TimeDrift::new(place()?)),
            "warm-up" => Self::WarmUp(WarmUp::new(place()?, T::of(TAU))),
            "step-change" => Self::StepChange(StepChange::new(place()?, T::zero())),
            _ => return None,
        })
    }
}
