//! Files that Python names.

use std::path::Path;

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

/// The text of a file; a refusal of the operating system keeps its number, so that a missing file is
/// a `FileNotFoundError` that names it.
pub fn text(path: &Path) -> PyResult<String> {
    std::fs::read_to_string(path).map_err(|error| match error.raw_os_error() {
        Some(number) => PyOSError::new_err((number, error.to_string(), path.display().to_string())),
        None => PyOSError::new_err(format!("cannot read {}: {error}", path.display())),
    })
}
