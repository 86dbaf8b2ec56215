//! What the rigid chain lacks.
//!
//! An effect either adds to the reading of its joint, as a function of readings and
//! conditions ([`Stage::Reading`]), or displaces everything beyond a joint or the base, as a
//! function of where the arm then stands ([`Stage::Posture`]). It is linear in its values and
//! zero when they are zero. Host and controller evaluate the same code.
//!
//! To add one: a file here with a struct that implements [`EffectModel`], a line at the *end*
//! of the `effects!` list, a line in [`KINDS`], an arm in [`Effect::named`].

mod anchor;
mod axis_wobble;
mod backlash;
mod base_flex;
mod cross_axis_compliance;
mod gear_eccentricity;
mod gear_ripple;
mod gravity_lever;
mod joint_compliance;
mod joint_coupling;
mod joint_curve;
mod joint_gain;
mod link_bending;
mod naming;
mod prismatic_straightness;
mod situation;
mod step_change;
mod thermal_drift;
mod thermal_growth;
mod time_drift;
mod tool_load;
pub(crate) mod unnamed;
mod warm_up;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::vector::less;
use crate::{JointKind, Scalar, Twist};
use situation::since;

pub use anchor::{AXES, Anchor, Description, Place};
pub use axis_wobble::{AxisWobble, Wobble};
pub use backlash::Backlash;
pub use base_flex::BaseFlex;
pub use cross_axis_compliance::CrossAxisCompliance;
pub use gear_eccentricity::GearEccentricity;
pub use gear_ripple::GearRipple;
pub use gravity_lever::GravityLever;
pub use joint_compliance::JointCompliance;
pub use joint_coupling::JointCoupling;
pub use joint_curve::{Hat, JointCurve, UNMEASURED, encode, hat};
pub(crate) use joint_curve::{LookUp, PreparedCurve};
pub use joint_gain::JointGain;
pub use link_bending::{Bends, Link, LinkBending};
pub use naming::{KINDS, Kind, Needs, Selector, Wish};
pub use prismatic_straightness::PrismaticStraightness;
pub use situation::{Ambient, Conditions, MAX_SENSORS, Posture, Reading, gravity_loads};
pub use step_change::StepChange;
pub use thermal_drift::ThermalDrift;
pub use thermal_growth::{Grows, ThermalGrowth};
pub use time_drift::TimeDrift;
pub use tool_load::ToolLoad;
pub use unnamed::{FADE, Factor, ONE, RAMP, Shape, Unnamed, Variable};
pub use warm_up::WarmUp;

/// When an effect is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Before the kinematics: it adds to a joint's reading.
    Reading,
    /// After them: it displaces what lies beyond a joint, or the base with everything on it.
    Posture,
}

/// A displacement of everything beyond a joint, about `origin`.
#[derive(Clone, Copy, Debug)]
pub struct Displacement<T: Scalar> {
    /// Axes of the kinematics' start frame.
    pub twist: Twist<T>,
    /// Reference point of the twist, m.
    pub origin: Vector3<T>,
}

impl<T: Scalar> Displacement<T> {
    /// None.
    pub fn zero() -> Self {
        Self {
            twist: Twist::zero(),
            origin: Vector3::zeros(),
        }
    }

    /// Adds `value` times one about the origin that it takes over.
    #[inline(never)]
    fn add(&mut self, other: &Self, value: T) {
        self.origin = other.origin;
        self.twist = self.twist.plus(&other.twist.scaled(value));
    }

    /// The same of the tool point.
    fn at_tool(&self, at: &Posture<'_, T>) -> Twist<T> {
        self.twist.at(&less(&at.tool.translation, &self.origin))
    }
}

/// What every non-geometric effect can do.
pub trait EffectModel<T: Scalar> {
    /// Kind as it stands in reports, e.g. `"joint-gain"`.
    fn kind(&self) -> &'static str;

    /// The joint that it acts on or through, counted from 0; `None` for the base.
    fn joint(&self) -> Option<usize>;

    /// Which effect of its kind, so that [`Effect::named`] finds it again.
    fn selector(&self) -> Selector {
        Selector {
            joint: self.joint(),
            ..Selector::default()
        }
    }

    /// Linear parameters in order, with SI units (of a revolute joint):
    /// `[("compliance", "rad/(N m)")]`.
    fn parameters(&self) -> &'static [(&'static str, &'static str)];

    /// Values in the order of [`Self::parameters`].
    fn values(&self) -> &[T];

