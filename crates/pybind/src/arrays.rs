//! Columns as NumPy arrays; lists of numbers move without a copy.

use numpy::ndarray::Array1;
use numpy::{Element, IntoPyArray, PyArray1};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use store::{Column, Values};

/// A column as an array. Where the schema tells absence from zero, numbers of 32 bits become
/// doubles with NaN, others masked arrays, texts and bytes `None`.
///
/// A column of numbers without any value takes no memory: all its entries are the same NaN, and it cannot
/// be written to.
pub fn column(py: Python<'_>, column: Column) -> PyResult<Bound<'_, PyAny>> {
    if let Some(rows) = rows_without_value(&column) {
        return py
            .import("numpy")?
            .call_method1("broadcast_to", (f64::NAN, (rows,)));
    }
    let Some(present) = column.present else {
        return values(py, column.values);
    };
    match column.values {
        Values::I32(list) => Ok(with_nan(py, &list, &present)),
        Values::U32(list) => Ok(with_nan(py, &list, &present)),
        Values::Text(list) => objects(py, list.into_iter().zip(present), |py, (text, there)| {
            there.then_some(text).into_py_any(py)
        }),
        Values::Bytes(list) => objects(py, list.into_iter().zip(present), |py, (bytes, there)| {
            let bytes = there.then(|| PyBytes::new(py, &bytes));
            bytes.into_py_any(py)
        }),
        other => masked(py, values(py, other)?, present),
    }
}

/// The number of rows of a column that would become an array of NaN alone.
fn rows_without_value(column: &Column) -> Option<usize> {
    let is_absent = match (&column.values, &column.present) {
        (Values::F64(list), None) => list.iter().all(|value| value.is_nan()),
        (Values::I32(_) | Values::U32(_), Some(present)) => present.iter().all(|there| !there),
        _ => false,
    };
    Some(column.values.len()).filter(|rows| is_absent && *rows > 0)
}

fn values(py: Python<'_>, values: Values) -> PyResult<Bound<'_, PyAny>> {
    Ok(match values {
        Values::F64(list) => list.into_pyarray(py).into_any(),
        Values::I32(list) => list.into_pyarray(py).into_any(),
        Values::I64(list) => list.into_pyarray(py).into_any(),
        Values::U32(list) => list.into_pyarray(py).into_any(),
        Values::U64(list) => list.into_pyarray(py).into_any(),
        Values::Bool(list) => list.into_pyarray(py).into_any(),
        Values::Text(list) => objects(py, list, |py, text| text.into_py_any(py))?,
        Values::Bytes(list) => objects(py, list, |py, b| PyBytes::new(py, &b).into_py_any(py))?,
        Values::List { ends, values } => lists(py, &ends, *values)?,
    })
}

/// Rows of a list column, each an array: views into one array of all values.
fn lists<'py>(py: Python<'py>, ends: &[usize], all: Values) -> PyResult<Bound<'py, PyAny>> {
    let all = values(py, all)?;
    let starts = std::iter::once(0).chain(ends.iter().copied());
    objects(py, starts.zip(ends.iter().copied()), |py, (start, end)| {
        let slice = pyo3::types::PySlice::new(py, start.cast_signed(), end.cast_signed(), 1);
        Ok(all.get_item(slice)?.unbind())
    })
}

fn with_nan<'py, T>(py: Python<'py>, list: &[T], present: &[bool]) -> Bound<'py, PyAny>
where
    T: Copy + Into<f64> + Element,
{
    let values: Vec<f64> = list
        .iter()
        .zip(present)
        .map(|(value, there)| if *there { (*value).into() } else { f64::NAN })
        .collect();
    values.into_pyarray(py).into_any()
}

fn masked<'py>(
    py: Python<'py>,
    values: Bound<'py, PyAny>,
    present: Vec<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let absent: Vec<bool> = present.into_iter().map(|there| !there).collect();
    let options = PyDict::new(py);
    options.set_item("mask", absent.into_pyarray(py))?;
    py.import("numpy.ma")?
        .call_method("masked_array", (values,), Some(&options))
}

fn objects<'py, T>(
    py: Python<'py>,
    items: impl IntoIterator<Item = T>,
    object: impl Fn(Python<'py>, T) -> PyResult<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let objects: PyResult<Vec<Py<PyAny>>> =
        items.into_iter().map(|item| object(py, item)).collect();
    Ok(PyArray1::from_owned_object_array(py, Array1::from_vec(objects?)).into_any())
}
