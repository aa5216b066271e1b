//! One track of a road of an ISO 8608 class.

use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::RoadClass;
use crate::Error;
use crate::error::require;

/// A track whose height is a sum of sines with the density of its class and phases drawn from a
/// seed. It is a function of position, so that any speed and step may run over it.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadProfile {
    sines: Vec<Sine>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Sine {
    rad_m: f64,
    amplitude_m: f64,
    phase_rad: f64,
}

impl RoadProfile {
    /// A profile with `sines` waves spread evenly in the logarithm of their length from
    /// `longest_m` to `shortest_m`. ISO 8608 covers 0.35 to 91 m.
    ///
    /// # Errors
    /// When the lengths are not positive and ordered, or there is no wave.
    pub fn new(
        class: RoadClass,
        longest_m: f64,
        shortest_m: f64,
        sines: usize,
        seed: u64,
    ) -> Result<Self, Error> {
        require(
            shortest_m > 0.0,
            "shortest wave",
            shortest_m,
            "m",
            "above 0",
        )?;
        require(
            longest_m > shortest_m,
            "longest wave",
            longest_m,
            "m",
            "longer than the shortest",
        )?;
        require(sines > 0, "waves", sines as f64, "", "1 or more")?;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let edge =
            |k: usize| math::powf(longest_m / shortest_m, k as f64 / sines as f64) / longest_m;
        let sines = (0..sines)
            .map(|k| {
                let (low, high) = (edge(k), edge(k + 1));
                // Anywhere within its band, so that the sum does not repeat.
                let cycles_m = low * math::powf(high / low, random.random::<f64>());
                // The band's power: the integral of G_d over it.
                let power = class.density_m3(1.0) * (1.0 / low - 1.0 / high);
                Sine {
                    rad_m: TAU * cycles_m,
                    amplitude_m: (2.0 * power).sqrt(),
                    phase_rad: TAU * random.random::<f64>(),
                }
            })
            .collect();
        Ok(Self { sines })
    }

    /// Height at a position along the track, m.
    #[must_use]
    pub fn height_m(&self, position_m: f64) -> f64 {
        self.sines
            .iter()
            .map(|s| s.amplitude_m * math::sin(s.rad_m * position_m + s.phase_rad))
            .sum()
    }

    /// Slope at a position, m/m; times the speed it is the height's rate.
    #[must_use]
    pub fn slope(&self, position_m: f64) -> f64 {
        self.sines
            .iter()
            .map(|s| s.amplitude_m * s.rad_m * math::cos(s.rad_m * position_m + s.phase_rad))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_has_its_class_s_power() {
        let (longest, shortest) = (20.0, 0.5);
        let road = RoadProfile::new(RoadClass::D, longest, shortest, 200, 7).expect("in range");
        let (count, step) = (200_000, 0.05);
        let sum: f64 = (0..count)
            .map(|k| road.height_m(f64::from(k) * step).powi(2))
            .sum();
        let expected = RoadClass::D.density_m3(1.0) * (longest - shortest);
        let found = sum / f64::from(count);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    }

    #[test]
    fn the_seed_decides_and_slope_is_the_derivative() {
        let make = |seed| RoadProfile::new(RoadClass::C, 50.0, 0.5, 80, seed).expect("in range");
        assert_eq!(make(1), make(1));
        assert_ne!(make(1), make(2));
        let (road, step) = (make(3), 1e-5);
        for x in [0.0, 3.7, 120.0] {
            let slope = (road.height_m(x + step) - road.height_m(x - step)) / (2.0 * step);
            assert!((road.slope(x) - slope).abs() < 1e-6);
        }
        assert!(RoadProfile::new(RoadClass::C, 0.5, 50.0, 80, 1).is_err());
        assert!(RoadProfile::new(RoadClass::C, f64::NAN, 0.5, 80, 1).is_err());
    }
}
