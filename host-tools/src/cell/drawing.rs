//! The arms as their makers draw them. Dimensions and masses are of the published kind,
//! rounded; none of them stands for a particular arm.

use std::f64::consts::FRAC_PI_2;

use super::solid::{Solid, shift, turn_x, turn_y, turn_z, xyz_rpy};
use crate::random::Random;

/// An arm of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arm {
    /// Six revolute joints, two of them parallel, offset shoulder. Standard DH.
    Puma560,
    /// Six revolute joints, three of them parallel, no spherical wrist. Standard DH.
    Ur10,
    /// Six revolute joints, two of them parallel, small. Standard DH.
    Irb120,
    /// Seven revolute joints. Craig's modified DH.
    Panda,
    /// Two parallel revolute joints, a slide, a revolute joint, all axes parallel. Standard DH.
    Scara,
    /// Two revolute joints, a slide, a spherical wrist. Standard DH.
    Stanford,
}

impl Arm {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Puma560,
        Self::Ur10,
        Self::Irb120,
        Self::Panda,
        Self::Scara,
        Self::Stanford,
    ];
}

/// What a joint's reading turns into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Revolute,
    Prismatic,
}

/// One joint with its link, m, rad, kg.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub(crate) kind: Kind,
    /// Craig's order of the four transforms; standard DH otherwise.
    pub(crate) proximal: bool,
    pub(crate) theta: f64,
    pub(crate) d: f64,
    pub(crate) a: f64,
    pub(crate) alpha: f64,
    /// Zero in a drawing: only the arm itself has it.
    pub(crate) beta: f64,
    pub(crate) limits: [f64; 2],
    pub(crate) ratio: f64,
    pub(crate) mass: f64,
    pub(crate) com: [f64; 3],
}

impl Link {
    /// Constant part before the motion. `growth`: the link's lengths, 1 where nothing grows.
    pub(crate) fn before(&self, growth: f64) -> Solid {
        if self.proximal {
            turn_x(self.alpha) * shift(self.a * growth, 0.0, 0.0) * turn_y(self.beta)
        } else {
            Solid::identity()
        }
    }

    /// The motion itself, with the offset of its zero.
    pub(crate) fn motion(&self, q: f64) -> Solid {
        match self.kind {
            Kind::Revolute => turn_z(self.theta + q),
            Kind::Prismatic => turn_z(self.theta) * shift(0.0, 0.0, q),
        }
    }

    /// Constant part after the motion.
    pub(crate) fn after(&self, growth: f64) -> Solid {
        let along = shift(0.0, 0.0, self.d * growth);
        if self.proximal {
            along
        } else {
            along * shift(self.a * growth, 0.0, 0.0) * turn_x(self.alpha) * turn_y(self.beta)
        }
    }
}

/// An arm without its base: joints, tool.
#[derive(Clone, Debug)]
pub(crate) struct Drawing {
    pub(crate) name: &'static str,
    pub(crate) links: Vec<Link>,
    /// Last link's frame to the tool: xyz (m), roll, pitch, yaw (rad).
    pub(crate) tool: [f64; 6],
}

impl Drawing {
    pub(crate) fn tool_pose(&self) -> Solid {
        let [x, y, z, roll, pitch, yaw] = self.tool;
        xyz_rpy([x, y, z], [roll, pitch, yaw])
    }

    /// The same arm as it was built: every link parameter off by a few tenths of a millimetre
    /// and a few hundredths of a degree, the tool by more.
    pub(crate) fn as_built(&self, random: &mut Random) -> Self {
        let mut built = self.clone();
        for link in &mut built.links {
            link.theta += random.deviation(DEVIATION_ANGLE);
            link.d += random.deviation(DEVIATION_LENGTH);
            link.a += random.deviation(DEVIATION_LENGTH);
            link.alpha += random.deviation(DEVIATION_ANGLE);
            link.beta += random.deviation(DEVIATION_ANGLE);
        }
        for (k, x) in built.tool.iter_mut().enumerate() {
            *x += random.deviation(if k < 3 { TOOL_LENGTH } else { TOOL_ANGLE });
        }
        built
    }

