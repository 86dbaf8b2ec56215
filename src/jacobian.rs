//! Derivatives of the tool pose: by the joints and by the parameters of the description.

use nalgebra::Vector3;

use crate::chain::{BakedJoint, Frame, Gauge};
use crate::pose::{crossed, rotated};
use crate::{Joint, JointKind, Parameter, Pose, Scalar, Twist};

/// Displacement of the tool point per unit of one joint (rad or m): a column of the joint
/// Jacobian, axes of the frame that `frame` and `tool` are given in. MRD 5.64 to 5.68.
#[inline]
pub fn joint_column<T: Scalar>(kind: JointKind, frame: &Frame<T>, tool: &Vector3<T>) -> Twist<T> {
    let z = frame.axis();
    match kind {
        JointKind::Revolute => {
            // Entry by entry: compiled for size, a difference of vectors is a loop.
            let o = &frame.origin;
            let arm = Vector3::new(tool.x - o.x, tool.y - o.y, tool.z - o.z);
            Twist::new(z.cross(&arm), z)
        }
        JointKind::Prismatic => Twist::new(z, Vector3::zeros()),
    }
}

/// Where a constant twist of the description is attached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attachment {
    /// The robot base frame, baked.
    Base,
    /// The baked frame of a joint after its motion, joints counted from 0.
    Joint(usize),
}

/// How one parameter of the description moves the tool, ready to be carried to any pose: the
/// sum of one or two constant twists, each in a frame of the pass of [`crate::forward`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttachedTwist<T: Scalar> {
    /// Frame that `twist` is given in.
    pub at: Attachment,
    /// Axes and origin of that frame.
    pub twist: Twist<T>,
}

impl<T: Scalar> AttachedTwist<T> {
    /// Displacement of the tool per unit of the parameter: the identification Jacobian's
    /// column, world axes at the tool point. `base`: baked base. MRD 4.7 (left form).
    #[inline]
    pub fn column(&self, base: &Pose<T>, frames: &[Frame<T>], tool: &Vector3<T>) -> Twist<T> {
        let (r, o) = match self.at {
            Attachment::Base => (&base.rotation, &base.translation),
            Attachment::Joint(j) => match frames.get(j) {
                Some(frame) => (&frame.rotation, &frame.origin),
                None => return Twist::zero(),
            },
        };
        Twist::new(r * self.twist.linear, r * self.twist.angular).at(&(tool - o))
    }
}

/// A twist seen from another frame: `pose` is the twist's own frame seen from there.
pub fn carried<T: Scalar>(pose: &Pose<T>, twist: &Twist<T>) -> Twist<T> {
    let w = rotated(&pose.rotation, &twist.angular);
    let (v, a) = (
        rotated(&pose.rotation, &twist.linear),
        crossed(&pose.translation, &w),
    );
    Twist::new(Vector3::new(v.x + a.x, v.y + a.y, v.z + a.z), w)
}

/// The constant twists of parameter `parameter` of joint `j` (from 0), attached to frames of
/// the baked chain. Up to two: a zero-reference axis moves the arm before and after its
/// motion. `gauges` from [`crate::bake`]; `base` is the described base seen from the baked
/// one.
pub fn parameter_twists<T: Scalar>(
    base: &Pose<T>,
    joints: &[Joint<T>],
    gauges: &[Gauge<T>],
    j: usize,
    parameter: Parameter,
) -> [Option<AttachedTwist<T>>; 2] {
    let (Some(joint), Some(gauge)) = (joints.get(j), gauges.get(j)) else {
        return [None, None];
    };
    let twist = joint.parameter_twist(parameter);
    let after = twist.after.map(|t| AttachedTwist {
        at: Attachment::Joint(j),
        twist: carried(gauge, &t),
    });
    let before = twist.before.map(|t| {
        // The joint frame before the motion is constant in the frame after the one before.
        match j
            .checked_sub(1)
            .and_then(|i| Some((i, joints.get(i)?, gauges.get(i)?)))
        {
            Some((i, previous, gauge)) => AttachedTwist {
                at: Attachment::Joint(i),
                twist: carried(&gauge.then(&previous.after()).then(&joint.before()), &t),
            },
            None => AttachedTwist {
                at: Attachment::Base,
                twist: carried(&base.then(&joint.before()), &t),
            },
        }
    });
    [before, after]
}

/// Displacement per unit of a parameter through the joint's motion alone, used where an
/// effect adds to the reading of joint `j`.
#[inline]
pub fn reading_column<T: Scalar>(
    joints: &[BakedJoint<T>],
    frames: &[Frame<T>],
    j: usize,
    tool: &Vector3<T>,
) -> Twist<T> {
    match (joints.get(j), frames.get(j)) {
        (Some(joint), Some(frame)) => joint_column(joint.kind, frame, tool),
        _ => Twist::zero(),
    }
}