    /// The same, for the solver to set.
    fn values_mut(&mut self) -> &mut [T];

    /// Constants that it is not linear in and that a solver may refine, with SI units:
    /// `[("tau", "s")]`.
    fn constant_names(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }

    /// Constants in the order of [`Self::constant_names`].
    fn constants(&self) -> &[T] {
        &[]
    }

    /// The same, to refine them.
    fn constants_mut(&mut self) -> &mut [T] {
        &mut []
    }

    /// Sets what is fixed in the links from the described arm. To be called after every bake; an
    /// effect that fixes nothing in a link does nothing.
    fn attach(&mut self, _to: &Description<'_>) {}

    /// What [`Self::attach`] sets, in stored order.
    fn fixed_mut(&mut self) -> &mut [T] {
        &mut []
    }

    /// When it is evaluated.
    fn stage(&self) -> Stage;

    /// Whether it looks at gravity's moments and forces, which are only there if an effect does.
    fn loaded(&self) -> bool {
        false
    }

    /// [`Stage::Reading`]: d (addition to the reading of [`Self::joint`]) / d `values()[k]`,
    /// rad or m per unit.
    fn reading_partial(&self, _k: usize, _at: &Reading<'_, T>) -> T {
        T::zero()
    }

    /// [`Stage::Posture`]: d displacement / d `values()[k]`.
    fn posture_partial(&self, _k: usize, _at: &Posture<'_, T>) -> Displacement<T> {
        Displacement::zero()
    }

    /// [`Stage::Reading`]: the whole addition, rad or m. Computed at once where the partials
    /// share their work.
    #[inline]
    fn addition(&self, at: &Reading<'_, T>) -> T {
        let mut sum = T::zero();
        for (k, &value) in self.values().iter().enumerate() {
            sum += self.reading_partial(k, at) * value;
        }
        sum
    }

    /// [`Stage::Posture`]: the whole displacement. Computed at once where the partials share
    /// their work. All of them are about the same origin.
    #[inline]
    fn displacement(&self, at: &Posture<'_, T>) -> Displacement<T> {
        let mut sum = Displacement::zero();
        for (k, &value) in self.values().iter().enumerate() {
            sum.add(&self.posture_partial(k, at), value);
        }
        sum
    }
}

/// The list: variant, its order is its number in stored blobs; stage, or `either`.
macro_rules! effects {
    (@addition posture $e:ident $at:ident) => {{
        let _ = $e;
        T::zero()
    }};
    (@addition $stage:ident $e:ident $at:ident) => {
        $e.addition($at)
    };
    (@displacement reading $e:ident $at:ident) => {{
        let _ = $e;
        Displacement::zero()
    }};
    (@displacement $stage:ident $e:ident $at:ident) => {
        $e.displacement($at)
    };
    ($life:lifetime: $($(#[$meta:meta])* $name:ident $(<$borrow:lifetime>)? $stage:ident),+ $(,)?) => {
        /// One effect of any kind. `'a`: whoever holds the tables of joint curves.
        ///
        /// The variant's position is its number in stored blobs: append, never reorder, never
        /// remove. Exhaustive on purpose: whoever matches on it must notice a new one.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Effect<$life, T: Scalar> {
            $($(#[$meta])* $name($name<$($borrow,)? T>)),+
        }

        impl<$life, T: Scalar> Effect<$life, T> {
            /// As its contract.
            #[inline]
            pub fn model(&self) -> &dyn EffectModel<T> {
                match self { $(Self::$name(e) => e),+ }
            }

            /// As its contract, to change its values.
            #[inline]
            pub fn model_mut(&mut self) -> &mut dyn EffectModel<T> {
                match self { $(Self::$name(e) => e),+ }
            }

            /// The same in another number type, rounded once.
            #[inline(never)]
            pub fn cast<U: Scalar>(&self) -> Effect<$life, U> {
                match self { $(Self::$name(e) => Effect::$name(e.cast())),+ }
            }

            /// See [`EffectModel::attach`].
            #[inline(never)]
            pub fn attach(&mut self, to: &Description<'_>) {
                match self { $(Self::$name(e) => e.attach(to)),+ }
            }

            /// See [`EffectModel::fixed_mut`].
            #[inline(never)]
            pub fn fixed_mut(&mut self) -> &mut [T] {
                match self { $(Self::$name(e) => e.fixed_mut()),+ }
            }

            /// True if its values and constants are finite and its joints are among the first
            /// `joints`: what a decoded effect has to be.
            #[inline(never)]
            pub fn is_sound(&self, joints: usize) -> bool {
                // Not by the contract's table, which would bring every function of every effect
                // into a program that only reads a blob.
                let (values, constants, selector) = match self {
                    $(Self::$name(e) => (e.values(), e.constants(), e.selector())),+
                };
                values.iter().chain(constants).all(|x| x.finite())
                    && [selector.joint, selector.from].iter().flatten().all(|&j| j < joints)
            }

            /// The joint that it acts on or through, counted from 0; `None` for the base.
            #[inline]
            pub fn joint(&self) -> Option<usize> {
                match self { $(Self::$name(e) => e.joint()),+ }
            }

            /// When it is evaluated.
            #[inline]
            pub fn stage(&self) -> Stage {
                match self { $(Self::$name(e) => e.stage()),+ }
            }

            /// As its contract.
            #[inline]
            pub fn loaded(&self) -> bool {
                match self { $(Self::$name(e) => e.loaded()),+ }
            }

            /// The joint and what this effect adds to its reading, rad or m.
            #[inline]
            pub fn addition(&self, at: &Reading<'_, T>) -> (usize, T) {
                match self { $(Self::$name(e) => (e.joint().unwrap_or(usize::MAX), effects!(@addition $stage e at))),+ }
            }

            /// Displacement of the tool point, axes of the kinematics' start frame.
            #[inline]
            pub fn displacement(&self, at: &Posture<'_, T>) -> Twist<T> {
                match self { $(Self::$name(e) => effects!(@displacement $stage e at)),+ }.at_tool(at)
            }
        }
    };
}

effects! { 'a:
    /// See [`JointGain`].
    JointGain reading,
    /// See [`GearEccentricity`].
    GearEccentricity reading,
    /// See [`JointCompliance`].
    JointCompliance posture,
    /// See [`JointCurve`].
    #[serde(borrow)]
    JointCurve<'a> reading,
    /// See [`CrossAxisCompliance`].
    CrossAxisCompliance posture,
    /// See [`ThermalDrift`].
    ThermalDrift either,
    /// See [`TimeDrift`].
    TimeDrift either,
    /// See [`WarmUp`].
    WarmUp either,
    /// See [`StepChange`].
    StepChange either,
    /// See [`GearRipple`].
    GearRipple reading,
    /// See [`LinkBending`].
    LinkBending posture,
    /// See [`BaseFlex`].
    BaseFlex posture,
    /// See [`ToolLoad`].
    ToolLoad posture,
    /// See [`GravityLever`].
    GravityLever posture,
    /// See [`Backlash`].
    Backlash reading,
    /// See [`ThermalGrowth`].
    ThermalGrowth posture,
    /// See [`JointCoupling`].
    JointCoupling reading,
    /// See [`AxisWobble`].
    AxisWobble posture,
    /// See [`PrismaticStraightness`].
    PrismaticStraightness posture,
    /// See [`Unnamed`].
    Unnamed either,
}

/// A turn (or a shift) by `way` alone, about `origin`.
pub(crate) fn one_way<T: Scalar>(
    turns: bool,
    way: &Vector3<T>,
    origin: &Vector3<T>,
) -> Displacement<T> {
    let none = Vector3::zeros();
    Displacement {
        twist: match turns {
            true => Twist::new(none, *way),
            false => Twist::new(*way, none),
        },
        origin: *origin,
    }
}

/// The turn of everything beyond joint `j` about (or, prismatic, the slide along) its own
/// axis, per rad or m.
pub(crate) fn about_joint<T: Scalar>(at: &Posture<'_, T>, j: usize) -> Displacement<T> {
    match (at.joints.get(j), at.frames.get(j)) {
        (Some(joint), Some(frame)) => one_way(
            joint.kind == JointKind::Revolute,
            &frame.axis(),
            &frame.origin,
        ),
        _ => Displacement::zero(),
    }
}

/// Entry `j` of a slice, zero beyond its end.
#[inline]
pub(crate) fn entry<T: Scalar>(slice: &[T], j: usize) -> T {
    slice.get(j).copied().unwrap_or_else(T::zero)
}

/// One in place `k` of two, zero in the other.
fn unit<T: Scalar>(k: usize) -> [T; 2] {
    let mut unit = [T::zero(); 2];
    if let Some(place) = unit.get_mut(k) {
        *place = T::one();
    }
    unit
}
