//! Counts beyond the range of the converter that the sensors file describes.

use std::fmt;

use sample::Counts;

/// Number of readings beyond the range from which the stated range counts as wrong. A few can be errors of a
/// transmission.
const READINGS_MIN: u32 = 10;

/// Range of the counts that a channel sent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CountRange {
    least: f64,
    largest: f64,
    beyond: u32,
}

impl CountRange {
    /// Takes a reading of a channel whose converter has `adc_bits` according to the sensors file. A value that
    /// was sent in another unit has no limits.
    pub fn push(&mut self, counts: Counts, adc_bits: u8) {
        if let Counts::Converter(counts) = counts {
            let counts = f64::from(counts);
            if !(0.0..full_scale(adc_bits)).contains(&counts) {
                self.beyond = self.beyond.saturating_add(1);
            }
            self.least = self.least.min(counts);
            self.largest = self.largest.max(counts);
        }
    }

    /// The contradiction to `adc_bits`, which is the field `field` of the sensors file; `None` without one.
    #[must_use]
    pub fn beyond(&self, field: &'static str, adc_bits: u8) -> Option<BeyondRange> {
        (self.beyond >= READINGS_MIN).then_some(BeyondRange {
            least: self.least,
            largest: self.largest,
            field,
            adc_bits,
        })
    }
}

/// Counts that the converter of the sensors file cannot send.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeyondRange {
    /// Least count that arrived, at most 0.
    pub least: f64,
    /// Largest count that arrived, at least 0.
    pub largest: f64,
    /// Field of the sensors file.
    pub field: &'static str,
    /// Bits of the converter according to the sensors file.
    pub adc_bits: u8,
}

impl BeyondRange {
    /// Fewest bits whose range contains the counts. Counts of a signal with a sign have their zero in the
    /// middle of the range.
    #[must_use]
    pub fn bits_needed(&self) -> u8 {
        let middle = 0.5 * full_scale(self.adc_bits);
        let needed = |bits: &u8| {
            let full = full_scale(*bits);
            if self.least < 0.0 {
                let below = middle - self.least <= 0.5 * full;
                below && self.largest - middle < 0.5 * full
            } else {
                self.largest < full
            }
        };
        (self.adc_bits..=32).find(needed).unwrap_or(32)
    }

    /// What arrived, and what the sensors file allows.
    #[must_use]
    pub fn found(&self) -> String {
        let Self {
            least,
            largest,
            field,
            adc_bits,
        } = self;
        let last = full_scale(*adc_bits) - 1.0;
        let arrived = if *least < 0.0 {
            format!("counts from {least} to {largest}")
        } else {
            format!("counts up to {largest}")
        };
        format!(
            "{arrived} arrive, but {field} = {adc_bits} of the sensors file allows 0 to {last}; counts beyond \
             this range are not used"
        )
    }

    /// Next step.
    #[must_use]
    pub fn remedy(&self) -> String {
        format!(
            "set {} to the bits of the device's converter, at least {}",
            self.field,
            self.bits_needed()
        )
    }
}

impl fmt::Display for BeyondRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.found(), self.remedy())
    }
}

fn full_scale(adc_bits: u8) -> f64 {
    model::strain::full_scale(adc_bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(counts: [i32; 2], readings: usize) -> CountRange {
        let mut range = CountRange::default();
        for reading in 0..readings {
            range.push(Counts::Converter(counts[reading % 2]), 12);
        }
        range
    }

    #[test]
    fn counts_beyond_the_range_name_the_bits_that_are_needed() {
        assert_eq!(after([4095, 0], 100).beyond("f", 12), None);
        let beyond = after([40_211, 2000], 100).beyond("strain.adc_bits", 12);
        let beyond = beyond.expect("counts beyond the range");
        assert_eq!(beyond.bits_needed(), 16);
        let text = beyond.to_string();
        assert!(text.contains("counts up to 40211 arrive"), "{text}");
        assert!(text.contains("strain.adc_bits = 12"), "{text}");
        // A signal of 16 bits with a sign, whose zero the conversion puts at 2048 counts.
        let signed = after([-30_720, 34_815], 100).beyond("f", 12);
        assert_eq!(signed.map(|beyond| beyond.bits_needed()), Some(16));
        assert!(signed.expect("beyond").to_string().contains("from -30720"));
    }

    #[test]
    fn single_errors_and_values_of_other_units_are_no_contradiction() {
        assert_eq!(after([4096, 2000], 18).beyond("f", 12), None);
        assert!(after([4096, 2000], 20).beyond("f", 12).is_some());
        let mut range = CountRange::default();
        let counts = Counts::Equivalent {
            counts: 1e6,
            step: 1.0,
        };
        (0..100).for_each(|_| range.push(counts, 12));
        assert_eq!(range.beyond("f", 12), None);
    }
}
