//! What is large and not in a hurry.

use crate::chain::{BakedJoint, Frame};
use crate::compensate::{Along, descent, lqr, minimum_move, step};
use crate::effects::{Ambient, Unnamed, unnamed};
use crate::prepared;
use crate::taught::{Cmac, Outputs, Place, Region, cmac, place};
use crate::{Prepared, Scalar};
use nalgebra::Vector3;

/// Declares a trait of functions and implements it for both number types.
macro_rules! aside {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? = $path:path;)+) => {
        /// Behind a trait's functions code is in a program once for each number type, and is
        /// compiled with this crate for size, not with its caller for speed.
        pub trait Aside: Sized {
            $($(#[$meta])*
            fn $name($($argument: $type),*) $(-> $result)? where Self: Scalar;)+
        }
        aside!(@impl f32: $(fn $name($($argument: $type),*) $(-> $result)? = $path;)+);
        aside!(@impl f64: $(fn $name($($argument: $type),*) $(-> $result)? = $path;)+);
    };
    (@impl $scalar:ty: $(fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? = $path:path;)+) => {
        impl Aside for $scalar {
            $(#[inline(never)]
            fn $name($($argument: $type),*) $(-> $result)? { $path($($argument),*) })+
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

    /// Where each joint may go.
    fn keep_near(
        room: &mut [[Self; 2]],
        joints: &[BakedJoint<Self>],
        q: &[Self],
        bound: &[Self; 2],
    ) = step::keep_near;

    /// Says which of `q` stand at an end of their interval.
    fn bounded(q: &[Self], room: &[[Self; 2]], clamped: &mut [bool]) = step::bounded;

    /// Moves each of `q` into its interval.
    fn confine(q: &mut [Self], room: &[[Self; 2]]) = step::confine;

    /// A step, each joint kept in its interval.
    fn advance(
        from: &[Self],
        step: &[Self],
        scale: Self,
        room: &[[Self; 2]],
        q: &mut [Self],
    ) = step::advance;

    /// The joints' share of multipliers.
    fn projected(columns: &[[Self; 6]], y: &[Self; 6], step: &mut [Self]) = step::projected;

    /// What efforts make of a damped step's equations.
    fn eased(
        columns: &[[Self; 6]],
        effort: &[Self],
        away: &[Self],
        damping: Self,
        right: &mut [Self; 6],
        ease: &mut [Self],
        back: &mut [Self],
    ) -> Self = step::eased;

    /// Coordinate descent inside a box.
    fn sweep(
        columns: &[[Self; 6]],
        error: &[Self; 6],
        joints: &mut [Along<Self>],
        room: &[[Self; 2]],
        p: &mut [Self],
    ) = step::sweep;

    /// Half of what a merit falls along a step.
    fn half_slope(
        error: &[Self; 6],
        columns: &[[Self; 6]],
        effort: &[Self],
        away: &[Self],
        step: &[Self],
    ) -> Self = descent::half_slope;

    /// Columns of the weighted joint Jacobian.
    fn weighted_jacobian(
        joints: &[BakedJoint<Self>],
        frames: &[Frame<Self>],
        tool: &Vector3<Self>,
        weights: [Self; 2],
        columns: &mut [[Self; 6]],
    ) = descent::weighted_jacobian;

    /// See [`Region::place`].
    fn place(region: &Region<Self>, q: &[Self]) -> Option<Place<Self>> = place;

    /// See [`Cmac::evaluate`].
    fn cells(cmac: &Cmac<'_, Self>, q: &[Self]) -> Option<Outputs<Self>> = cmac::cells;
}
