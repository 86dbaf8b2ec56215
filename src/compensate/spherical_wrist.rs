//! Analytic nominal inverse kinematics of the common six-joint arm.
//!
//! Needs six revolute joints whose last three axes meet in a point and whose second and third
//! are parallel, as most industrial arms have them nominally: whether an arm is one is found
//! out from its baked chain, whatever convention it was described in. Cost: about two forward
//! kinematics and six arc tangents for each of the eight solutions.

use crate::chain::{BakedJoint, Frame, forward};
use crate::model::BakedChain;
use crate::{JointKind, Pose, Scalar};

/// An arm that has the analytic solution.
#[derive(Clone, Debug)]
pub struct SphericalWrist<'m, T: Scalar> {
    chain: &'m BakedChain<T, 6>,
}

/// Whether six joints turn, the last three axes meet in a point, the second and third are
/// parallel, and the others are not, to the tolerance `tiny` (m or rad).
#[inline(never)]
pub(super) fn fits<T: Scalar>(joints: &[BakedJoint<T>], tiny: T) -> bool {
    let [first, second, _, fourth, fifth, _] = joints else {
        return false;
    };
    let meet = |joint: &BakedJoint<T>| joint.tx.abs() < tiny && joint.ty.abs() < tiny;
    joints.iter().all(|j| j.kind == JointKind::Revolute)
        && meet(fourth)
        && meet(fifth)
        && second.sin_alpha.abs() < tiny
        && [first, fourth, fifth]
            .iter()
            .all(|j| j.sin_alpha.abs() > T::of(0.1))
}

impl<'m, T: Scalar> SphericalWrist<'m, T> {
    /// `None` if the arm is not of this kind, to a hundred times rounding (of metres).
    pub fn of(chain: &'m BakedChain<T, 6>) -> Option<Self> {
        let tiny = T::EPSILON * T::of(100.0);
        fits(&chain.joints, tiny).then_some(Self { chain })
    }

    /// The joints (rad) that put the tool nominally at `pose` in the world, of up to eight
    /// solutions the one nearest to `near`, each joint by whole turns as near as it comes.
    /// Where the wrist is aligned, the fourth joint stays as in `near`. `None` out of reach.
    #[inline(never)]
    pub fn inverse(&self, pose: &Pose<T>, near: &[T; 6]) -> Option<[T; 6]> {
        let chain = self.chain;
        let goal = chain.base.inverse().then(&pose.then(&chain.tool.inverse()));
        let [j1, j2, j3, j4, j5, _] = &chain.joints;
        let p = goal.translation;
        // Joint 1: the wrist lies in the plane of joints 2 and 3.
        let across = j1.ty + j1.cos_alpha * p.z / j1.sin_alpha;
        let reach = p.x * p.x + p.y * p.y - across * across;
        if reach < T::zero() {
            return None;
        }
        let along = p.y.arctangent2(p.x);
        let tilt = across.arctangent2(reach.root());
        let mut best: Option<([T; 6], T)> = None;
        for a1 in [along - tilt, along + tilt + T::pi()] {
            let (s, c) = a1.sincos();
            let v = (p.x * c + p.y * s - j1.tx, p.y * c - p.x * s - j1.ty);
            // The wrist seen from the second joint, before its turn.
            let w = (v.0, j1.cos_alpha * v.1 + j1.sin_alpha * p.z);
            // Joint 3: law of cosines; a half turn between the parallel axes mirrors y.
            let mirror = j2.cos_alpha;
            let (tx, ty) = (j2.tx, mirror * j2.ty);
            let square = |x: T, y: T| x * x + y * y;
            let (upper, fore) = (square(tx, ty), square(j3.tx, j3.ty));
            let product = (upper * fore).root();
            let cosine = (square(w.0, w.1) - upper - fore) / (product + product);
            let rest = T::one() - cosine * cosine;
            if !rest.finite() || rest < T::zero() {
                continue;
            }
            let bend = rest.root().arctangent2(cosine);
            let between = ty.arctangent2(tx) - j3.ty.arctangent2(j3.tx);
            for a3 in [between + bend, between - bend] {
                let (s, c) = a3.sincos();
                let (x, y) = (j3.tx * c - j3.ty * s, j3.tx * s + j3.ty * c);
                let a2 = w.1.arctangent2(w.0) - (j2.ty + mirror * y).arctangent2(j2.tx + x);
                let arm = [a1 - j1.theta, a2 - j2.theta, a3 - j3.theta];
                self.wrist(&goal, arm, [j4, j5], near, &mut best);
            }
        }
        best.map(|(q, _)| q)
    }

    /// Adds the two wrist solutions to an arm solution and keeps what is nearest.
    #[inline(never)]
    fn wrist(
        &self,
        goal: &Pose<T>,
        arm: [T; 3],
        [j4, j5]: [&BakedJoint<T>; 2],
        near: &[T; 6],
        best: &mut Option<([T; 6], T)>,
    ) {
        let joints = &self.chain.joints;
        let mut frames = [Frame::identity(); 3];
        let elbow = forward(&Pose::identity(), joints, &arm, &mut frames);
        let m = elbow.rotation.tr_mul(&goal.rotation);
        let (x, y) = (m[(0, 2)], m[(1, 2)]);
        let cosine = (j4.cos_alpha * j5.cos_alpha - m[(2, 2)]) / (j4.sin_alpha * j5.sin_alpha);
        // Rounding takes it beyond one where the wrist is aligned.
        let rest = T::one() - cosine * cosine;
        if rest < -T::EPSILON * T::of(64.0) {
            return;
        }
        let bend = rest.max(T::zero()).root().arctangent2(cosine);
        for a5 in [bend, -bend] {
            let (s, c) = a5.sincos();
            // The sixth axis seen from the fourth joint after its turn.
            let u = (
                s * j5.sin_alpha,
                -j4.cos_alpha * c * j5.sin_alpha - j4.sin_alpha * j5.cos_alpha,
            );
            let size = u.0 * u.0 + u.1 * u.1;
            let q4 = if size > T::EPSILON {
                y.arctangent2(x) - u.1.arctangent2(u.0) - j4.theta
            } else {
                near[3]
            };
            let mut q = [arm[0], arm[1], arm[2], q4, a5 - j5.theta, T::zero()];
            let mut frames = [Frame::identity(); 5];
            let hand = forward(&Pose::identity(), joints, &q[..5], &mut frames);
            let turn = hand.rotation.tr_mul(&goal.rotation);
            let theta6 = joints[5].theta;
            q[5] = turn[(1, 0)].arctangent2(turn[(0, 0)]) - theta6;
            let mut distance = T::zero();
            for (q, &near) in q.iter_mut().zip(near) {
                let turns = ((near - *q) / T::two_pi()).round();
                *q += turns * T::two_pi();
                distance += (*q - near) * (*q - near);
            }
            if best.is_none_or(|(_, least)| distance < least) {
                *best = Some((q, distance));
            }
        }
    }
}
