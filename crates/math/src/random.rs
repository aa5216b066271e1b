//! Random numbers of a seed.

use crate::{cos, ln};

/// Uniform and normal numbers by the 64-bit xorshift generator (Marsaglia, Xorshift RNGs, Journal of
/// Statistical Software 8, 2003, with the shifts 13, 7, 17). A seed gives the same numbers on every
/// machine and with every version of every library, so that drives and tests made of them stay the
/// same. The numbers are not fit for secrets.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The numbers of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut random = Self::from_state(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..8 {
            random.bits();
        }
        random
    }

    /// The generator in a state, which must not be zero: zero gives zeros only.
    #[must_use]
    pub const fn from_state(state: u64) -> Self {
        Self(state)
    }

    /// 64 random bits, never all zero.
    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// A whole number from 0 to `end` - 1. `end` must not be zero.
    pub fn below(&mut self, end: u64) -> u64 {
        self.bits() % end
    }

    /// A number from 0 (included) to 1 (excluded).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number from `low` (included) to `high` (excluded).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// -1 or +1.
    pub fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }

    /// A normal number of mean 0 and standard deviation 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        (-2.0 * ln(1.0 - self.unit())).sqrt() * cos(std::f64::consts::TAU * self.unit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drives of the tests depend on these numbers.
    #[test]
    fn a_seed_gives_its_numbers_for_ever() {
        let mut random = Random::new(1);
        let found = [random.bits(), random.bits()];
        assert_eq!(found, EXPECTED, "{found:#x?}");
        let mut random = Random::from_state(1);
        assert_eq!(random.bits(), 0x4082_2041);
    }

    const EXPECTED: [u64; 2] = [0xddaa_4e85_b0d6_e28b, 0x8f8e_a9d3_4942_8d8e];

    #[test]
    fn moments() {
        let mut random = Random::new(7);
        let (mut sum, mut squares, mut unit, mut left) = (0.0, 0.0, 0.0, 0);
        const COUNT: u32 = 20_000;
        for _ in 0..COUNT {
            let x = random.normal();
            sum += x;
            squares += x * x;
            unit += random.between(2.0, 4.0);
            left += u32::from(random.sign() < 0.0);
            assert!(random.below(6) < 6);
        }
        let n = f64::from(COUNT);
        assert!((sum / n).abs() < 0.03, "{}", sum / n);
        assert!((squares / n - 1.0).abs() < 0.04, "{}", squares / n);
        assert!((unit / n - 3.0).abs() < 0.02, "{}", unit / n);
        assert!((f64::from(left) / n - 0.5).abs() < 0.015, "{left}");
    }
}
