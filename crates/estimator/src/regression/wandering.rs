//! Covariance of estimates whose residuals wander.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::long_run::autoregression;
use crate::statistics::{SIGMAS_95, student_over_normal};

/// Drawn repetitions that tell how far deviations fall short, and their seed.
const REPETITIONS: usize = 100;
const SEED: u64 = 1;
/// Part of the drawn errors that the widened deviations hold.
const HELD: f64 = 0.95;

/// Covariance of estimates that are sums of leverage times residual; several fits of the same rows
/// are joined, each given by its leverage (a column a coefficient) and its residuals.
///
/// Each fit's residuals follow an autoregression, of the order that Schwarz's criterion asks for;
/// with the innovations' covariances s_fg, the covariance of coefficients of the fits f and g is
/// s_fg y_f^T y_g, y solving the transposed autoregression for the leverage (generalised least
/// squares' algebra read backwards). Where the regressors swing at a frequency of their own this is
/// much surer than a sum over the scores' correlations, whose spectrum the regressors fold.
///
/// A fit takes from its residuals what they have of the regressors' own frequency, so that they
/// wander less than the errors did. By how much the deviations fall short is seen on errors that are
/// drawn from the autoregression, fitted, and judged in the same way (a parametric bootstrap of the
/// studentised error, Efron and Tibshirani 1993, section 12.5): they are widened until 1.96 of them
/// hold 95 % of the drawn errors.
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
            let pairs = tail(left, count).iter().zip(tail(right, count));
            let cross = pairs.map(|(a, b)| a * b).sum::<f64>() / count.max(1) as f64;
            let block =
                left.passed.transpose() * &right.passed * (cross * left.widen * right.widen);
            all.view_mut((row, column), block.shape()).copy_from(&block);
            column += right.passed.ncols();
        }
        row += left.passed.ncols();
    }
    all
}

/// The last innovations.
fn tail(part: &Part, count: usize) -> &[f64] {
    &part.innovations[part.innovations.len() - count..]
}

struct Part {
    /// Leverage after the transposed autoregression.
    passed: DMatrix<f64>,
    innovations: Vec<f64>,
    widen: f64,
}

impl Part {
    fn new(leverage: &DMatrix<f64>, residuals: &[f64]) -> Self {
        let phi = autoregression(residuals);
        let innovations = innovations(&phi, residuals);
        let widen = if phi.is_empty() {
            student(residuals.len(), leverage.ncols())
        } else {
            shortfall(leverage, &phi).max(1.0)
        };
        Self {
            passed: passed(leverage, &phi),
            innovations,
            widen,
        }
    }
}

/// What the autoregression does not foretell.
fn innovations(phi: &[f64], residuals: &[f64]) -> Vec<f64> {
    (phi.len()..residuals.len())
        .map(|row| residuals[row] - foretold(phi, &residuals[..row]))
        .collect()
}

/// What an autoregression expects after these values.
fn foretold(phi: &[f64], before: &[f64]) -> f64 {
    phi.iter()
        .zip(before.iter().rev())
        .map(|(phi, v)| phi * v)
        .sum()
}

/// The leverage after the transposed autoregression.
fn passed(leverage: &DMatrix<f64>, phi: &[f64]) -> DMatrix<f64> {
    let (rows, columns) = leverage.shape();
    let mut passed = leverage.clone();
    for j in 0..columns {
        for row in (0..rows).rev() {
            let later = phi.iter().zip(row + 1..rows);
            passed[(row, j)] += later.map(|(phi, row)| phi * passed[(row, j)]).sum::<f64>();
        }
    }
    passed
}

/// Factor for a standard deviation of `rows` residuals from which `columns` coefficients were
/// fitted: the residuals' own shortfall and Student's t distribution.
fn student(rows: usize, columns: usize) -> f64 {
    let freedom = (rows as f64 - columns as f64).max(3.0);
    (rows as f64 / freedom).sqrt() * student_over_normal(freedom)
}

/// By how much deviations that are estimated from a fit's residuals have to grow, on average over
/// the coefficients.
fn shortfall(leverage: &DMatrix<f64>, phi: &[f64]) -> f64 {
    let (rows, columns) = leverage.shape();
    let Some(square) = (leverage.transpose() * leverage).try_inverse() else {
        return 1.0;
    };
    let design = leverage * square;
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut studentised = vec![Vec::with_capacity(REPETITIONS); columns];
    for _ in 0..REPETITIONS {
        let errors = nalgebra::DVector::from_vec(drawn(phi, rows, &mut random));
        let moved = leverage.transpose() * &errors;
        let residuals = &errors - &design * &moved;
        let phi = autoregression(residuals.as_slice());
        let innovations = innovations(&phi, residuals.as_slice());
        let size = mean_square(&innovations);
        let passed = passed(leverage, &phi);
        for (j, studentised) in studentised.iter_mut().enumerate() {
            let sigma = (size * passed.column(j).norm_squared()).sqrt();
            studentised.push((moved[j] / sigma.max(f64::MIN_POSITIVE)).abs());
        }
    }
    let held = studentised.into_iter().map(|mut values| {
        values.sort_by(f64::total_cmp);
        values[(HELD * REPETITIONS as f64) as usize] / SIGMAS_95
    });
    held.sum::<f64>() / columns as f64
}

/// An autoregression's values, of unit innovations, once its start is forgotten.
fn drawn(phi: &[f64], rows: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut values: Vec<f64> = Vec::with_capacity(2 * rows);
    for _ in 0..2 * rows {
        values.push(foretold(phi, &values) + normal(random));
    }
    values.split_off(rows)
}

/// A normal number (Box and Muller 1958).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let [size, turn]: [f64; 2] = std::array::from_fn(|_| random.random());
    (-2.0 * math::ln(1.0 - size)).sqrt() * math::cos(std::f64::consts::TAU * turn)
}

fn mean_square(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64
}
