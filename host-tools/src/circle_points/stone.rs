//! Link parameters after Stone: a frame of any turn and place on each axis, the transforms
//! between them, and six parameters of each (the S-model). MRD 4.299 to 4.325.

use truepose::{Convention, JointKind, Pose};

use crate::convert::link::Link;
use crate::convert::{Axis, shortest_turn};

use super::describe::Neighbours;

/// `Rz(beta) Tz(d) Tx(a) Rx(alpha) Rz(gamma) Tz(b)`, MRD 4.304.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SModel {
    /// The first four; the link's theta is MRD's beta.
    pub link: Link,
    /// Turn of the next frame about its axis, rad.
    pub gamma: f64,
    /// Place of the next frame along its axis, m.
    pub b: f64,
}

impl SModel {
    /// From the transform between two frames, each with z along its axis. MRD 4.320 to 4.325;
    /// the print of 4.322 squares what must be added as it is: gamma is the turn that is left.
    pub fn of(t: &Pose<f64>) -> Self {
        let link = Link::by_common_normal(&t.rotation.column(2).into_owned(), &t.translation, 0.0);
        let rest = link.pose().inverse().then(t);
        Self {
            link,
            gamma: turn(&rest),
            b: rest.translation.z,
        }
    }
}

/// A frame on an axis: origin at its point, turned the shortest way from the instrument's.
fn frame(axis: &Axis) -> Pose<f64> {
    Pose::new(
        shortest_turn(&nalgebra::Vector3::z(), &axis.direction),
        axis.point,
    )
}

/// First frame and links, see [`super::Method::links`].
pub fn links(axes: &[Axis]) -> (Pose<f64>, Vec<(Convention, Link)>) {
    let mut links: Vec<(Convention, Link)> = Vec::new();
    let Some(mut axis) = axes.first().copied() else {
        return (Pose::identity(), links);
    };
    let mut base = frame(&axis);
    // What stands between the link's own frame and Stone's frame on the same axis.
    let mut rest = Pose::<f64>::identity();
    for next in axes.iter().skip(1) {
        let mut next = *next;
        let neighbours = Neighbours::of(&axis, &next);
        let own = frame(&axis).then(&rest.inverse());
        if neighbours == Neighbours::ParallelSlide {
            next.point = own.translation;
        }
        let t = frame(&axis).inverse().then(&frame(&next));
        let (convention, link) = if neighbours == Neighbours::Apart {
            let model = SModel::of(&t);
            // MRD 4.305 and 4.306.
            let combined = Link {
                theta: model.link.theta + turn(&rest),
                d: model.link.d + rest.translation.z,
                ..model.link
            };
            let (link, turned) = combined.turned_near(0.0);
            rest = Pose::rotate_z(model.gamma + turned).then(&Pose::translate(0.0, 0.0, model.b));
            (Convention::Dh, link)
        } else {
            // The plane that the next axis goes through is that of the link's own frame.
            let t = rest.then(&t);
            let z = t.rotation.column(2).into_owned();
            let link = match next.kind {
                JointKind::Revolute => Link::in_plane(&z, &t.translation, 0.0),
                JointKind::Prismatic => Link::by_tilt(&z, 0.0),
            };
            rest = link.pose().inverse().then(&t);
            (Convention::Hayati, link)
        };
        if links.is_empty() {
            // The first frame is free: it stands where the first link begins.
            base = base
                .then(&Pose::rotate_z(link.theta))
                .then(&Pose::translate(0.0, 0.0, link.d));
            let start = Link {
                theta: 0.0,
                d: 0.0,
                ..link
            };
            links.push((convention, start));
        } else {
            links.push((convention, link));
        }
        axis = next;
    }
    (base, links)
}

/// Angle of a turn about z.
fn turn(pose: &Pose<f64>) -> f64 {
    pose.rotation[(1, 0)].atan2(pose.rotation[(0, 0)])
}
