//! How the program ends.

use std::process::ExitCode;

use engine::config::Problems;
use estimator::EstimatorError;

/// How a command ended that did its job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All is well.
    Good,
    /// The answer is no: a comparison found a difference, a check found an error.
    Failed,
    /// Done, but data was lost on the way.
    DataLoss,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        Self::from(match outcome {
            Outcome::Good => 0,
            Outcome::Failed => 1,
            Outcome::DataLoss => 3,
        })
    }
}

/// The exit code of an error: 2 for what the user wrote wrongly, 1 for all else.
pub fn code_of(error: &anyhow::Error) -> ExitCode {
    let usage = error.downcast_ref::<Problems>().is_some()
        || error.downcast_ref::<UsageError>().is_some()
        || error.downcast_ref().is_some_and(engine::Error::is_usage)
        || error.downcast_ref().is_some_and(is_wrong_reading);
    ExitCode::from(if usage { 2 } else { 1 })
}

/// Something on the command line that only the command itself could find wrong.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

/// Whether a person's reading or mark, which a calibration takes, is wrong.
const fn is_wrong_reading(error: &EstimatorError) -> bool {
    matches!(error, EstimatorError::Recording(problem) if problem.is_usage())
}
