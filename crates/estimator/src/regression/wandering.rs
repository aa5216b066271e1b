//! Covariance of estimates whose residuals wander.

use nalgebra::DMatrix;

use super::long_run::autoregression;

/// Covariance of estimates that are sums of leverage times residual; several fits of the same rows
/// are joined, each given by its leverage (a column a coefficient) and its residuals.
///
/// Each fit's residuals follow an autoregression, of the order that Schwarz's criterion asks for;
/// with the innovations' covariances s_fg, the covariance of coefficients of the fits f and g is
/// s_fg y_f^T y_g, y solving the transposed autoregression for the leverage (generalised least
/// squares' algebra read backwards). Where the regressors swing at a frequency of their own this is
/// much surer than a sum over the scores' correlations, whose spectrum the regressors fold. The
/// deviations are widened as Student's t is wider than a normal distribution for as many degrees of
/// freedom as there are independent residuals less coefficients.
#[must_use]
pub fn wandering(fits: &[(&DMatrix<f64>, &[f64])]) -> DMatrix<f64> {
    let parts: Vec<Part> = fits
        .iter()
        .map(|(leverage, residuals)| Part::new(leverage, residuals))
        .collect();
    let size = parts.iter().map(|part| part.passed.ncols()).sum();
    let mut all = DMatrix::zeros(size, size);
    let mut row = 0;
    for left in &parts {
        let mut column = 0;
        for right in &parts {
            let count = left.innovations.len().min(right.innovations.len());
            let tail = |part: &Part| part.innovations[part.innovations.len() - count..].to_vec();
            let cross: f64 = tail(left)
                .iter()
                .zip(tail(right))
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / count.max(1) as f64;
            let block =
                left.passed.transpose() * &right.passed * (cross * left.widen * right.widen);
            all.view_mut((row, column), block.shape()).copy_from(&block);
            column += right.passed.ncols();
        }
        row += left.passed.ncols();
    }
    all
}

struct Part {
    /// Leverage after the transposed autoregression.
    passed: DMatrix<f64>,
    innovations: Vec<f64>,
    widen: f64,
}

impl Part {
    fn new(leverage: &DMatrix<f64>, residuals: &[f64]) -> Self {
        let (rows, columns) = leverage.shape();
        let phi = autoregression(residuals);
        let innovations: Vec<f64> = (phi.len()..rows)
            .map(|row| {
                let expected: f64 = phi
                    .iter()
                    .enumerate()
                    .map(|(lag, phi)| phi * residuals[row - 1 - lag])
                    .sum();
                residuals[row] - expected
            })
            .collect();
        let mut passed = leverage.clone();
        for row in (0..rows).rev() {
            for (lag, phi) in phi.iter().enumerate() {
                if row + 1 + lag < rows {
                    for j in 0..columns {
                        passed[(row, j)] += phi * passed[(row + 1 + lag, j)];
                    }
                }
            }
        }
        // Of `rows` residuals so many are independent: their variance over that of their mean.
        let mean_square =
            |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64;
        let slow = mean_square(&innovations) / (1.0 - phi.iter().sum::<f64>().min(0.99)).powi(2);
        let fast = mean_square(residuals).max(f64::MIN_POSITIVE);
        let independent = rows as f64 / (slow / fast).max(1.0);
        let freedom = (independent - columns as f64).max(3.0);
        let widen = (independent.max(freedom) / freedom).sqrt() * (1.0 + 1.21 / freedom);
        Self {
            passed,
            innovations,
            widen,
        }
    }
}
