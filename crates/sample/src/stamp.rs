use std::fmt;
use std::ops::{Add, Sub};

use serde::{Deserialize, Serialize};

/// Nanoseconds in one second.
pub const NANOS_PER_SECOND: i64 = 1_000_000_000;

/// An instant on the log clock: nanoseconds of the host's monotonic clock, anchored once, at
/// start, to UTC. It never steps back, whatever is done to the host's wall clock.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct LogTime(pub u64);

impl LogTime {
    /// This instant moved by `nanos` (negative moves back), held at zero below.
    #[must_use]
    pub fn offset_nanos(self, nanos: i64) -> Self {
        Self(self.0.saturating_add_signed(nanos))
    }

    /// This instant moved by `seconds`, rounded to the nearest nanosecond.
    #[must_use]
    pub fn offset_seconds(self, seconds: f64) -> Self {
        self.offset_nanos((seconds * NANOS_PER_SECOND as f64).round() as i64)
    }

    /// Seconds from `earlier` to this instant; negative if `earlier` is later.
    #[must_use]
    pub fn seconds_since(self, earlier: Self) -> f64 {
        (self - earlier) as f64 / NANOS_PER_SECOND as f64
    }
}

impl Add<i64> for LogTime {
    type Output = Self;

    fn add(self, nanos: i64) -> Self {
        self.offset_nanos(nanos)
    }
}

impl Sub for LogTime {
    type Output = i64;

    fn sub(self, earlier: Self) -> i64 {
        self.0.wrapping_sub(earlier.0) as i64
    }
}

impl fmt::Display for LogTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}.{:09}",
            self.0 / 1_000_000_000,
            self.0 % 1_000_000_000
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_signed() {
        let early = LogTime(5);
        let late = LogTime(1_000_000_005);
        assert_eq!(late - early, NANOS_PER_SECOND);
        assert_eq!(early.seconds_since(late), -1.0);
        assert_eq!(early.offset_nanos(-10), LogTime(0));
        assert_eq!(early.offset_seconds(1.0), late);
    }
}