    /// The drawing of an arm.
    pub(crate) fn of(arm: Arm) -> Self {
        match arm {
            Arm::Puma560 => Self {
                name: "PUMA 560",
                links: vec![
                    dh(0.0, 0.6718, 0.0, 90.0, 160.0).weighing(13.0, [0.0, -0.3, 0.04]),
                    dh(0.0, 0.0, 0.4318, 0.0, 110.0).weighing(17.4, [-0.364, 0.006, 0.228]),
                    dh(0.0, 0.15, 0.0203, -90.0, 135.0).weighing(4.8, [-0.02, -0.014, 0.07]),
                    dh(0.0, 0.4318, 0.0, 90.0, 140.0).weighing(0.82, [0.0, 0.019, -0.05]),
                    dh(0.0, 0.0, 0.0, -90.0, 100.0).weighing(0.34, [0.0, 0.0, 0.0]),
                    dh(0.0, 0.05625, 0.0, 0.0, 175.0).weighing(0.3, [0.0, 0.0, -0.02]),
                ],
                tool: [0.03, 0.0, 0.09, 0.0, 0.0, 0.0],
            },
            Arm::Ur10 => Self {
                name: "UR10",
                links: vec![
                    dh(0.0, 0.1273, 0.0, 90.0, 175.0).weighing(7.1, [0.021, 0.0, 0.027]),
                    dh(0.0, 0.0, -0.612, 0.0, 175.0).weighing(12.7, [0.38, 0.0, 0.158]),
                    dh(0.0, 0.0, -0.5723, 0.0, 160.0).weighing(4.27, [0.24, 0.0, 0.068]),
                    dh(0.0, 0.1639, 0.0, 90.0, 175.0).weighing(2.0, [0.0, 0.007, 0.018]),
                    dh(0.0, 0.1157, 0.0, -90.0, 175.0).weighing(2.0, [0.0, 0.007, 0.018]),
                    dh(0.0, 0.0922, 0.0, 0.0, 175.0).weighing(0.365, [0.0, 0.0, -0.026]),
                ],
                tool: [0.02, 0.0, 0.08, 0.0, 0.0, 0.0],
            },
            Arm::Irb120 => Self {
                name: "IRB 120",
                links: vec![
                    dh(0.0, 0.29, 0.0, -90.0, 165.0).weighing(3.07, [0.0, 0.043, 0.0]),
                    dh(-90.0, 0.0, 0.27, 0.0, 105.0).weighing(3.9, [-0.169, 0.0, 0.001]),
                    dh(0.0, 0.0, 0.07, -90.0, 85.0).weighing(2.94, [-0.012, 0.0, 0.022]),
                    dh(0.0, 0.302, 0.0, 90.0, 160.0).weighing(1.33, [0.0, -0.078, 0.0]),
                    dh(0.0, 0.0, 0.0, -90.0, 115.0).weighing(0.55, [0.0, 0.0, 0.0]),
                    dh(0.0, 0.072, 0.0, 0.0, 175.0).weighing(0.14, [0.0, 0.0, -0.007]),
                ],
                tool: [0.05, 0.02, 0.1, 0.0, 0.0, 0.0],
            },
            Arm::Panda => Self {
                name: "Panda",
                links: vec![
                    mdh(0.333, 0.0, 0.0, [-165.0, 165.0]).weighing(4.97, [0.004, 0.002, -0.17]),
                    mdh(0.0, 0.0, -90.0, [-100.0, 100.0]).weighing(3.2, [-0.003, -0.029, 0.003]),
                    mdh(0.316, 0.0, 90.0, [-165.0, 165.0]).weighing(3.2, [0.027, 0.039, -0.066]),
                    mdh(0.0, 0.0825, 90.0, [-175.0, -5.0]).weighing(3.6, [-0.053, 0.104, 0.027]),
                    mdh(0.384, -0.0825, -90.0, [-165.0, 165.0])
                        .weighing(1.2, [-0.012, 0.041, -0.038]),
                    mdh(0.0, 0.0, 90.0, [0.0, 210.0]).weighing(1.7, [0.06, -0.014, -0.01]),
                    mdh(0.107, 0.088, 90.0, [-165.0, 165.0]).weighing(0.74, [0.01, -0.004, 0.062]),
                ],
                tool: [0.02, 0.03, 0.1, 0.0, 0.0, 0.0],
            },
            Arm::Scara => Self {
                name: "SCARA",
                links: vec![
                    dh(0.0, 0.4, 0.4, 0.0, 130.0).weighing(9.0, [-0.18, 0.0, 0.02]),
                    dh(0.0, 0.0, 0.3, 180.0, 140.0).weighing(6.0, [-0.12, 0.0, -0.03]),
                    slide(0.0, 0.05, [0.0, 0.3]).weighing(1.5, [0.0, 0.0, -0.1]),
                    dh(0.0, 0.04, 0.0, 0.0, 175.0).weighing(0.5, [0.0, 0.0, 0.0]),
                ],
                tool: [0.06, 0.02, 0.05, 0.0, 0.0, 0.0],
            },
            Arm::Stanford => Self {
                name: "Stanford arm",
                links: vec![
                    dh(0.0, 0.412, 0.0, -90.0, 165.0).weighing(9.3, [0.0, 0.175, -0.11]),
                    dh(0.0, 0.154, 0.0, 90.0, 120.0).weighing(5.0, [0.0, -0.105, 0.0]),
                    Link {
                        theta: -FRAC_PI_2,
                        ..slide(0.0, 0.0, [0.25, 0.85]).weighing(4.25, [0.0, 0.0, -0.35])
                    },
                    dh(0.0, 0.0, 0.0, -90.0, 165.0).weighing(1.08, [0.0, 0.009, -0.005]),
                    dh(0.0, 0.0, 0.0, 90.0, 100.0).weighing(0.63, [0.0, 0.0, 0.0]),
                    dh(0.0, 0.263, 0.0, 0.0, 165.0).weighing(0.51, [0.0, 0.0, -0.1]),
                ],
                tool: [0.03, 0.02, 0.06, 0.0, 0.0, 0.0],
            },
        }
    }
}

