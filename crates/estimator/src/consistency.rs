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

use crate::score::median;
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
    let steps: Vec<usize> = (0..length)
        .filter(|k| normalised.iter().all(|z| z[*k].is_finite()))
        .collect();
    let signals: Vec<Vec<f64>> = normalised
        .iter()
        .map(|z| steps.iter().map(|k| z[*k]).collect())
        .collect();
    if window == 0 || steps.len() < window {
        return None;
    }
    let freedom = effective_freedom(&signals, window);
    let bounds = chi_squared_bounds(freedom);
    let count = (signals.len() * window) as f64;
    let mut means: Vec<f64> = (0..steps.len() / window)
        .map(|w| {
            let part = w * window..(w + 1) * window;
            let squares = signals.iter().flat_map(|z| &z[part.clone()]);
            squares.map(|z| z * z).sum::<f64>() / count
        })
        .collect();
    let part = |test: &dyn Fn(f64) -> bool| {
        means.iter().filter(|mean| test(**mean)).count() as f64 / means.len() as f64
    };
    Some(Consistency {
        windows: means.len(),
        inside: part(&|mean| (bounds[0]..=bounds[1]).contains(&mean)),
        above: part(&|mean| mean > bounds[1]),
        freedom,
        bounds,
        mean: means.iter().sum::<f64>() / means.len() as f64,
        median: median(&mut means)?,
    })
}

/// n^2 / sum rho^2 over all pairs of a window.
fn effective_freedom(signals: &[Vec<f64>], window: usize) -> f64 {
    let power: Vec<f64> = signals
        .iter()
        .map(|z| z.iter().map(|z| z * z).sum::<f64>().max(f64::MIN_POSITIVE) / z.len() as f64)
        .collect();
    let mut sum = 0.0;
    for (i, first) in signals.iter().enumerate() {
        for (j, second) in signals.iter().enumerate() {
            for lag in 0..window {
                let pairs = first.len() - lag;
                let product: f64 = first[lag..].iter().zip(second).map(|(a, b)| a * b).sum();
                let correlation = product / pairs as f64 / (power[i] * power[j]).sqrt();
                let times = if lag == 0 { window } else { 2 * (window - lag) };
                sum += times as f64 * correlation * correlation;
            }
        }
    }
    let count = (signals.len() * window) as f64;
    count * count / sum
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
