//! Truth files as Parquet.

use std::fs::File;
use std::path::Path;

use parquet::column::reader::ColumnReader;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::thrift::Cursor;
use super::{COLUMNS_MAX, Columns, NUMBERS_MAX, Wanted, too_much};
use crate::SimError;

/// Largest page after decompression, bytes.
const PAGE_MAX: i64 = 64 << 20;
/// Rows that are read at once: a count that is declared and not there costs no more.
const BATCH: usize = 1 << 16;
/// Behind the footer: its length and "PAR1".
const TAIL: usize = 8;

/// Reads the wanted columns.
pub fn read(path: &Path, bytes: Vec<u8>, wanted: Wanted<'_>) -> Result<Columns, SimError> {
    let damaged = |cause| SimError::Parquet {
        path: path.to_owned(),
        cause,
    };
    let unreadable = |what: &str| SimError::Unreadable {
        path: path.to_owned(),
        what: what.to_owned(),
    };
    let footer = footer(&bytes).ok_or_else(|| unreadable("it is cut or no Parquet file"))?;
    Cursor::new(footer)
        .schema_depth()
        .ok_or_else(|| unreadable("its schema is damaged or nested too deeply"))?;
    let file = File::open(path).map_err(|cause| SimError::Read {
        path: path.to_owned(),
        cause,
    })?;
    let reader = SerializedFileReader::new(file).map_err(damaged)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    if schema.num_columns() > COLUMNS_MAX {
        return too_much(path, "columns", COLUMNS_MAX as u64);
    }
    let mut kept = Vec::new();
    for (index, descriptor) in schema.columns().iter().enumerate() {
        if let Some(name) = wanted(descriptor.name())? {
            if descriptor.path().parts().len() > 1 || descriptor.max_rep_level() > 0 {
                return Err(SimError::NotNumbers {
                    path: path.to_owned(),
                    column: name,
                    found: "lists or structures".to_owned(),
                });
            }
            kept.push((index, name));
        }
    }
    let rows_max = NUMBERS_MAX / kept.len().max(1);
    let mut columns = Columns::new();
    for (index, name) in kept {
        let mut values = Vec::new();
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(damaged)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            if rows > rows_max - values.len() {
                return too_much(path, "rows", rows_max as u64);
            }
            check_pages(&bytes, group.metadata().column(index))
                .map_err(|what| unreadable(&what))?;
            let mut column = group.get_column_reader(index).map_err(damaged)?;
            let end = values.len() + rows;
            while values.len() < end {
                let batch = BATCH.min(end - values.len());
                if append(path, &name, &mut column, batch, &mut values)? < batch {
                    return Err(SimError::BadValue {
                        path: path.to_owned(),
                        row: values.len() + 1,
                        column: name,
                        value: "null or missing".to_owned(),
                    });
                }
            }
        }
        columns.insert(name, values);
    }
    Ok(columns)
}

fn footer(bytes: &[u8]) -> Option<&[u8]> {
    let (body, tail) = bytes.split_at_checked(bytes.len().checked_sub(TAIL)?)?;
    let length = u32::from_le_bytes(*tail.first_chunk()?);
    body.get(body.len().checked_sub(usize::try_from(length).ok()?)?..)
}

/// Looks at the headers of all pages of a column before their sizes are used.
fn check_pages(bytes: &[u8], column: &ColumnChunkMetaData) -> Result<(), String> {
    let (start, length) = column.byte_range();
    let chunk = usize::try_from(start)
        .ok()
        .and_then(|start| bytes.get(start..)?.get(..usize::try_from(length).ok()?))
        .ok_or("a column lies beyond its end")?;
    let mut cursor = Cursor::new(chunk);
    while !cursor.is_at_end() {
        let header = cursor
            .page_header()
            .ok_or("the header of a page is damaged")?;
        if header.inflated > PAGE_MAX {
            return Err(format!(
                "a page has {} bytes after decompression, more than {PAGE_MAX}",
                header.inflated
            ));
        }
        if header.dictionary_values > header.inflated {
            return Err(format!(
                "a dictionary declares {} values in {} bytes",
                header.dictionary_values, header.inflated
            ));
        }
        cursor
            .advance(header.stored)
            .ok_or("a page ends behind its column")?;
    }
    Ok(())
}

/// Appends values of one row group; nulls are left out. Returns how many came.
fn append(
    path: &Path,
    name: &str,
    column: &mut ColumnReader,
    rows: usize,
    values: &mut Vec<f64>,
) -> Result<usize, SimError> {
    let damaged = |cause| SimError::Parquet {
        path: path.to_owned(),
        cause,
    };
    let before = values.len();
    let mut levels = Vec::new();
    match column {
        ColumnReader::DoubleColumnReader(typed) => {
            typed
                .read_records(rows, Some(&mut levels), None, values)
                .map_err(damaged)?;
        }
        ColumnReader::FloatColumnReader(typed) => {
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
    Ok(values.len() - before)
}
