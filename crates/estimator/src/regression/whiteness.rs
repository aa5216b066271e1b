//! Are residuals white?

use crate::finding::Whiteness;
use crate::statistics::chi_squared_above;

/// Durbin-Watson's statistic and Ljung and Box's test over min(20, n/5) lags.
///
/// DW = sum (e_t - e_(t-1))^2 / sum e_t^2; Q = n (n+2) sum_k r_k^2/(n-k), which is chi-squared
/// distributed with as many degrees of freedom as lags for white residuals (Ljung and Box 1978).
/// The fitted parameters are not subtracted from the degrees of freedom: they are few beside the
/// lags.
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
        ljung_box_p: chi_squared_above(q, lags as f64),
        lags,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_said_of_nothing() {
        assert!(whiteness(&[]).durbin_watson.is_nan());
        assert!(whiteness(&[0.0; 40]).ljung_box_p.is_nan());
    }
}
