//! Sensors files.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;

use crate::errors;

/// Sensors and their converters, as a sensors file describes them.
///
/// Made by `Sensors.builtin`, `Sensors.load` or `Sensors.from_toml`; never changed.
#[pyclass(frozen, module = "atvrec")]
pub struct Sensors {
    pub inner: model::sensors::Sensors,
}

#[pymethods]
impl Sensors {
    /// A sensors file that ships with the package; see `builtin_names`.
    #[staticmethod]
    #[pyo3(signature = (name="thesis-10bit"))]
    fn builtin(name: &str) -> PyResult<Self> {
        let inner = model::sensors::Sensors::builtin(name).map_err(|e| errors::model(&e))?;
        Ok(Self { inner })
    }

    /// Names of the sensors files that ship with the package.
    #[staticmethod]
    fn builtin_names() -> Vec<&'static str> {
        model::sensors::Sensors::builtin_names().collect()
    }

    /// Sensors from a file. All errors of the file are reported at once.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        read(&path).map(|inner| Self { inner })
    }

    /// Sensors from the text of a sensors file; `name` stands for the file in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name="sensors.toml"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        parse(text, name.as_ref()).map(|inner| Self { inner })
    }

    /// Name, for people.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    fn __repr__(&self) -> String {
        format!("<atvrec.Sensors {:?}>", self.inner.name)
    }
}

/// The sensors of a file.
pub fn read(path: &Path) -> PyResult<model::sensors::Sensors> {
    parse(&std::fs::read_to_string(path)?, path)
}

fn parse(text: &str, path: &Path) -> PyResult<model::sensors::Sensors> {
    model::sensors::Sensors::from_toml(text, path)
        .map_err(|error| errors::vehicle(error.to_string()))
}
