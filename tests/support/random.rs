//! Random arms for the tests, from an integer generator: the same everywhere.

use nalgebra::Vector3;
use truepose::{Convention, Joint, JointKind, LinkMass, Pose};

/// A 64-bit linear congruential generator (Knuth's MMIX constants).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Uniform in [-1, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in [-range, range).
    pub(crate) fn within(&mut self, range: f64) -> f64 {
        self.unit() * range
    }

    /// One of `count`.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.unit() + 1.0) / 2.0 * count as f64) as usize
    }

    /// Three numbers within `range`.
    pub(crate) fn vector(&mut self, range: f64) -> Vector3<f64> {
        Vector3::new(self.within(range), self.within(range), self.within(range))
    }

    /// Any pose within `range` (m) of the origin.
    pub(crate) fn pose(&mut self, range: f64) -> Pose<f64> {
        Pose::from_xyz_rpy(self.vector(range), self.vector(3.0))
    }

    /// A joint of any kind and convention; about one in four with its next axis parallel.
    pub(crate) fn joint(&mut self) -> Joint<f64> {
        let kind = if self.below(4) == 0 {
            JointKind::Prismatic
        } else {
            JointKind::Revolute
        };
        let convention = match self.below(4) {
            0 => Convention::Dh,
            1 => Convention::Hayati,
            2 => Convention::Mdh,
            _ => Convention::ZeroReference,
        };
        let mut joint = Joint::new(kind, convention);
        joint.theta = self.within(3.0);
        joint.d = self.within(0.5);
        if convention == Convention::ZeroReference {
            joint.axis = loop {
                let v = self.vector(1.0);
                if v.norm() > 0.1 {
                    break v.normalize();
                }
            };
            joint.point = self.vector(0.5);
            joint.turn = [self.within(0.3), self.within(0.3)];
            joint.shift = [self.within(0.1), self.within(0.1)];
        } else {
            joint.a = self.within(0.5);
            joint.alpha = match self.below(4) {
                0 => 0.0,
                1 => std::f64::consts::FRAC_PI_2,
                2 => std::f64::consts::PI,
                _ => self.within(3.0),
            };
            joint.beta = match self.below(2) {
                0 => 0.0,
                _ => self.within(0.5),
            };
        }
        joint
    }

    /// Mass of a link, kg, within 0.2 m.
    pub(crate) fn mass(&mut self) -> LinkMass<f64> {
        LinkMass {
            mass: self.unit() + 1.5,
            com: self.vector(0.2),
        }
    }
}
