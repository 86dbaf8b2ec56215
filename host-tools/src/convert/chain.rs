//! From the zero position to joints of a form.

use nalgebra::Vector3;
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};

use super::link::{Link, PARALLEL};
use super::{Axis, Converted, Form, NearlyParallel, Refused, ZeroPosition};
use crate::description::{Robot, RobotJoint};
use crate::identify::structure::NEARLY_PARALLEL;

/// No link is longer, m, in a description that can be read again.
const LONGEST: f64 = 50.0;

/// `robot` in `form`. The base frame moves only where `form` needs axis 1 along its z axis,
/// the last link's distal frame only where `form` cannot reach it; base, tool, gravity and
/// masses follow. Refused where two axes are so nearly parallel that their common normal is
/// out of reach.
pub fn convert(robot: &Robot, form: Form) -> Result<Converted, Refused> {
    let zero = ZeroPosition::of(robot);
    let mut converted = Converted {
        robot: robot.clone(),
        nearly_parallel: Vec::new(),
    };
    // The new base frame in the old one.
    let moved = match form {
        Form::ZeroReference => Pose::identity(),
        Form::Dh | Form::Hayati | Form::Mdh => on_first_axis(&zero),
    };
    let joints: Vec<Joint<f64>> = match form {
        Form::ZeroReference => zero.axes.iter().map(zero_reference).collect(),
        Form::Dh | Form::Hayati | Form::Mdh => {
            let thetas = thetas(robot);
            let links = links(&zero, &thetas, &moved, form, &mut converted.nearly_parallel)?;
            from_links(&zero, &links)
        }
    };
    let back = moved.inverse();
    let new = &mut converted.robot;
    new.base = robot.base.then(&moved);
    new.gravity = moved.rotation.transpose() * robot.gravity;
    let mut at = Pose::identity();
    for ((to, joint), link) in new.joints.iter_mut().zip(joints).zip(&zero.links) {
        at = at.then(&joint.transform(0.0));
        *to = RobotJoint {
            joint,
            link: to.link.map(|mass| LinkMass {
                com: at.inverse().then(&back).then(link).point(&mass.com),
                ..mass
            }),
            ..to.clone()
        };
    }
    new.tool = at.inverse().then(&back).then(&zero.tool);
    Ok(converted)
}

fn zero_reference(axis: &Axis) -> Joint<f64> {
    Joint {
        axis: axis.direction,
        point: match axis.kind {
            JointKind::Revolute => axis.point,
            JointKind::Prismatic => Vector3::zeros(),
        },
        ..Joint::new(axis.kind, Convention::ZeroReference)
    }
}

/// The base frame turned and moved as little as brings its z axis onto the first axis.
fn on_first_axis(zero: &ZeroPosition) -> Pose<f64> {
    let Some(first) = zero.axes.first() else {
        return Pose::identity();
    };
    let turn = shortest_turn(&Vector3::z(), &first.direction);
    let foot = match first.kind {
        JointKind::Revolute => first.point - first.direction * first.point.dot(&first.direction),
        JointKind::Prismatic => Vector3::zeros(),
    };
    let on_axis = foot.norm() <= 1e-12;
    Pose::new(turn, if on_axis { Vector3::zeros() } else { foot })
}

/// The rotation by the smallest angle that takes one unit vector to another; the identity
/// where they differ by rounding.
pub(crate) fn shortest_turn(from: &Vector3<f64>, to: &Vector3<f64>) -> nalgebra::Matrix3<f64> {
    let normal = from.cross(to);
    let (sine, cosine) = (normal.norm(), from.dot(to));
    if sine > 1e-14 {
        return Pose::from_rotation_vector(&(normal * (sine.atan2(cosine) / sine))).rotation;
    }
    if cosine > 0.0 {
        return nalgebra::Matrix3::identity();
    }
    // Half a turn about the axis across that `from` is farthest from.
    let across = match from.iamin() {
        0 => Vector3::x(),
        1 => Vector3::y(),
        _ => Vector3::z(),
    };
    let axis = from.cross(&across).normalize();
    Pose::from_rotation_vector(&(axis * std::f64::consts::PI)).rotation
}

