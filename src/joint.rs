//! One joint and its link, in the four conventions of a robot description.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::pose::{added, crossed, dotted, seen};
use crate::{Pose, Scalar, Twist};

/// What a joint's reading means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum JointKind {
    /// Turns about its axis, reading in rad.
    Revolute,
    /// Slides along its axis, reading in m.
    Prismatic,
}

/// The form in which a joint and its link are described. Each is a motion `J` about or along
/// z with a constant before and a constant after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Convention {
    /// Standard Denavit-Hartenberg: `Rz(theta) Tz(d) Tx(a) Rx(alpha)`. MRD 2.24.
    Dh,
    /// Hayati's for nearly parallel axes: `Rz(theta) Tx(a) Rx(alpha) Ry(beta)`. MRD 2.60. A
    /// constant `d` is kept between `Rz` and `Tx`: it is the drawing's, not identified.
    Hayati,
    /// Craig's modified DH: `Rx(alpha) Tx(a) Rz(theta) Tz(d)`, here with `Ry(beta)` before
    /// `Rz` for nearly parallel axes.
    Mdh,
    /// Zero reference: the axis `u` through the point `p` in the frame before the joint; at
    /// zero reading the joint moves nothing. MRD 2.7.
    ZeroReference,
}

/// One parameter of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Parameter {
    /// Offset of a revolute joint's reading, rad (DH: the angle theta).
    Theta,
    /// Offset of a prismatic joint's reading, m (DH: the distance d).
    D,
    /// Distance along x, m.
    A,
    /// Angle about x, rad.
    Alpha,
    /// Angle about y, rad.
    Beta,
    /// Turn of a zero-reference axis about its own frame's x, rad.
    AxisX,
    /// Turn of a zero-reference axis about its own frame's y, rad.
    AxisY,
    /// Shift of a zero-reference axis along its own frame's x, m.
    PointX,
    /// Shift of a zero-reference axis along its own frame's y, m.
    PointY,
}

impl Parameter {
    /// As it stands in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Theta => "theta",
            Self::D => "d",
            Self::A => "a",
            Self::Alpha => "alpha",
            Self::Beta => "beta",
            Self::AxisX => "axis x",
            Self::AxisY => "axis y",
            Self::PointX => "point x",
            Self::PointY => "point y",
        }
    }

    /// `"rad"` or `"m"`.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Theta | Self::Alpha | Self::Beta | Self::AxisX | Self::AxisY => "rad",
            Self::D | Self::A | Self::PointX | Self::PointY => "m",
        }
    }
}

/// A joint, its link and the parameters of both.
///
/// Not every field is used in every convention; those that are not are zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint<T: Scalar> {
    /// Turns or slides.
    pub kind: JointKind,
    /// The form of the description.
    pub convention: Convention,
    /// rad. Added to the reading of a revolute joint.
    pub theta: T,
    /// m. Added to the reading of a prismatic joint.
    pub d: T,
    /// m.
    pub a: T,
    /// rad.
    pub alpha: T,
    /// rad.
    pub beta: T,
    /// Zero reference: unit vector along the nominal axis, in the frame before the joint.
    pub axis: Vector3<T>,
    /// Zero reference: a point on the nominal axis, m, in the frame before the joint.
    pub point: Vector3<T>,
    /// Zero reference: turn of the axis about x and y of the axis' own frame, rad.
    pub turn: [T; 2],
    /// Zero reference: shift of the axis along x and y of the axis' own frame, m.
    pub shift: [T; 2],
}

/// How one parameter moves the arm: everything beyond the joint is displaced by `before`,
/// seen in the frame just before the motion, and by `after`, seen in the frame just after
/// it, each per unit of the parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterTwist<T: Scalar> {
    /// About the joint frame before the motion.
    pub before: Option<Twist<T>>,
    /// About the joint frame after the motion.
    pub after: Option<Twist<T>>,
}

impl<T: Scalar> Joint<T> {
    /// All zero, of the given kind and convention; a zero-reference axis along z.
    pub fn new(kind: JointKind, convention: Convention) -> Self {
        let o = T::zero();
        Self {
            kind,
            convention,
            theta: o,
            d: o,
            a: o,
            alpha: o,
            beta: o,
            axis: Vector3::z(),
            point: Vector3::zeros(),
            turn: [o; 2],
            shift: [o; 2],
        }
    }

