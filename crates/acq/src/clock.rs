//! The log clock: the only place below the binary where time is read.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use sample::LogTime;

/// The host's monotonic clock, anchored once, when it is made, to UTC. Steps of the wall clock
/// (NTP, a wrong battery clock put right) move [`Reading::realtime_ns`] only.
#[derive(Clone, Copy, Debug)]
pub struct LogClock {
    start: Instant,
    start_realtime_ns: i64,
}

/// Both clocks at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The log clock.
    pub log_time: LogTime,
    /// The host's wall clock, ns since the UNIX epoch.
    pub realtime_ns: i64,
}

impl LogClock {
    /// Anchors the log clock to what the wall clock says now. A recorder does so once.
    #[must_use]
    pub fn start() -> Self {
        Self {
            start: Instant::now(),
            start_realtime_ns: realtime_ns(),
        }
    }

    /// Reads both clocks.
    #[must_use]
    pub fn read(&self) -> Reading {
        Reading {
            log_time: self.now(),
            realtime_ns: realtime_ns(),
        }
    }

    /// Reads the log clock alone. Never falls from one call to the next.
    #[must_use]
    pub fn now(&self) -> LogTime {
        let elapsed = self.start.elapsed().as_nanos();
        let anchor = u64::try_from(self.start_realtime_ns).unwrap_or(0);
        LogTime(anchor.saturating_add(u64::try_from(elapsed).unwrap_or(u64::MAX)))
    }

    /// What the wall clock said at the anchor, ns since the UNIX epoch: for the log's metadata.
    #[must_use]
    pub const fn anchor_realtime_ns(&self) -> i64 {
        self.start_realtime_ns
    }
}

/// The wall clock, ns since the UNIX epoch; negative before it.
fn realtime_ns() -> i64 {
    match SystemTime::now().duration_since(UNIX_EPOCH) {
        Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
        Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |ns| -ns),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_time_starts_at_the_anchor_and_never_falls() {
        let clock = LogClock::start();
        let mut last = clock.read();
        assert!(last.log_time.0 >= u64::try_from(clock.anchor_realtime_ns()).expect("after 1970"));
        for _ in 0..1000 {
            let next = clock.read();
            assert!(next.log_time >= last.log_time);
            last = next;
        }
    }
}