/// Axes with each slide put where the link after it needs no length: through the foot of the
/// common normal on the axis that follows. `end`: where the last axis' own link ends, m.
/// MRD 4.5.2 (a of a slide and d of the joint after it are zero).
pub(crate) fn placed(axes: &[Axis], end: &Vector3<f64>) -> Vec<Axis> {
    let mut axes = axes.to_vec();
    let mut foot = *end;
    for k in (0..axes.len()).rev() {
        let (before, after) = axes.split_at_mut(k + 1);
        let Some(axis) = before.last_mut() else {
            break;
        };
        if axis.kind == JointKind::Prismatic {
            axis.point = foot;
            continue;
        }
        foot = match after.first() {
            Some(next) if axis.direction.cross(&next.direction).norm() > NEARLY_PARALLEL.sin() => {
                let turn = shortest_turn(&Vector3::z(), &axis.direction);
                let next = next.moved(&Pose::new(turn, axis.point).inverse());
                let link = Link::by_common_normal(&next.direction, &next.point, 0.0);
                axis.point + axis.direction * link.d
            }
            Some(_) => axis.point,
            None => axis.point + axis.direction * (foot - axis.point).dot(&axis.direction),
        };
    }
    axes
}

/// Thetas that the new ones are to be near to: numbers stay comparable with the drawing's.
fn thetas(robot: &Robot) -> Vec<f64> {
    let theta = |joint: &Joint<f64>| match joint.convention {
        Convention::ZeroReference => 0.0,
        _ => joint.theta,
    };
    robot.joints.iter().map(|j| theta(&j.joint)).collect()
}

/// One link a joint with its convention, the last one to the last link's distal frame where
/// it can be.
fn links(
    zero: &ZeroPosition,
    thetas: &[f64],
    base: &Pose<f64>,
    form: Form,
    nearly_parallel: &mut Vec<NearlyParallel>,
) -> Result<Vec<(Convention, Link)>, Refused> {
    let plain = match form {
        Form::Mdh => Convention::Mdh,
        _ => Convention::Dh,
    };
    let axes = placed(&zero.axes, &zero.flange().translation);
    let mut at = *base;
    let mut links = Vec::with_capacity(axes.len());
    for ((first, pair), &near) in axes.windows(2).enumerate().zip(thetas) {
        let [_, next] = pair else { break };
        let next = next.moved(&at.inverse());
        let sine = next.direction.x.hypot(next.direction.y);
        let angle = sine.atan2(next.direction.z.abs());
        let parallel = angle < NEARLY_PARALLEL;
        let (u, p) = (&next.direction, &next.point);
        let (convention, link) = match next.kind {
            // A slide has no place of its own: what is nearly parallel stays where it is.
            JointKind::Prismatic if parallel && form == Form::Hayati => {
                nearly_parallel.push(NearlyParallel { first, angle });
                (Convention::Hayati, Link::by_tilt(u, near))
            }
            JointKind::Prismatic if parallel && sine >= PARALLEL => {
                (plain, Link::by_common_normal(u, &Vector3::zeros(), near))
            }
            JointKind::Revolute if parallel && form == Form::Hayati => {
                nearly_parallel.push(NearlyParallel { first, angle });
                (Convention::Hayati, Link::in_plane(u, p, near))
            }
            _ => (plain, Link::by_common_normal(u, p, near)),
        };
        if link.d.abs() > LONGEST {
            return Err(Refused {
                form,
                first,
                angle,
                distance: link.d,
            });
        }
        at = at.then(&link.pose());
        links.push((convention, link));
    }
    let rest = at.inverse().then(&zero.flange());
    let last = Link::of_pose(&rest).filter(|last| match form {
        Form::Mdh => last.a.abs() < 1e-12 && last.alpha.abs() < 1e-12,
        _ => true,
    });
    links.push((plain, last.unwrap_or_default()));
    Ok(links)
}

/// The last link of Craig's form has no `a` and `alpha` after it.
fn from_links(zero: &ZeroPosition, links: &[(Convention, Link)]) -> Vec<Joint<f64>> {
    let mut before = Link::default();
    let mut joints = Vec::with_capacity(links.len());
    for (axis, (convention, link)) in zero.axes.iter().zip(links) {
        // Craig's stand before the axis that they lead to.
        let across = match convention {
            Convention::Mdh => std::mem::replace(&mut before, *link),
            _ => *link,
        };
        joints.push(Joint {
            theta: link.theta,
            d: link.d,
            a: across.a,
            alpha: across.alpha,
            beta: across.beta,
            ..Joint::new(axis.kind, *convention)
        });
    }
    joints
}
