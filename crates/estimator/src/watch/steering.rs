//! The hand wheel.

use sample::LogTime;

use super::{CONTRADICTS, SensorChange};
use crate::gaussian::{Gaussian, within};
use crate::tuning::SteeringWatchTuning;

/// Memory of the hand wheel.
#[derive(Clone, Copy, Debug, Default)]
pub struct SteeringWatch {
    tuning: SteeringWatchTuning,
    last: Option<Read>,
    /// When it last moved, and whether that is long ago.
    moved: Option<LogTime>,
    stuck: bool,
    /// The angle that it has jumped to, for as long as it stays there to the bit: what is expected may
    /// pass by, which is no agreement.
    stuck_at: Option<f64>,
    /// Since when it has been strange, and has not been.
    inconsistent_since: Option<LogTime>,
    agreed: Option<LogTime>,
    /// When it last jumped away from what is expected.
    left_range_at: Option<LogTime>,
    /// Whether something else than its own past has contradicted it since it is strange.
    witnessed_once: bool,
    /// What was put in its place last, as value and variance: that is what is expected of a strange
    /// wheel while nothing else is.
    held: Option<Gaussian>,
    reported: bool,
}

/// A reading.
#[derive(Clone, Copy, Debug)]
struct Read {
    time: LogTime,
    angle_rad: f64,
}

impl SteeringWatch {
    /// A monitor that has seen nothing.
    pub fn new(tuning: SteeringWatchTuning) -> Self {
        Self {
            tuning,
            ..Self::default()
        }
    }

    /// Whether the last angle is sure enough to learn from.
    pub fn is_used(&self) -> bool {
        self.inconsistent_since.is_none() && !self.stuck
    }

    /// Whether it was contradicted, and has not agreed for long enough since.
    pub fn is_inconsistent(&self) -> bool {
        self.inconsistent_since.is_some()
    }

