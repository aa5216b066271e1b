//! Integration over time: fixed steps, adaptive steps, and steps that stop at events. Nothing here
//! allocates.
//!
//! General solvers of the ecosystem integrate over heap-allocated vectors; these models have a
//! fixed size and a rate of a microsecond, where that would cost more than the model.

mod adaptive;
mod event;

pub use adaptive::{Tolerance, adaptive};
pub use event::{Advance, step_to_event};

use crate::Scalar;

/// One step of the classical Runge-Kutta rule of fourth order for an autonomous rate.
#[inline]
pub fn rk4<T: Scalar, const N: usize>(
    x: &[T; N],
    step_s: f64,
    rate: impl Fn(&[T; N]) -> [T; N],
) -> [T; N] {
    let ahead = |k: &[T; N], part: f64| -> [T; N] {
        std::array::from_fn(|i| x[i] + k[i] * (part * step_s))
    };
    let k1 = rate(x);
    let k2 = rate(&ahead(&k1, 0.5));
    let k3 = rate(&ahead(&k2, 0.5));
    let k4 = rate(&ahead(&k3, 1.0));
    std::array::from_fn(|i| x[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (step_s / 6.0))
}
