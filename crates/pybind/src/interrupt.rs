//! Ctrl-C in long calls.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Steps of work between two looks at Python's signals: some milliseconds.
const STEPS: u32 = 1_024;
/// Time between two looks while another thread works.
const INTERVAL: Duration = Duration::from_millis(50);

/// Looks at Python's signals now and then, from work without the GIL.
#[derive(Default)]
pub struct Watch {
    steps: u32,
}

impl Watch {
    /// Counts a step.
    ///
    /// # Errors
    /// What the signal's handler raised, such as `KeyboardInterrupt`.
    pub fn check(&mut self) -> PyResult<()> {
        self.steps = (self.steps + 1) % STEPS;
        match self.steps {
            0 => Python::attach(|py| py.check_signals()),
            _ => Ok(()),
        }
    }
}

/// Lets another thread do work that cannot be stopped. After Ctrl-C the call returns at once, and the
/// thread ends by itself later.
pub fn detached<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    py.detach(|| {
        let (sender, receiver) = channel();
        std::thread::spawn(move || sender.send(work()));
        loop {
            match receiver.recv_timeout(INTERVAL) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err(
                        "the work ended early; standard error has the message of its panic",
                    ));
                }
            }
        }
    })
}
