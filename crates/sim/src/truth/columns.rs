//! Columns of numbers of a Parquet or CSV file.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

#[cfg(feature = "parquet")]
use parquet::column::reader::ColumnReader;
#[cfg(feature = "parquet")]
use parquet::file::reader::{FileReader, SerializedFileReader};

use crate::SimError;

/// Columns by name; all are of one length.
pub type Columns = BTreeMap<String, Vec<f64>>;

/// Reads columns of numbers from a Parquet or CSV file; the end of the file's name says which.
/// `wanted` gives the name under which a column of the file is kept, or `None` to skip the column.
///
/// # Errors
/// A file that cannot be read or is damaged, a wanted column that holds anything but numbers (nulls
/// included), and the errors of `wanted`.
pub fn read_columns<W>(path: &Path, wanted: W) -> Result<Columns, SimError>
where
    W: Fn(&str) -> Result<Option<String>, SimError>,
{
    match path.extension().and_then(|end| end.to_str()) {
        #[cfg(feature = "parquet")]
        Some("parquet") => read_parquet(path, wanted),
        Some("csv") => read_csv(path, wanted),
        _ => Err(SimError::UnknownKind {
            path: path.to_owned(),
        }),
    }
}

#[cfg(feature = "parquet")]
fn read_parquet<W>(path: &Path, wanted: W) -> Result<Columns, SimError>
where
    W: Fn(&str) -> Result<Option<String>, SimError>,
{
    let damaged = |cause| SimError::Parquet {
        path: path.to_owned(),
        cause,
    };
    let file = File::open(path).map_err(|cause| SimError::Read {
        path: path.to_owned(),
        cause,
    })?;
    let reader = SerializedFileReader::new(file).map_err(damaged)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let mut columns = Columns::new();
    for (index, descriptor) in schema.columns().iter().enumerate() {
        let Some(name) = wanted(descriptor.name())? else {
            continue;
        };
        let mut values = Vec::new();
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(damaged)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let column = group.get_column_reader(index).map_err(damaged)?;
            let before = values.len();
            append_column(path, &name, column, rows, &mut values)?;
            if values.len() - before != rows {
                return Err(SimError::BadValue {
                    path: path.to_owned(),
                    row: values.len() + 1,
                    column: name,
                    value: "null".to_owned(),
                });
            }
        }
        columns.insert(name, values);
    }
    Ok(columns)
}

/// Appends one row group's values; nulls are left out, so that the caller sees too few.
#[cfg(feature = "parquet")]
fn append_column(
    path: &Path,
    name: &str,
    column: ColumnReader,
    rows: usize,
    values: &mut Vec<f64>,
) -> Result<(), SimError> {
    let damaged = |cause| SimError::Parquet {
        path: path.to_owned(),
        cause,
    };
    let mut levels = Vec::new();
    match column {
        ColumnReader::DoubleColumnReader(mut typed) => {
            typed
                .read_records(rows, Some(&mut levels), None, values)
                .map_err(damaged)?;
        }
        ColumnReader::FloatColumnReader(mut typed) => {
            let mut narrow = Vec::new();
            typed
                .read_records(rows, Some(&mut levels), None, &mut narrow)
                .map_err(damaged)?;
            values.extend(narrow.into_iter().map(f64::from));
        }
        other => {
            let found = match other {
                ColumnReader::BoolColumnReader(_) => "booleans",
                ColumnReader::Int32ColumnReader(_) | ColumnReader::Int64ColumnReader(_) => {
                    "integers"
                }
                _ => "bytes",
            };
            return Err(SimError::NotNumbers {
                path: path.to_owned(),
                column: name.to_owned(),
                found: found.to_owned(),
            });
        }
    }
    Ok(())
}

fn read_csv<W>(path: &Path, wanted: W) -> Result<Columns, SimError>
where
    W: Fn(&str) -> Result<Option<String>, SimError>,
{
    let damaged = |cause| SimError::Csv {
        path: path.to_owned(),
        cause,
    };
    let file = File::open(path).map_err(|cause| SimError::Read {
        path: path.to_owned(),
        cause,
    })?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(file);
    let mut columns = Vec::new();
    for (index, found) in reader.headers().map_err(damaged)?.iter().enumerate() {
        if let Some(name) = wanted(found)? {
            columns.push((index, name, Vec::new()));
        }
    }
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(damaged)?;
        for (index, name, values) in &mut columns {
            let cell = record.get(*index).unwrap_or_default();
            values.push(cell.parse::<f64>().map_err(|_| SimError::BadValue {
                path: path.to_owned(),
                row: row + 1,
                column: name.clone(),
                value: cell.to_owned(),
            })?);
        }
    }
    Ok(columns
        .into_iter()
        .map(|(_, name, values)| (name, values))
        .collect())
}
