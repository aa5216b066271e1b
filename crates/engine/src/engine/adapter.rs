//! Late frames of adapters that stamp.
//!
//! A stalled computer or adapter delivers frames late and many at once. The stamps of the adapter say
//! when each was on the bus: the least difference of log clock and stamp is that of a frame that came
//! without delay. A frame that is later than that by more than [`LATE_NS`] is used at its own time.
//! Frames that are not late keep the time of their arrival, whose resolution is better than that of
//! the stamps (1 ms on SLCAN). A stamp counts whole milliseconds, so that a frame was on the bus half of
//! one after it in the mean.

use sample::{LogTime, NANOS_PER_SECOND};

/// Resolution of a stamp, ns.
const RESOLUTION_NS: i64 = 1_000_000;
/// Delay from which a frame has its own time, ns: the resolution, and the drift that the offset follows.
const LATE_NS: i64 = RESOLUTION_NS + RESOLUTION_NS / 5;
/// Delay that no stall explains, ns: the adapter has begun to count anew.
const DELAY_MAX_NS: i64 = 10 * NANOS_PER_SECOND;
/// Drift between the clocks that is followed: one part in this number (200 ppm).
const DRIFT_PARTS: i64 = 5_000;

/// The clock of an adapter against the log clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct AdapterClock {
    /// Least difference of log clock and stamp, ns, at the log time beside it.
    offset: Option<(i64, LogTime)>,
}

impl AdapterClock {
    /// How late a frame is, ns; zero if it is not late.
    pub fn lateness_ns(&mut self, log_time: LogTime, stamp_ns: i64) -> i64 {
        let difference = log_time.0.cast_signed() - stamp_ns;
        let grown = self
            .offset
            .map(|(offset, at)| offset + (log_time - at) / DRIFT_PARTS);
        let Some(offset) = grown.filter(|offset| (difference - offset).abs() < DELAY_MAX_NS) else {
            self.offset = Some((difference, log_time));
            return 0;
        };
        if difference <= offset {
            self.offset = Some((difference, log_time));
            return 0;
        }
        let late = difference - offset;
        if late > LATE_NS {
            late - RESOLUTION_NS / 2
        } else {
            0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn at(ms: i64) -> LogTime {
        LogTime((1_000_000 * MS + ms * MS).cast_unsigned())
    }

    #[test]
    fn a_burst_after_a_stall_has_its_own_times() {
        let mut clock = AdapterClock::default();
        for ms in 0..1_000 {
            assert_eq!(clock.lateness_ns(at(ms), ms * MS), 0);
        }
        for ms in 1_000..1_050 {
            let late = clock.lateness_ns(at(1_050), ms * MS);
            let expected = (1_050 - ms) * MS;
            assert!(
                late == 0 && expected <= LATE_NS || (late - expected).abs() < MS,
                "{ms}: {late}"
            );
        }
        assert_eq!(clock.lateness_ns(at(1_051), 1_051 * MS), 0);
    }

    #[test]
    fn jitter_drift_and_a_restart_are_not_late() {
        let mut clock = AdapterClock::default();
        for ms in 0..600_000_i64 {
            // 100 ppm, and delays of up to 0.15 ms.
            let log = LogTime((ms * MS + ms * MS / 10_000 + ms * 7 % 4 * MS / 20).cast_unsigned());
            assert_eq!(clock.lateness_ns(log, ms * MS), 0, "{ms}");
        }
        assert_eq!(clock.lateness_ns(at(0), 0), 0);
        assert_eq!(clock.lateness_ns(at(1), MS), 0);
    }
}