/// One standard deviation of a link's angle as built, rad (0.05 deg).
const DEVIATION_ANGLE: f64 = 8.7e-4;
/// Likewise of a length, m.
const DEVIATION_LENGTH: f64 = 3.0e-4;
/// Likewise of the tool's angles, rad (0.3 deg).
const TOOL_ANGLE: f64 = 5.2e-3;
/// Likewise of the tool's position, m.
const TOOL_LENGTH: f64 = 1.0e-3;

/// Revolute, standard DH: degrees, m, m, degrees, limits on both sides in degrees.
fn dh(theta: f64, d: f64, a: f64, alpha: f64, limit: f64) -> Link {
    Link {
        kind: Kind::Revolute,
        proximal: false,
        theta: theta.to_radians(),
        d,
        a,
        alpha: alpha.to_radians(),
        beta: 0.0,
        limits: [-limit.to_radians(), limit.to_radians()],
        ratio: 100.0,
        mass: 0.0,
        com: [0.0; 3],
    }
}

/// Revolute, Craig's form: m, m, degrees, degrees.
fn mdh(d: f64, a: f64, alpha: f64, limits: [f64; 2]) -> Link {
    Link {
        proximal: true,
        limits: limits.map(f64::to_radians),
        ..dh(0.0, d, a, alpha, 0.0)
    }
}

/// Prismatic, standard DH: m.
fn slide(a: f64, d: f64, limits: [f64; 2]) -> Link {
    Link {
        kind: Kind::Prismatic,
        limits,
        ratio: 0.0,
        ..dh(0.0, d, a, 0.0, 0.0)
    }
}

impl Link {
    fn weighing(self, mass: f64, com: [f64; 3]) -> Self {
        Self { mass, com, ..self }
    }
}
