//! Covariance of a mean whose terms are correlated in time.

use nalgebra::DMatrix;

/// Greatest first-order correlation that prewhitening takes out; beyond, the data are one trend.
const PREWHITEN_MAX: f64 = 0.97;

/// Covariance of the mean of the rows of `scores`, whose expectation is zero: a prewhitened kernel
/// estimate (Andrews and Monahan 1992).
///
/// Each column's first-order autoregression is taken out, the rest summed over its
/// autocovariances with Bartlett's weights (Newey and West 1987) up to the bandwidth
/// 1.1447 (alpha n)^(1/3) (Andrews 1991), and the autoregression put back. Bartlett's weights keep
/// the result positive semidefinite; prewhitening spares it the shortfall that a plain sum has
/// where residuals wander slowly.
#[must_use]
pub fn long_run(scores: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = scores.shape();
    if rows < 3 {
        return scores.transpose() * scores / (rows.max(1) as f64).powi(2);
    }
    let rho: Vec<f64> = (0..columns)
        .map(|j| autoregression(scores, j).clamp(-PREWHITEN_MAX, PREWHITEN_MAX))
        .collect();
    let white = DMatrix::from_fn(rows - 1, columns, |i, j| {
        scores[(i + 1, j)] - rho[j] * scores[(i, j)]
    });
    let bandwidth = bandwidth(&white).min((rows / 3) as f64);
    let mut sum = white.transpose() * &white;
    for lag in 1..=bandwidth as usize {
        let weight = 1.0 - lag as f64 / (bandwidth + 1.0);
        let length = white.nrows() - lag;
        let cross = white.rows(lag, length).transpose() * white.rows(0, length);
        sum += (&cross + cross.transpose()) * weight;
    }
    DMatrix::from_fn(columns, columns, |i, j| {
        sum[(i, j)] / ((1.0 - rho[i]) * (1.0 - rho[j])) / ((rows - 1) as f64 * rows as f64)
    })
}

/// First-order autoregression coefficient of a column.
fn autoregression(scores: &DMatrix<f64>, column: usize) -> f64 {
    let values = scores.column(column);
    let n = values.len();
    let cross: f64 = (1..n).map(|i| values[i] * values[i - 1]).sum();
    let square: f64 = (0..n - 1).map(|i| values[i].powi(2)).sum();
    if square > 0.0 { cross / square } else { 0.0 }
}

/// Andrews' bandwidth for Bartlett's weights, from first-order autoregressions of the columns.
fn bandwidth(scores: &DMatrix<f64>) -> f64 {
    let (rows, columns) = scores.shape();
    let (mut above, mut below) = (0.0, 0.0);
    for j in 0..columns {
        let rho = autoregression(scores, j).clamp(-PREWHITEN_MAX, PREWHITEN_MAX);
        let values = scores.column(j);
        let innovation: f64 = (1..rows)
            .map(|i| (values[i] - rho * values[i - 1]).powi(2))
            .sum::<f64>()
            / rows as f64;
        let square = innovation.powi(2);
        above += 4.0 * rho * rho * square / ((1.0 - rho).powi(6) * (1.0 + rho).powi(2));
        below += square / (1.0 - rho).powi(4);
    }
    if below > 0.0 {
        1.1447 * (above / below * rows as f64).cbrt()
    } else {
        0.0
    }
}
