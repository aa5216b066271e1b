//! A reading that does not change while the other sensors change.

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

#[cfg(test)]
mod tests {
    use super::*;

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
