//! Tuned numbers of the estimator.

use estimator::Tuning as Inner;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;
use crate::origin::{Origin, Reduced};
use crate::tables::{to_python, to_toml};

/// All tuned numbers of the estimator; `docs/filter-spec.md` has their units and meanings.
///
/// `Tuning()` has the default values, `with_values` replaces some; never changed.
#[pyclass(frozen, module = "atvrec")]
pub struct Tuning {
    pub inner: Inner,
}

#[pymethods]
impl Tuning {
    /// The default values.
    #[new]
    fn new() -> Self {
        Self {
            inner: Inner::default(),
        }
    }

    /// The tuning with other numbers, by their dotted names or in nested dicts:
    /// {"motion.gate_sigma": 6.0} is the same as {"motion": {"gate_sigma": 6.0}}.
    fn with_values(&self, values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut inner = self.inner;
        replace(&mut inner, "", &to_toml("values", values)?).map_err(errors::argument)?;
        Ok(Self { inner })
    }

    /// A tuning from the text of a TOML file; `name` stands for the file in messages. What the text
    /// does not have keeps its default value.
    #[staticmethod]
    #[pyo3(signature = (text, name="tuning.toml"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        let table: toml::Table = text
            .parse()
            .map_err(|error| errors::argument(format!("{name}: {error}")))?;
        let mut inner = Inner::default();
        replace(&mut inner, "", &toml::Value::Table(table))
            .map_err(|error| errors::argument(format!("{name}: {error}")))?;
        Ok(Self { inner })
    }

    /// The numbers as TOML, as `[estimator.tuning]` of a configuration has them.
    fn to_toml(&self) -> PyResult<String> {
        toml::to_string(&self.inner).map_err(|error| errors::argument(error.to_string()))
    }

    /// The numbers as nested dicts and lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let table = toml::Value::try_from(self.inner);
        to_python(
            py,
            table.map_err(|error| errors::argument(error.to_string()))?,
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        Origin::new(py, "from_toml", (self.to_toml()?,))?.reduce::<Self>(py)
    }
}

/// Replaces the numbers that a table and its sub-tables give.
fn replace(tuning: &mut Inner, name: &str, value: &toml::Value) -> Result<(), String> {
    use toml::Value::{Array, Float, Integer, Table};
    let number = |value: &toml::Value| match value {
        Float(number) => Some(*number),
        Integer(number) => Some(*number as f64),
        _ => None,
    };
    let numbers = match value {
        Table(table) => {
            return table.iter().try_for_each(|(key, value)| {
                let dot = if name.is_empty() { "" } else { "." };
                replace(tuning, &format!("{name}{dot}{key}"), value)
            });
        }
        Array(values) => values.iter().map(number).collect(),
        one => number(one).map(|number| vec![number]),
    };
    match numbers {
        Some(numbers) => tuning.replace(name, &numbers),
        None => Err(format!(
            "{name} = {value}: must be a number or a list of numbers"
        )),
    }
}
