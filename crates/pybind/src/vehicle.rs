//! Vehicle files.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::origin::{Origin, Reduced};
use crate::tables::{to_python, to_toml};
use crate::{errors, files};

/// A vehicle, as its file describes it: SI units and radians, ISO 8855 axes.
///
/// Made by `Vehicle.builtin`, `Vehicle.load` or `Vehicle.from_toml`; never changed.
#[pyclass(frozen, module = "atvrec")]
pub struct Vehicle {
    pub inner: model::vehicle::Vehicle,
}

#[pymethods]
impl Vehicle {
    /// A vehicle that ships with the package; see `builtin_names`.
    #[staticmethod]
    #[pyo3(signature = (name="prowler"))]
    fn builtin(name: &str) -> PyResult<Self> {
        let inner = model::vehicle::Vehicle::builtin(name).map_err(|e| errors::model(&e))?;
        Ok(Self { inner })
    }

    /// Names of the vehicles that ship with the package.
    #[staticmethod]
    fn builtin_names() -> Vec<&'static str> {
        model::vehicle::Vehicle::builtin_names().collect()
    }

    /// A vehicle from a file and the tyre property files that it names. All errors of the file are
    /// reported at once.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let text = engine::config::with_tyre_files(&files::text(&path)?, &path);
        let text = text.map_err(|error| errors::vehicle(error.to_string()))?;
        Self::parse(&text, path)
    }

    /// A vehicle from the text of a vehicle file; `name` stands for the file in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name="vehicle.toml"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        Self::parse(text, name.into())
    }

    /// The text of a vehicle file.
    pub fn to_toml(&self) -> PyResult<String> {
        let text = self.inner.to_toml();
        text.map_err(|error| errors::vehicle(error.to_string()))
    }

    /// All values as nested dicts and lists, named as in the vehicle file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, self.value()?)
    }

    /// A vehicle with other values by their dotted names: {"body.mass_kg": 700.0}. It is checked
    /// like a file.
    fn with_values(&self, values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut root = self.value()?;
        for (name, value) in values {
            let name: String = name.extract()?;
            set(&mut root, &name, to_toml(&name, &value)?)?;
        }
        let text = toml::to_string(&root).map_err(|error| errors::vehicle(error.to_string()))?;
        Self::parse(
            &text,
            format!("{} with other values", self.inner.name).into(),
        )
    }

    /// What is odd about the vehicle without being impossible.
    fn warnings(&self) -> Vec<String> {
        let warnings = self.inner.warnings();
        warnings.iter().map(ToString::to_string).collect()
    }

    /// Name, for people.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// What is meant by this variant and where it is from.
    #[getter]
    fn description(&self) -> &str {
        &self.inner.description
    }

    /// Total mass m, kg.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.inner.body.mass_kg
    }

    /// Sprung mass m_s, kg.
    #[getter]
    fn sprung_mass_kg(&self) -> f64 {
        self.inner.sprung().mass_kg
    }

    /// Wheelbase L, m.
    #[getter]
    fn wheelbase_m(&self) -> f64 {
        self.inner.wheelbase_m()
    }

    /// Height of the roll axis above ground below the centre of gravity, m.
    #[getter]
    fn roll_axis_height_m(&self) -> f64 {
        self.inner.roll_axis_height_m()
    }

    /// Arm h_1 of the sprung mass over the roll axis, m.
    #[getter]
    fn roll_arm_m(&self) -> f64 {
        self.inner.roll_arm_m()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Origin::new(py, "from_toml", (self.to_toml()?,))?.reduce::<Self>(py)
    }

    fn __repr__(&self) -> String {
        format!(
            "<atvrec.Vehicle {:?}: {} kg, wheelbase {:.4} m>",
            self.inner.name,
            self.inner.body.mass_kg,
            self.inner.wheelbase_m()
        )
    }
}

impl Vehicle {
    fn parse(text: &str, path: PathBuf) -> PyResult<Self> {
        model::vehicle::Vehicle::from_toml(text, path)
            .map(|inner| Self { inner })
            .map_err(|error| errors::vehicle(error.to_string()))
    }

    fn value(&self) -> PyResult<toml::Value> {
        toml::Value::try_from(&self.inner).map_err(|error| errors::vehicle(error.to_string()))
    }
}

fn set(root: &mut toml::Value, name: &str, value: toml::Value) -> PyResult<()> {
    let mut place = root;
    for part in name.split('.') {
        let table = place.as_table_mut().ok_or_else(|| {
            errors::vehicle(format!("{name}: what stands before {part} is no table"))
        })?;
        place = table
            .entry(part)
            .or_insert_with(|| toml::Value::Table(toml::Table::new()));
    }
    *place = value;
    Ok(())
}
