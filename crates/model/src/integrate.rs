//! Integration over time: fixed steps, adaptive steps, and steps that stop at events. Nothing here
//! allocates.
//!
//! General solvers of the ecosystem integrate over heap-allocated vectors; these models have a
//! fixed size and a rate of a microsecond, where that would cost more than the model.

mod adaptive;
mod event;
mod lanes;
mod running;

pub use adaptive::{Tolerance, adaptive};
pub use event::{Advance, step_to_event};
pub use lanes::LANES;
pub(crate) use lanes::{StraightRate, rk4_lanes};
pub(crate) use running::{Running, RunningRate, rk4_steps};

use crate::Scalar;

/// One step of the classical Runge-Kutta rule of fourth order for an autonomous rate.
#[inline(always)]
pub fn rk4<T: Scalar, const N: usize>(
    x: &[T; N],
    step_s: f64,
    rate: impl Fn(&[T; N]) -> [T; N],
) -> [T; N] {
    // Loops in place: built by closures, these arrays would be copied and not vectorised.
    let mut sum = rate(x);
    let mut ahead = *x;
    for i in 0..N {
        ahead[i] += sum[i] * (0.5 * step_s);
    }
    let k = rate(&ahead);
    for i in 0..N {
        ahead[i] = x[i] + k[i] * (0.5 * step_s);
        sum[i] += k[i] * 2.0;
    }
    let k = rate(&ahead);
    for i in 0..N {
        ahead[i] = x[i] + k[i] * step_s;
        sum[i] += k[i] * 2.0;
    }
    let k = rate(&ahead);
    for i in 0..N {
        sum[i] = x[i] + (sum[i] + k[i]) * (step_s / 6.0);
    }
    sum
}
