//! Sensors files.

use std::path::PathBuf;

use pyo3::prelude::*;

use crate::origin::{Origin, Reduced};
use crate::{errors, files};

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
    pub fn builtin(name: &str) -> PyResult<Self> {
        let inner = model::sensors::Sensors::builtin(name).map_err(|e| errors::model(&e))?;
        Ok(Self { inner })
    }

    /// Names of the sensors files that ship with the package.
    #[staticmethod]
    pub fn builtin_names() -> Vec<&'static str> {
        model::sensors::Sensors::builtin_names().collect()
    }

    /// Sensors from a file. All errors of the file are reported at once.
    #[staticmethod]
    pub fn load(path: PathBuf) -> PyResult<Self> {
        Self::from_toml(&files::text(&path)?, &path.display().to_string())
    }

    /// Sensors from the text of a sensors file; `name` stands for the file in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name="sensors.toml"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        model::sensors::Sensors::from_toml(text, name)
            .map(|inner| Self { inner })
            .map_err(|error| errors::vehicle(error.to_string()))
    }

    /// The text of a sensors file.
    pub fn to_toml(&self) -> PyResult<String> {
        toml::to_string(&self.inner).map_err(|error| errors::vehicle(error.to_string()))
    }

    /// Name, for people.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Origin::new(py, "from_toml", (self.to_toml()?,))?.reduce::<Self>(py)
    }

    fn __repr__(&self) -> String {
        format!("<atvrec.Sensors {:?}>", self.inner.name)
    }
}
