//! Standard deviations of the parameters.
//!
//! Innovations of a model that is not quite right are correlated over time, and their correlation
//! depends on what the vehicle does. The covariance of the parameters is that of a fit with correlated
//! errors,
//!
//! ```text
//! C = H^-1 (S + P) H^-1
//! ```
//!
//! with H the information of the fit, S the covariance of the sum of the scores (derivative times
//! residual of each row), and P what the vehicle file adds. S is the larger of two estimates for each
//! parameter: a prewhitened kernel estimate (`long_run`), and that of blocks of time, each of which is
//! a drive of its own (a delete-a-block jackknife, linearised; Shao and Tu, The Jackknife and Bootstrap,
//! 1995, section 9.2). The second one contains what the model neglects in one manoeuvre and not in
//! another.

use nalgebra::{DMatrix, DVector};

use super::{LOGARITHMIC, PARAMETERS, PRIOR_ROWS, SEARCHED, Theta, prior_sigma};
use crate::planar::PlanarInput;
use crate::regression::long_run;
use crate::statistics::student_over_normal;

/// Length of a block of time, s, and the fewest and most blocks.
const BLOCK_S: f64 = 15.0;
const BLOCKS: [usize; 2] = [6, 60];

/// Deviations of the parameters that were searched for.
pub(super) struct Deviations {
    /// In their own units.
    pub sigma: [f64; SEARCHED],
    /// Part that the drive told.
    pub told: [f64; SEARCHED],
}

/// The deviations of a fit, from its residuals and their derivatives.
pub(super) fn of(
    theta: &Theta,
    residual: &DVector<f64>,
    slopes: &DMatrix<f64>,
    inputs: &[PlanarInput],
) -> Deviations {
    let information = slopes.transpose() * slopes;
    let Some(inverse) = information.try_inverse() else {
        return Deviations {
            sigma: [f64::NAN; SEARCHED],
            told: [0.0; SEARCHED],
        };
    };
    // Of each instant, the residuals of yaw rate and lateral acceleration.
    let scores = DMatrix::from_fn(inputs.len(), SEARCHED, |row, j| {
        [2 * row, 2 * row + 1]
            .into_iter()
            .map(|i| slopes[(i, j)] * residual[i])
            .sum()
    });
    let prior = DMatrix::from_fn(SEARCHED, SEARCHED, |i, j| {
        let one = PRIOR_ROWS / prior_sigma(i);
        if i == j { one * one } else { 0.0 }
    });
    let rows = inputs.len() as f64;
    let kernel = long_run(&scores) * (rows * rows);
    let (blocks, widen) = of_blocks(&scores, inputs);
    let variance = |sum: &DMatrix<f64>, j: usize| {
        let covariance = &inverse * (sum + &prior) * &inverse;
        covariance[(j, j)].max(0.0)
    };
    let value = |j: usize| {
        if j < PARAMETERS && LOGARITHMIC[j] {
            math::exp(theta[j])
        } else {
            1.0
        }
    };
    Deviations {
        sigma: std::array::from_fn(|j| {
            let by_blocks = widen * widen * variance(&blocks, j);
            value(j) * variance(&kernel, j).max(by_blocks).sqrt()
        }),
        told: std::array::from_fn(|j| {
            let alone = prior_sigma(j) * prior_sigma(j) / PRIOR_ROWS;
            (1.0 - inverse[(j, j)].max(0.0) / alone).clamp(0.0, 1.0)
        }),
    }
}

/// Covariance of the sum of the scores from blocks of time, and the factor of a deviation that is known
/// from so many blocks.
fn of_blocks(scores: &DMatrix<f64>, inputs: &[PlanarInput]) -> (DMatrix<f64>, f64) {
    let span_s = inputs
        .last()
        .map_or(0.0, |last| last.time_s - inputs[0].time_s);
    let count = ((span_s / BLOCK_S) as usize).clamp(BLOCKS[0], BLOCKS[1]);
    let rows = scores.nrows();
    let sums: Vec<DVector<f64>> = (0..count)
        .map(|block| {
            let (from, to) = (block * rows / count, (block + 1) * rows / count);
            DVector::from_fn(SEARCHED, |j, _| {
                scores.view((from, j), (to - from, 1)).sum()
            })
        })
        .collect();
    let mean = sums.iter().sum::<DVector<f64>>() / count as f64;
    let mut covariance = DMatrix::zeros(SEARCHED, SEARCHED);
    for sum in &sums {
        let apart = sum - &mean;
        covariance += &apart * apart.transpose();
    }
    let freedom = (count - 1) as f64;
    (
        covariance * (count as f64 / freedom),
        student_over_normal(freedom),
    )
}
