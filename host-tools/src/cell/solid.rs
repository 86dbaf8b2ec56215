//! Plain 4 x 4 homogeneous transforms.

use nalgebra::{Matrix3, Matrix4, Vector3};

/// Pose of one frame seen from another, last row `0 0 0 1`, lengths in m.
pub type Solid = Matrix4<f64>;

pub(crate) fn shift(x: f64, y: f64, z: f64) -> Solid {
    Solid::new_translation(&Vector3::new(x, y, z))
}

pub(crate) fn turn_x(angle: f64) -> Solid {
    let (s, c) = libm::sincos(angle);
    Solid::new(
        1.0, 0.0, 0.0, 0.0, 0.0, c, -s, 0.0, 0.0, s, c, 0.0, 0.0, 0.0, 0.0, 1.0,
    )
}

pub(crate) fn turn_y(angle: f64) -> Solid {
    let (s, c) = libm::sincos(angle);
    Solid::new(
        c, 0.0, s, 0.0, 0.0, 1.0, 0.0, 0.0, -s, 0.0, c, 0.0, 0.0, 0.0, 0.0, 1.0,
    )
}

pub(crate) fn turn_z(angle: f64) -> Solid {
    let (s, c) = libm::sincos(angle);
    Solid::new(
        c, -s, 0.0, 0.0, s, c, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    )
}

/// Exact rotation by a rotation vector (rad) after a shift (m): `[dx dy dz rx ry rz]`.
pub(crate) fn moved(twist: &[f64; 6]) -> Solid {
    let [x, y, z, rx, ry, rz] = *twist;
    let angle = libm::sqrt(rx * rx + ry * ry + rz * rz);
    let mut solid = shift(x, y, z);
    if angle > 0.0 {
        let k = Vector3::new(rx, ry, rz) / angle;
        let cross = k.cross_matrix();
        // 1 - cos without the difference of near-equal numbers.
        let half = libm::sin(0.5 * angle);
        let r =
            Matrix3::identity() + cross * libm::sin(angle) + cross * cross * (2.0 * half * half);
        solid.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    }
    solid
}

/// Fixed-axis roll, pitch, yaw (rad) and a position (m).
pub(crate) fn xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Solid {
    shift(xyz[0], xyz[1], xyz[2]) * turn_z(rpy[2]) * turn_y(rpy[1]) * turn_x(rpy[0])
}

pub(crate) fn origin(solid: &Solid) -> Vector3<f64> {
    solid.fixed_view::<3, 1>(0, 3).into_owned()
}

pub(crate) fn axes(solid: &Solid) -> Matrix3<f64> {
    solid.fixed_view::<3, 3>(0, 0).into_owned()
}

/// A point given in the frame, seen from outside, m.
pub(crate) fn place(solid: &Solid, point: [f64; 3]) -> Vector3<f64> {
    origin(solid) + axes(solid) * Vector3::from(point)
}

/// Unit quaternion `[w, x, y, z]`, w >= 0.
pub(crate) fn quaternion(solid: &Solid) -> [f64; 4] {
    let r = axes(solid);
    let (a, b, c) = (r[(0, 0)], r[(1, 1)], r[(2, 2)]);
    // 4 q q' for an exact rotation: every column is a multiple of q.
    let outer = Matrix4::new(
        1.0 + a + b + c,
        r[(2, 1)] - r[(1, 2)],
        r[(0, 2)] - r[(2, 0)],
        r[(1, 0)] - r[(0, 1)],
        r[(2, 1)] - r[(1, 2)],
        1.0 + a - b - c,
        r[(0, 1)] + r[(1, 0)],
        r[(0, 2)] + r[(2, 0)],
        r[(0, 2)] - r[(2, 0)],
        r[(0, 1)] + r[(1, 0)],
        1.0 - a + b - c,
        r[(1, 2)] + r[(2, 1)],
        r[(1, 0)] - r[(0, 1)],
        r[(0, 2)] + r[(2, 0)],
        r[(1, 2)] + r[(2, 1)],
        1.0 - a - b + c,
    );
    let column = outer.column(outer.diagonal().imax());
    let scale = 1.0 / libm::sqrt(column.norm_squared());
    let scale = if column[0] < 0.0 { -scale } else { scale };
    [column[0], column[1], column[2], column[3]].map(|x| x * scale)
}
