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

/// Runs that vector code steps side by side.
pub const LANES: usize = 8;

/// The states of runs side by side: row j holds number j of each run's state.
pub type Lanes<const N: usize> = [[f64; LANES]; N];

/// Rates of runs side by side.
///
/// A trait and no closure: its implementation must be inlined into the function that was compiled
/// for wide registers, which only a named function can be told.
pub trait LaneRates<const N: usize> {
    /// Writes the rates of the states `x`.
    fn rates(&self, x: &Lanes<N>, rate: &mut Lanes<N>);
}

/// One step of [`rk4`] for runs side by side, to the same bits for each run.
#[inline(always)]
pub fn rk4_lanes<const N: usize>(x: &mut Lanes<N>, step_s: f64, rates: &impl LaneRates<N>) {
    let ahead_s = [0.5 * step_s, 0.5 * step_s, step_s, 0.0];
    let weight = [1.0, 2.0, 2.0, 1.0];
    let mut sum = [[0.0; LANES]; N];
    let mut k = [[0.0; LANES]; N];
    let mut ahead = *x;
    // One copy of the rates for all four stages.
    for stage in 0..4 {
        rates.rates(&ahead, &mut k);
        for j in 0..N {
            for lane in 0..LANES {
                ahead[j][lane] = x[j][lane] + k[j][lane] * ahead_s[stage];
                let weighted = k[j][lane] * weight[stage];
                sum[j][lane] = if stage == 0 {
                    weighted
                } else {
                    sum[j][lane] + weighted
                };
            }
        }
    }
    for j in 0..N {
        for lane in 0..LANES {
            x[j][lane] += sum[j][lane] * (step_s / 6.0);
        }
    }
}
