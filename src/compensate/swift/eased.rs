//! One step of a regulator that asks a price of its own of each joint: the plain case of a
//! command in a margin, for which [`super::super::descent`] evaluates the model again and again.

use super::super::descent::weighted;
use super::super::rigid::approach;
use super::super::solve::dot;
use super::super::{Compensator, Request, Status};
use super::{Plain, Squares, Work, bound, without};
use crate::{Pose, Scalar};

impl<T: Scalar, const N: usize> Compensator<'_, T, N> {
    /// The only step of a regulator that asks a price of its own of each joint, where the command
    /// is in a margin: that of [`super::descent`], if what it leaves is bounded by less than was
    /// there before. `None`, and the state as it was, otherwise.
    #[inline(never)]
    pub(super) fn eased(
        &mut self,
        request: &Request<T, N>,
        desired: &Pose<T>,
        fits: bool,
    ) -> Option<Plain<T>> {
        let constants = self.constants.as_ref()?;
        let settings = &self.settings;
        if settings.max_iterations != 1 || !fits {
            return None;
        }
        let chain = &self.model.calibrated;
        let target = without(desired, &chain.base, &chain.tool);
        let Work {
            q,
            turns,
            columns,
            steps,
            ..
        } = &mut self.work;
        T::turn_to(&chain.joints, &request.q, turns);
        let tip = &chain.tool.translation;
        let rest = approach(&chain.joints, turns, tip, &target, columns, true);
        let [position, orientation] = rest.squares;
        let initial = Squares {
            position,
            orientation,
        };
        if !rest.turned(&initial) || initial.below(&constants.tolerance) {
            return None;
        }
        let merit = initial.weighted(constants.weights);
        let inverse = constants.undamped(columns, &rest.way, &rest.twist, steps, true, position)?;
        // No price for being near a singularity either; NaN is not clear.
        let clear = inverse * (constants.singular + merit) <= T::one();
        if !clear {
            return None;
        }
        let mut prices = [T::zero(); N];
        let limits = &self.model.limits;
        T::prices(
            settings.effort,
            &request.q,
            &chain.joints,
            limits,
            &mut prices,
        );
        let weights = [settings.position_weight, settings.orientation_weight];
        let mut weighted_columns = [[T::zero(); 6]; N];
        for (weighted_column, column) in weighted_columns.iter_mut().zip(columns.iter()) {
            *weighted_column = weighted(column, weights);
        }
        let error = weighted(&rest.twist, weights);
        // `p = S Jᵀ W (W J S Jᵀ W + μ I)⁻¹ W e`, `S = μ / (G + λ² I)`: of any μ the same step.
        let mu = settings.damping + settings.effort;
        for share in &mut prices {
            *share = mu / (settings.damping + *share);
        }
        let (y, _) = T::shared_multipliers(&weighted_columns, &prices, mu, &error, false);
        for (step, (column, share)) in steps.iter_mut().zip(weighted_columns.iter().zip(&prices)) {
            *step = dot(column, &y) * *share;
        }
        *q = request.q;
        let (mut way, mut left) = (T::zero(), rest.twist);
        for ((q, &step), column) in q.iter_mut().zip(steps.iter()).zip(columns.iter()) {
            *q += step;
            way += step.abs();
            left = left.plus(&column.scaled(-step));
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
        let near = way > constants.perceptible && way < settings.correction_bound[0];
        if !better || !near || !constants.inside(&request.q, way) {
            return None;
        }
        self.state.asked = request.q;
        self.state.found = *q;
        self.state.last = *q;
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
}
