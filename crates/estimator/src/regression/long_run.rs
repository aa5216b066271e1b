//! Covariance of a mean whose terms are correlated in time.

use nalgebra::DMatrix;

/// Greatest sum of an autoregression's coefficients that prewhitening takes out; beyond, the data
/// are one trend.
const PREWHITEN_MAX: f64 = 0.97;
/// Greatest order of an autoregression.
const ORDER_MAX: usize = 10;

/// Covariance of the mean of the rows of `scores`, whose expectation is zero: a prewhitened kernel
/// estimate (Andrews and Monahan 1992).
///
/// Each column's autoregression, of the order that Schwarz's criterion asks for, is taken out (den
/// Haan and Levin 1997), the rest summed over its autocovariances with Bartlett's weights (Newey
/// and West 1987) up to the bandwidth 1.1447 (alpha n)^(1/3) (Andrews 1991), and the autoregression
/// put back. Bartlett's weights keep the result positive semidefinite; prewhitening spares it the
/// shortfall that a plain sum has where residuals wander slowly.
#[must_use]
pub fn long_run(scores: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = scores.shape();
    if rows < 3 {
        return scores.transpose() * scores / (rows.max(1) as f64).powi(2);
    }
    let phi: Vec<Vec<f64>> = (0..columns)
        .map(|j| autoregression(&scores.column(j).iter().copied().collect::<Vec<_>>()))
        .collect();
    let start = phi.iter().map(Vec::len).max().unwrap_or(0);
    let white = DMatrix::from_fn(rows - start, columns, |i, j| {
        let row = i + start;
        let expected: f64 = phi[j]
            .iter()
            .enumerate()
            .map(|(lag, phi)| phi * scores[(row - 1 - lag, j)])
            .sum();
        scores[(row, j)] - expected
    });
    let bandwidth = bandwidth(&white).min((white.nrows() / 3) as f64);
    let mut sum = white.transpose() * &white;
    for lag in 1..=bandwidth as usize {
        let weight = 1.0 - lag as f64 / (bandwidth + 1.0);
        let length = white.nrows() - lag;
        let cross = white.rows(lag, length).transpose() * white.rows(0, length);
        sum += (&cross + cross.transpose()) * weight;
    }
    let left = |j: usize| 1.0 - phi[j].iter().sum::<f64>().min(PREWHITEN_MAX);
    DMatrix::from_fn(columns, columns, |i, j| {
        sum[(i, j)] / (left(i) * left(j)) / (white.nrows() as f64 * rows as f64)
    })
}

/// Coefficients of an autoregression by Levinson and Durbin, its order by Schwarz's
/// criterion.
pub(super) fn autoregression(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let most = ORDER_MAX.min(n / 20);
    let covariance: Vec<f64> = (0..=most)
        .map(|lag| {
            let pairs = values.iter().zip(&values[lag..]);
            pairs.map(|(a, b)| a * b).sum::<f64>() / n as f64
        })
        .collect();
    if covariance[0] <= 0.0 {
        return Vec::new();
    }
    let mut variance = covariance[0];
    let mut phi: Vec<f64> = Vec::new();
    let mut best = (n as f64 * math::ln(variance), Vec::new());
    for order in 1..=most {
        let explained: f64 = phi
            .iter()
            .enumerate()
            .map(|(k, phi)| phi * covariance[order - 1 - k])
            .sum();
        let reflection = (covariance[order] - explained) / variance;
        let mut next: Vec<f64> = (0..order - 1)
            .map(|k| phi[k] - reflection * phi[order - 2 - k])
            .collect();
        next.push(reflection);
        phi = next;
        variance *= 1.0 - reflection * reflection;
        if variance <= 0.0 {
            break;
        }
        let criterion = n as f64 * math::ln(variance) + order as f64 * math::ln(n as f64);
        if criterion < best.0 {
            best = (criterion, phi.clone());
        }
    }
    best.1
}

/// First-order autoregression coefficient of a column.
fn first_order(scores: &DMatrix<f64>, column: usize) -> f64 {
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
        let rho = first_order(scores, j).clamp(-PREWHITEN_MAX, PREWHITEN_MAX);
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
        1.1447 * math::cbrt(above / below * rows as f64)
    } else {
        0.0
    }
}
