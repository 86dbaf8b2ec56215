//! One pass along a rigid chain that keeps the joint Jacobian only: what the control loop
//! needs where no effect asks for the frames.

use nalgebra::Vector3;

use super::damped::cross;
use crate::chain::BakedJoint;
use crate::{JointKind, Pose, Scalar, Twist};

/// Where the pass has come to: axes and origin of a frame, in the first joint's before its
/// motion.
struct Walk<T: Scalar> {
    x: Vector3<T>,
    y: Vector3<T>,
    z: Vector3<T>,
    origin: Vector3<T>,
}

/// Sine and cosine of the angle about a joint's axis, and the way along it.
#[inline(always)]
fn motion<T: Scalar>(joint: &BakedJoint<T>, q: T) -> (T, T, T) {
    match joint.kind {
        JointKind::Revolute => {
            let (s, c) = q.sincos_beside(joint.theta);
            (s, c, T::zero())
        }
        JointKind::Prismatic => (joint.sincos_theta[0], joint.sincos_theta[1], q),
    }
}

impl<T: Scalar> Walk<T> {
    /// Through the first joint and its link, which start at the identity.
    #[inline(always)]
    fn first(joint: &BakedJoint<T>, q: T) -> Self {
        let (s, c, slide) = motion(joint, q);
        let (sa, ca) = (joint.sin_alpha, joint.cos_alpha);
        let (tx, ty) = (joint.tx, joint.ty);
        Self {
            x: Vector3::new(c, s, T::zero()),
            y: Vector3::new(-(s * ca), c * ca, sa),
            z: Vector3::new(s * sa, -(c * sa), ca),
            origin: Vector3::new(c * tx - s * ty, s * tx + c * ty, slide),
        }
    }

    /// Through a joint's motion. `column`: set to its column of the Jacobian about `point`.
    #[inline(always)]
    fn turn(&mut self, joint: &BakedJoint<T>, q: T, point: &Vector3<T>, column: &mut Twist<T>) {
        match joint.kind {
            JointKind::Revolute => {
                *column = Twist::new(cross(&self.z, &(point - self.origin)), self.z);
                self.rotate(q.sincos_beside(joint.theta));
            }
            JointKind::Prismatic => {
                *column = Twist::new(self.z, Vector3::zeros());
                self.origin += self.z * q;
                self.rotate((joint.sincos_theta[0], joint.sincos_theta[1]));
            }
        }
    }

    /// About z by an angle of this sine and cosine.
    #[inline(always)]
    fn rotate(&mut self, (s, c): (T, T)) {
        let x = self.x * c + self.y * s;
        self.y = self.y * c - self.x * s;
        self.x = x;
    }

    /// The twist from here to the target.
    #[inline(always)]
    fn to(&self, tip: &Vector3<T>, target: &Pose<T>) -> Twist<T> {
        let at = self.origin + self.x * tip.x + self.y * tip.y + self.z * tip.z;
        let linear = target.translation - at;
        let [x, y, z] = [0, 1, 2].map(|k| target.rotation.column(k).into_owned());
        let angular = (cross(&self.x, &x) + cross(&self.y, &y) + cross(&self.z, &z)) * T::of(0.5);
        Twist::new(linear, angular).at(&linear)
    }

    /// Through a link.
    #[inline(always)]
    fn link(&mut self, joint: &BakedJoint<T>) {
        self.origin += self.x * joint.tx + self.y * joint.ty;
        let y = self.y;
        self.y = y * joint.cos_alpha + self.z * joint.sin_alpha;
        self.z = self.z * joint.cos_alpha - y * joint.sin_alpha;
    }
}

/// What is left to a target, and the joint Jacobian there: everything that a step needs.
///
/// All poses in the first joint's frame before its motion, up to the last joint's after it:
/// `target` comes without the base and, its rotation, without the tool's; `tip` is the tool
/// point in the last joint's frame, m. `columns`: one place a joint, set to the displacement
/// of the body point at the target's position per unit of the joint.
///
/// Returns the twist from the present pose to the target about the target's position. Its
/// angular part is the sine of the angle along the axis: to be used below a quarter turn.
/// At least one joint.
#[inline(never)]
pub(super) fn approach<T: Scalar>(
    joints: &[BakedJoint<T>],
    q: &[T],
    tip: &Vector3<T>,
    target: &Pose<T>,
    columns: &mut [Twist<T>],
) -> Twist<T> {
    let ([first, joints @ ..], [q_first, q @ ..], [column, columns @ ..]) = (joints, q, columns)
    else {
        return Twist::zero();
    };
    let point = &target.translation;
    *column = match first.kind {
        JointKind::Revolute => Twist::new(Vector3::new(-point.y, point.x, T::zero()), Vector3::z()),
        JointKind::Prismatic => Twist::new(Vector3::z(), Vector3::zeros()),
    };
    let mut walk = Walk::first(first, *q_first);
    if let ([joints @ .., last], [q @ .., q_last], [columns @ .., last_column]) =
        (joints, q, columns)
    {
        for ((joint, &q), column) in joints.iter().zip(q).zip(columns) {
            walk.turn(joint, q, point, column);
            walk.link(joint);
        }
        // The last joint has no link: it is in the tool.
        walk.turn(last, *q_last, point, last_column);
    }
    walk.to(tip, target)
}
