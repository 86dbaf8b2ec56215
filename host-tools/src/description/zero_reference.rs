//! Zero-reference axes, from the base frame into the frame before each joint.

use nalgebra::Vector3;
use truepose::{Convention, Pose};

use super::RobotJoint;

/// Carries each zero-reference axis and point, given in the base frame at zero reading (m),
/// into the distal frame of the link before it, where [`truepose::Joint`] has them.
///
/// `t_base_link(k)` is the product of the transforms of the joints before joint `k` at zero
/// reading. Behind zero-reference joints without offset it is the identity.
pub(super) fn into_link_frames(joints: &mut [RobotJoint]) {
    let mut t_base_link = Pose::identity();
    for RobotJoint { joint, .. } in joints {
        if joint.convention == Convention::ZeroReference {
            let t_link_base = t_base_link.inverse();
            joint.axis = unit(&(t_link_base.rotation * joint.axis)).unwrap_or(joint.axis);
            joint.point = t_link_base.point(&joint.point);
        }
        t_base_link = t_base_link.then(&joint.transform(0.0));
    }
}

/// Unit vector along `v`; `None` where it has no direction. Scaled by its largest entry
/// first, so that tiny and huge vectors keep their direction.
pub(super) fn unit(v: &Vector3<f64>) -> Option<Vector3<f64>> {
    let largest = v.amax();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    Some((v / largest).normalize())
}
