//! Truth files as comma-separated values.

use std::path::Path;

use super::{COLUMNS_MAX, Columns, NUMBERS_MAX, Wanted, shown, too_much};
use crate::SimError;

/// Longest line, bytes.
const LINE_MAX: usize = 1 << 20;

/// Reads the wanted columns. Cells are numbers, so that a line break ends a row also inside quotes.
pub fn read(path: &Path, bytes: Vec<u8>, wanted: Wanted<'_>) -> Result<Columns, SimError> {
    let damaged = |cause| SimError::Csv {
        path: path.to_owned(),
        cause,
    };
    if bytes
        .split(|byte| *byte == b'\n')
        .any(|line| line.len() > LINE_MAX)
    {
        return too_much(path, "bytes in a line", LINE_MAX as u64);
    }
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .quoting(false)
        .from_reader(&bytes[..]);
    let mut kept = Vec::new();
    let headers = reader.headers().map_err(damaged)?;
    if headers.len() > COLUMNS_MAX {
        return too_much(path, "columns", COLUMNS_MAX as u64);
    }
    for (index, found) in headers.iter().enumerate() {
        if let Some(name) = wanted(unquoted(found))? {
            kept.push((index, name, Vec::new()));
        }
    }
    let rows_max = NUMBERS_MAX / kept.len().max(1);
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(damaged)?;
        if row >= rows_max {
            return too_much(path, "rows", rows_max as u64);
        }
        for (index, name, values) in &mut kept {
            let cell = unquoted(record.get(*index).unwrap_or_default());
            values.push(cell.parse::<f64>().map_err(|_| SimError::BadValue {
                path: path.to_owned(),
                row: row + 1,
                column: name.clone(),
                value: shown(cell),
            })?);
        }
    }
    Ok(kept
        .into_iter()
        .map(|(_, name, values)| (name, values))
        .collect())
}

fn unquoted(cell: &str) -> &str {
    let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    inner.map_or(cell, str::trim)
}
