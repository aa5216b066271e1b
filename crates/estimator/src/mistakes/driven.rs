//! Whether a drive is long and lively enough to decide, and the manoeuvre that is missing.

use crate::fusion::relations::RelationWindow;
use crate::tuning::MistakeTuning;

/// Time of a drive by what it can tell of the configuration, since the last correction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Driven {
    /// Time that was used, s.
    pub used_s: f64,
    /// Of that, time in bends, s.
    pub turning_s: f64,
    /// Time that was not used because the vehicle was too slow, s.
    pub slow_s: f64,
    /// Time that was not used because a wheel was nearly in the air, s.
    pub lifted_s: f64,
}

impl Driven {
    pub(super) fn take(&mut self, window: &RelationWindow, tuning: &MistakeTuning) {
        self.used_s += tuning.window_s;
        let lateral_n: f64 = (0..4)
            .map(|wheel| window.loads.force_n[3 * wheel + 1])
            .sum();
        let load_n: f64 = (0..4)
            .map(|wheel| window.loads.force_n[3 * wheel + 2])
            .sum();
        if lateral_n.abs() > tuning.turning_part * load_n {
            self.turning_s += tuning.window_s;
        }
    }

    pub(super) fn leave_out(&mut self, is_slow: bool, tuning: &MistakeTuning) {
        if is_slow {
            self.slow_s += tuning.window_s;
        } else {
            self.lifted_s += tuning.window_s;
        }
    }

    /// Times that are missing for a decision: of all driving, and of bends, whole s.
    fn missing_s(&self, tuning: &MistakeTuning) -> [f64; 2] {
        let [used_s, turning_s] = tuning.decisive_s;
        [used_s - self.used_s, turning_s - self.turning_s].map(|missing| missing.max(0.0).ceil())
    }

    /// Whether a drive without a mistake shows that the configuration is right.
    #[must_use]
    pub fn is_decisive(&self, tuning: &MistakeTuning) -> bool {
        self.missing_s(tuning) == [0.0; 2]
    }

    /// The manoeuvre that decides, with its duration. After a drive that is long enough, the same once more.
    #[must_use]
    pub fn manoeuvre(&self, tuning: &MistakeTuning) -> String {
        let [mut all_s, mut turning_s] = self.missing_s(tuning);
        if self.is_decisive(tuning) {
            [all_s, turning_s] = tuning.decisive_s;
        }
        let all_s = all_s.max(turning_s);
        let mut text = if turning_s > 0.0 {
            format!(
                "drive a slalom for {all_s:.0} s at 5 m/s or faster, of which {turning_s:.0} s with more than {:.1} m/s² of \
                 lateral acceleration, and accelerate and brake firmly meanwhile",
                tuning.turning_part * sample::STANDARD_GRAVITY_M_S2
            )
        } else {
            format!(
                "drive on for {all_s:.0} s at 5 m/s or faster, and accelerate and brake firmly meanwhile"
            )
        };
        let least_m_s = tuning.speed_min_m_s;
        if self.slow_s > self.used_s {
            text += &format!("; {:.0} s below {least_m_s} m/s were not used", self.slow_s);
        }
        if self.lifted_s > self.used_s {
            text += &format!(
                "; keep all wheels on the ground: {:.0} s with a wheel nearly in the air were not used",
                self.lifted_s
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manoeuvre_and_its_duration_are_those_that_are_missing() {
        let t = MistakeTuning::default();
        let text = |used_s, turning_s, slow_s, lifted_s| {
            let driven = Driven {
                used_s,
                turning_s,
                slow_s,
                lifted_s,
            };
            (driven.is_decisive(&t), driven.manoeuvre(&t))
        };
        let (decides, standing) = text(0.0, 0.0, 30.0, 0.0);
        assert!(
            !decides && standing.starts_with("drive a slalom for 40 s"),
            "{standing}"
        );
        assert!(
            standing.contains("of which 10 s with more than 1.0 m/s²"),
            "{standing}"
        );
        assert!(
            standing.ends_with("30 s below 1.5 m/s were not used"),
            "{standing}"
        );
        // A straight road of a minute.
        let (decides, straight) = text(60.0, 2.0, 0.0, 0.0);
        assert!(
            !decides && straight.starts_with("drive a slalom for 8 s"),
            "{straight}"
        );
        let (decides, short) = text(12.0, 11.0, 0.0, 20.0);
        assert!(
            !decides && short.starts_with("drive on for 28 s"),
            "{short}"
        );
        assert!(
            short.contains("20 s with a wheel nearly in the air"),
            "{short}"
        );
        let (decides, whole) = text(60.0, 20.0, 0.0, 0.0);
        assert!(
            decides && whole.starts_with("drive a slalom for 40 s"),
            "{whole}"
        );
    }
}
