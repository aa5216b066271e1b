//! Some rows of a truth run, with rates of change.

use nalgebra::Vector3;
use testkit::truth::{self, RATE_HZ};

/// Every `stride`th row of a run.
pub struct Run {
    whole: &'static truth::Run,
    pub rows: usize,
    stride: usize,
}

impl Run {
    pub fn open(name: &str, stride: usize) -> Option<Self> {
        Some(Self::of(truth::run(name)?, stride))
    }

    pub fn of(whole: &'static truth::Run, stride: usize) -> Self {
        // The first and the last row have no slope.
        let rows = (whole.rows - 2).div_ceil(stride);
        Self {
            whole,
            rows,
            stride,
        }
    }

    pub fn get(&self, name: &str, row: usize) -> f64 {
        self.whole.column(name)[1 + row * self.stride]
    }

    /// Rate of change of a column, per second.
    pub fn slope(&self, name: &str, row: usize) -> f64 {
        let (values, middle) = (self.whole.column(name), 1 + row * self.stride);
        (values[middle + 1] - values[middle - 1]) * RATE_HZ / 2.0
    }

    /// Second derivative of a column at a row.
    pub fn bend(&self, name: &str, row: usize) -> f64 {
        let (values, middle) = (self.whole.column(name), 1 + row * self.stride);
        (values[middle + 1] - 2.0 * values[middle] + values[middle - 1]) * RATE_HZ * RATE_HZ
    }

    /// The vector of the columns `name` + `x`, `y`, `z` (+ `suffix`).
    pub fn vector(&self, name: &str, suffix: &str, row: usize) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.get(&format!("{name}{}{suffix}", ["x", "y", "z"][i]), row))
    }

    /// Three columns in a row.
    pub fn three(&self, names: [&str; 3], row: usize) -> Vector3<f64> {
        Vector3::from(names.map(|name| self.get(name, row)))
    }
}
