//! Monitor of the steering wheel's angle sensor.

use sample::LogTime;

use super::{CONTRADICTS, FROZEN, SensorChange};
use crate::gaussian::{Gaussian, within};
use crate::grid::GRID_S;
use crate::tuning::SteeringWatchTuning;

/// Monitor of the steering wheel.
#[derive(Clone, Copy, Debug, Default)]
pub struct SteeringWatch {
    tuning: SteeringWatchTuning,
    last: Option<Read>,
    /// Time of the last change of the reading.
    moved: Option<LogTime>,
    /// Whether that is long ago.
    stuck: bool,
    /// Angle after a jump while the sensor repeats exactly this value. A stuck sensor may match the
    /// expected angle by chance; that must not count as agreement.
    stuck_at: Option<f64>,
    /// Since when the sensor has been inconsistent.
    inconsistent_since: Option<LogTime>,
    /// Since when the sensor has been consistent.
    agreed: Option<LogTime>,
    /// Time of the last jump away from the expected angle.
    left_range_at: Option<LogTime>,
    /// Whether, since the sensor became inconsistent, forces and motion have contradicted it, and not
    /// only its own past.
    contradicted_by_forces: bool,
    /// The angle that last replaced the reading: the expected angle of an inconsistent sensor while
    /// nothing else is known.
    held: Option<Gaussian>,
    /// Whether its noise is gone.
    frozen: bool,
    reported: bool,
}

/// A reading.
#[derive(Clone, Copy, Debug)]
struct Read {
    time: LogTime,
    angle_rad: f64,
}

impl SteeringWatch {
    /// A monitor without readings.
    pub fn new(tuning: SteeringWatchTuning) -> Self {
        Self {
            tuning,
            ..Self::default()
        }
    }

    /// Whether grip may be learnt with the last angle.
    pub fn is_used(&self) -> bool {
        self.inconsistent_since.is_none() && !self.stuck
    }

    /// Whether the sensor is inconsistent and has not agreed for long enough since.
    pub fn is_inconsistent(&self) -> bool {
        self.inconsistent_since.is_some()
    }