    /// The angle to go on with, rad, from one that was read at `time` and what is expected as value
    /// and variance.
    pub fn judge(
        &mut self,
        time: LogTime,
        angle_rad: f64,
        expected: Option<Gaussian>,
        changes: &mut impl FnMut(SensorChange),
    ) -> f64 {
        let t = self.tuning;
        let longer = |since: Option<LogTime>, span_s| {
            since.is_some_and(|since| time.seconds_since(since) >= span_s)
        };
        let last = self.last.replace(Read { time, angle_rad });
        if last.is_none_or(|last| last.angle_rad != angle_rad) {
            self.moved = Some(time);
        }
        let jumped = last.is_some_and(|last| {
            let span_s = time.seconds_since(last.time).max(0.0);
            (angle_rad - last.angle_rad).abs() > t.jump_rad_s * span_s
        });
        let held = self
            .held
            .filter(|_| self.witnessed_once || !longer(self.inconsistent_since, t.held_max_s));
        let held_variance = t.held_sigma_rad * t.held_sigma_rad;
        let witnessed = expected.is_some();
        let before = last.filter(|_| jumped).map(|last| last.angle_rad);
        let expected = expected
            .or(held)
            .or(before.map(|before| Gaussian::new(before, held_variance)));
        // A driver's hand does not jump: a wide deviation of what is expected is no excuse.
        if let (Some(before), Some(expected)) = (before, expected)
            && (angle_rad - expected.mean).abs() > (before - expected.mean).abs()
        {
            self.left_range_at = Some(time);
        } else if jumped || longer(self.left_range_at, t.good_s) {
            self.left_range_at = None;
        }
        self.stuck_at = match self.stuck_at {
            _ if jumped => Some(angle_rad),
            stuck_at => stuck_at.filter(|stuck_at| *stuck_at == angle_rad),
        };
        self.stuck = longer(self.moved, t.stuck_s);
        let gate = if jumped || self.stuck || self.inconsistent_since.is_some() {
            t.suspect_gate_sigma
        } else {
            t.gate_sigma
        };
        let agrees = expected.map(|expected| {
            self.left_range_at.is_none()
                && within(gate, angle_rad - expected.mean, expected.variance)
        });
        if agrees == Some(false) {
            self.witnessed_once =
                witnessed || self.witnessed_once && self.inconsistent_since.is_some();
            self.inconsistent_since.get_or_insert(time);
            self.agreed = None;
        } else {
            self.agreed.get_or_insert(time);
            let passed = !self.reported && self.stuck_at.is_none();
            if passed || longer(self.agreed, t.good_s) && !self.stuck {
                self.inconsistent_since = None;
            }
        }
        let faulty = self.inconsistent_since.is_some()
            && (self.reported || longer(self.inconsistent_since, t.faulty_s));
        if faulty != self.reported {
            self.reported = faulty;
            changes(SensorChange {
                name: "hand wheel",
                faulty,
                why: CONTRADICTS,
            });
        }
        let used = match expected {
            Some(expected) if self.inconsistent_since.is_some() => expected.mean,
            _ => angle_rad,
        };
        self.held =
            (self.inconsistent_since.is_some()).then_some(Gaussian::new(used, held_variance));
        used
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reported(
        angle: impl Fn(u64) -> f64,
        expected: impl Fn(u64) -> f64,
    ) -> (Vec<(u64, bool)>, Vec<f64>) {
        let mut watch = SteeringWatch::default();
        let mut reported = Vec::new();
        let mut used = Vec::new();
        for k in 0..400 {
            let expected = Some(Gaussian::new(expected(k), 0.01));
            used.push(
                watch.judge(LogTime(10_000_000 * k), angle(k), expected, &mut |change| {
                    reported.push((k, change.faulty));
                }),
            );
        }
        (reported, used)
    }

    #[test]
    fn a_hand_wheel_that_is_off_is_replaced_at_once_named_and_taken_back() {
        let angle = |k| {
            let off = if (100..200).contains(&k) { 2.0 } else { 0.0 };
            0.5 + off + 1e-3 * (k % 3) as f64
        };
        let (reported, used) = reported(angle, |_| 0.5);
        assert_eq!(reported, [(130, true), (250, false)]);
        assert!(used.iter().all(|angle| (angle - 0.5).abs() < 0.01));
    }

    #[test]
    fn one_that_stands_is_believed_until_it_is_contradicted_by_little() {
        let angle = |k: u64| 0.5 + 1e-3 * (k.min(100) % 7) as f64;
        assert_eq!(reported(angle, |_| 0.5).0, []);
        let turned = |k| if k < 200 { 0.5 } else { 0.75 };
        assert_eq!(reported(angle, turned).0, [(230, true)]);
        let moving = |k| 0.5 + 1e-3 * (k % 7) as f64;
        assert_eq!(reported(moving, turned).0, []);
    }

    /// Near the friction's limit the slip angle that a lateral force calls for is anybody's guess.
    #[test]
    fn one_that_jumps_is_not_followed_though_what_is_expected_is_vague() {
        let mut watch = SteeringWatch::default();
        for k in 0..200 {
            let off = if (100..150).contains(&k) { 1.0 } else { 0.0 };
            let angle = off - 1.2 + 1e-3 * (k % 3) as f64;
            let vague = (k % 20 < 10).then_some(Gaussian::new(-1.0, 0.5));
            let used = watch.judge(LogTime(10_000_000 * k), angle, vague, &mut |_| {});
            assert!((used + 1.1).abs() < 0.2, "{k} {used}");
        }
    }

    #[test]
    fn one_that_jumps_unseen_is_believed_in_the_end() {
        let mut watch = SteeringWatch::default();
        let mut used = Vec::new();
        for k in 0..400 {
            let angle = if k < 100 { 0.0 } else { 1.0 } + 1e-3 * (k % 3) as f64;
            used.push(watch.judge(LogTime(10_000_000 * k), angle, None, &mut |_| {}));
        }
        assert!(
            used[250] < 0.01 && used[399] > 0.99,
            "{} {}",
            used[250],
            used[399]
        );
    }

    #[test]
    fn one_that_has_died_is_named_though_what_is_expected_passes_by() {
        let expected = |k: u64| 1.0 - 0.05 * k.saturating_sub(100) as f64;
        let angle = |k| if k < 100 { expected(k) } else { 0.0 };
        assert_eq!(reported(angle, expected).0, [(130, true)]);
    }
}
