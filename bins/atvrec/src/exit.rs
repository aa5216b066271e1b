//! Exit codes of the program.

use engine::config::Problems;
use estimator::EstimatorError;

/// Result of a command that ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Success.
    Good,
    /// Failure: a comparison found a difference, or a check found an error.
    Failed,
    /// Finished, but data was lost.
    DataLoss,
}

impl Outcome {
    /// Exit code.
    pub const fn code(self) -> u8 {
        match self {
            Self::Good => 0,
            Self::Failed => 1,
            Self::DataLoss => 3,
        }
    }
}

/// Exit code of an error: 2 for wrong usage or configuration, 1 for all other errors.
pub fn code_of(error: &anyhow::Error) -> u8 {
    let usage = error.downcast_ref::<Problems>().is_some()
        || error.downcast_ref::<UsageError>().is_some()
        || error.downcast_ref().is_some_and(engine::Error::is_usage)
        || error.downcast_ref().is_some_and(is_wrong_reading);
    if usage { 2 } else { 1 }
}

/// Error in the command line that the command itself finds.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

/// Whether a person's reading or mark, which a calibration takes, is wrong.
const fn is_wrong_reading(error: &EstimatorError) -> bool {
    matches!(error, EstimatorError::Recording(problem) if problem.is_usage())
}
