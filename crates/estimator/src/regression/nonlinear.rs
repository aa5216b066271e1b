//! Nonlinear least squares by Levenberg and Marquardt.

use nalgebra::{DMatrix, DVector};

use super::{CONDITION_MAX, Fit, Gram, check, singular, symmetric, wandering, whiteness};
use crate::finding::Refusal;

/// Step of the coefficients, parts of their size, at which a fit is at rest.
const AT_REST: f64 = 1e-9;
/// Part by which the sum of squares falls at least while a fit is not at rest.
const FALL_MIN: f64 = 1e-12;

/// Options of a nonlinear fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Nonlinear {
    /// Where to begin.
    pub start: Vec<f64>,
    /// Size of each coefficient: steps of the difference quotients are 1e-5 of it.
    pub scale: Vec<f64>,
    /// Iterations at most.
    pub iterations: usize,
}

/// Minimises the sum of the squares of what `residuals` gives (response less model, one a row, the
/// same number for any coefficients). The design of the [`Fit`] is the model's derivative at the
/// minimum.
///
/// # Errors
/// As [`least_squares`](super::least_squares); a fit that does not come to rest.
pub fn nonlinear(
    problem: &Nonlinear,
    residuals: impl Fn(&[f64]) -> Vec<f64>,
) -> Result<Fit, Refusal> {
    let mut theta = problem.start.clone();
    let mut residual = DVector::from_vec(residuals(&theta));
    let mut damping = 1e-3;
    let mut at_rest = false;
    for _ in 0..problem.iterations {
        let design = derivative(problem, &theta, &residuals, residual.len());
        check(&design, &residual, None)?;
        let gram = design.transpose() * &design;
        let pull = design.transpose() * &residual;
        let mut better = None;
        while better.is_none() && damping < 1e12 {
            let mut damped = gram.clone();
            for j in 0..theta.len() {
                damped[(j, j)] += damping * gram[(j, j)].max(f64::MIN_POSITIVE);
            }
            let step = damped
                .lu()
                .solve(&pull)
                .ok_or_else(|| singular(f64::INFINITY))?;
            let next: Vec<f64> = theta.iter().zip(step.iter()).map(|(t, s)| t + s).collect();
            let next_residual = DVector::from_vec(residuals(&next));
            let falls = next_residual.norm_squared() <= residual.norm_squared();
            if falls {
                better = Some((next, next_residual, step));
                damping = (damping * 0.2).max(1e-12);
            } else {
                damping *= 5.0;
            }
        }
        let Some((next, next_residual, step)) = better else {
            // No step lowers the sum any further.
            at_rest = true;
            break;
        };
        let small = step
            .iter()
            .zip(&problem.scale)
            .all(|(step, scale)| step.abs() < AT_REST * scale);
        let fall = residual.norm_squared() - next_residual.norm_squared();
        let flat = fall <= FALL_MIN * residual.norm_squared();
        (theta, residual) = (next, next_residual);
        if small || flat {
            at_rest = true;
            break;
        }
    }
    if !at_rest {
        return Err(Refusal::NotConverged {
            what: "regression".to_owned(),
            iterations: problem.iterations,
            help: "begin nearer, or fix one of the parameters".to_owned(),
        });
    }
    let design = derivative(problem, &theta, &residuals, residual.len());
    finish(theta, &design, &residual)
}

fn derivative(
    problem: &Nonlinear,
    theta: &[f64],
    residuals: &impl Fn(&[f64]) -> Vec<f64>,
    rows: usize,
) -> DMatrix<f64> {
    let mut design = DMatrix::zeros(rows, theta.len());
    for j in 0..theta.len() {
        let step = 1e-5 * problem.scale[j];
        let at = |side: f64| {
            let mut moved = theta.to_vec();
            moved[j] += side * step;
            residuals(&moved)
        };
        let (low, high) = (at(-1.0), at(1.0));
        for i in 0..rows {
            design[(i, j)] = (low[i] - high[i]) / (2.0 * step);
        }
    }
    design
}

fn finish(
    coefficients: Vec<f64>,
    design: &DMatrix<f64>,
    residual: &DVector<f64>,
) -> Result<Fit, Refusal> {
    let (rows, columns) = design.shape();
    let gram = Gram::new(design, residual, None);
    let condition = gram.condition();
    if condition > CONDITION_MAX {
        return Err(singular(condition));
    }
    let inverse = gram.inverse(condition)?;
    let scores = DMatrix::from_fn(rows, columns, |i, j| design[(i, j)] * residual[i]);
    let free = (rows - columns) as f64;
    let influence = scores * &inverse;
    let leverage = design * &inverse;
    let residuals: Vec<f64> = residual.iter().copied().collect();
    Ok(Fit {
        coefficients,
        covariance: symmetric(&wandering(&[(&leverage, residual.as_slice())])),
        covariance_white: symmetric(&(&inverse * (residual.norm_squared() / free))),
        whiteness: whiteness(&residuals),
        residuals,
        influence,
        leverage,
        condition,
        excitation: (0..columns)
            .map(|j| (inverse[(j, j)] * rows as f64).sqrt().recip())
            .collect(),
    })
}
