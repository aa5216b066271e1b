//! Independent random streams, one a sensor.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

/// One sensor's random numbers.
pub(crate) struct Noise(ChaCha8Rng);

impl Noise {
    /// The stream called `name` of `seed`: streams of different names share no numbers.
    pub(crate) fn new(seed: u64, name: &str) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(fnv1a(name));
        Self(generator)
    }

    /// A normal number of mean 0 and standard deviation `sigma`.
    pub(crate) fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.0);
        sigma * unit
    }

    /// Three independent normal numbers.
    pub(crate) fn normal3(&mut self, sigma: f64) -> [f64; 3] {
        std::array::from_fn(|_| self.normal(sigma))
    }

    /// A number from -`bound` to `bound`, each as likely.
    pub(crate) fn within(&mut self, bound: f64) -> f64 {
        let unit = Uniform::new_inclusive(-1.0, 1.0).map_or(0.0, |u| u.sample(&mut self.0));
        bound * unit
    }

    /// A number from 0 to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        0.5 + self.within(0.5)
    }

    /// An exponentially distributed delay of the given mean, cut off at five times the mean.
    pub(crate) fn delay(&mut self, mean: f64) -> f64 {
        let unit: f64 = rand_distr::Exp1.sample(&mut self.0);
        mean * unit.min(5.0)
    }

    /// -1 or +1.
    pub(crate) fn sign(&mut self) -> f64 {
        if self.within(1.0) < 0.0 { -1.0 } else { 1.0 }
    }
}

/// The 64-bit FNV-1a hash: a fixed number for each name, on every machine.
fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ() {
        let draw = |seed, name| {
            let mut noise = Noise::new(seed, name);
            std::array::from_fn::<f64, 8, _>(|_| noise.normal(1.0))
        };
        assert_eq!(draw(7, "imu"), draw(7, "imu"));
        assert_ne!(draw(7, "imu"), draw(8, "imu"));
        assert_ne!(draw(7, "imu"), draw(7, "novatel"));
    }

    #[test]
    fn moments() {
        let mut noise = Noise::new(1, "moments");
        let n = 20_000;
        let (mut sum, mut squares, mut flat) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = noise.normal(2.0);
            sum += x;
            squares += x * x;
            flat += noise.within(3.0).powi(2);
        }
        let n = f64::from(n);
        assert!((sum / n).abs() < 0.06);
        assert!((squares / n / 4.0 - 1.0).abs() < 0.04);
        assert!((flat / n / 3.0 - 1.0).abs() < 0.04, "uniform: b^2/3");
    }
}
