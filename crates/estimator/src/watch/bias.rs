//! Report of biases of the inertial unit that have jumped. The motion filter detects the jump and
//! estimates the bias again.

use sample::LogTime;

use super::{JUMPED, SensorChange};
use crate::tuning::BiasWatchTuning;

/// Names in events: accelerometers, then gyros.
const NAMES: [&str; 6] = [
    "inertial unit forward acceleration bias",
    "inertial unit leftward acceleration bias",
    "inertial unit upward acceleration bias",
    "inertial unit roll rate bias",
    "inertial unit pitch rate bias",
    "inertial unit yaw rate bias",
];

/// Monitor of the biases.
#[derive(Clone, Copy, Debug, Default)]
pub struct BiasWatch {
    /// When the first biases were judged.
    start: Option<LogTime>,
    jump: Option<Jump>,
}

/// A suspected jump.
#[derive(Clone, Copy, Debug)]
struct Jump {
    first: LogTime,
    last: LogTime,
    /// Biases before the jump.
    before: [f64; 6],
    reported: [bool; 6],
}

impl BiasWatch {
    /// Whether a jump is suspected.
    pub fn is_suspected(&self) -> bool {
        self.jump.is_some()
    }

    /// Notes a sign that one of the biases has jumped; `before` are the biases before it.
    pub fn suspect(&mut self, now: LogTime, before: [f64; 6]) {
        let new = Jump {
            first: now,
            last: now,
            before,
            reported: [false; 6],
        };
        self.jump.get_or_insert(new).last = now;
    }

    /// Reports which bias has jumped, from the present biases. `sigma` are the initial standard
    /// deviations of accelerometer and gyro biases.
    pub fn judge(
        &mut self,
        now: LogTime,
        biases: [f64; 6],
        sigma: [f64; 2],
        tuning: &BiasWatchTuning,
        changes: &mut impl FnMut(SensorChange),
    ) {
        let start = *self.start.get_or_insert(now);
        // A vehicle that shakes at the start gives a wrong attitude, whose correction is no jump.
        let settled = |jump: &Jump| jump.first.seconds_since(start) >= tuning.settling_s;
        self.jump = self.jump.filter(settled);
        let Some(jump) = &mut self.jump else {
            return;
        };
        let known = now.seconds_since(jump.last) >= tuning.known_s;
        if now.seconds_since(jump.first) < tuning.learning_s {
            return;
        }
        for (i, reported) in jump.reported.iter_mut().enumerate() {
            let far = (biases[i] - jump.before[i]).abs() > tuning.reported_sigma * sigma[i / 3];
            let faulty = !known && (far || *reported);
            if faulty != *reported {
                *reported = faulty;
                changes(SensorChange {
                    name: NAMES[i],
                    faulty,
                    why: JUMPED,
                });
            }
        }
        if known {
            self.jump = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bias_that_has_changed_is_named_until_it_is_known() {
        let mut watch = BiasWatch::default();
        let mut reported = Vec::new();
        for k in 0..900 {
            let now = LogTime(10_000_000 * k);
            // The attitude of the start is corrected: no jump.
            if k == 120 {
                watch.suspect(now, [0.5; 6]);
            }
            let k = k.max(300) - 300;
            // Taken for an acceleration at first.
            let bias = match k {
                0..100 => [0.0; 6],
                100..130 => [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
                _ => [0.0, 0.02, 0.0, 0.1, 0.0, 0.0],
            };
            if now.0 > 3_000_000_000 && (k == 100 || k == 130) {
                watch.suspect(now, if k == 100 { [0.0; 6] } else { bias });
            }
            let tuning = BiasWatchTuning::default();
            watch.judge(now, bias, [0.05, 0.005], &tuning, &mut |change| {
                reported.push((k, change.name, change.faulty));
            });
        }
        assert_eq!(reported, [(150, NAMES[3], true), (330, NAMES[3], false)]);
    }
}
