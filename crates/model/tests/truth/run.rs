//! Reads a few columns of a truth run in place.

use atvrec_model::vehicle::Vehicle;
use nalgebra::Vector3;

/// The vehicle of the runs; `None` if the data is missing.
pub fn vehicle() -> Option<Vehicle> {
    params_text().map(|text| sim::vehicle_from_truth_params(&text).expect("params.json converts"))
}

/// Text of the runs' `params.json`.
fn params_text() -> Option<String> {
    let path = testkit::shared("data/truth/params.json")?;
    Some(std::fs::read_to_string(path).expect("readable"))
}

/// Columns of one run, by name without unit.
pub struct Run {
    columns: sim::Columns,
    pub rows: usize,
    stride: usize,
}

/// Rows a second of a truth run.
const RATE_HZ: f64 = 200.0;

impl Run {
    /// Reads the columns whose name without unit satisfies `wanted`; its rows are every
    /// `stride`th of the file's.
    pub fn open(name: &str, stride: usize, wanted: impl Fn(&str) -> bool) -> Option<Self> {
        let path = testkit::shared(&format!("data/truth/{name}.parquet"))?;
        let columns = sim::read_columns(&path, |full| {
            let name = full.split('[').next().unwrap_or(full);
            Ok(wanted(name).then(|| name.to_owned()))
        })
        .expect("columns of numbers");
        let all = columns.values().next().map_or(0, Vec::len);
        // The first and the last row have no slope.
        let rows = all.saturating_sub(2).div_ceil(stride);
        assert!(
            rows > 0,
            "no rows of the wanted columns in {}",
            path.display()
        );
        Some(Self {
            columns,
            rows,
            stride,
        })
    }

    pub fn get(&self, name: &str, row: usize) -> f64 {
        self.column(name)[1 + row * self.stride]
    }

    /// Rate of change of a column, per second.
    pub fn slope(&self, name: &str, row: usize) -> f64 {
        let (values, middle) = (self.column(name), 1 + row * self.stride);
        (values[middle + 1] - values[middle - 1]) * RATE_HZ / 2.0
    }

    /// Second derivative of a column at a row.
    pub fn bend(&self, name: &str, row: usize) -> f64 {
        let (values, middle) = (self.column(name), 1 + row * self.stride);
        (values[middle + 1] - 2.0 * values[middle] + values[middle - 1]) * RATE_HZ * RATE_HZ
    }

    fn column(&self, name: &str) -> &[f64] {
        self.columns
            .get(name)
            .unwrap_or_else(|| panic!("column {name} was not read"))
    }

    /// The vector of the columns `name` + `x`, `y`, `z` (+ `suffix`).
    pub fn vector(&self, name: &str, suffix: &str, row: usize) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.get(&format!("{name}{}{suffix}", ["x", "y", "z"][i]), row))
    }
}
