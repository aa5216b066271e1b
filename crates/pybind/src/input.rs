//! Arguments that are arrays.

use std::borrow::Cow;

use numpy::{AllowTypeChange, PyArrayLikeDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sample::Wheel;

use crate::errors;

/// An argument that is an array of doubles, or can be made one; taken without a copy where it is
/// one, row by row.
pub type Doubles<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// The numbers of an array in row order, borrowed where they stand so already.
pub fn row_major<'a>(array: &'a Doubles<'_>) -> Cow<'a, [f64]> {
    let view = array.as_array();
    match view.to_slice() {
        Some(slice) => Cow::Borrowed(slice),
        None => Cow::Owned(view.iter().copied().collect()),
    }
}

/// The array's numbers, all finite, with `names.len()` of them in each row.
pub fn rows<'a, S: AsRef<str>>(
    argument: &str,
    array: &'a Doubles<'_>,
    names: &[S],
) -> PyResult<Cow<'a, [f64]>> {
    let shape = array.shape();
    if shape.last() != Some(&names.len()) {
        return Err(errors::argument(format!(
            "{argument} has the shape {shape:?}: its last axis must hold {} numbers: {}",
            names.len(),
            names
                .iter()
                .map(AsRef::as_ref)
                .collect::<Vec<_>>()
                .join(", ")
        )));
    }
    let values = row_major(array);
    if let Some(bad) = values.iter().position(|value| !value.is_finite()) {
        let (row, column) = (bad / names.len(), bad % names.len());
        return Err(errors::argument(format!(
            "{argument}: {} in row {row} is {}: must be a finite number",
            names[column].as_ref(),
            values[bad]
        )));
    }
    Ok(values)
}

/// A number that must be finite.
pub fn finite(argument: &str, value: f64, unit: &str) -> PyResult<f64> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(errors::argument(format!(
            "{argument} = {value} {unit}: must be a finite number"
        )))
    }
}

/// A number that must be finite and greater than zero.
pub fn positive(argument: &str, value: f64, unit: &str) -> PyResult<f64> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(errors::argument(format!(
            "{argument} = {value} {unit}: must be finite and greater than 0"
        )))
    }
}

/// The wheel of this name.
pub fn wheel(name: &str) -> PyResult<Wheel> {
    Wheel::from_abbreviation(name)
        .ok_or_else(|| errors::argument(format!("wheel = {name:?}: must be fl, fr, rl or rr")))
}

/// One number for all wheels, or one for each.
#[derive(FromPyObject)]
pub enum PerWheel {
    /// For all.
    All(f64),
    /// Front left, front right, rear left, rear right.
    Each([f64; 4]),
}

impl PerWheel {
    /// The four numbers.
    pub fn each(self) -> [f64; 4] {
        match self {
            Self::All(value) => [value; 4],
            Self::Each(values) => values,
        }
    }
}

/// Sets the four wheels' numbers where they are given.
pub fn set(place: &mut [f64; 4], value: Option<PerWheel>) {
    if let Some(value) = value {
        *place = value.each();
    }
}
