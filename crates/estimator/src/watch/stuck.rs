//! A reading that does not change while the other sensors change, or although the sensor is noisy.

use crate::tuning::RepeatsTuning;

/// Repeats of a reading, and the values that were expected meanwhile.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stuck {
    reading: f64,
    repeats: u32,
    least: f64,
    most: f64,
}

impl Stuck {
    /// Takes a reading and the value that the other sensors expect, `None` of a vehicle that stands: its readings
    /// may stay the same. Returns whether the reading is stuck: it was repeated `repeats_min` times, while the
    /// expected value changed by more than `change_min`.
    pub fn take(
        &mut self,
        reading: f64,
        expected: Option<f64>,
        repeats_min: u32,
        change_min: f64,
    ) -> bool {
        let Some(expected) = expected else {
            *self = Self::default();
            return false;
        };
        if reading == self.reading {
            self.repeats = self.repeats.saturating_add(1);
            self.least = self.least.min(expected);
            self.most = self.most.max(expected);
        } else {
            *self = Self {
                reading,
                repeats: 0,
                least: expected,
                most: expected,
            };
        }
        self.repeats >= repeats_min && self.most - self.least > change_min
    }
}

/// Repeats of a reading of a sensor whose own noise changes each reading.
///
/// The noise shows itself: successive differences change their sign, and exceed the resolution. An encoder without
/// noise that a driver turns has differences of one sign; one between two counts has differences of one count.
#[derive(Clone, Copy, Debug)]
pub struct Repeats {
    reading: f64,
    /// Last difference that was not zero.
    difference: f64,
    /// Smallest difference that was not zero.
    resolution: f64,
    /// Part of the differences that are noise, with a fading memory.
    noisy: f64,
    repeats: u32,
}

impl Default for Repeats {
    fn default() -> Self {
        Self {
            reading: f64::NAN,
            difference: 0.0,
            resolution: f64::INFINITY,
            noisy: 0.0,
            repeats: 0,
        }
    }
}

impl Repeats {
    /// Takes a reading; `moves`: whether the vehicle drives. The readings of a vehicle that stands may stay the same.
    /// Returns whether the sensor is frozen: a noisy sensor repeated its reading `repeats_min` times.
    pub fn take(&mut self, reading: f64, moves: bool, repeats_min: u32, t: &RepeatsTuning) -> bool {
        let difference = reading - self.reading;
        self.reading = reading;
        if !moves || difference.is_nan() {
            self.repeats = 0;
        } else if difference == 0.0 {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            self.repeats = 0;
            self.resolution = self.resolution.min(difference.abs());
            let least = t.resolutions * self.resolution;
            let before = std::mem::replace(&mut self.difference, difference);
            let is_noise = difference * before < 0.0 && difference.abs().min(before.abs()) > least;
            self.noisy += (1.0 - t.keep) * (f64::from(is_noise) - self.noisy);
        }
        self.repeats >= repeats_min && self.noisy > t.noisy_part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings at which a sensor with a resolution of 1 is found to be frozen, with noise of a standard deviation and
    /// a true value by the number of the reading. From reading 300 on, it repeats its reading.
    fn frozen(sigma: f64, truth: impl Fn(u32) -> f64) -> Vec<u32> {
        let mut random = math::Random::new(11);
        let mut repeats = Repeats::default();
        let mut held = 0.0;
        let tuning = RepeatsTuning::default();
        (0..400)
            .filter(|k| {
                if *k < 300 {
                    held = (truth(*k) + sigma * random.normal()).round();
                }
                repeats.take(held, true, 50, &tuning)
            })
            .collect()
    }

    #[test]
    fn a_noisy_sensor_that_repeats_its_reading_is_frozen() {
        // Readings before the last one may be the same by chance.
        let from = |truth: fn(u32) -> f64| frozen(5.0, truth)[0];
        assert!((345..350).contains(&from(|_| 100.0)));
        assert!((345..350).contains(&from(|k| 0.7 * f64::from(k))));
    }

    #[test]
    fn a_sensor_without_noise_may_repeat_its_reading() {
        assert_eq!(frozen(0.0, |k| 0.7 * f64::from(k)), []);
        let swing = |k: u32| 80.0 * math::sin(0.05 * f64::from(k));
        assert_eq!(frozen(0.0, swing), []);
        // Noise of a part of a count, at the border of two counts.
        assert_eq!(frozen(0.4, |_| 0.5), []);
        let mut repeats = Repeats::default();
        let tuning = RepeatsTuning::default();
        for k in 0..500_u32 {
            // A vehicle that stands from reading 300 on.
            let noise = if k < 300 { f64::from(k % 2 * 9) } else { 0.0 };
            assert!(!repeats.take(noise, k < 300, 50, &tuning), "{k}");
        }
    }

    #[test]
    fn a_constant_reading_is_stuck_only_while_the_expected_value_changes() {
        let (mut still, mut held) = (Stuck::default(), Stuck::default());
        for k in 0..50 {
            let expected = 5.0 + 0.05 * f64::from(k);
            assert!(!still.take(0.0, Some(0.01), 5, 0.3), "{k}");
            assert_eq!(held.take(5.0, Some(expected), 5, 0.3), k > 6, "{k}");
        }
        assert!(!held.take(5.0, None, 5, 0.3));
        assert!(!held.take(5.0, Some(7.5), 5, 0.3));
    }
}
