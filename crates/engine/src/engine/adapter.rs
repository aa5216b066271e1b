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
/// Delay of all frames for [`LOST_AFTER_NS`] that no backlog explains, ns: the adapter has lost time.
const LOST_NS: i64 = NANOS_PER_SECOND / 10;
/// Time after which the lost time is accepted, ns.
const LOST_AFTER_NS: i64 = 5 * NANOS_PER_SECOND;
/// Drift between the clocks that is followed: one part in this number (200 ppm).
const DRIFT_PARTS: i64 = 5_000;

/// The clock of an adapter against the log clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct AdapterClock {
    /// Least difference of log clock and stamp, ns, at the log time beside it.
    offset: Option<(i64, LogTime)>,
    /// Least difference of the frames that are late by more than [`LOST_NS`], ns, and the log time of the
    /// first of them. A frame that is less late ends it.
    late: Option<(i64, LogTime)>,
}

impl AdapterClock {
    /// How late a frame is, ns; zero if it is not late.
    pub fn lateness_ns(&mut self, log_time: LogTime, stamp_ns: i64) -> i64 {
        let difference = log_time.0.cast_signed() - stamp_ns;
        let grown = self
            .offset
            .map(|(offset, at)| offset + (log_time - at) / DRIFT_PARTS);
        let Some(offset) = grown.filter(|offset| (difference - offset).abs() < DELAY_MAX_NS) else {
            return self.set(difference, log_time);
        };
        if difference <= offset {
            return self.set(difference, log_time);
        }
        let late = difference - offset;
        if late <= LOST_NS {
            self.late = None;
        } else {
            let (least, since) = self.late.unwrap_or((difference, log_time));
            let least = least.min(difference);
            self.late = Some((least, since));
            if log_time - since > LOST_AFTER_NS {
                self.set(least, log_time);
                return self.lateness_ns(log_time, stamp_ns);
            }
        }
        if late > LATE_NS {
            late - RESOLUTION_NS / 2
        } else {
            0
        }
    }

    /// Sets the offset by a frame that is not late.
    fn set(&mut self, difference: i64, log_time: LogTime) -> i64 {
        *self = Self {
            offset: Some((difference, log_time)),
            late: None,
        };
        0
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

    /// An adapter that restarts while its port stays open counts from zero, or from where it was.
    #[test]
    fn an_adapter_that_lost_time_is_late_for_seconds_only() {
        let mut clock = AdapterClock::default();
        for ms in 0..1_000 {
            assert_eq!(clock.lateness_ns(at(ms), ms * MS), 0);
        }
        const LOST_MS: i64 = 2_500;
        for ms in 1_000..10_000 {
            let late = clock.lateness_ns(at(ms + LOST_MS), ms * MS);
            assert_eq!(late == 0, ms > 6_000, "{ms}: {late}");
        }
    }

    /// A backlog that shrinks to less than 0.1 s within five seconds is late, however large it was.
    #[test]
    fn a_backlog_is_late() {
        let mut clock = AdapterClock::default();
        for ms in 0..1_000 {
            assert_eq!(clock.lateness_ns(at(ms), ms * MS), 0);
        }
        for ms in 1_000..6_000 {
            let backlog = (6_000 - ms) / 2;
            let late = clock.lateness_ns(at(ms + backlog), ms * MS);
            let expected = backlog * MS;
            // The offset follows 200 ppm for up to 5 s.
            assert!(
                late == 0 && expected <= 2 * LATE_NS || (late - expected).abs() < 2 * MS,
                "{ms}: {late}"
            );
        }
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
