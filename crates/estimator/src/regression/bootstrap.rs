//! Seeded block bootstrap.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::statistics::{SIGMAS_95, student_over_normal};

/// A circular moving-block bootstrap (Politis and Romano 1992): rows are drawn in blocks, so that
/// their correlation stays what it is. The same seed gives the same interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bootstrap {
    /// Repetitions.
    pub repetitions: usize,
    /// Rows of a block; see [`block_length`].
    pub block: usize,
    /// Seed.
    pub seed: u64,
}

impl Bootstrap {
    /// 400 repetitions with blocks as the influences of a fit ask for.
    #[must_use]
    pub fn for_influence(influence: &DMatrix<f64>, seed: u64) -> Self {
        Self {
            repetitions: 400,
            block: block_length(influence),
            seed,
        }
    }

    /// The interval of each parameter that holds 95 % of the repetitions, widened by the ratio of
    /// Student's t distribution to the normal one, with as many degrees of freedom as there are
    /// blocks: the spread of a few blocks is uncertain. `estimate` gets row numbers, as many as
    /// `rows` and some of them repeated, and returns the parameters; repetitions that it cannot
    /// estimate are left out. `None` if more than one in ten are.
    #[must_use]
    pub fn intervals(
        &self,
        rows: usize,
        mut estimate: impl FnMut(&[usize]) -> Option<Vec<f64>>,
    ) -> Option<Vec<[f64; 2]>> {
        if rows == 0 {
            return None;
        }
        let block = self.block.clamp(1, rows);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut drawn = Vec::with_capacity(rows + block);
        let mut found: Vec<Vec<f64>> = Vec::with_capacity(self.repetitions);
        for _ in 0..self.repetitions {
            drawn.clear();
            while drawn.len() < rows {
                let start = random.random_range(0..rows);
                drawn.extend((start..start + block).map(|row| row % rows));
            }
            drawn.truncate(rows);
            found.extend(
                estimate(&drawn).filter(|values| values.iter().all(|value| value.is_finite())),
            );
        }
        if found.len() * 10 < self.repetitions * 9 {
            return None;
        }
        let parameters = found.first()?.len();
        let widen = student_over_normal(rows as f64 / block as f64);
        Some(
            (0..parameters)
                .map(|j| interval(&found, j, widen))
                .collect(),
        )
    }
}

/// Bootstrap intervals of functions of coefficients, without fitting again: a repetition moves the
/// coefficients by the sum of the drawn rows' influences (the estimating-function bootstrap of Hu
/// and Kalbfleisch 2000), so that a thousand rows cost no more than a sum.
///
/// Blocks cut correlation that is slower than they are, and know no doubt that is common to all rows:
/// the interval is brought to the width that the deviation of `covariance` gives. Its shape is the
/// bootstrap's.
#[must_use]
pub fn intervals_by_influence(
    influence: &DMatrix<f64>,
    coefficients: &[f64],
    covariance: &DMatrix<f64>,
    seed: u64,
    parameters: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<Vec<[f64; 2]>> {
    let by_row = influence.transpose();
    let intervals =
        Bootstrap::for_influence(influence, seed).intervals(influence.nrows(), |drawn| {
            let mut moved = coefficients.to_vec();
            for &row in drawn {
                for (value, step) in moved.iter_mut().zip(by_row.column(row).iter()) {
                    *value += step;
                }
            }
            Some(parameters(&moved))
        })?;
    let middle = parameters(coefficients);
    let slopes: Vec<Vec<f64>> = (0..coefficients.len())
        .map(|j| {
            let step = 1e-3 * covariance[(j, j)].max(0.0).sqrt();
            let mut moved = coefficients.to_vec();
            moved[j] += step;
            let next = parameters(&moved);
            let slope = |(next, middle): (&f64, &f64)| {
                if step > 0.0 {
                    (next - middle) / step
                } else {
                    0.0
                }
            };
            next.iter().zip(&middle).map(slope).collect()
        })
        .collect();
    let stretched = intervals.into_iter().enumerate().map(|(p, [low, high])| {
        let gradient = DVector::from_fn(slopes.len(), |j, _| slopes[j][p]);
        let sigma = (gradient.transpose() * covariance * &gradient)[(0, 0)]
            .max(0.0)
            .sqrt();
        let stretch = 2.0 * SIGMAS_95 * sigma / (high - low);
        if stretch.is_finite() {
            [low, high].map(|end| middle[p] + stretch * (end - middle[p]))
        } else {
            [low, high]
        }
    });
    Some(stretched.collect())
}

/// The middle 95 % of the repetitions, each side `widen` times as far from the median.
fn interval(found: &[Vec<f64>], parameter: usize, widen: f64) -> [f64; 2] {
    let mut values: Vec<f64> = found.iter().map(|values| values[parameter]).collect();
    values.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let place = part * (values.len() - 1) as f64;
        let (low, high) = (place.floor() as usize, place.ceil() as usize);
        values[low] + (values[high] - values[low]) * (place - low as f64)
    };
    let median = at(0.5);
    [0.025, 0.975].map(|part| median + widen * (at(part) - median))
}

/// Length of a block: half as long again as (6 b^2)^(1/3) n^(1/3) with b = rho/(1 - rho^2) of the most correlated
/// column (Politis and White 2004 for a first-order autoregression), at least n^(1/3), at most n/6.
/// Half as long again, because their length is best for the variance's mean square error and leaves
/// intervals too narrow by a tenth.
#[must_use]
pub fn block_length(influence: &DMatrix<f64>) -> usize {
    let (rows, columns) = influence.shape();
    let correlation = |j: usize| {
        let values = influence.column(j);
        let cross: f64 = (1..rows).map(|i| values[i] * values[i - 1]).sum();
        let square: f64 = values.iter().map(|value| value * value).sum();
        if square > 0.0 { cross / square } else { 0.0 }
    };
    let rho = (0..columns).map(correlation).fold(0.0, f64::max).min(0.999);
    let ratio = rho / (1.0 - rho * rho);
    let length = (1.5 * math::cbrt(6.0 * ratio * ratio)).max(1.0) * math::cbrt(rows as f64);
    (length.ceil() as usize).clamp(1, (rows / 6).max(1))
}
