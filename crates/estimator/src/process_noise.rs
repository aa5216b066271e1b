//! Process noise that adapts to the filter's own corrections.
//!
//! In a filter with the right process noise, corrections are white. With too little process noise
//! the state lags, and consecutive corrections have the same sign. With too much the state follows
//! measurement noise, and consecutive corrections alternate. With the normalised corrections z and
//! their fading mean s = (1 - a) s + a z, white corrections have E[z s] = 0 (s of the step before)
//! and E[s²] = a/(2 - a).
//!
//! - Slow part: the density grows while the mean of z s over about a quarter second is above zero and
//!   shrinks while it is below (Mehra, On the identification of variances and adaptive Kalman
//!   filtering, IEEE Transactions on Automatic Control 15 (1970), uses the same correlation).
//! - Where corrections are much smaller than their standard deviations, the covariance is too large, as
//!   after a manoeuvre: the density shrinks faster.
//! - Fast part: s² above its value for white corrections multiplies the density in the same step, so
//!   that a manoeuvre does not wait for the slow part. Half of the states corrected alone, such as one
//!   axle, count almost like all.

use crate::tuning::ProcessNoiseTuning;

/// Density of the process noise of N states with a common density.
#[derive(Clone, Copy, Debug)]
pub struct ProcessNoise<const N: usize> {
    tuning: ProcessNoiseTuning,
    slow: f64,
    bounds: [f64; 2],
    recent: [f64; N],
    product: f64,
    square: f64,
    boost: f64,
}

impl<const N: usize> ProcessNoise<N> {
    /// Noise that starts at `density` and stays within `bounds`.
    pub fn new(density: f64, bounds: [f64; 2], tuning: ProcessNoiseTuning) -> Self {
        Self {
            tuning,
            slow: density,
            bounds,
            recent: [0.0; N],
            product: 0.0,
            square: 1.0,
            boost: 1.0,
        }
    }

    /// The density for the next step.
    pub fn density(&self) -> f64 {
        (self.slow * self.boost).min(self.bounds[1])
    }

    /// Takes the normalised corrections of one step.
    pub fn learn(&mut self, corrections: [f64; N]) {
        let t = &self.tuning;
        let mut product = 0.0;
        let mut square = 0.0;
        let mut squares = [0.0; 2];
        for (i, (recent, z)) in self.recent.iter_mut().zip(corrections).enumerate() {
            let z = if z.is_finite() { z } else { 0.0 };
            let z = z.clamp(-t.correction_max, t.correction_max);
            product += z * *recent / N as f64;
            square += z * z / N as f64;
            *recent += t.recent * (z - *recent);
            squares[i / N.div_ceil(2)] += *recent * *recent / N as f64;
        }
        self.product += t.slow * (product.clamp(-t.product_max, t.product_max) - self.product);
        self.square += t.slow * (square.min(t.square_max) - self.square);
        let [down, up] = t.step;
        let [least, most] = self.bounds;
        let doubt = t.small_gain * (t.small - self.square).max(0.0);
        let step = (self.product - t.colour - doubt).clamp(-down, up);
        self.slow = (self.slow * (1.0 + step)).clamp(least, most);
        // One standard deviation above the mean of chi-square over N.
        let usual = (1.0 + (2.0 / N as f64).sqrt()) * t.recent / (2.0 - t.recent);
        let halves = N as f64 / N.div_ceil(2) as f64;
        let half = t.half * halves * squares[0].max(squares[1]);
        let square = (squares[0] + squares[1]).max(half);
        self.boost = (square / usual).max(1.0).powi(4);
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const BOUNDS: [f64; 2] = [1.0, 1e6];

    fn after(corrections: impl Fn(f64, f64) -> f64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut noise = ProcessNoise::<4>::new(1e3, BOUNDS, ProcessNoiseTuning::default());
        let mut last = [0.0; 4];
        for _ in 0..2000 {
            let z = std::array::from_fn(|i| {
                let fresh: f64 = StandardNormal.sample(&mut rng);
                corrections(fresh, last[i])
            });
            noise.learn(z);
            last = z;
        }
        noise.density()
    }

    #[test]
    fn a_filter_that_lags_is_loosened_and_one_that_follows_noise_is_tightened() {
        let lagging = after(|fresh, last| 0.6 * last + fresh);
        let noisy = after(|fresh, last| fresh - 0.6 * last);
        assert!(lagging > 1e5 && noisy < 10.0, "{lagging} {noisy}");
    }

    #[test]
    fn what_begins_at_once_is_followed_at_once_and_let_go() {
        let mut noise = ProcessNoise::<1>::new(10.0, BOUNDS, ProcessNoiseTuning::default());
        for _ in 0..10 {
            noise.learn([5.0]);
        }
        assert!(noise.density() > 1e3);
        for _ in 0..30 {
            noise.learn([0.0]);
        }
        assert!(noise.density() < 50.0);
        noise.learn([f64::NAN]);
        assert!(noise.density().is_finite());
    }

    #[test]
    fn one_axle_alone_is_followed_almost_as_all_are() {
        let density_after = |corrections: [f64; 4]| {
            let mut noise = ProcessNoise::<4>::new(10.0, BOUNDS, ProcessNoiseTuning::default());
            for _ in 0..10 {
                noise.learn(corrections);
            }
            noise.density()
        };
        let [none, rear, all] = [[0.0; 4], [0.0, 0.0, 2.0, 2.0], [2.0; 4]].map(density_after);
        assert!(
            rear > 10.0 * none && rear > 0.3 * all && rear < all,
            "{none} {rear} {all}"
        );
    }
}
