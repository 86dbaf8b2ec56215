//! One step of a regulator that asks a price of its own of each joint: the plain case of a
//! command in a margin, for which [`super::super::descent`] evaluates the model again and again.

use super::super::error::weighted;
use super::super::rigid::{Rest, approach};
use super::super::solve::dot;
use super::super::{Compensator, Request, Status};
use super::{Constants, Plain, Plan, Squares, Work, bound};
use crate::vector::along;
use crate::{Pose, Scalar, Twist};

impl<T: Scalar, const N: usize> Compensator<'_, T, N> {
    /// The only step of a regulator that asks a price of its own of each joint, where the command
    /// is in a margin: that of [`super::descent`], if what it leaves is bounded by less than was
    /// there before. `None`, and the state as it was, otherwise.
    #[inline(never)]
    pub(super) fn eased(
        &mut self,
        request: &Request<T, N>,
        target: &Pose<T>,
        fits: bool,
    ) -> Option<Plain<T>> {
        let constants = self.constants.as_ref()?;
        if self.settings.max_iterations != 1 || !fits {
            return None;
        }
        let Work {
            q,
            turns,
            columns,
            steps,
            more,
            rows,
            travel,
            ..
        } = &mut self.work;
        let chain = &self.model.calibrated;
        T::turn_to(&chain.joints, &request.q, turns);
        let tip = &chain.tool.translation;
        let rest = approach(&chain.joints, turns, tip, target, columns, true);
        let [position, _] = rest.squares;
        let inverse = constants.undamped(columns, &rest.way, &rest.twist, steps, true, position)?;
        let plan = Plan {
            joints: &chain.joints,
            tool: tip,
            limits: &self.model.limits,
            resolution: &self.model.resolution,
            settings: &self.settings,
        };
        *q = request.q;
        let plain = T::ease(
            &plan, constants, &rest, inverse, columns, rows, more, q, travel,
        )?;
        self.state.asked = request.q;
        self.state.found = *q;
        self.state.last = *q;
        Some(plain)
    }
}

/// Moves `q` by the step to `rest`, if that is a plain case. `inverse`: bound of `|J⁻¹|²`;
/// `rows` and `shares`: one place a joint.
#[expect(clippy::too_many_arguments, reason = "the places of one step")]
pub(crate) fn ease<T: Scalar>(
    plan: &Plan<'_, T>,
    constants: &Constants<T>,
    rest: &Rest<T>,
    inverse: T,
    columns: &[Twist<T>],
    rows: &mut [[T; 6]],
    shares: &mut [T],
    q: &mut [T],
    travel: &[[T; 2]],
) -> Option<Plain<T>> {
    let settings = plan.settings;
    let [position, orientation] = rest.squares;
    let initial = Squares {
        position,
        orientation,
    };
    let merit = initial.weighted(constants.weights);
    // No price for being near a singularity either; NaN is not clear.
    let clear = inverse * (constants.singular + merit) <= T::one();
    if !rest.turned(&initial) || initial.below(&constants.tolerance) || !clear {
        return None;
    }
    // How far every joint may go.
    let [mut room, _] = settings.correction_bound;
    for (&q, &[middle, half]) in q.iter().zip(travel) {
        let here = half - (q - middle).abs();
        if here < room {
            room = here;
        }
    }
    T::prices(settings.effort, q, plan.joints, plan.limits, shares);
    let weights = [settings.position_weight, settings.orientation_weight];
    for (row, column) in rows.iter_mut().zip(columns) {
        *row = weighted(column, weights);
    }
    let error = weighted(&rest.twist, weights);
    // `p = S Jᵀ W (W J S Jᵀ W + μ I)⁻¹ W e`, `S = μ / (G + λ² I)`: of any μ the same step.
    let mu = settings.damping + settings.effort;
    for share in shares.iter_mut() {
        *share = mu / (settings.damping + *share);
    }
    let (y, _) = T::shared_multipliers(rows, shares, mu, &error, false);
    let (mut way, mut left) = (T::zero(), rest.twist);
    for ((q, &share), (row, column)) in q.iter_mut().zip(&*shares).zip(rows.iter().zip(columns)) {
        let step = dot(row, &y) * share;
        *q += step;
        way += step.abs();
        left.linear = along(&left.linear, &column.linear, -step);
        left.angular = along(&left.angular, &column.angular, -step);
    }
    let kept = Squares::of(&left).error();
    let quarter = way * way * T::of(0.25);
    let off = [constants.twice_reach * quarter, quarter];
    // The roots are rough.
    let kept = [kept.position, kept.orientation].map(|kept| kept * T::of(1.0 + 1e-5));
    let remaining = bound(kept, off);
    let squares = Squares::of_error(&remaining);
    // NaN is none of these.
    let better = squares.weighted(constants.weights) <= merit;
    let near = way > constants.perceptible && way < room;
    if !better || !near {
        return None;
    }
    Some(Plain {
        status: match squares.below(&constants.tolerance) {
            true => Status::Converged,
            false => Status::IterationLimit,
        },
        iterations: 1,
        initial,
        remaining,
    })
}
