//! Exact Jacobians by dual numbers.

use nalgebra::{Const, SMatrix, SVector};
use num_dual::DualSVec64;

/// Columns of a Jacobian that are worked out at a time.
const COLUMNS: usize = 4;

/// A number with its derivatives by [`COLUMNS`] variables.
pub(crate) type Sloped = DualSVec64<COLUMNS>;

/// Values of a function and its Jacobian: row i, column j is d(value_i)/d(variable_j).
///
/// A few columns at a time, so that the models are compiled for one kind of dual number whatever
/// the size of the Jacobian.
pub(crate) fn jacobian<const N: usize>(
    function: impl Fn(SVector<Sloped, N>) -> SVector<Sloped, N>,
    at: &SVector<f64, N>,
) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let mut values = SVector::zeros();
    let mut slopes = SMatrix::zeros();
    for first in (0..N).step_by(COLUMNS) {
        let count = COLUMNS.min(N - first);
        let mut variables = at.map(Sloped::from);
        for column in 0..count {
            let variable = &mut variables[first + column];
            *variable = variable.derivative(column);
        }
        let found = function(variables);
        for (row, value) in found.iter().enumerate() {
            values[row] = value.re;
            let slope = value.eps.unwrap_generic(Const::<COLUMNS>, Const::<1>);
            for column in 0..count {
                slopes[(row, first + column)] = slope[column];
            }
        }
    }
    (values, slopes)
}
