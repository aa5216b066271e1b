//! Truth runs of the independent simulator, and the vehicle file made from their parameters.

use std::path::PathBuf;

use model::vehicle::Vehicle;

/// Rate of the truth files, Hz.
pub const RATE_HZ: f64 = 200.0;

/// Folder of the truth runs; `None` if the data is missing.
pub fn directory() -> Option<PathBuf> {
    testkit::shared("data/truth")
}

/// The columns of one run.
pub struct Run {
    pub rows: usize,
    pub columns: sim::Columns,
}

impl Run {
    pub fn load(name: &str) -> Self {
        let path = directory()
            .expect("checked by the caller")
            .join(format!("{name}.parquet"));
        let columns =
            sim::read_columns(&path, |full| Ok(full.split('[').next().map(str::to_owned))).unwrap();
        let rows = columns["t"].len();
        Self { rows, columns }
    }

    pub fn column(&self, name: &str) -> &[f64] {
        self.columns
            .get(name)
            .unwrap_or_else(|| panic!("no column {name}"))
    }

    pub fn vector(&self, names: [&str; 3], row: usize) -> [f64; 3] {
        names.map(|name| self.column(name)[row])
    }
}

/// The vehicle file of `params.json`: what a workshop could measure.
pub fn vehicle() -> Vehicle {
    let path = directory()
        .expect("checked by the caller")
        .join("params.json");
    sim::vehicle_from_truth_params(&std::fs::read_to_string(path).unwrap()).unwrap()
}
