//! Rigid poses and small displacements.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::vector::{add_cross, along, cross, dot, less, plus, square, times};
use crate::{Scalar, vector};

/// Pose of a frame B seen from a frame A, `t_a_b`.
///
/// `rotation` has B's axes as columns, in A; `translation` is B's origin in A, in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<T> {
    /// 3 x 3, orthonormal, determinant +1.
    pub rotation: Matrix3<T>,
    /// m.
    pub translation: Vector3<T>,
}

/// Small displacement: translation first, then rotation vector.
///
/// Axes and reference point are the world's axes and the tool point unless the place of use
/// says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Twist<T: Scalar> {
    /// m.
    pub linear: Vector3<T>,
    /// rad.
    pub angular: Vector3<T>,
}

impl<T: Scalar> Twist<T> {
    /// No displacement.
    pub fn zero() -> Self {
        Self::new(Vector3::zeros(), Vector3::zeros())
    }

    /// From its two halves.
    #[inline]
    pub fn new(linear: Vector3<T>, angular: Vector3<T>) -> Self {
        Self { linear, angular }
    }

    /// The same displacement of a rigid body, for the point `arm` (m) away from the
    /// present reference point: `linear + angular x arm`.
    #[inline]
    pub fn at(&self, arm: &Vector3<T>) -> Self {
        Self::new(add_cross(&self.linear, &self.angular, arm), self.angular)
    }

    /// Scaled by `factor`.
    #[inline]
    pub fn scaled(&self, factor: T) -> Self {
        Self::new(times(&self.linear, factor), times(&self.angular, factor))
    }

    /// Sum of two displacements about the same point and axes, to first order.
    #[inline]
    pub fn plus(&self, other: &Self) -> Self {
        Self::new(
            plus(&self.linear, &other.linear),
            plus(&self.angular, &other.angular),
        )
    }

    /// The same in another number type.
    pub fn cast<U: Scalar>(&self) -> Twist<U> {
        let c = |v: &Vector3<T>| v.map(|x| U::of(x.widen()));
        Twist::new(c(&self.linear), c(&self.angular))
    }

    /// From its rows.
    #[inline]
    pub fn from_rows([x, y, z, rx, ry, rz]: [T; 6]) -> Self {
        Self::new(Vector3::new(x, y, z), Vector3::new(rx, ry, rz))
    }

    /// Rows `[dx dy dz rx ry rz]`.
    #[inline]
    pub fn rows(&self) -> [T; 6] {
        let (v, w) = (&self.linear, &self.angular);
        [v.x, v.y, v.z, w.x, w.y, w.z]
    }
}

impl<T: Scalar> Pose<T> {
    /// The frame itself.
    pub fn identity() -> Self {
        Self::new(Matrix3::identity(), Vector3::zeros())
    }

    /// From rotation and translation (m).
    #[inline]
    pub fn new(rotation: Matrix3<T>, translation: Vector3<T>) -> Self {
        Self {
            rotation,
            translation,
        }
    }

    /// Translation alone, m.
    pub fn translate(x: T, y: T, z: T) -> Self {
        Self::new(Matrix3::identity(), Vector3::new(x, y, z))
    }

    /// Rotation by `angle` (rad) about x.
    pub fn rotate_x(angle: T) -> Self {
        let ((s, c), o, i) = (angle.sincos(), T::zero(), T::one());
        Self::new(Matrix3::new(i, o, o, o, c, -s, o, s, c), Vector3::zeros())
    }

    /// Rotation by `angle` (rad) about y.
    pub fn rotate_y(angle: T) -> Self {
        let ((s, c), o, i) = (angle.sincos(), T::zero(), T::one());
        Self::new(Matrix3::new(c, o, s, o, i, o, -s, o, c), Vector3::zeros())
    }

    /// Rotation by `angle` (rad) about z.
    pub fn rotate_z(angle: T) -> Self {
        let ((s, c), o, i) = (angle.sincos(), T::zero(), T::one());
        Self::new(Matrix3::new(c, -s, o, s, c, o, o, o, i), Vector3::zeros())
    }