    /// Standard DH, angles in rad, lengths in m.
    pub fn dh(kind: JointKind, theta: T, d: T, a: T, alpha: T) -> Self {
        Self {
            theta,
            d,
            a,
            alpha,
            ..Self::new(kind, Convention::Dh)
        }
    }

    /// Value of a parameter, rad or m.
    pub fn parameter(&self, parameter: Parameter) -> T {
        match parameter {
            Parameter::Theta => self.theta,
            Parameter::D => self.d,
            Parameter::A => self.a,
            Parameter::Alpha => self.alpha,
            Parameter::Beta => self.beta,
            Parameter::AxisX => self.turn[0],
            Parameter::AxisY => self.turn[1],
            Parameter::PointX => self.shift[0],
            Parameter::PointY => self.shift[1],
        }
    }

    /// The same, to change it.
    pub fn parameter_mut(&mut self, parameter: Parameter) -> &mut T {
        match parameter {
            Parameter::Theta => &mut self.theta,
            Parameter::D => &mut self.d,
            Parameter::A => &mut self.a,
            Parameter::Alpha => &mut self.alpha,
            Parameter::Beta => &mut self.beta,
            Parameter::AxisX => &mut self.turn[0],
            Parameter::AxisY => &mut self.turn[1],
            Parameter::PointX => &mut self.shift[0],
            Parameter::PointY => &mut self.shift[1],
        }
    }

