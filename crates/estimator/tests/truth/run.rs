//! Truth runs of the independent simulator, and the vehicle file made from their parameters.

use std::collections::HashMap;
use std::fs::File;
use std::path::PathBuf;

use model::vehicle::Vehicle;
use parquet::column::reader::ColumnReader;
use parquet::file::reader::{FileReader, SerializedFileReader};

/// Rate of the truth files, Hz.
pub const RATE_HZ: f64 = 200.0;

/// Where the truth runs are; `None`, with a loud word, where they are absent.
pub fn directory() -> Option<PathBuf> {
    let path = PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/truth"
    ));
    if path.join("params.json").exists() {
        Some(path)
    } else {
        eprintln!("SKIPPED: no truth runs at {}", path.display());
        None
    }
}

/// The columns of one run.
pub struct Run {
    pub rows: usize,
    pub columns: HashMap<String, Vec<f64>>,
}

impl Run {
    pub fn load(name: &str) -> Self {
        let path = directory()
            .expect("checked by the caller")
            .join(format!("{name}.parquet"));
        let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        let mut columns = HashMap::new();
        for index in 0..schema.num_columns() {
            let full = schema.column(index).name().to_owned();
            let short = full.split('[').next().unwrap_or(&full).to_owned();
            let mut values = Vec::new();
            for group in 0..reader.num_row_groups() {
                let group = reader.get_row_group(group).unwrap();
                let rows = group.metadata().num_rows() as usize;
                match group.get_column_reader(index).unwrap() {
                    ColumnReader::DoubleColumnReader(mut column) => {
                        let mut part = Vec::with_capacity(rows);
                        let mut levels = Vec::new();
                        column
                            .read_records(rows, Some(&mut levels), None, &mut part)
                            .unwrap();
                        values.extend(part);
                    }
                    ColumnReader::FloatColumnReader(mut column) => {
                        let mut part = Vec::with_capacity(rows);
                        let mut levels = Vec::new();
                        column
                            .read_records(rows, Some(&mut levels), None, &mut part)
                            .unwrap();
                        values.extend(part.into_iter().map(f64::from));
                    }
                    _ => panic!("column {full} is not a floating-point number"),
                }
            }
            columns.insert(short, values);
        }
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
    Vehicle::from_truth_params(&std::fs::read_to_string(path).unwrap()).unwrap()
}