    /// `self` followed by a turn by `angle` (rad) about its own x.
    pub fn turned_x(&self, angle: T) -> Self {
        let [x, y, z] = columns(&self.rotation);
        let [y, z] = turned(&y, &z, angle);
        Self::new(Matrix3::from_columns(&[x, y, z]), self.translation)
    }

    /// `self` followed by a turn by `angle` (rad) about its own y.
    pub fn turned_y(&self, angle: T) -> Self {
        let [x, y, z] = columns(&self.rotation);
        let [z, x] = turned(&z, &x, angle);
        Self::new(Matrix3::from_columns(&[x, y, z]), self.translation)
    }

    /// `self` followed by a way of `distance` (m) along its own x.
    pub fn moved_x(&self, distance: T) -> Self {
        let [x, ..] = columns(&self.rotation);
        Self::new(self.rotation, added(&self.translation, &x, distance))
    }

    /// `self` (A to B) followed by `next` (B to C).
    pub fn then(&self, next: &Self) -> Self {
        T::then(self, next)
    }

    /// Pose of A seen from B.
    #[inline(never)]
    pub fn inverse(&self) -> Self {
        let r = self.rotation.transpose();
        Self::new(r, -rotated(&r, &self.translation))
    }

    /// Point given in B (m), seen from A.
    #[inline]
    pub fn point(&self, p: &Vector3<T>) -> Vector3<T> {
        plus(&self.translation, &vector::turned(&self.rotation, p))
    }

    /// Fixed-axis roll, pitch, yaw (rad): `R = Rz(yaw) Ry(pitch) Rx(roll)`.
    pub fn from_xyz_rpy(xyz: Vector3<T>, rpy: Vector3<T>) -> Self {
        let r = Self::rotate_z(rpy.z)
            .then(&Self::rotate_y(rpy.y))
            .then(&Self::rotate_x(rpy.x));
        Self::new(r.rotation, xyz)
    }

    /// Inverse of [`Pose::from_xyz_rpy`]: roll, pitch, yaw in rad. At pitch = +-pi/2, where
    /// only roll -+ yaw is defined, roll is 0.
    pub fn rpy(&self) -> Vector3<T> {
        let r = &self.rotation;
        let cos_pitch = (r[(0, 0)] * r[(0, 0)] + r[(1, 0)] * r[(1, 0)]).root();
        let pitch = (-r[(2, 0)]).arctangent2(cos_pitch);
        if cos_pitch > T::EPSILON * T::of(16.0) {
            let yaw = r[(1, 0)].arctangent2(r[(0, 0)]);
            // Roll of what the yaw leaves: near +-pi/2 of pitch it takes up the yaw's rounding.
            let (s, c) = yaw.sincos();
            let roll = (s * r[(0, 2)] - c * r[(1, 2)]).arctangent2(c * r[(1, 1)] - s * r[(0, 1)]);
            Vector3::new(roll, pitch, yaw)
        } else {
            Vector3::new(T::zero(), pitch, (-r[(0, 1)]).arctangent2(r[(1, 1)]))
        }
    }

    /// From a quaternion `[w, x, y, z]` of any length above zero, and a translation in m.
    /// `None` where the quaternion has no direction.
    pub fn from_quaternion(wxyz: [T; 4], translation: Vector3<T>) -> Option<Self> {
        let q = Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
        let norm = q.norm_squared().root();
        if !(norm > T::EPSILON && norm.finite()) {
            return None;
        }
        let unit = UnitQuaternion::new_unchecked(q / norm);
        Some(Self::new(
            unit.to_rotation_matrix().into_inner(),
            translation,
        ))
    }

