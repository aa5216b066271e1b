//! Whether the deviations that an estimator states hold: normalised errors against chi-square
//! bounds, window by window.
//!
//! Errors of a filter are alike from step to step and from signal to signal, so that a window of n
//! normalised errors z tells far less than n independent ones would. For normal z the variance of
//! their mean square is 2/n^2 sum_ij rho_ij^2 with rho_ij the correlation of z_i and z_j; a mean of
//! nu independent squares has 2/nu. The window's effective degrees of freedom are therefore
//!
//! nu = n^2 / sum_ij rho_ij^2,
//!
//! with rho measured over the whole run about zero, so that an error that never changes sign counts
//! as one draw. The bounds are those of chi-square over nu.

use crate::score::{Distribution, LaggedProducts};
pub use crate::statistics::chi_squared_bounds;

/// Steps of a window in which an estimator is judged: one second.
pub const WINDOW_STEPS: usize = 100;

/// What the windows of a run tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Consistency {
    /// Number of windows.
    pub windows: usize,
    /// Part of them whose mean square lies within the bounds.
    pub inside: f64,
    /// Part of them above the upper bound: the estimator is too sure of itself.
    pub above: f64,
    /// Effective degrees of freedom of a window.
    pub freedom: f64,
    /// 95 % bounds of a window's mean square.
    pub bounds: [f64; 2],
    /// Mean square over the whole run: one where the deviations hold.
    pub mean: f64,
    /// Median of the windows' mean squares.
    pub median: f64,
}

/// Judges the normalised errors `(estimate - truth)/sigma` of several signals, equally spaced and
/// equally long, in windows of `window` steps. Steps at which any is not finite are left out.
/// `None` without a single window.
#[must_use]
pub fn consistency(normalised: &[Vec<f64>], window: usize) -> Option<Consistency> {
    let length = normalised.iter().map(Vec::len).min()?;
    let mut all = ConsistencyStatistics::new(normalised.len(), window);
    let mut step = vec![0.0; normalised.len()];
    for k in 0..length {
        for (value, z) in step.iter_mut().zip(normalised) {
            *value = z[k];
        }
        all.push(&step);
    }
    all.finish()
}

/// The same for signals that come step by step, in constant memory.
#[derive(Clone, Debug)]
pub struct ConsistencyStatistics {
    window: usize,
    /// The last steps of each signal, whose products are not formed yet.
    recent: Vec<Vec<f64>>,
    steps: usize,
    steps_of_window: usize,
    /// Sum of the squares of each signal.
    squares: Vec<f64>,
    /// Sum of the squares of all signals in the present window.
    window_squares: f64,
    /// Products of each pair of signals, for each lag from 0 to `window - 1`.
    products: LaggedProducts,
    means: Distribution,
    sum_of_means: f64,
}

impl ConsistencyStatistics {
    /// For a number of signals and windows of `window` steps.
    #[must_use]
    pub fn new(signals: usize, window: usize) -> Self {
        Self {
            window,
            recent: vec![Vec::new(); signals],
            steps: 0,
            steps_of_window: 0,
            squares: vec![0.0; signals],
            window_squares: 0.0,
            products: LaggedProducts::new(signals, window),
            means: Distribution::default(),
            sum_of_means: 0.0,
        }
    }

    /// Takes the normalised errors of a step.
    pub fn push(&mut self, step: &[f64]) {
        if self.window == 0 || !step.iter().all(|z| z.is_finite()) {
            return;
        }
        let sums = self.recent.iter_mut().zip(&mut self.squares);
        for ((recent, sum), z) in sums.zip(step) {
            recent.push(*z);
            *sum += z * z;
            self.window_squares += z * z;
        }
        self.steps += 1;
        self.steps_of_window += 1;
        if self.steps_of_window == self.window {
            self.steps_of_window = 0;
            self.end_window();
        }
        let length = self.recent.first().map_or(0, Vec::len);
        if length == self.products.block() + self.window - 1 {
            self.form_products(self.products.block());
        }
    }

    fn end_window(&mut self) {
        let mean = self.window_squares / (self.recent.len() * self.window) as f64;
        self.window_squares = 0.0;
        self.sum_of_means += mean;
        self.means.push(mean);
    }

