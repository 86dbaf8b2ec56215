//! Link parameters after Sklar: common normals of neighbouring axes by vector algebra.
//! MRD 4.326 to 4.348.

use nalgebra::Vector3;
use truepose::{Convention, Pose};

use crate::convert::link::{Link, PARALLEL};
use crate::convert::{Axis, shortest_turn};

use super::describe::Neighbours;

/// The common normal of two axes j and k.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    /// Unit vector from axis j to axis k; where they meet, along the cross product of the two.
    pub direction: Vector3<f64>,
    /// Where it meets axis j, m.
    pub on_first: Vector3<f64>,
    /// Where it meets axis k, m.
    pub on_second: Vector3<f64>,
    /// Length, m, not negative.
    pub length: f64,
    /// From axis j to axis k about it, rad.
    pub twist: f64,
}

/// Axes nearer than this meet, m.
const MEET: f64 = 1e-12;

/// Moment of each axis about the other, m. It is `- length sin(twist)`: zero where the axes
/// meet or are parallel. MRD 4.333, 4.336.
pub fn mutual_moment(j: &Axis, k: &Axis) -> f64 {
    let moment = |axis: &Axis| axis.point.cross(&axis.direction);
    j.direction.dot(&moment(k)) + k.direction.dot(&moment(j))
}

/// Skew, meeting and parallel axes, MRD 4.337 to 4.348. The print of 4.338 has the length with
/// the wrong sign: the normal goes from j to k. Of parallel axes, the normal through k's point.
pub fn common_normal(j: &Axis, k: &Axis) -> Normal {
    let cross = j.direction.cross(&k.direction);
    let sine = cross.norm();
    if sine < PARALLEL {
        let cosine = j.direction.dot(&k.direction).signum();
        // 4.348, and its foot below k's point
        let moment = |axis: &Axis| axis.point.cross(&axis.direction);
        let normal = j.direction.cross(&(moment(k) * cosine - moment(j)));
        let length = normal.norm();
        let direction = if length > MEET {
            normal / length
        } else {
            shortest_turn(&Vector3::z(), &j.direction)
                .column(0)
                .into_owned()
        };
        return Normal {
            direction,
            on_first: k.point - direction * (k.point - j.point).dot(&direction),
            on_second: k.point,
            length: if length > MEET { length } else { 0.0 },
            twist: if cosine < 0.0 {
                std::f64::consts::PI
            } else {
                0.0
            },
        };
    }
    let moment = mutual_moment(j, k);
    let sign = if moment > MEET * sine { -1.0 } else { 1.0 };
    let direction = cross * (sign / sine);
    // Where each axis goes through the plane of the other and the normal, 4.339 and 4.340.
    let foot = |axis: &Axis, other: &Axis| {
        let across = direction.cross(&other.direction);
        let way = (other.point - axis.point).dot(&across) / axis.direction.dot(&across);
        axis.point + axis.direction * way
    };
    let (on_first, on_second) = (foot(j, k), foot(k, j));
    Normal {
        direction,
        on_first,
        on_second,
        length: (on_second - on_first).dot(&direction).max(0.0),
        twist: cross.dot(&direction).atan2(j.direction.dot(&k.direction)),
    }
}

/// First frame and links, see [`super::Method::links`].
pub fn links(axes: &[Axis]) -> (Pose<f64>, Vec<(Convention, Link)>) {
    let mut links = Vec::new();
    let Some(first) = axes.first() else {
        return (Pose::identity(), links);
    };
    let mut x = shortest_turn(&Vector3::z(), &first.direction)
        .column(0)
        .into_owned();
    let mut origin = first.point;
    let mut base = (x, origin);
    let mut j = *first;
    for next in axes.iter().skip(1) {
        let mut next = *next;
        let s = j.direction;
        let local = |x: &Vector3<f64>, v: &Vector3<f64>| {
            Vector3::new(v.dot(x), v.dot(&s.cross(x)), v.dot(&s))
        };
        let neighbours = Neighbours::of(&j, &next);
        let (convention, link, beyond) = if neighbours == Neighbours::ParallelSlide {
            next.point = origin;
            let link = Link::by_tilt(&local(&x, &next.direction), 0.0);
            (Convention::Hayati, link, origin)
        } else if neighbours == Neighbours::Parallel {
            let way = (origin - next.point).dot(&s) / next.direction.dot(&s);
            let beyond = next.point + next.direction * way;
            let (theta, a, towards) = turn_to(&x, &s, &(beyond - origin));
            let link = Link {
                theta,
                a,
                ..Link::in_plane(&local(&towards, &next.direction), &Vector3::zeros(), 0.0)
            };
            (Convention::Hayati, link, beyond)
        } else {
            let normal = common_normal(&j, &next);
            // 4.329, 4.330 and 4.341
            let theta = x
                .cross(&normal.direction)
                .dot(&s)
                .atan2(x.dot(&normal.direction));
            let plain = Link {
                theta,
                d: (normal.on_first - origin).dot(&s),
                a: normal.length,
                alpha: normal.twist,
                beta: 0.0,
            };
            let coincide = normal.length <= MEET && normal.twist.sin().abs() < PARALLEL;
            let theta = if coincide { 0.0 } else { theta };
            let (link, _) = Link { theta, ..plain }.turned_near(0.0);
            (Convention::Dh, link, normal.on_second)
        };
        let at = Pose::new(
            nalgebra::Matrix3::from_columns(&[x, s.cross(&x), s]),
            origin,
        );
        if links.is_empty() {
            let begins = at
                .then(&Pose::rotate_z(link.theta))
                .then(&Pose::translate(0.0, 0.0, link.d));
            base = (begins.rotation.column(0).into_owned(), begins.translation);
            links.push((
                convention,
                Link {
                    theta: 0.0,
                    d: 0.0,
                    ..link
                },
            ));
        } else {
            links.push((convention, link));
        }
        let end = at.then(&link.pose());
        x = across(&end.rotation.column(0).into_owned(), &next.direction);
        origin = beyond;
        j = next;
    }
    let (x, origin) = base;
    let s = first.direction;
    let x = across(&x, &s);
    let turn = nalgebra::Matrix3::from_columns(&[x, s.cross(&x), s]);
    (Pose::new(turn, origin), links)
}

/// `x` made orthogonal to the unit vector `s` to rounding.
fn across(x: &Vector3<f64>, s: &Vector3<f64>) -> Vector3<f64> {
    (x - s * x.dot(s)).normalize()
}

/// Angle from `x` to `way` about `s`, within half a turn, the length along it with its sign,
/// and its direction; no turn where there is no way.
fn turn_to(x: &Vector3<f64>, s: &Vector3<f64>, way: &Vector3<f64>) -> (f64, f64, Vector3<f64>) {
    let length = way.norm();
    if length <= MEET {
        return (0.0, 0.0, *x);
    }
    let theta = x.cross(way).dot(s).atan2(x.dot(way));
    let (link, _) = Link {
        theta,
        a: length,
        ..Link::default()
    }
    .turned_near(0.0);
    (link.theta, link.a, way * (link.a.signum() / length))
}
