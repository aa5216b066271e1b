//! Three-vectors and a 6 x 6 solve over any scalar.

use crate::Scalar;

pub(super) type V3<T> = [T; 3];

#[inline]
pub(super) fn dot<T: Scalar>(a: V3<T>, b: V3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(super) fn cross<T: Scalar>(a: V3<T>, b: V3<T>) -> V3<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline]
pub(super) fn add<T: Scalar>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub(super) fn sub<T: Scalar>(a: V3<T>, b: V3<T>) -> V3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(super) fn scale<T: Scalar>(a: V3<T>, by: T) -> V3<T> {
    [a[0] * by, a[1] * by, a[2] * by]
}

/// A constant vector times a scalar.
#[inline]
pub(super) fn along<T: Scalar>(a: [f64; 3], by: T) -> V3<T> {
    [by * a[0], by * a[1], by * a[2]]
}

/// A constant vector dotted with another.
#[inline]
pub(super) fn dot_constant<T: Scalar>(a: [f64; 3], b: V3<T>) -> T {
    b[0] * a[0] + b[1] * a[1] + b[2] * a[2]
}

/// Solves a symmetric positive definite system by its factors L D L'. Only the lower triangle is
/// read.
#[inline]
#[allow(clippy::needless_range_loop)]
pub(super) fn solve_symmetric<T: Scalar>(mut a: [[T; 6]; 6], mut b: [T; 6]) -> [T; 6] {
    let mut inverse = [T::from(0.0); 6];
    for j in 0..6 {
        inverse[j] = a[j][j].recip();
        for i in j + 1..6 {
            let factor = a[i][j] * inverse[j];
            for k in j + 1..=i {
                a[i][k] -= factor * a[k][j];
            }
            b[i] -= factor * b[j];
        }
    }
    // Column j now holds D_j L_ij below the diagonal.
    for j in (0..6).rev() {
        let mut left = b[j];
        for i in j + 1..6 {
            left -= a[i][j] * b[i];
        }
        b[j] = left * inverse[j];
    }
    b
}