    /// Forms the products of the steps before `end` with those up to `window - 1` after them.
    fn form_products(&mut self, end: usize) {
        let all = |count: usize| self.recent.iter().map(|z| &z[..count]).collect::<Vec<_>>();
        self.products.add(&all(end), &all(end + self.window - 1));
        for recent in &mut self.recent {
            recent.drain(..end);
        }
    }

    /// The result; `None` without a single window.
    #[must_use]
    pub fn finish(mut self) -> Option<Consistency> {
        if self.means.count() == 0 {
            return None;
        }
        // Zeros behind the end add nothing to the products.
        let length = self.recent.first().map_or(0, Vec::len);
        for recent in &mut self.recent {
            recent.resize(length + self.window - 1, 0.0);
        }
        self.form_products(length);
        let freedom = self.effective_freedom();
        let bounds = chi_squared_bounds(freedom);
        let count = self.means.count() as f64;
        let not_above = self.means.up_to(bounds[1]);
        Some(Consistency {
            windows: self.means.count(),
            inside: (not_above - self.means.below(bounds[0])) / count,
            above: (count - not_above) / count,
            freedom,
            bounds,
            mean: self.sum_of_means / count,
            median: self.means.median()?,
        })
    }

    /// n^2 / sum rho^2 over all pairs of a window.
    fn effective_freedom(&self) -> f64 {
        let (signals, window) = (self.recent.len(), self.window);
        let power: Vec<f64> = self
            .squares
            .iter()
            .map(|sum| sum.max(f64::MIN_POSITIVE) / self.steps as f64)
            .collect();
        let mut sum = 0.0;
        for (pair, products) in self.products.sums().enumerate() {
            let (i, j) = (pair / signals, pair % signals);
            for (lag, product) in products.iter().enumerate() {
                let pairs = self.steps - lag;
                let correlation = product / pairs as f64 / (power[i] * power[j]).sqrt();
                let times = if lag == 0 { window } else { 2 * (window - lag) };
                sum += times as f64 * correlation * correlation;
            }
        }
        let count = (signals * window) as f64;
        count * count / sum
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Unit-variance noise of which the part `keep` lasts from step to step.
    fn noise(rng: &mut ChaCha8Rng, length: usize, keep: f64) -> Vec<f64> {
        let mut value: f64 = StandardNormal.sample(rng);
        (0..length)
            .map(|_| {
                let fresh: f64 = StandardNormal.sample(rng);
                value = keep * value + (1.0 - keep * keep).sqrt() * fresh;
                value
            })
            .collect()
    }

    #[test]
    fn true_deviations_hold_and_wrong_ones_do_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for keep in [0.0, 0.8, 0.97] {
            let signals: Vec<_> = (0..3).map(|_| noise(&mut rng, 40_000, keep)).collect();
            let found = consistency(&signals, 100).unwrap();
            assert!((found.inside - 0.95).abs() < 0.03, "{keep} {found:?}");
            // First-order noise: sum of rho^2 over all lags is (1 + k^2)/(1 - k^2).
            let expected = 300.0 * (1.0 - keep * keep) / (1.0 + keep * keep);
            assert!(
                (found.freedom / expected - 1.0).abs() < 0.25,
                "{keep} {found:?}"
            );
            for wrong in [0.6, 1.6] {
                let wide: Vec<Vec<f64>> = signals
                    .iter()
                    .map(|z| z.iter().map(|z| z * wrong).collect())
                    .collect();
                let found = consistency(&wide, 100).unwrap();
                // Few independent draws a window tell a wrong deviation less often.
                let most = if keep > 0.9 { 0.9 } else { 0.3 };
                assert!(found.inside < most, "{keep} {wrong} {found:?}");
            }
        }
    }

    #[test]
    fn one_error_that_never_changes_counts_once() {
        let constant = vec![vec![1.5; 1000]];
        let found = consistency(&constant, 100).unwrap();
        assert!((found.freedom - 1.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.inside, 1.0);
        assert!(consistency(&[vec![1.0; 20]], 100).is_none());
        let gap = vec![vec![f64::NAN; 1000]];
        assert!(consistency(&gap, 10).is_none());
    }
}
