//! Quantiles and tails of the normal, chi-squared and Student's t distributions, from `statrs`.
//!
//! They judge results and give intervals; no estimate of a drive depends on them. `statrs` calls
//! the elementary functions of the C library, so that a last bit can differ between processors.

use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Number of standard deviations on either side of the mean that hold 95 % of a normal
/// distribution, rounded to three digits.
pub(crate) const SIGMAS_95: f64 = 1.96;

/// Probability below which the upper end of a two-sided interval of 95 % lies.
const UPPER_95: f64 = 0.975;

/// Interval that holds a normally distributed quantity with 95 %.
pub(crate) fn interval_95(value: f64, sigma: f64) -> [f64; 2] {
    [value - SIGMAS_95 * sigma, value + SIGMAS_95 * sigma]
}

/// Width of the 95 % interval of Student's t distribution over that of the normal distribution: the
/// factor for a standard deviation that was estimated from `freedom` degrees of freedom. Infinite
/// without a degree of freedom.
pub(crate) fn student_over_normal(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(UPPER_95) / SIGMAS_95)
}

/// Bounds that hold the mean of `freedom` (at least one) independent squares of standard normal
/// numbers with 95 %: the quantiles of chi-squared over its degrees of freedom.
#[must_use]
pub fn chi_squared_bounds(freedom: f64) -> [f64; 2] {
    let freedom = freedom.max(1.0);
    ChiSquared::new(freedom).map_or([0.0, f64::INFINITY], |chi_squared| {
        [1.0 - UPPER_95, UPPER_95].map(|p| chi_squared.inverse_cdf(p) / freedom)
    })
}

/// Probability that a chi-squared variable exceeds `value`; NaN without a degree of freedom.
pub(crate) fn chi_squared_above(value: f64, freedom: f64) -> f64 {
    ChiSquared::new(freedom).map_or(f64::NAN, |chi_squared| chi_squared.sf(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_and_tails_are_the_tabulated_ones() {
        // Chi-squared of 100 degrees of freedom: 2.5 % below 74.222, above 129.561.
        let [low, high] = chi_squared_bounds(100.0);
        assert!((low - 0.742_22).abs() < 1e-5 && (high - 1.295_61).abs() < 1e-5);
        // One degree of freedom: 5.0239 is 2.2414 squared. Fewer are taken for one.
        assert!((chi_squared_bounds(1.0)[1] - 5.023_9).abs() < 1e-4);
        assert_eq!(chi_squared_bounds(0.2), chi_squared_bounds(1.0));
        // 5 % above 31.410 with 20 degrees of freedom, above 11.070 with 5.
        assert!((chi_squared_above(31.410, 20.0) - 0.05).abs() < 1e-5);
        assert!((chi_squared_above(11.070, 5.0) - 0.05).abs() < 1e-5);
        assert!(chi_squared_above(1.0, 0.0).is_nan());
    }

    #[test]
    fn students_t_is_the_tabulated_one_and_becomes_normal() {
        for (freedom, t) in [(1.0, 12.706), (2.0, 4.303), (5.0, 2.571), (30.0, 2.042)] {
            assert!(
                (student_over_normal(freedom) * SIGMAS_95 - t).abs() < 1e-3,
                "{freedom}"
            );
        }
        assert_eq!(student_over_normal(0.0), f64::INFINITY);
        for freedom in [1e3, 1e4, 1e5, 1e6] {
            // Expansion in 1/freedom (Abramowitz and Stegun 1964, equation 26.7.5).
            let expected = 1.0 + 1.21 / freedom;
            let found = student_over_normal(freedom);
            assert!((found - expected).abs() < 2e-4, "{freedom} {found}");
        }
    }

    #[test]
    fn bounds_of_many_numbers_close_in_as_the_normal_distribution_has_it() {
        for exponent in 4..8 {
            let freedom = 10_f64.powi(exponent);
            let spread = SIGMAS_95 * (2.0 / freedom).sqrt();
            let [low, high] = chi_squared_bounds(freedom);
            assert!(
                (low - (1.0 - spread)).abs() < 0.02 * spread,
                "{freedom} {low}"
            );
            assert!(
                (high - (1.0 + spread)).abs() < 0.02 * spread,
                "{freedom} {high}"
            );
        }
    }
}
