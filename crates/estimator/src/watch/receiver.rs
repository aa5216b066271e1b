//! A GNSS receiver whose values the state contradicts.

use sample::LogTime;

use super::{CONTRADICTS, FROZEN, SensorChange};
use crate::motion::Verdict;

use crate::tuning::ReceiverWatchTuning;

/// Monitor of one receiver.
#[derive(Clone, Copy, Debug)]
pub struct ReceiverWatch {
    name: &'static str,
    /// Since when all values have been rejected.
    since: Option<LogTime>,
    /// Whether the noise of a value is gone.
    frozen: bool,
    reported: bool,
}

impl ReceiverWatch {
    /// For the receiver that events call `name`.
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            since: None,
            frozen: false,
            reported: false,
        }
    }

    /// Whether the receiver was reported.
    pub fn is_faulty(&self) -> bool {
        self.reported
    }

    /// Takes whether a value is frozen, from its own noise. A frozen value counts as rejected.
    pub fn take_frozen(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    /// Takes the verdict of a value that was valid at `time`. A rejection is a fault of the
    /// receiver only while the inertial unit is consistent with the balances and no jump of its biases is
    /// suspected.
    pub fn judge(
        &mut self,
        time: LogTime,
        verdict: Verdict,
        imu_trusted: bool,
        tuning: &ReceiverWatchTuning,
        changes: &mut impl FnMut(SensorChange),
    ) {
        let verdict = if self.frozen {
            Verdict::Rejected
        } else {
            verdict
        };
        let trusted = imu_trusted || self.frozen;
        let faulty = match verdict {
            Verdict::Unusable => self.reported,
            Verdict::Used => {
                self.since = None;
                false
            }
            Verdict::Rejected => {
                let since = *self.since.get_or_insert(time);
                self.reported || trusted && time.seconds_since(since) >= tuning.faulty_s
            }
        };
        if faulty != self.reported {
            self.reported = faulty;
            changes(SensorChange {
                name: self.name,
                faulty,
                why: if self.frozen { FROZEN } else { CONTRADICTS },
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_receiver_is_named_where_the_state_is_confirmed() {
        let mut reported = Vec::new();
        for imu_consistent in [false, true] {
            let mut watch = ReceiverWatch::new("GNSS velocity");
            for k in 0..40 {
                let verdict = if (10..30).contains(&k) {
                    Verdict::Rejected
                } else {
                    Verdict::Used
                };
                let time = LogTime(1_000_000_000 + 50_000_000 * k);
                let tuning = ReceiverWatchTuning::default();
                watch.judge(time, verdict, imu_consistent, &tuning, &mut |change| {
                    reported.push((k, change.faulty));
                });
            }
        }
        assert_eq!(reported, [(20, true), (30, false)]);
    }
}
