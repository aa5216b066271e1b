//! Values of TOML files as Python's own.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors;

/// A value of a file as Python's own.
pub fn to_python(py: Python<'_>, value: toml::Value) -> PyResult<Bound<'_, PyAny>> {
    match value {
        toml::Value::String(text) => text.into_bound_py_any(py),
        toml::Value::Integer(number) => number.into_bound_py_any(py),
        toml::Value::Float(number) => number.into_bound_py_any(py),
        toml::Value::Boolean(flag) => flag.into_bound_py_any(py),
        toml::Value::Datetime(time) => time.to_string().into_bound_py_any(py),
        toml::Value::Array(items) => {
            let list = PyList::empty(py);
            for item in items {
                list.append(to_python(py, item)?)?;
            }
            list.into_bound_py_any(py)
        }
        toml::Value::Table(table) => {
            let dict = PyDict::new(py);
            for (key, value) in table {
                dict.set_item(key, to_python(py, value)?)?;
            }
            dict.into_bound_py_any(py)
        }
    }
}

/// Python's own as a value of a file; `name` stands for it in messages.
pub fn to_toml(name: &str, value: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    if let Ok(flag) = value.cast::<pyo3::types::PyBool>() {
        return Ok(toml::Value::Boolean(flag.is_true()));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(toml::Value::Float(number));
    }
    if let Ok(text) = value.extract::<String>() {
        return Ok(toml::Value::String(text));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        let mut table = toml::Table::new();
        for (key, value) in dict {
            let key: String = key.extract()?;
            let value = to_toml(&format!("{name}.{key}"), &value)?;
            table.insert(key, value);
        }
        return Ok(toml::Value::Table(table));
    }
    let items = value.try_iter().map_err(|_| {
        errors::vehicle(format!(
            "{name}: give a number, a text, truth, a list or a dict of them"
        ))
    })?;
    let items: PyResult<Vec<_>> = items.map(|item| to_toml(name, &item?)).collect();
    Ok(toml::Value::Array(items?))
}