    /// The parameters that this convention has. DH and Craig's form list beta as well: with
    /// it, and without d, they are Hayati's.
    pub fn parameters(&self) -> &'static [Parameter] {
        use Parameter::{A, Alpha, AxisX, AxisY, Beta, D, PointX, PointY, Theta};
        match (self.convention, self.kind) {
            (Convention::Dh | Convention::Hayati | Convention::Mdh, _) => {
                &[Theta, D, A, Alpha, Beta]
            }
            (Convention::ZeroReference, JointKind::Revolute) => {
                &[Theta, AxisX, AxisY, PointX, PointY]
            }
            (Convention::ZeroReference, JointKind::Prismatic) => &[D, AxisX, AxisY],
        }
    }

    /// Frame of a zero-reference axis: z along the axis, origin on it.
    fn axis_frame(&self) -> Pose<T> {
        let z = self.axis;
        // x across z and the base axis that is farthest from it.
        let (ax, ay, az) = (z.x.abs(), z.y.abs(), z.z.abs());
        let helper = if ax <= ay && ax <= az {
            Vector3::x()
        } else if ay <= az {
            Vector3::y()
        } else {
            Vector3::z()
        };
        let y = crossed(&z, &helper);
        let y = added(&Vector3::zeros(), &y, T::one() / dotted(&y, &y).root());
        let x = crossed(&y, &z);
        let [across, along] = self.shift;
        let axes = Pose::new(Matrix3::from_columns(&[x, y, z]), self.point);
        let origin = seen(&axes, &Vector3::new(across, along, T::zero()));
        Pose::new(axes.rotation, origin)
            .turned_x(self.turn[0])
            .turned_y(self.turn[1])
    }

    /// Constant transform from the previous link's distal frame to the joint frame, z along
    /// the axis.
    pub fn before(&self) -> Pose<T> {
        match self.convention {
            Convention::Dh | Convention::Hayati => Pose::identity(),
            Convention::Mdh => Pose::rotate_x(self.alpha)
                .moved_x(self.a)
                .turned_y(self.beta),
            Convention::ZeroReference => self.axis_frame(),
        }
    }

    /// Constant transform from the joint frame after the motion to the link's distal frame.
    /// The reading's offset is in here, where it commutes with the motion.
    pub fn after(&self) -> Pose<T> {
        let mut offset = Pose::rotate_z(self.theta);
        offset.translation.z = self.d;
        match self.convention {
            Convention::Dh | Convention::Hayati => offset
                .moved_x(self.a)
                .turned_x(self.alpha)
                .turned_y(self.beta),
            Convention::Mdh => offset,
            Convention::ZeroReference => offset.then(&self.axis_frame().inverse()),
        }
    }

    /// The motion alone at a reading of `q` (rad or m).
    pub fn motion(&self, q: T) -> Pose<T> {
        match self.kind {
            JointKind::Revolute => Pose::rotate_z(q),
            JointKind::Prismatic => Pose::translate(T::zero(), T::zero(), q),
        }
    }

    /// From the previous link's distal frame to this link's, at a reading of `q`.
    pub fn transform(&self, q: T) -> Pose<T> {
        self.before().then(&self.motion(q)).then(&self.after())
    }

    /// How `parameter` moves what lies beyond it. Exact derivative at the present values.
    pub fn parameter_twist(&self, parameter: Parameter) -> ParameterTwist<T> {
        let o = Vector3::<T>::zeros();
        let linear = |v: Vector3<T>| Twist::new(v, o);
        let angular = |w: Vector3<T>| Twist::new(o, w);
        // Rotation `axis` through the point `p`, seen at the frame's own origin.
        let about = |axis: Vector3<T>, p: Vector3<T>| Twist::new(p.cross(&axis), axis);
        let after = |twist| ParameterTwist {
            before: None,
            after: Some(twist),
        };
        let before = |twist| ParameterTwist {
            before: Some(twist),
            after: None,
        };
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let turned = Pose::rotate_z(self.theta);
        match (self.convention, parameter) {
            (_, Parameter::Theta) => after(angular(z)),
            (_, Parameter::D) => after(linear(z)),
            (Convention::Dh | Convention::Hayati, Parameter::A) => {
                after(linear(turned.rotation * x))
            }
            (Convention::Dh | Convention::Hayati, Parameter::Alpha) => {
                // about x through the axis' foot; d along z does not commute with it
                after(about(turned.rotation * x, z * self.d))
            }
            (Convention::Dh | Convention::Hayati, Parameter::Beta) => {
                let r = turned.then(&Pose::rotate_x(self.alpha));
                let p = turned.rotation * (x * self.a) + z * self.d;
                after(about(r.rotation * y, p))
            }
            (Convention::Mdh, p) => {
                // Seen in the joint frame: the transform from there back to the parameter.
                let unturned = Pose::rotate_y(self.beta).inverse();
                match p {
                    Parameter::A => before(linear(unturned.rotation * x)),
                    Parameter::Alpha => {
                        // x passes through the joint frame's origin
                        before(angular(unturned.rotation * x))
                    }
                    _ => before(angular(y)),
                }
            }
            (_, p) => {
                // The axis frame stands before and, inverted, after the motion. There `p`
                // displaces the frame by `twist` (in its own axes); beyond it everything
                // moves along before the motion and back after it.
                let turn = Pose::rotate_y(self.turn[1]).inverse().rotation;
                let tilt = turn * Pose::rotate_x(self.turn[0]).inverse().rotation;
                let twist = match p {
                    Parameter::AxisX => angular(turn * x),
                    Parameter::AxisY => angular(y),
                    Parameter::PointX => linear(tilt * x),
                    _ => linear(tilt * y),
                };
                // After the motion the inverse frame follows the offset.
                let back = Twist::new(
                    turned.rotation * twist.linear,
                    turned.rotation * twist.angular,
                );
                let back = back.scaled(-T::one());
                let origin = z * self.d;
                ParameterTwist {
                    before: Some(twist),
                    after: Some(Twist::new(
                        back.linear + origin.cross(&back.angular),
                        back.angular,
                    )),
                }
            }
        }
    }

    /// The same joint in another number type.
    pub fn cast<U: Scalar>(&self) -> Joint<U> {
        let c = |x: T| U::of(x.widen());
        Joint {
            kind: self.kind,
            convention: self.convention,
            theta: c(self.theta),
            d: c(self.d),
            a: c(self.a),
            alpha: c(self.alpha),
            beta: c(self.beta),
            axis: self.axis.map(c),
            point: self.point.map(c),
            turn: self.turn.map(c),
            shift: self.shift.map(c),
        }
    }
}
