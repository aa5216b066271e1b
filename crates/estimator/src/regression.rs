//! Least squares that say how sure they are: ordinary, weighted, total and nonlinear.
//!
//! All solve estimating equations sum_i psi_i(theta) = 0. Where only the response has errors, the
//! covariance is that of residuals that wander ([`wandering`]); total least squares takes it from the
//! sandwich B^-1 S B^-1 with the bread B = -d(sum psi)/d(theta) and S the long-run covariance of
//! the scores psi ([`long_run`]), so that it holds for residuals that are correlated in time or uneven
//! in size. Rows are instants in order of time.

mod bootstrap;
mod long_run;
mod nonlinear;
mod wandering;
mod whiteness;

pub use bootstrap::{Bootstrap, block_length, intervals_by_influence};
pub use long_run::long_run;
pub use nonlinear::{Nonlinear, nonlinear};
pub use wandering::wandering;
pub use whiteness::whiteness;

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use crate::finding::{Refusal, Whiteness};

/// Condition number, columns brought to equal size, above which parameters are not told apart.
pub const CONDITION_MAX: f64 = 1e7;

/// What a fit gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Coefficients, in the columns' order.
    pub coefficients: Vec<f64>,
    /// Their covariance, valid for correlated residuals.
    pub covariance: DMatrix<f64>,
    /// Their covariance if the residuals were white and of one size.
    pub covariance_white: DMatrix<f64>,
    /// Response less fit, weights not applied.
    pub residuals: Vec<f64>,
    /// How far each row moves each coefficient: rows in their order, a column a coefficient.
    pub influence: DMatrix<f64>,
    /// How far a unit of each row's residual moves each coefficient; fits of the same rows are
    /// joined by [`wandering`].
    pub leverage: DMatrix<f64>,
    /// Condition number of the design, its columns brought to equal size.
    pub condition: f64,
    /// Root mean square of the part of each column that the others do not explain.
    pub excitation: Vec<f64>,
    /// Whether the residuals are white.
    pub whiteness: Whiteness,
}

