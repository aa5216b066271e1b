//! Three-vectors and a solve over any scalar.

use crate::Scalar;

pub(super) type V3<T> = [T; 3];

#[inline(always)]
pub(super) fn dot<T: Scalar>(a: V3<T>, b: V3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn cross<T: Scalar>(a: V3<T>, b: V3<T>) -> V3<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
pub(super) fn add<T: Scalar>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn sub<T: Scalar>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn scale<T: Scalar>(a: V3<T>, by: T) -> V3<T> {
    [a[0] * by, a[1] * by, a[2] * by]
}

/// A constant vector.
#[inline(always)]
pub(super) fn lift<T: Scalar>(a: [f64; 3]) -> V3<T> {
    [T::from(a[0]), T::from(a[1]), T::from(a[2])]
}

/// A constant vector times a scalar.
#[inline(always)]
pub(super) fn along<T: Scalar>(a: [f64; 3], by: T) -> V3<T> {
    [by * a[0], by * a[1], by * a[2]]
}

/// A constant vector dotted with another.
#[inline(always)]
pub(super) fn dot_constant<T: Scalar>(a: [f64; 3], b: V3<T>) -> T {
    b[0] * a[0] + b[1] * a[1] + b[2] * a[2]
}

/// Lower triangle of a symmetric matrix: xx, yx, yy, zx, zy, zz.
pub(super) type Symmetric<T> = [T; 6];

/// Solves a symmetric positive definite system by its cofactors: one division, in three dimensions
/// as exact as factors.
#[inline(always)]
pub(super) fn solve_symmetric<T: Scalar>(a: Symmetric<T>, b: V3<T>) -> V3<T> {
    let [xx, yx, yy, zx, zy, zz] = a;
    let first = [yy * zz - zy * zy, zx * zy - yx * zz, yx * zy - zx * yy];
    let inverse = (xx * first[0] + yx * first[1] + zx * first[2]).recip();
    let second = [first[1], xx * zz - zx * zx, yx * zx - xx * zy];
    let third = [first[2], second[2], xx * yy - yx * yx];
    scale([dot(first, b), dot(second, b), dot(third, b)], inverse)
}