    /// Unit quaternion `[w, x, y, z]` of the rotation, w >= 0 (Shepperd's method: the largest
    /// of the four is found first, so nothing small is divided by).
    pub fn quaternion(&self) -> [T; 4] {
        let r = &self.rotation;
        let (xx, yy, zz) = (r[(0, 0)], r[(1, 1)], r[(2, 2)]);
        let (one, half) = (T::one(), T::of(0.5));
        let trace = xx + yy + zz;
        let (a, b, c) = (
            r[(2, 1)] - r[(1, 2)],
            r[(0, 2)] - r[(2, 0)],
            r[(1, 0)] - r[(0, 1)],
        );
        let (d, e, f) = (
            r[(1, 0)] + r[(0, 1)],
            r[(0, 2)] + r[(2, 0)],
            r[(2, 1)] + r[(1, 2)],
        );
        let q = if trace >= xx && trace >= yy && trace >= zz {
            let s = (one + trace).root();
            let k = half / s;
            [half * s, a * k, b * k, c * k]
        } else if xx >= yy && xx >= zz {
            let s = (one + xx - yy - zz).root();
            let k = half / s;
            [a * k, half * s, d * k, e * k]
        } else if yy >= zz {
            let s = (one - xx + yy - zz).root();
            let k = half / s;
            [b * k, d * k, half * s, f * k]
        } else {
            let s = (one - xx - yy + zz).root();
            let k = half / s;
            [c * k, e * k, f * k, half * s]
        };
        if q[0] < T::zero() {
            [-q[0], -q[1], -q[2], -q[3]]
        } else {
            q
        }
    }

    /// Rotation vector (rad) of the rotation, its angle in [0, pi].
    ///
    /// Exact at both ends: near 0 by the ratio's limit, near pi by the quaternion's vector
    /// part, which is far from zero there.
    pub fn rotation_vector(&self) -> Vector3<T> {
        let [w, x, y, z] = self.quaternion();
        let v = Vector3::new(x, y, z);
        let sine = square(&v).root();
        let two = T::of(2.0);
        // angle / sin(angle/2) -> 2 as the angle -> 0; the next term, angle^2/24 of that, is
        // below rounding where sine^2 < epsilon.
        if sine * sine < T::EPSILON {
            times(&v, two / w)
        } else {
            times(&v, two * sine.arctangent2(w) / sine)
        }
    }

    /// Rotation by a rotation vector (rad).
    pub fn from_rotation_vector(w: &Vector3<T>) -> Self {
        Self::identity().displaced(&Twist::new(Vector3::zeros(), *w))
    }

    /// Displaced by a small `twist` (axes of A at B's origin): the translation is added, the
    /// rotation vector turns the rotation from the left, by Rodrigues' formula.
    pub fn displaced(&self, twist: &Twist<T>) -> Self {
        T::displaced(self, twist)
    }

    /// The twist that takes `self` to `target`: `self.displaced(&self.twist_to(&target))`
    /// is `target`. Axes of A at B's origin.
    pub fn twist_to(&self, target: &Self) -> Twist<T> {
        T::twist(self, target)
    }

    /// The same pose in another number type.
    pub fn cast<U: Scalar>(&self) -> Pose<U> {
        Pose::new(
            self.rotation.map(|x| U::of(x.widen())),
            self.translation.map(|x| U::of(x.widen())),
        )
    }

    /// False if any entry is NaN or infinite.
    pub fn is_finite(&self) -> bool {
        self.rotation.iter().all(|x| x.finite()) && self.translation.iter().all(|x| x.finite())
    }
}

/// [`Pose::then`].
pub(crate) fn then<T: Scalar>(first: &Pose<T>, next: &Pose<T>) -> Pose<T> {
    let axes = columns(&next.rotation).map(|axis| rotated(&first.rotation, &axis));
    Pose::new(from_columns(&axes), seen(first, &next.translation))
}

/// [`Pose::displaced`].
pub(crate) fn displaced<T: Scalar>(pose: &Pose<T>, twist: &Twist<T>) -> Pose<T> {
    let w = &twist.angular;
    let (a, b) = rodrigues(square(w));
    let mut axes = columns(&pose.rotation);
    for axis in &mut axes {
        let once = crossed(w, axis);
        let twice = crossed(w, &once);
        *axis = added(&added(axis, &once, a), &twice, b);
    }
    Pose::new(
        from_columns(&axes),
        added(&pose.translation, &twist.linear, T::one()),
    )
}

