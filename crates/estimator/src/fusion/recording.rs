//! What a smoother needs of each step of the force filter.

use nalgebra::{SMatrix, SVector};

use super::Fusion;
use super::layout::{BODY_RATE, SIZE};
use crate::trace::Operation;

/// States with a smoothed value: forces and angular rates of the body.
pub const OUTPUTS: [usize; 15] = [
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    8,
    9,
    10,
    11,
    BODY_RATE,
    BODY_RATE + 1,
    BODY_RATE + 2,
];

/// Record of one step for a smoother.
#[derive(Clone, Debug, PartialEq)]
pub struct FusionTrace {
    /// Operations since the instant before.
    pub operations: Vec<Operation<SIZE>>,
    /// The state, in the order of [`super::layout`].
    pub state: SVector<f64, SIZE>,
    /// Covariances of [`OUTPUTS`] with all states.
    pub covariance: SMatrix<f64, { OUTPUTS.len() }, SIZE>,
    /// Variances of [`OUTPUTS`] by latencies that are not known.
    pub by_latency: [f64; OUTPUTS.len()],
}

impl Fusion {
    /// Starts recording operations for [`Self::take_trace`].
    pub fn switch_trace_on(&mut self) {
        self.covariance.trace.switch_on();
    }

    /// State, covariance, and the operations since the last call.
    pub fn take_trace(&mut self) -> FusionTrace {
        FusionTrace {
            operations: self.covariance.trace.take(),
            state: SVector::from(self.state),
            covariance: SMatrix::from_rows(
                &OUTPUTS.map(|index| self.covariance.row(index).transpose()),
            ),
            by_latency: OUTPUTS.map(|index| self.latencies.state_variance(index)),
        }
    }
}
