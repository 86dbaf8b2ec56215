//! The link from one joint's frame to the next joint's axis, as parameters.
//!
//! A frame stands on an axis, z along it; the next axis is a direction and a point seen from
//! there. How far the frame must turn and slide along its z, and what follows across, are the
//! parameters. MRD 4.320 to 4.325 (Stone), 6.19 to 6.40; derived again, since the print of
//! 4.322 and 6.33 has signs wrong. There are two equal answers, theta and theta plus half a turn;
//! then a, alpha and beta change sign.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use truepose::Pose;

/// Axes whose directions differ by less are parallel, rad: a hundred times what rounding
/// leaves of a right angle given in degrees.
pub const PARALLEL: f64 = 1e-12;

/// Points nearer than this are one, m.
const COINCIDENT: f64 = 1e-12;

/// `Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)`, angles in rad, lengths in m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// About the axis.
    pub theta: f64,
    /// Along the axis.
    pub d: f64,
    /// Along the turned x.
    pub a: f64,
    /// About the turned x.
    pub alpha: f64,
    /// About y after that; Hayati's.
    pub beta: f64,
}

impl Link {
    /// The transform.
    pub fn pose(&self) -> Pose<f64> {
        Pose::rotate_z(self.theta)
            .then(&Pose::translate(self.a, 0.0, self.d))
            .then(&Pose::rotate_x(self.alpha))
            .then(&Pose::rotate_y(self.beta))
    }

    /// By the common normal of the frame's z axis and the next axis, which stands along the
    /// unit vector `direction` through `point` (m), both in the frame. Of parallel axes, whose
    /// common normal is anywhere, the one through `point`. Theta is as near as can be to
    /// `near`. MRD 6.21 to 6.30, 4.320 to 4.325.
    pub fn by_common_normal(direction: &Vector3<f64>, point: &Vector3<f64>, near: f64) -> Self {
        let across = direction.x.hypot(direction.y);
        let link = if across < PARALLEL {
            let a = point.x.hypot(point.y);
            let apart = a > COINCIDENT;
            Self {
                theta: if apart { point.y.atan2(point.x) } else { near },
                d: point.z,
                a: if apart { a } else { 0.0 },
                alpha: if direction.z < 0.0 { PI } else { 0.0 },
                beta: 0.0,
            }
        } else {
            // The normal is along z x direction.
            let theta = direction.x.atan2(-direction.y);
            let p = Pose::rotate_z(-theta).rotation * point;
            Self {
                theta,
                d: p.z + p.y * direction.z / across,
                a: p.x,
                alpha: across.atan2(direction.z),
                beta: 0.0,
            }
        };
        link.turned_near(near).0
    }

    /// By the point where the next axis goes through the frame's x-y plane, Hayati's way; not
    /// for an axis that lies along that plane. MRD 6.31 to 6.40.
    pub fn in_plane(direction: &Vector3<f64>, point: &Vector3<f64>, near: f64) -> Self {
        let p = point - direction * (point.z / direction.z);
        let a = p.x.hypot(p.y);
        let apart = a > COINCIDENT;
        let place = Self {
            theta: if apart { p.y.atan2(p.x) } else { near },
            a: if apart { a } else { 0.0 },
            ..Self::default()
        };
        let (place, _) = place.turned_near(near);
        // z turned: (sin beta, -sin alpha cos beta, cos alpha cos beta)
        let u = Pose::rotate_z(-place.theta).rotation * direction;
        Self {
            alpha: (-u.y).atan2(u.z),
            beta: u.x.atan2(u.y.hypot(u.z)),
            ..place
        }
    }

    /// Of the two links that reach the same axis, the one with theta nearer to `near`, and what
    /// the next frame is turned by, 0 or pi. Where both are a quarter turn away rounding does
    /// not choose: it is the one with a positive `a`.
    pub fn turned_near(self, near: f64) -> (Self, f64) {
        let off = (self.theta - near + PI).rem_euclid(2.0 * PI) - PI;
        let tie = (off.abs() - FRAC_PI_2).abs() < 1e-9;
        let kept = match tie {
            true if self.a.abs() > COINCIDENT => self.a > 0.0,
            true => off > 0.0,
            false => off.abs() < FRAC_PI_2,
        };
        if kept {
            let theta = near + off;
            return (Self { theta, ..self }, 0.0);
        }
        let turned = Self {
            theta: near + off - PI.copysign(off),
            d: self.d,
            a: -self.a,
            alpha: -self.alpha,
            beta: -self.beta,
        };
        (turned, PI)
    }

    /// Turns the frame's z axis into `direction` and moves nowhere, for a slide that is nearly
    /// parallel to it: theta is `near`, alpha and beta tilt.
    pub fn by_tilt(direction: &Vector3<f64>, near: f64) -> Self {
        Self::in_plane(direction, &Vector3::zeros(), near)
    }

    /// The link that is `pose` exactly, where there is one without beta.
    pub fn of_pose(pose: &Pose<f64>) -> Option<Self> {
        let z = pose.rotation.column(2).into_owned();
        let x = pose.rotation.column(0).into_owned();
        let p = &pose.translation;
        // x must be across the frame's z and lie in the direction of the translation across.
        let theta = x.y.atan2(x.x);
        let link = Self {
            theta,
            d: p.z,
            a: p.x * theta.cos() + p.y * theta.sin(),
            alpha: (z.x * theta.sin() - z.y * theta.cos()).atan2(z.z),
            beta: 0.0,
        };
        let left = link.pose().twist_to(pose);
        (left.linear.norm() < COINCIDENT && left.angular.norm() < PARALLEL).then_some(link)
    }
}