/// [`Pose::twist_to`].
pub(crate) fn twist<T: Scalar>(pose: &Pose<T>, target: &Pose<T>) -> Twist<T> {
    let back = pose.rotation.transpose();
    let axes = columns(&back).map(|axis| rotated(&target.rotation, &axis));
    let turn = Pose::new(from_columns(&axes), Vector3::zeros());
    Twist::new(
        less(&target.translation, &pose.translation),
        turn.rotation_vector(),
    )
}

/// `sin(x) / x` and `(1 - cos(x)) / x²` of an angle x (rad), whose square is given.
#[inline]
fn rodrigues<T: Scalar>(angle2: T) -> (T, T) {
    // Below this angle the series to the fourth power is exact to rounding.
    if angle2 * angle2 < T::EPSILON {
        let sixth = T::of(1.0 / 6.0);
        let half = T::of(0.5);
        (T::one() - angle2 * sixth, half - angle2 * T::of(1.0 / 24.0))
    } else {
        let angle = angle2.root();
        let (s, c) = angle.sincos();
        (s / angle, (T::one() - c) / angle2)
    }
}

/// `r v`, out of line: effects do it often, each for itself.
#[inline(never)]
pub(crate) fn rotated<T: Scalar>(r: &Matrix3<T>, v: &Vector3<T>) -> Vector3<T> {
    vector::turned(r, v)
}

/// `a x b`, out of line likewise.
#[inline(never)]
pub(crate) fn crossed<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    cross(a, b)
}

/// `a · b`, out of line likewise.
#[inline(never)]
pub(crate) fn dotted<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    dot(a, b)
}

/// `a x + b y`, out of line likewise.
#[inline(never)]
pub(crate) fn both<T: Scalar>(a: T, x: T, b: T, y: T) -> T {
    a * x + b * y
}

/// `a + b k`, out of line likewise.
#[inline(never)]
pub(crate) fn added<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>, k: T) -> Vector3<T> {
    along(a, b, k)
}

/// [`Pose::point`], out of line likewise.
pub(crate) fn seen<T: Scalar>(pose: &Pose<T>, point: &Vector3<T>) -> Vector3<T> {
    plus(&pose.translation, &rotated(&pose.rotation, point))
}

/// The three axes of a rotation.
#[inline]
pub(crate) fn columns<T: Scalar>(rotation: &Matrix3<T>) -> [Vector3<T>; 3] {
    rotation.data.0.map(Vector3::from)
}

/// A rotation from its axes.
#[inline]
pub(crate) fn from_columns<T: Scalar>([x, y, z]: &[Vector3<T>; 3]) -> Matrix3<T> {
    Matrix3::new(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z)
}

/// Two axes after a turn by `angle` (rad) that leads from the first to the second.
#[inline(never)]
fn turned<T: Scalar>(first: &Vector3<T>, second: &Vector3<T>, angle: T) -> [Vector3<T>; 2] {
    // Most links have some: not to turn is cheaper than to turn by nothing.
    if angle.is_zero() {
        return [*first, *second];
    }
    let (s, c) = angle.sincos();
    let none = Vector3::zeros();
    [
        added(&added(&none, first, c), second, s),
        added(&added(&none, second, c), first, -s),
    ]
}

/// A pose as it is stored: translation (m) and rotation vector (rad).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredPose {
    /// m.
    pub translation: [f64; 3],
    /// rad.
    pub rotation_vector: [f64; 3],
}

impl From<&Pose<f64>> for StoredPose {
    fn from(pose: &Pose<f64>) -> Self {
        Self {
            translation: pose.translation.into(),
            rotation_vector: pose.rotation_vector().into(),
        }
    }
}

impl From<&StoredPose> for Pose<f64> {
    fn from(stored: &StoredPose) -> Self {
        let turn = Pose::from_rotation_vector(&Vector3::from(stored.rotation_vector));
        Pose::new(turn.rotation, Vector3::from(stored.translation))
    }
}
