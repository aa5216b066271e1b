//! Questions about a vehicle's axles that kernels have answered at compile time.

/// What an axle is asked on the way, told at compile time where all axles answer alike.
pub(crate) trait Form {
    /// Whether the loop between loads and forces takes two passes.
    const TWICE: bool;

    /// Whether the tyres' slips relax.
    fn relaxes(length_m: f64) -> bool;
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
    fn roll_steers(gain: f64) -> bool {
        gain != 0.0
    }
}
