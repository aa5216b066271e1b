//! Calibration files.

use std::path::PathBuf;

use estimator::calibration::Calibration as Inner;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::origin::{Origin, Reduced};
use crate::tables::{to_python, to_toml};
use crate::vehicle::Vehicle;
use crate::{errors, files};

/// A calibration file: zeros, gains and mounting of the sensors of one vehicle.
///
/// Made by `Calibration.nominal`, `Calibration.load`, `Calibration.from_toml` or
/// `Calibration.from_dict`; never changed.
#[pyclass(frozen, module = "atvrec")]
pub struct Calibration {
    pub inner: Inner,
}

#[pymethods]
impl Calibration {
    /// The calibration that changes nothing: every channel is as the sensors file states.
    #[staticmethod]
    fn nominal(vehicle: &Vehicle) -> Self {
        Self {
            inner: Inner::nominal(&vehicle.inner.name),
        }
    }

    /// A calibration from a file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Self::from_toml(&files::text(&path)?, &path.display().to_string())
    }

    /// A calibration from the text of a file; `name` stands for the file in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name="calibration.toml"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        Inner::from_toml(text)
            .map(|inner| Self { inner })
            .map_err(|error| errors::argument(format!("{name}: {error}")))
    }

    /// A calibration from nested dicts and lists, named as in the file: the `vehicle` that it is for
    /// and the tables that functions of `atvrec.calibrate` return.
    #[staticmethod]
    fn from_dict(values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let table = to_toml("values", values)?;
        table
            .try_into()
            .map(|inner| Self { inner })
            .map_err(|error: toml::de::Error| errors::argument(format!("values: {error}")))
    }

    /// The text of a calibration file.
    pub fn to_toml(&self) -> PyResult<String> {
        let text = self.inner.to_toml();
        text.map_err(|error| errors::argument(error.to_string()))
    }

    /// All values as nested dicts and lists, named as in the file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let table = toml::Value::try_from(&self.inner);
        to_python(
            py,
            table.map_err(|error| errors::argument(error.to_string()))?,
        )
    }

    /// Name of the vehicle that it is for.
    #[getter]
    fn vehicle(&self) -> &str {
        &self.inner.vehicle
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Origin::new(py, "from_toml", (self.to_toml()?,))?.reduce::<Self>(py)
    }

    fn __repr__(&self) -> String {
        format!("<atvrec.Calibration of {:?}>", self.inner.vehicle)
    }
}
