//! Vectors of three, entry by entry: nalgebra's own operations are loops, which a compiler that is
//! to save space leaves as loops over memory.

use nalgebra::{Matrix3, Vector3};

use crate::Scalar;

/// `a + b`.
#[inline(always)]
pub(crate) fn plus<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x + b.x, a.y + b.y, a.z + b.z)
}

/// `a - b`.
#[inline(always)]
pub(crate) fn less<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x - b.x, a.y - b.y, a.z - b.z)
}

/// `a k`.
#[inline(always)]
pub(crate) fn times<T: Scalar>(a: &Vector3<T>, k: T) -> Vector3<T> {
    Vector3::new(a.x * k, a.y * k, a.z * k)
}

/// `a + b k`.
#[inline(always)]
pub(crate) fn along<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>, k: T) -> Vector3<T> {
    Vector3::new(a.x + b.x * k, a.y + b.y * k, a.z + b.z * k)
}

/// `a · b`.
#[inline(always)]
pub(crate) fn dot<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// `a · a`.
#[inline(always)]
pub(crate) fn square<T: Scalar>(a: &Vector3<T>) -> T {
    dot(a, a)
}

/// `a x b`, each entry one product less another.
#[inline(always)]
pub(crate) fn cross<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        a.y * b.z - a.z * b.y,
        a.z * b.x - a.x * b.z,
        a.x * b.y - a.y * b.x,
    )
}

/// `sum + a x b`.
#[inline(always)]
pub(crate) fn add_cross<T: Scalar>(sum: &Vector3<T>, a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        sum.x + a.y * b.z - a.z * b.y,
        sum.y + a.z * b.x - a.x * b.z,
        sum.z + a.x * b.y - a.y * b.x,
    )
}

/// `m v`.
#[inline(always)]
pub(crate) fn turned<T: Scalar>(m: &Matrix3<T>, v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        m.m11 * v.x + m.m12 * v.y + m.m13 * v.z,
        m.m21 * v.x + m.m22 * v.y + m.m23 * v.z,
        m.m31 * v.x + m.m32 * v.y + m.m33 * v.z,
    )
}
