//! What calibration and identification found, as dicts.

use estimator::EstimatorError;
use estimator::finding::{Finding, Findings, Refusal};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors;
use crate::input::{self, Doubles};

/// Findings as a dict: `what`, `findings` by name, `covariance` in their order (or `None`),
/// `beside` by name as value and unit, `notes`.
pub fn dict<'py>(py: Python<'py>, found: &Findings) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("what", &found.what)?;
    let findings = PyDict::new(py);
    for one in &found.findings {
        findings.set_item(&one.name, finding(py, one)?)?;
    }
    all.set_item("findings", findings)?;
    let size = found.covariance.len();
    let covariance = (size > 0).then(|| {
        Array2::from_shape_fn((size, size), |(i, j)| found.covariance[i][j]).into_pyarray(py)
    });
    all.set_item("covariance", covariance)?;
    let beside = PyDict::new(py);
    for (name, value, unit) in &found.beside {
        beside.set_item(name, (value, unit))?;
    }
    all.set_item("beside", beside)?;
    all.set_item("notes", &found.notes)?;
    Ok(all)
}

fn finding<'py>(py: Python<'py>, finding: &Finding) -> PyResult<Bound<'py, PyDict>> {
    let one = PyDict::new(py);
    one.set_item("value", finding.value)?;
    one.set_item("sigma", finding.sigma)?;
    one.set_item("unit", &finding.unit)?;
    one.set_item("interval", finding.interval.map(|[low, high]| (low, high)))?;
    one.set_item("condition", finding.condition)?;
    let excitation = finding.excitation.as_ref();
    one.set_item("excitation", excitation.map(|e| (e.rms, &e.unit)))?;
    let whiteness = finding.whiteness;
    one.set_item("durbin_watson", whiteness.map(|w| w.durbin_watson))?;
    one.set_item("ljung_box_p", whiteness.map(|w| w.ljung_box_p))?;
    let span = finding.span;
    one.set_item("span_s", (span.from_s, span.to_s))?;
    one.set_item("used_s", span.used_s)?;
    one.set_item("rows", span.rows)?;
    Ok(one)
}

/// Why data do not tell what is looked for.
pub fn refusal(refusal: &Refusal) -> PyErr {
    errors::data(refusal.to_string())
}

/// The same of what also reads a vehicle file.
pub fn estimator(error: &EstimatorError) -> PyErr {
    errors::data(error.to_string())
}

/// A column as it is, unknown values (NaN) in it; empty where there is none.
pub fn column(argument: &str, array: Option<&Doubles<'_>>) -> PyResult<Vec<f64>> {
    let Some(array) = array else {
        return Ok(Vec::new());
    };
    if array.shape().len() != 1 {
        return Err(errors::argument(format!(
            "{argument} has the shape {:?}: must be (n,)",
            array.shape()
        )));
    }
    Ok(input::row_major(array).into_owned())
}

/// Rows of `N` numbers, unknown values (NaN) in them.
pub fn vectors<const N: usize>(argument: &str, array: &Doubles<'_>) -> PyResult<Vec<[f64; N]>> {
    if array.shape().len() != 2 || array.shape()[1] != N {
        return Err(errors::argument(format!(
            "{argument} has the shape {:?}: must be (n, {N})",
            array.shape()
        )));
    }
    let numbers = input::row_major(array);
    let (rows, _) = numbers.as_chunks::<N>();
    Ok(rows.to_vec())
}

/// Columns of one length, the first of which is `time_s`.
pub fn same_length(columns: &[(&str, usize)]) -> PyResult<()> {
    let Some((first, expected)) = columns.first() else {
        return Ok(());
    };
    match columns.iter().find(|(_, length)| length != expected) {
        None => Ok(()),
        Some((name, length)) => Err(errors::argument(format!(
            "{name} has {length} rows, {first} has {expected}: they must be as many"
        ))),
    }
}
