//! A sample of every effect, and arms and conditions at random to try them on.

use crate::described::{Baked, Described, Given};
use crate::random::Random;
use truepose::effects::{
    Ambient, AxisWobble, Backlash, BaseFlex, Bends, CrossAxisCompliance, Effect, Factor,
    GearEccentricity, GearRipple, GravityLever, Grows, JointCompliance, JointCoupling, JointCurve,
    JointGain, LinkBending, ONE, Place, PrismaticStraightness, Shape, StepChange, ThermalDrift,
    ThermalGrowth, TimeDrift, ToolLoad, Unnamed, Variable, WarmUp, Wobble,
};
use truepose::{BakedJoint, Scalar};

/// Fewest joints of an arm that all samples fit on.
pub(crate) const JOINTS: usize = 4;

const COUNTS: [u8; 12] = [1, 0, 0, 0x80, 7, 1, 200, 255, 30, 1, 5, 0];

/// The first sample (`None`) or the one after `effect`. No wildcard: a new variant does not
/// compile until it has a sample here, and the chain of them ends where it says `None`.
fn next(effect: Option<&Effect<'static, f64>>) -> Option<Effect<'static, f64>> {
    let term = |place, shapes: [Shape; 2]| {
        let factors = [
            Factor {
                variable: Variable::Joint(2),
                shape: shapes[0],
            },
            Factor {
                variable: Variable::Joint(0),
                shape: shapes[1],
            },
        ];
        Effect::Unnamed(Unnamed::new(
            place,
            factors,
            [[2.0, -2.5, 2.0], [0.3, -2.8, 3.0]],
        ))
    };
    let Some(effect) = effect else {
        return Some(Effect::JointGain(JointGain::new(1)));
    };
    Some(match effect {
        Effect::JointGain(_) => Effect::GearEccentricity(GearEccentricity::new(2, 3.0)),
        Effect::GearEccentricity(_) => Effect::JointCompliance(JointCompliance::new(1)),
        Effect::JointCompliance(_) => Effect::JointCurve(JointCurve::turn(1, 0.0, &COUNTS)),
        Effect::JointCurve(_) => Effect::CrossAxisCompliance(CrossAxisCompliance::new(1)),
        Effect::CrossAxisCompliance(_) => {
            Effect::ThermalDrift(ThermalDrift::new(Place::Joint(2), 1))
        }
        Effect::ThermalDrift(e) if e.place == Place::Joint(2) => {
            Effect::ThermalDrift(ThermalDrift::new(Place::base(1), 0))
        }
        Effect::ThermalDrift(_) => Effect::TimeDrift(TimeDrift::new(Place::base(5))),
        Effect::TimeDrift(_) => Effect::WarmUp(WarmUp::new(Place::Joint(0), 100.0)),
        Effect::WarmUp(_) => Effect::StepChange(StepChange::new(Place::Joint(3), 40.0)),
        Effect::StepChange(_) => Effect::GearRipple(GearRipple::new(1, -101.0)),
        Effect::GearRipple(_) => Effect::LinkBending(LinkBending::new(1, Bends::AtEnd)),
        Effect::LinkBending(e) if e.bends == Bends::AtEnd => {
            Effect::LinkBending(LinkBending::new(2, Bends::Beam))
        }
        Effect::LinkBending(_) => Effect::BaseFlex(BaseFlex::default()),
        Effect::BaseFlex(_) => Effect::ToolLoad(ToolLoad::new(1)),
        Effect::ToolLoad(_) => Effect::GravityLever(GravityLever::new(1, 2)),
        Effect::GravityLever(_) => Effect::Backlash(Backlash::new(0)),
        Effect::Backlash(_) => Effect::ThermalGrowth(ThermalGrowth::new(2, Grows::Link, 0)),
        Effect::ThermalGrowth(e) if e.grows == Grows::Link => {
            Effect::ThermalGrowth(ThermalGrowth::new(2, Grows::Travel, 0))
        }
        Effect::ThermalGrowth(_) => Effect::JointCoupling(JointCoupling::new(2, 1)),
        Effect::JointCoupling(_) => Effect::AxisWobble(AxisWobble::new(1, Wobble::ALL[0], 1.5)),
        Effect::AxisWobble(e) => match Wobble::ALL.iter().position(|&w| w == e.motion) {
            Some(i) if i < 3 => Effect::AxisWobble(AxisWobble::new(3, Wobble::ALL[i + 1], 2.0)),
            _ => Effect::PrismaticStraightness(PrismaticStraightness::new(0, 0)),
        },
        Effect::PrismaticStraightness(e) if e.axis < 5 => {
            Effect::PrismaticStraightness(PrismaticStraightness::new(0, e.axis + 1))
        }
        Effect::PrismaticStraightness(_) => {
            term(Place::Joint(1), [Shape::Sine, Shape::Polynomial(3)])
        }
        Effect::Unnamed(e) => match e.factors[0].shape {
            Shape::Sine => term(Place::base(3), [Shape::Cosine, Shape::Sign]),
            Shape::Cosine => Effect::Unnamed(Unnamed::new(
                Place::Joint(0),
                [
                    Factor {
                        variable: Variable::Temperature(0),
                        shape: Shape::Polynomial(2),
                    },
                    ONE,
                ],
                [[0.0, 10.0, 40.0], [0.0; 3]],
            )),
            _ => return None,
        },
    })
}

/// A sample of every variant, all values zero.
pub(crate) fn one_of_each() -> Vec<Effect<'static, f64>> {
    let mut all = Vec::new();
    let mut last = next(None);
    while let Some(effect) = last {
        all.push(effect);
        last = next(Some(&effect));
    }
    all
}

impl<T: Scalar> Given<T> {
    pub(crate) fn cast<U: Scalar>(&self) -> Given<U> {
        let c = |x: &T| U::of(x.widen());
        Given {
            q: self.q.iter().map(c).collect(),
            direction: self.direction.iter().map(c).collect(),
            ambient: Ambient {
                payload: c(&self.ambient.payload),
                payload_com: self.ambient.payload_com.map(|x| c(&x)),
                temperature: self.ambient.temperature.each_ref().map(c),
                time: c(&self.ambient.time),
            },
        }
    }
}

impl<T: Scalar> Baked<T> {
    pub(crate) fn cast<U: Scalar>(&self) -> Baked<U> {
        Baked {
            base: self.base.cast(),
            joints: self.joints.iter().map(BakedJoint::cast).collect(),
            tool: self.tool.cast(),
            gravity: self.gravity.map(|x| U::of(x.widen())),
        }
    }
}

/// An arm of four to seven joints of any convention and kind.
pub(crate) fn arm(random: &mut Random, case: usize) -> Described {
    let count = JOINTS + case % 4;
    Described {
        base: random.pose(1.0),
        joints: (0..count).map(|_| random.joint()).collect(),
        masses: (0..count).map(|_| random.mass()).collect(),
        tool: random.pose(0.3),
        gravity: random.vector(9.81),
    }
}

/// Readings and conditions for an arm of `count` joints.
pub(crate) fn given(random: &mut Random, count: usize) -> Given<f64> {
    let mut ambient = Ambient {
        payload: random.within(1.0) + 2.0,
        payload_com: random.vector(0.1),
        time: random.within(50.0) + 50.0,
        ..Ambient::default()
    };
    for t in &mut ambient.temperature {
        *t = random.within(10.0) + 25.0;
    }
    Given {
        q: (0..count).map(|_| random.within(3.3)).collect(),
        direction: (0..count).map(|_| random.within(1.0).signum()).collect(),
        ambient,
    }
}
