//! Are residuals white?

use crate::finding::Whiteness;

/// Durbin-Watson's statistic and Ljung and Box's test over min(20, n/5) lags.
///
/// DW = sum (e_t - e_(t-1))^2 / sum e_t^2; Q = n (n+2) sum_k r_k^2/(n-k), which is chi-square
/// distributed with as many degrees of freedom as lags for white residuals (Ljung and Box 1978).
/// The parameters that were fitted are not counted against the degrees of freedom: there are few
/// of them beside the lags. The distribution is taken by Wilson and Hilferty's cube root.
#[must_use]
pub fn whiteness(residuals: &[f64]) -> Whiteness {
    let n = residuals.len();
    let mean = residuals.iter().sum::<f64>() / n.max(1) as f64;
    let square: f64 = residuals.iter().map(|e| (e - mean).powi(2)).sum();
    let step: f64 = residuals.windows(2).map(|e| (e[1] - e[0]).powi(2)).sum();
    let lags = (n / 5).min(20);
    if lags == 0 || square <= 0.0 {
        return Whiteness {
            durbin_watson: f64::NAN,
            ljung_box_p: f64::NAN,
            lags,
        };
    }
    let correlation = |lag: usize| -> f64 {
        let pairs = residuals.iter().zip(&residuals[lag..]);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / square
    };
    let size = n as f64;
    let q: f64 = (1..=lags)
        .map(|lag| correlation(lag).powi(2) / (size - lag as f64))
        .sum::<f64>()
        * size
        * (size + 2.0);
    Whiteness {
        durbin_watson: step / square,
        ljung_box_p: chi_square_above(q, lags as f64),
        lags,
    }
}

/// Probability that a chi-square variable exceeds `value` (Wilson and Hilferty 1931).
fn chi_square_above(value: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    let z = (math::cbrt(value / freedom) - (1.0 - spread)) / spread.sqrt();
    normal_above(z)
}

/// Probability that a standard normal variable exceeds `z`, to 1e-7 (Abramowitz and Stegun 26.2.17).
fn normal_above(z: f64) -> f64 {
    const B: [f64; 5] = [
        0.319_381_530,
        -0.356_563_782,
        1.781_477_937,
        -1.821_255_978,
        1.330_274_429,
    ];
    let t = (1.0 + 0.231_641_9 * z.abs()).recip();
    let sum = B.iter().rev().fold(0.0, |sum, b| (sum + b) * t);
    let tail = math::exp(-0.5 * z * z) / (std::f64::consts::TAU).sqrt() * sum;
    if z < 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_meets_tabulated_quantiles() {
        // Chi-square: 5 % above 31.410 with 20 degrees of freedom, above 11.070 with 5.
        assert!((chi_square_above(31.410, 20.0) - 0.05).abs() < 1e-3);
        assert!((chi_square_above(11.070, 5.0) - 0.05).abs() < 2e-3);
        assert!((normal_above(1.959_964) - 0.025).abs() < 1e-6);
        assert!((normal_above(-1.0) - 0.841_344_7).abs() < 1e-6);
    }

    #[test]
    fn nothing_is_said_of_nothing() {
        assert!(whiteness(&[]).durbin_watson.is_nan());
        assert!(whiteness(&[0.0; 40]).ljung_box_p.is_nan());
    }
}
