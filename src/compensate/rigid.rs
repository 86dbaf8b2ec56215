//! One pass along a rigid chain of turns that keeps the joint Jacobian only: what the control
//! loop needs where no effect asks for the frames.

use nalgebra::Vector3;

use crate::chain::BakedJoint;
use crate::vector::{add_cross, cross, square};
use crate::{Pose, Scalar, Twist};

/// Where the pass has come to: axes of a frame, and the way from its origin to the target's,
/// in the first joint's frame before its motion.
struct Walk<T: Scalar> {
    x: Vector3<T>,
    y: Vector3<T>,
    z: Vector3<T>,
    way: Vector3<T>,
}

/// What a pass leaves to the target.
#[derive(Clone, Copy, Debug)]
pub struct Rest<T: Scalar> {
    /// From the present pose to the target, about the target's position: of the screw that leads
    /// there, right to second order, since its point halfway moves along the chord. The angular
    /// part is the sine of the angle along the axis: to be used below a quarter turn.
    pub(super) twist: Twist<T>,
    /// Squares of its linear and angular part.
    pub(super) squares: [T; 2],
    /// From the last joint's origin to the target's position, m.
    pub(super) way: Vector3<T>,
    /// Square of the distance of the rotation matrices, entry by entry: for rotations
    /// `4 (1 - cos angle)`. Zero where it was not asked for.
    pub(super) apart: T,
}

impl<T: Scalar> Rest<T> {
    /// Nothing is known: infinitely far.
    fn nowhere() -> Self {
        let far = T::one() / T::zero();
        Self {
            twist: Twist::zero(),
            squares: [far; 2],
            way: Vector3::zeros(),
            apart: far,
        }
    }
}

impl<T: Scalar> Walk<T> {
    /// Through the first joint, which starts at the identity, and its link.
    #[inline(always)]
    fn first(joint: &BakedJoint<T>, [s, c]: [T; 2], point: &Vector3<T>) -> Self {
        let (sa, ca) = (joint.sin_alpha, joint.cos_alpha);
        let (tx, ty) = (joint.tx, joint.ty);
        Self {
            x: Vector3::new(c, s, T::zero()),
            y: Vector3::new(-(s * ca), c * ca, sa),
            z: Vector3::new(s * sa, -(c * sa), ca),
            way: Vector3::new(
                point.x - c * tx + s * ty,
                point.y - s * tx - c * ty,
                point.z,
            ),
        }
    }

    /// The present axis' column of the Jacobian.
    #[inline(always)]
    fn column(&self) -> Twist<T> {
        Twist::new(cross(&self.z, &self.way), self.z)
    }

    /// About z by an angle of this sine and cosine.
    #[inline(always)]
    fn turn(&mut self, [s, c]: [T; 2]) {
        let x = self.x * c + self.y * s;
        self.y = self.y * c - self.x * s;
        self.x = x;
    }

    /// Through a link.
    #[inline(always)]
    fn link(&mut self, joint: &BakedJoint<T>) {
        self.way = self.way - self.x * joint.tx - self.y * joint.ty;
        let y = self.y;
        self.y = y * joint.cos_alpha + self.z * joint.sin_alpha;
        self.z = self.z * joint.cos_alpha - y * joint.sin_alpha;
    }