impl Fit {
    /// Standard deviation of a coefficient.
    #[must_use]
    pub fn sigma(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// Bootstrap intervals (95 %) of functions of the coefficients, see
    /// [`intervals_by_influence`].
    #[must_use]
    pub fn intervals(
        &self,
        seed: u64,
        parameters: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Option<Vec<[f64; 2]>> {
        intervals_by_influence(
            &self.influence,
            &self.coefficients,
            &self.covariance,
            seed,
            parameters,
        )
    }

    /// Root mean square of the residuals.
    #[must_use]
    pub fn residual_rms(&self) -> f64 {
        let sum: f64 = self.residuals.iter().map(|r| r * r).sum();
        (sum / self.residuals.len() as f64).sqrt()
    }

    /// Widens the covariance by a doubt that moves the coefficients together, one deviation of it
    /// by so much.
    pub fn doubt(&mut self, moved: &DVector<f64>) {
        self.covariance += moved * moved.transpose();
    }

    /// Covariance of functions of the coefficients whose gradients are the rows of `jacobian`.
    #[must_use]
    pub fn propagated(&self, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        jacobian * &self.covariance * jacobian.transpose()
    }
}

/// Ordinary least squares: response = design coefficients + error.
///
/// # Errors
/// Fewer rows than columns and one, values that are not finite, or columns that cannot be told
/// apart.
pub fn least_squares(design: &DMatrix<f64>, response: &DVector<f64>) -> Result<Fit, Refusal> {
    weighted(design, response, None)
}

/// Weighted least squares; a row's weight is the reciprocal of its error's variance.
///
/// # Errors
/// As [`least_squares`]; weights that are negative.
pub fn weighted(
    design: &DMatrix<f64>,
    response: &DVector<f64>,
    weights: Option<&[f64]>,
) -> Result<Fit, Refusal> {
    let none = DMatrix::zeros(design.ncols() + 1, design.ncols() + 1);
    solve(design, response, weights, &none)
}

/// Total least squares: columns and response all have errors, whose covariance is `errors` up to a
/// common factor (the columns in their order, then the response; zero for what is exact, such as a
/// column of ones).
///
/// Minimises sum e_i^2/v with e = y - x theta and v = \[-theta 1\] errors \[-theta 1\]^T. The
/// solution is (X^T X - lambda errors_xx)^-1 (X^T y - lambda errors_xy) with lambda the least root
/// of det(\[X y\]^T \[X y\] - lambda errors) = 0 (Golub and Van Loan 1980, Fuller 1987 section 2.3);
/// with one noisy column it is Deming's regression. It is as good as the ratio of the errors is
/// known.
///
/// # Errors
/// As [`least_squares`]; errors that leave nothing of a column.
pub fn total(
    design: &DMatrix<f64>,
    response: &DVector<f64>,
    errors: &DMatrix<f64>,
) -> Result<Fit, Refusal> {
    solve(design, response, None, errors)
}

fn solve(
    design: &DMatrix<f64>,
    response: &DVector<f64>,
    weights: Option<&[f64]>,
    errors: &DMatrix<f64>,
) -> Result<Fit, Refusal> {
    let (rows, columns) = design.shape();
    check(design, response, weights)?;
    let weight = |row: usize| weights.map_or(1.0, |weights| weights[row]);
    let gram = Gram::new(design, response, weights);
    let condition = gram.condition();
    let inverse = gram.inverse(condition)?;
    let excitation = (0..columns)
        .map(|j| (inverse[(j, j)] * rows as f64).sqrt().recip())
        .collect();

    let lambda = gram.least_root(errors);
    let errors_xx = errors.view((0, 0), (columns, columns)).into_owned();
    let errors_xy = errors.view((0, columns), (columns, 1)).into_owned();
    let bread = &gram.xx - &errors_xx * lambda;
    let unsure = || singular(f64::INFINITY);
    let bread_inverse = bread.clone().try_inverse().ok_or_else(unsure)?;
    let theta = &bread_inverse * (&gram.xy - &errors_xy * lambda);
    let theta = DVector::from_column_slice(theta.as_slice());

    let residual = response - design * &theta;
    let pull = &errors_xx * &theta - DVector::from_column_slice(errors_xy.as_slice());
    let direction = theta.clone().insert_row(columns, -1.0);
    let variance = (direction.transpose() * errors * &direction)[(0, 0)];
    let share = if variance > 0.0 {
        variance.recip()
    } else {
        0.0
    };
    let scores = DMatrix::from_fn(rows, columns, |i, j| {
        let e = residual[i];
        weight(i) * (design[(i, j)] * e + e * e * share * pull[j])
    });
    let free = (rows - columns) as f64;
    let influence = scores * bread_inverse.transpose();
    let exact = errors.iter().all(|value| *value == 0.0);
    // Rows of weight one are of one size.
    let mut leverage = design * bread_inverse.transpose();
    let mut even = residual.clone();
    for (i, weight) in weights.into_iter().flatten().enumerate() {
        leverage.row_mut(i).scale_mut(weight.sqrt());
        even[i] *= weight.sqrt();
    }
    let square: f64 = (0..rows)
        .map(|i| weight(i) * residual[i].powi(2))
        .sum::<f64>()
        / free;
    let residuals: Vec<f64> = residual.iter().copied().collect();
    Ok(Fit {
        coefficients: theta.iter().copied().collect(),
        covariance: if exact {
            symmetric(&wandering(&[(&leverage, even.as_slice())]))
        } else {
            covariance_of(&influence, columns)
        },
        covariance_white: symmetric(&(&bread_inverse * square)),
        whiteness: whiteness(&residuals),
        residuals,
        influence,
        leverage,
        condition,
        excitation,
    })
}

/// Sums over the rows.
struct Gram {
    xx: DMatrix<f64>,
    xy: DVector<f64>,
    yy: f64,
}

impl Gram {
    fn new(design: &DMatrix<f64>, response: &DVector<f64>, weights: Option<&[f64]>) -> Self {
        let mut weighted = design.clone();
        let mut response_weighted = response.clone();
        if let Some(weights) = weights {
            for (i, weight) in weights.iter().enumerate() {
                weighted.row_mut(i).scale_mut(*weight);
                response_weighted[i] *= weight;
            }
        }
        Self {
            xx: weighted.transpose() * design,
            xy: weighted.transpose() * response,
            yy: response_weighted.dot(response),
        }
    }

    /// Reciprocal sizes of the columns.
    fn scales(&self) -> Vec<f64> {
        (0..self.xx.nrows())
            .map(|j| self.xx[(j, j)].sqrt().recip())
            .collect()
    }

    fn scaled(&self) -> DMatrix<f64> {
        let scales = self.scales();
        DMatrix::from_fn(self.xx.nrows(), self.xx.ncols(), |i, j| {
            self.xx[(i, j)] * scales[i] * scales[j]
        })
    }

    fn condition(&self) -> f64 {
        let scaled = self.scaled();
        if scaled.iter().any(|value| !value.is_finite()) {
            return f64::INFINITY;
        }
        let values = SymmetricEigen::new(scaled).eigenvalues;
        let least = values.min();
        if least > 0.0 {
            (values.max() / least).sqrt()
        } else {
            f64::INFINITY
        }
    }

    fn inverse(&self, condition: f64) -> Result<DMatrix<f64>, Refusal> {
        if condition > CONDITION_MAX {
            return Err(singular(condition));
        }
        let scales = self.scales();
        let inverse = Cholesky::new(self.scaled())
            .ok_or_else(|| singular(condition))?
            .inverse();
        Ok(DMatrix::from_fn(
            inverse.nrows(),
            inverse.ncols(),
            |i, j| inverse[(i, j)] * scales[i] * scales[j],
        ))
    }

    /// Least root lambda of det(M - lambda errors) = 0 with M the sums of columns and response:
    /// the reciprocal of the greatest eigenvalue of L^-1 errors L^-T where M = L L^T. Zero without
    /// errors, and where the data have none.
    fn least_root(&self, errors: &DMatrix<f64>) -> f64 {
        let k = self.xx.nrows();
        if errors.iter().all(|value| *value == 0.0) {
            return 0.0;
        }
        let mut scales = self.scales();
        scales.push(self.yy.sqrt().max(f64::MIN_POSITIVE).recip());
        let sums = DMatrix::from_fn(k + 1, k + 1, |i, j| {
            let sum = match (i == k, j == k) {
                (false, false) => self.xx[(i, j)],
                (false, true) => self.xy[i],
                (true, false) => self.xy[j],
                (true, true) => self.yy,
            };
            sum * scales[i] * scales[j]
        });
        let errors = DMatrix::from_fn(k + 1, k + 1, |i, j| errors[(i, j)] * scales[i] * scales[j]);
        let Some(half) = Cholesky::new(sums).and_then(|factor| factor.l().try_inverse()) else {
            return 0.0;
        };
        let values = SymmetricEigen::new(&half * errors * half.transpose()).eigenvalues;
        values.max().recip()
    }
}

fn check(
    design: &DMatrix<f64>,
    response: &DVector<f64>,
    weights: Option<&[f64]>,
) -> Result<(), Refusal> {
    let what = || "regression".to_owned();
    let (rows, columns) = design.shape();
    let lengths = [
        ("response", response.len()),
        ("weights", weights.map_or(rows, <[f64]>::len)),
    ];
    for (name, found) in lengths {
        if found != rows {
            return Err(Refusal::Length {
                what: what(),
                name: name.to_owned(),
                found,
                expected: rows,
            });
        }
    }
    if rows < columns + 2 {
        return Err(Refusal::Value {
            what: what(),
            name: "rows".to_owned(),
            value: rows as f64,
            expected: format!("{} at least", columns + 2),
        });
    }
    let bad_weight = weights
        .into_iter()
        .flatten()
        .find(|weight| !(weight.is_finite() && **weight >= 0.0));
    let bad = design
        .iter()
        .chain(response.iter())
        .find(|value| !value.is_finite())
        .or(bad_weight);
    bad.map_or(Ok(()), |value| {
        Err(Refusal::Value {
            what: what(),
            name: "a value".to_owned(),
            value: *value,
            expected: "finite numbers, weights not below zero".to_owned(),
        })
    })
}

fn singular(condition: f64) -> Refusal {
    Refusal::Singular {
        what: "regression".to_owned(),
        condition,
        help: "vary what is held constant, or fix one of the parameters".to_owned(),
    }
}

/// Covariance of estimates whose influences are the columns, `fitted` of them to each equation;
/// valid for residuals that are correlated in time.
#[must_use]
pub fn covariance_of(influence: &DMatrix<f64>, fitted: usize) -> DMatrix<f64> {
    let rows = influence.nrows() as f64;
    let free = (rows - fitted as f64).max(1.0);
    long_run(influence) * (rows.powi(3) / free)
}

fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    (matrix + matrix.transpose()) * 0.5
}

#[cfg(test)]
mod tests;
