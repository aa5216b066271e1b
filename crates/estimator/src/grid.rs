//! The time grid on which estimates are made.

use sample::LogTime;

/// Spacing of the instants that have an estimate, ns.
pub const GRID_NANOS: u64 = 10_000_000;
/// Spacing of the instants that have an estimate, s.
pub const GRID_S: f64 = 0.01;

/// Delay after an instant until its estimate is made, ns: measurements of the instant have arrived
/// by then.
pub(crate) const HOLD_NANOS: u64 = 5_000_000;
/// Largest jump of the log clock, ns, over which instants continue without a gap. After a larger
/// jump the grid starts at the present time.
const GAP_MAX_NANOS: u64 = 10_000_000_000;

/// The instants of the grid up to [`HOLD_NANOS`] before `now`, starting at `next`. Afterwards `next`
/// is the first instant that is still to come.
pub(crate) fn grid(
    next: &mut Option<LogTime>,
    now: LogTime,
) -> impl Iterator<Item = LogTime> + use<> {
    let first = match *next {
        Some(grid) if now.0.saturating_sub(grid.0) <= GAP_MAX_NANOS => grid.0,
        _ => now.0.div_ceil(GRID_NANOS) * GRID_NANOS,
    };
    let count = match now.0.checked_sub(first + HOLD_NANOS) {
        Some(behind) => behind / GRID_NANOS + 1,
        None => 0,
    };
    *next = Some(LogTime(first + count * GRID_NANOS));
    (0..count).map(move |step| LogTime(first + step * GRID_NANOS))
}