    /// From here to the target; how far apart only where it is `asked`.
    #[inline(always)]
    fn to(&self, tip: &Vector3<T>, target: &Pose<T>, asked: bool) -> Rest<T> {
        let mut rest = Rest::nowhere();
        rest.way = self.way;
        // What is stored before a barrier needs no registers behind it.
        core::hint::black_box(());
        let linear = self.way - self.x * tip.x - self.y * tip.y - self.z * tip.z;
        let r = &target.rotation;
        let x = Vector3::new(r.m11, r.m21, r.m31);
        let y = Vector3::new(r.m12, r.m22, r.m32);
        let z = Vector3::new(r.m13, r.m23, r.m33);
        let sum = cross(&self.x, &x);
        let sum = add_cross(&add_cross(&sum, &self.y, &y), &self.z, &z);
        let apart = if asked {
            let (x, y, z) = (self.x - x, self.y - y, self.z - z);
            let sum = square(&x) + y.x * y.x + y.y * y.y + y.z * y.z;
            sum + z.x * z.x + z.y * z.y + z.z * z.z
        } else {
            T::zero()
        };
        let linear = add_cross(&linear, &sum, &(linear * T::of(0.25)));
        let angular = sum * T::of(0.5);
        rest.squares = [square(&linear), square(&angular)];
        rest.twist = Twist::new(linear, angular);
        rest.apart = apart;
        rest
    }
}

/// Sine and cosine of each joint.
#[inline(always)]
pub(super) fn turns_at<T: Scalar>(joints: &[BakedJoint<T>], q: &[T], turns: &mut [[T; 2]]) {
    for ((turn, &q), joint) in turns.iter_mut().zip(q).zip(joints) {
        let (s, c) = q.sincos_beside(joint.theta);
        *turn = [s, c];
    }
}

/// [`turns_at`] where it is rare.
pub(crate) fn turn_to<T: Scalar>(joints: &[BakedJoint<T>], q: &[T], turns: &mut [[T; 2]]) {
    turns_at(joints, q, turns);
}

/// The same after steps of at most 0.12 rad, from those before.
#[inline(always)]
pub(super) fn turn_by<T: Scalar>(steps: &[T], turns: &mut [[T; 2]]) {
    for (turn, &step) in turns.iter_mut().zip(steps) {
        let [s, c] = *turn;
        let (s, c) = T::turned_by_step(s, c, step);
        *turn = [s, c];
    }
}

/// What is left to a target, and the joint Jacobian there: everything that a step needs.
///
/// All poses in the first joint's frame before its motion, up to the last joint's after it:
/// `target` comes without the base and, its rotation, without the tool's; `tip` is the tool
/// point in the last joint's frame, m. `turns`: sine and cosine of each joint. `columns`: one
/// place a joint, set to the displacement of the body point at the target's position per unit
/// of the joint. `apart`: whether to tell [`Rest::apart`]. All joints turn, and there are at
/// least two.
#[inline(never)]
pub(super) fn approach<T: Scalar>(
    joints: &[BakedJoint<T>],
    turns: &[[T; 2]],
    tip: &Vector3<T>,
    target: &Pose<T>,
    columns: &mut [Twist<T>],
    apart: bool,
) -> Rest<T> {
    let ([first, joints @ .., _], [first_turn, turns @ .., last_turn]) = (joints, turns) else {
        return Rest::nowhere();
    };
    let [column, columns @ .., last_column] = columns else {
        return Rest::nowhere();
    };
    let point = &target.translation;
    *column = Twist::new(Vector3::new(-point.y, point.x, T::zero()), Vector3::z());
    let mut walk = Walk::first(first, *first_turn, point);
    // Two at a time: what moves from register to register between them is saved.
    let (joint_pairs, joints) = joints.as_chunks::<2>();
    let (turn_pairs, turns) = turns.as_chunks::<2>();
    let (column_pairs, columns) = columns.as_chunks_mut::<2>();
    for ((joints, turns), columns) in joint_pairs.iter().zip(turn_pairs).zip(column_pairs) {
        for ((joint, turn), column) in joints.iter().zip(turns).zip(columns) {
            *column = walk.column();
            walk.turn(*turn);
            walk.link(joint);
        }
    }
    for ((joint, turn), column) in joints.iter().zip(turns).zip(columns) {
        *column = walk.column();
        walk.turn(*turn);
        walk.link(joint);
    }
    // The last joint has no link: it is in the tool.
    *last_column = walk.column();
    walk.turn(*last_turn);
    walk.to(tip, target, apart)
}