    /// Takes whether the sensor is frozen, from its own noise. A frozen sensor is inconsistent, whatever forces and
    /// motion imply.
    pub fn take_frozen(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    /// The angle to use, rad, from the reading at `time` and the angle that forces and motion imply.
    pub fn judge(
        &mut self,
        time: LogTime,
        angle_rad: f64,
        expected: Option<Gaussian>,
        changes: &mut impl FnMut(SensorChange),
    ) -> f64 {
        let t = self.tuning;
        let held_variance = t.held_sigma_rad * t.held_sigma_rad;
        let last = self.last.replace(Read { time, angle_rad });
        if last.is_none_or(|last| last.angle_rad != angle_rad) {
            self.moved = Some(time);
        }
        let before_jump = last
            .filter(|last| {
                // Late readings of a device without a clock may have one time.
                let span_s = time.seconds_since(last.time).max(GRID_S);
                (angle_rad - last.angle_rad).abs() > t.jump_rad_s * span_s
            })
            .map(|last| last.angle_rad);
        let held = self.held.filter(|_| {
            self.contradicted_by_forces || !longer(time, self.inconsistent_since, t.held_max_s)
        });
        let by_forces = expected.is_some() || self.frozen;
        let expected = expected
            .or(held)
            .or(before_jump.map(|before| Gaussian::new(before, held_variance)));
        let agrees = self.agrees(time, angle_rad, before_jump, expected);
        let agrees = if self.frozen { Some(false) } else { agrees };
        self.count(time, agrees, by_forces);
        self.report(time, changes);
        let used = match expected {
            Some(expected) if self.is_inconsistent() => expected.mean,
            _ => angle_rad,
        };
        self.held = self
            .is_inconsistent()
            .then_some(Gaussian::new(used, held_variance));
        used
    }

    /// Whether the angle is within the gate of the expected one; `None` without an expected angle.
    /// After a jump away from the expected angle it is not, whatever its variance is: a driver's hand
    /// does not jump.
    fn agrees(
        &mut self,
        time: LogTime,
        angle_rad: f64,
        before_jump: Option<f64>,
        expected: Option<Gaussian>,
    ) -> Option<bool> {
        let t = self.tuning;
        let jumped = before_jump.is_some();
        if let (Some(before), Some(expected)) = (before_jump, expected)
            && (angle_rad - expected.mean).abs() > (before - expected.mean).abs()
        {
            self.left_range_at = Some(time);
        } else if jumped || longer(time, self.left_range_at, t.good_s) {
            self.left_range_at = None;
        }
        self.stuck_at = match self.stuck_at {
            _ if jumped => Some(angle_rad),
            stuck_at => stuck_at.filter(|stuck_at| *stuck_at == angle_rad),
        };
        self.stuck = longer(time, self.moved, t.stuck_s);
        let gate = if jumped || self.stuck || self.is_inconsistent() {
            t.suspect_gate_sigma
        } else {
            t.gate_sigma
        };
        expected.map(|expected| {
            self.left_range_at.is_none()
                && within(gate, angle_rad - expected.mean, expected.variance)
        })
    }

    fn count(&mut self, time: LogTime, agrees: Option<bool>, by_forces: bool) {
        if agrees == Some(false) {
            self.contradicted_by_forces =
                by_forces || self.contradicted_by_forces && self.is_inconsistent();
            self.inconsistent_since.get_or_insert(time);
            self.agreed = None;
        } else {
            self.agreed.get_or_insert(time);
            let passed = !self.reported && self.stuck_at.is_none();
            if passed || longer(time, self.agreed, self.tuning.good_s) && !self.stuck {
                self.inconsistent_since = None;
            }
        }
    }

    fn report(&mut self, time: LogTime, changes: &mut impl FnMut(SensorChange)) {
        let lasts = longer(time, self.inconsistent_since, self.tuning.faulty_s);
        let faulty = self.is_inconsistent() && (self.reported || lasts);
        if faulty != self.reported {
            self.reported = faulty;
            changes(SensorChange {
                name: "steering wheel",
                faulty,
                why: if self.frozen { FROZEN } else { CONTRADICTS },
            });
        }
    }
}

/// Whether `since` is at least `span_s` before `time`.
fn longer(time: LogTime, since: Option<LogTime>, span_s: f64) -> bool {
    since.is_some_and(|since| time.seconds_since(since) >= span_s)
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
    fn a_wrong_angle_is_replaced_at_once_reported_and_used_again() {
        let angle = |k| {
            let off = if (100..200).contains(&k) { 2.0 } else { 0.0 };
            0.5 + off + 1e-3 * (k % 3) as f64
        };
        let (reported, used) = reported(angle, |_| 0.5);
        assert_eq!(reported, [(130, true), (250, false)]);
        assert!(used.iter().all(|angle| (angle - 0.5).abs() < 0.01));
    }

    #[test]
    fn a_frozen_angle_is_reported_although_it_agrees() {
        let mut watch = SteeringWatch::default();
        let mut reported = Vec::new();
        for k in 0..400_u64 {
            watch.take_frozen((200..300).contains(&k));
            let expected = Some(Gaussian::new(0.5, 0.01));
            let angle = 0.5
                + if (100..300).contains(&k) {
                    0.0
                } else {
                    1e-3 * (k % 3) as f64
                };
            watch.judge(LogTime(10_000_000 * k), angle, expected, &mut |change| {
                reported.push((k, change.faulty, change.why));
            });
        }
        assert_eq!(reported[0], (230, true, FROZEN));
        assert_eq!((reported.len(), reported[1].1), (2, false));
    }

    #[test]
    fn a_constant_angle_is_used_until_it_is_outside_the_narrow_gate() {
        let angle = |k: u64| 0.5 + 1e-3 * (k.min(100) % 7) as f64;
        assert_eq!(reported(angle, |_| 0.5).0, []);
        let turned = |k| if k < 200 { 0.5 } else { 0.75 };
        assert_eq!(reported(angle, turned).0, [(230, true)]);
        let moving = |k| 0.5 + 1e-3 * (k % 7) as f64;
        assert_eq!(reported(moving, turned).0, []);
    }

    /// After a stall, the readings of a device without a clock arrive together, with the time of their
    /// arrival.
    #[test]
    fn readings_that_come_late_and_at_once_are_no_jump() {
        let mut watch = SteeringWatch::default();
        for k in 0..600_u64 {
            let time = LogTime(10_000_000 * if k % 30 < 6 { k - k % 30 + 6 } else { k });
            let turned = 1.9 * math::sin(0.02 * k as f64);
            let expected = Some(Gaussian::new(turned + 0.02, 0.01));
            let used = watch.judge(time, turned, expected, &mut |change| {
                panic!("reading {k} is a fault: {}", change.faulty);
            });
            assert!((used - turned).abs() < 1e-9, "{k}: {used}, not {turned}");
        }
    }

    /// Near the friction limit the slip angle that a lateral force implies is very uncertain.
    #[test]
    fn a_jump_is_rejected_although_the_expected_angle_is_uncertain() {
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
    fn a_jump_without_an_expected_angle_is_used_in_the_end() {
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
    fn a_dead_sensor_is_reported_although_the_expected_angle_passes_its_value() {
        let expected = |k: u64| 1.0 - 0.05 * k.saturating_sub(100) as f64;
        let angle = |k| if k < 100 { expected(k) } else { 0.0 };
        assert_eq!(reported(angle, expected).0, [(130, true)]);
    }
}
