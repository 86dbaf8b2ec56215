//! What is large and not in a hurry.

use crate::budget::{self, Cost, Moment};
use crate::chain::{self, BakedJoint, Frame};
use crate::compensate::descent::{self, Next, Search};
use crate::compensate::rigid::Rest;
use crate::compensate::swift::{Constants, Plain, Plan, eased};
use crate::compensate::{
    self, PoseError, Status, damped, error, lqr, minimum_move, rigid, step, swift, task_point,
};
use crate::effects::{Ambient, Effect, Unnamed, unnamed};
use crate::model::{Arm, Prediction, Scratch};
use crate::prepared::{PreparedJoint, Whole};
use crate::taught::{Cmac, Outputs, Place, Polynomial, Region, cmac, place, polynomial};
use crate::{Pose, Prepared, Scalar, Settings, Twist};
use crate::{pose, prepared};
use nalgebra::Vector3;

/// Declares a trait of functions and implements it for both number types.
macro_rules! aside {
    ($($(#[$meta:meta])* fn $name:ident$(<$life:lifetime>)?($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? = $path:path;)+) => {
        /// Behind a trait's functions code is in a program once for each number type, and is
        /// compiled with this crate for size, not with its caller for speed.
        #[expect(clippy::too_many_arguments, reason = "the places of one step")]
        pub trait Aside: Sized {
            $($(#[$meta])*
            fn $name$(<$life>)?($($argument: $type),*) $(-> $result)? where Self: Scalar;)+
        }
        aside!(@impl f32: $(fn $name$(<$life>)?($($argument: $type),*) $(-> $result)? = $path;)+);
        aside!(@impl f64: $(fn $name$(<$life>)?($($argument: $type),*) $(-> $result)? = $path;)+);
    };
    (@impl $scalar:ty: $(fn $name:ident$(<$life:lifetime>)?($($argument:ident: $type:ty),*) $(-> $result:ty)? = $path:path;)+) => {
        impl Aside for $scalar {
            $(#[inline(never)]
            fn $name$(<$life>)?($($argument: $type),*) $(-> $result)? { $path($($argument),*) })+
        }
    };
}

aside! {
    /// What is left to the effects' contract adds to the readings.
    fn set_contracted(
        prepared: &Prepared<'_, Self>,
        q: &[Self],
        additions: &mut [Self],
    ) = prepared::set_contracted;

    /// `before` with what is left to the effects' contract after the kinematics.
    fn displaced_by_contract(
        prepared: &Prepared<'_, Self>,
        q: &[Self],
        rigid: &Pose<Self>,
        scratch: &mut Scratch<'_, Self>,
        before: &Twist<Self>,
    ) -> Twist<Self> = prepared::displaced_by_contract;

    /// See [`Arm::prepare`].
    fn work_in<'m>(
        arm: &Arm<'m, Self>,
        direction: &[Self],
        ambient: &Ambient<Self>,
        joints: &mut [PreparedJoint<'m, Self>],
        whole: &mut Whole<Self>,
    ) = prepared::work_in;

    /// An unnamed term without its amplitude.
    fn product(
        term: &Unnamed<Self>,
        q: &[Self],
        direction: &[Self],
        ambient: &Ambient<Self>,
    ) -> Self = unnamed::product;

    /// See [`minimum_move::nearest`].
    fn neighbours(q: Self, step: Self, limits: &[Self; 2]) -> Option<(Self, Self)>
        = minimum_move::neighbours;

    /// See [`minimum_move::nearest`].
    fn choose(
        columns: &mut [[Self; 6]],
        error: [Self; 6],
        steps: &[Self],
        limits: &[[Self; 2]],
        q: &mut [Self],
    ) = minimum_move::choose;

    /// See [`lqr`].
    fn prices(
        gamma: Self,
        q: &[Self],
        joints: &[BakedJoint<Self>],
        limits: &[[Self; 2]],
        prices: &mut [Self],
    ) = lqr::prices;

    /// Says which of `q` stand at an end of their interval.
    fn bounded(q: &[Self], room: &[[Self; 2]], clamped: &mut [bool]) = step::bounded;

    /// Moves each of `q` into its interval.
    fn confine(q: &mut [Self], room: &[[Self; 2]]) = step::confine;

    /// See [`Search`].
    fn set_out(
        search: &mut Search<'_, Self>,
        q: &[Self],
        asked: &[Self],
        found: &[Self],
    ) = descent::set_out;

    /// See [`Search`].
    fn carry_on(
        search: &mut Search<'_, Self>,
        prediction: &Prediction<Self>,
        now: &Moment,
    ) -> Next = descent::carry_on::<Self, false>;

    /// The same of fewer than six joints.
    fn carry_on_few(
        search: &mut Search<'_, Self>,
        prediction: &Prediction<Self>,
        now: &Moment,
    ) -> Next = descent::carry_on::<Self, true>;

    /// See [`Search`].
    fn answer(search: &mut Search<'_, Self>, q: &[Self]) = task_point::answer;

    /// See [`Search`].
    fn arrive(
        search: &Search<'_, Self>,
        q: &mut [Self],
        clamped: &mut [bool],
    ) -> [PoseError<Self>; 2] = descent::arrive;

    /// See [`Pose::displaced`].
    fn displaced(pose: &Pose<Self>, twist: &Twist<Self>) -> Pose<Self> = pose::displaced;

    /// See [`Pose::twist_to`].
    fn twist(pose: &Pose<Self>, target: &Pose<Self>) -> Twist<Self> = pose::twist;

    /// The twist from one pose to another.
    fn between(predicted: &Pose<Self>, desired: &Pose<Self>) -> Twist<Self> = error::between;

    /// Six damped equations.
    fn shared_multipliers(
        columns: &[[Self; 6]],
        shares: &[Self],
        mu: Self,
        e: &[Self; 6],
        clearance: bool,
    ) -> ([Self; 6], [Self; 2]) = damped::shared_multipliers;

    /// Why a request cannot be compensated, if so.
    fn refusal(
        q: &[Self],
        direction: &[Self],
        ambient: &Ambient<Self>,
        pose: Option<&Pose<Self>>,
    ) -> Option<Status> = compensate::refusal;

    /// What a compensation costs at worst, in general and in the plain case.
    fn costs(joints: usize, effects: &[Effect<'_, Self>], iteration: Option<u32>) -> [Cost; 2]
        = budget::costs;

    /// What does not change from one plain case to the next.
    fn constants(
        plan: &Plan<'_, Self>,
        travel: &mut [[Self; 2]],
        inner: &mut [Self],
    ) -> Option<Constants<Self>> = swift::constants;

    /// A regulator's only step.
    fn ease(
        plan: &Plan<'_, Self>,
        constants: &Constants<Self>,
        rest: &Rest<Self>,
        inverse: Self,
        columns: &[Twist<Self>],
        rows: &mut [[Self; 6]],
        shares: &mut [Self],
        q: &mut [Self],
        travel: &[[Self; 2]],
    ) -> Option<Plain<Self>> = eased::ease;

    /// [`Pose::then`].
    fn then(first: &Pose<Self>, next: &Pose<Self>) -> Pose<Self> = pose::then;

    /// [`crate::forward`].
    fn forward(
        start: &Pose<Self>,
        joints: &[BakedJoint<Self>],
        q: &[Self],
        frames: &mut [Frame<Self>],
    ) -> Pose<Self> = chain::pass;

    /// Sine and cosine of each joint.
    fn turn_to(joints: &[BakedJoint<Self>], q: &[Self], turns: &mut [[Self; 2]]) = rigid::turn_to;

    /// A damped step of a plain case.
    fn damped_step(
        constants: &Constants<Self>,
        settings: &Settings<Self>,
        error: &Twist<Self>,
        columns: &[Twist<Self>],
        rows: &mut [[Self; 6]],
        shares: &mut [Self],
        ends: [&[Self]; 2],
        first: bool,
        steps: &mut [Self],
    ) -> (Self, [Self; 2]) = swift::damped_step;

    /// See [`Polynomial::evaluate`].
    fn polynomial(
        polynomial: &Polynomial<'_, Self>,
        q: &[Self],
        delta: &mut [Self],
    ) -> Option<[Self; 3]> = polynomial::corrections;

    /// Columns of the weighted joint Jacobian.
    fn weighted_jacobian(
        joints: &[BakedJoint<Self>],
        frames: &[Frame<Self>],
        tool: &Vector3<Self>,
        weights: [Self; 2],
        columns: &mut [[Self; 6]],
    ) = error::weighted_jacobian;

    /// See [`Region::place`].
    fn place(region: &Region<Self>, q: &[Self]) -> Option<Place<Self>> = place;

    /// See [`Cmac::evaluate`].
    fn cells(cmac: &Cmac<'_, Self>, q: &[Self]) -> Option<Outputs<Self>> = cmac::cells;
}
