//! Questions about a vehicle's axles that kernels have answered at compile time.

use crate::scalar::each;
use crate::values::PerWheelValues;

/// What an axle is asked on the way, told at compile time where all axles answer alike.
pub(crate) trait Form {
    /// Whether the loop between loads and forces takes two passes.
    const TWICE: bool;

    /// Whether the tyres' slips relax.
    fn relaxes(length_m: f64) -> bool;
    /// What relaxing wheels have, and what the others have.
    fn relaxing<V: PerWheelValues>(length_m: &[f64; 4], relaxing: V, others: V) -> V;
    /// Whether roll steers the wheels.
    fn roll_steers(gain: f64) -> bool;
}

/// Relaxing tyres, no roll steer, two passes.
pub(crate) struct Relaxing;
/// Tyres that do not relax, no roll steer, two passes.
pub(crate) struct Immediate;
/// Each axle as it is.
pub(crate) struct Mixed;

impl Form for Relaxing {
    const TWICE: bool = true;

    #[inline(always)]
    fn relaxes(_: f64) -> bool {
        true
    }
    #[inline(always)]
    fn relaxing<V: PerWheelValues>(_: &[f64; 4], relaxing: V, _: V) -> V {
        relaxing
    }
    #[inline(always)]
    fn roll_steers(_: f64) -> bool {
        false
    }
}

impl Form for Immediate {
    const TWICE: bool = true;

    #[inline(always)]
    fn relaxes(_: f64) -> bool {
        false
    }
    #[inline(always)]
    fn relaxing<V: PerWheelValues>(_: &[f64; 4], _: V, others: V) -> V {
        others
    }
    #[inline(always)]
    fn roll_steers(_: f64) -> bool {
        false
    }
}

impl Form for Mixed {
    const TWICE: bool = false;

    #[inline(always)]
    fn relaxes(length_m: f64) -> bool {
        length_m > 0.0
    }
    #[inline(always)]
    fn relaxing<V: PerWheelValues>(length_m: &[f64; 4], relaxing: V, others: V) -> V {
        let (relaxing, others) = (relaxing.list(), others.list());
        V::of(each(|i| {
            if Self::relaxes(length_m[i]) {
                relaxing[i]
            } else {
                others[i]
            }
        }))
    }
    #[inline(always)]
    fn roll_steers(gain: f64) -> bool {
        gain != 0.0
    }
}
