//! Tables as MAT files of level 5 (MATLAB 5.0 MAT-file format).

use std::io::{self, Write};

use store::{Column, Table, Values};

/// Data types and classes of the format.
const INT8: u32 = 1;
const UINT16: u32 = 4;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const INT64: u32 = 12;
const MATRIX: u32 = 14;
const CHAR_CLASS: u32 = 4;
const DOUBLE_CLASS: u32 = 6;
const INT64_CLASS: u32 = 14;
/// Length of the text at the beginning of a file, bytes.
const TEXT: usize = 116;
/// Longest name of a variable.
const NAME_MAX: usize = 63;

/// Collects a table and writes each column of numbers as a variable. The values of all rows are in memory,
/// because a variable is contiguous.
pub struct Writer {
    times: [Vec<i64>; 2],
    columns: Vec<Variable>,
}

/// A column of numbers.
struct Variable {
    /// Position among the columns of the table.
    place: usize,
    name: String,
    unit: String,
    /// Whether the values are 64-bit integers; otherwise they are floating-point numbers.
    is_integer: bool,
    /// The values of all rows, as in the file.
    bytes: Vec<u8>,
}

impl Writer {
    /// Takes the columns; texts, bytes and lists are left out.
    pub fn new(columns: &[Column]) -> Self {
        let mut variables: Vec<Variable> = Vec::new();
        let mut left_out = Vec::new();
        for (place, column) in columns.iter().enumerate() {
            if matches!(
                column.values,
                Values::Text(_) | Values::Bytes(_) | Values::List { .. }
            ) {
                left_out.push(&*column.name);
                continue;
            }
            let name = variable_name(&column.name, |name| {
                variables.iter().any(|other| other.name == name)
            });
            variables.push(Variable {
                place,
                name,
                unit: column.unit.clone(),
                is_integer: column.present.is_none() && matches!(column.values, Values::I64(_)),
                bytes: Vec::new(),
            });
        }
        if !left_out.is_empty() {
            tracing::warn!(
                "columns without numbers are not in the MAT file: {}; export a .csv or .parquet file",
                left_out.join(", ")
            );
        }
        Self {
            times: [Vec::new(), Vec::new()],
            columns: variables,
        }
    }

    /// Takes rows.
    pub fn take(&mut self, table: &Table) {
        let [log, publish] = &mut self.times;
        log.extend(&table.log_time_ns);
        publish.extend(&table.publish_time_ns);
        for variable in &mut self.columns {
            if let Some(column) = table.columns.get(variable.place) {
                variable.take(column);
            }
        }
    }

    /// Writes the file: the times in ns, the columns, and `column_names` with `column_units`, a row of
    /// characters for each column.
    pub fn write(&self, mut sink: impl Write) -> io::Result<()> {
        let text = "MATLAB 5.0 MAT-file, written by atvrec";
        write!(sink, "{text:TEXT$}")?;
        sink.write_all(&[0; 8])?;
        sink.write_all(&[0x00, 0x01, b'I', b'M'])?;
        for (name, times) in ["log_time_ns", "publish_time_ns"].iter().zip(&self.times) {
            let bytes: Vec<u8> = times.iter().flat_map(|ns| ns.to_le_bytes()).collect();
            matrix(
                &mut sink,
                name,
                INT64_CLASS,
                [times.len(), 1],
                INT64,
                &bytes,
            )?;
        }
        for Variable {
            name,
            is_integer,
            bytes,
            ..
        } in &self.columns
        {
            let (class, kind) = match is_integer {
                true => (INT64_CLASS, INT64),
                false => (DOUBLE_CLASS, DOUBLE),
            };
            matrix(&mut sink, name, class, [bytes.len() / 8, 1], kind, bytes)?;
        }
        let names: Vec<&str> = self.columns.iter().map(|of| &*of.name).collect();
        let units: Vec<&str> = self.columns.iter().map(|of| &*of.unit).collect();
        for (name, lines) in [("column_names", names), ("column_units", units)] {
            characters(&mut sink, name, &lines)?;
        }
        sink.flush()
    }
}

impl Variable {
    /// Adds the values of a column; an absent value is NaN.
    fn take(&mut self, column: &Column) {
        if let (true, Values::I64(list)) = (self.is_integer, &column.values) {
            let values = list.iter().flat_map(|value| value.to_le_bytes());
            self.bytes.extend(values);
            return;
        }
        let mut put = |values: &mut dyn Iterator<Item = f64>| {
            for (row, value) in values.enumerate() {
                let is_present = column.present.as_ref().is_none_or(|present| present[row]);
                let value = if is_present { value } else { f64::NAN };
                self.bytes.extend(value.to_le_bytes());
            }
        };
        match &column.values {
            Values::F64(list) => put(&mut list.iter().copied()),
            Values::I32(list) => put(&mut list.iter().map(|value| f64::from(*value))),
            Values::I64(list) => put(&mut list.iter().map(|value| *value as f64)),
            Values::U32(list) => put(&mut list.iter().map(|value| f64::from(*value))),
            Values::U64(list) => put(&mut list.iter().map(|value| *value as f64)),
            Values::Bool(list) => {
                put(&mut list.iter().map(|value| f64::from(u8::from(*value))));
            }
            Values::Text(_) | Values::Bytes(_) | Values::List { .. } => {}
        }
    }
}

/// A name that MATLAB accepts: letters, digits and underscores, a letter first. `is_taken` tells which names
/// other columns have.
fn variable_name(column: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let mut name: String = column
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert(0, 'x');
    }
    name.truncate(NAME_MAX);
    let mut number = 2;
    let base = name.clone();
    while is_taken(&name) {
        let suffix = format!("_{number}");
        name = base[..base.len().min(NAME_MAX - suffix.len())].to_owned() + &suffix;
        number += 1;
    }
    name
}

/// Writes lines as a matrix of characters, filled with blanks.
fn characters(sink: &mut impl Write, name: &str, lines: &[&str]) -> io::Result<()> {
    let rows: Vec<Vec<u16>> = lines
        .iter()
        .map(|line| line.encode_utf16().collect())
        .collect();
    let width = rows.iter().map(Vec::len).max().unwrap_or(0);
    let mut bytes = Vec::new();
    for column in 0..width {
        let units = rows.iter().map(|row| row.get(column).copied());
        bytes.extend(units.flat_map(|unit| unit.unwrap_or(u16::from(b' ')).to_le_bytes()));
    }
    matrix(sink, name, CHAR_CLASS, [rows.len(), width], UINT16, &bytes)
}

/// Writes a variable.
fn matrix(
    sink: &mut impl Write,
    name: &str,
    class: u32,
    dimensions: [usize; 2],
    kind: u32,
    data: &[u8],
) -> io::Result<()> {
    let too_large = |_| io::Error::other("the table is too large for a MAT file of level 5");
    let mut sizes = Vec::new();
    for size in dimensions {
        sizes.extend(i32::try_from(size).map_err(too_large)?.to_le_bytes());
    }
    let mut head = Vec::new();
    let flags = [class.to_le_bytes(), [0; 4]].concat();
    element(&mut head, UINT32, &flags)?;
    element(&mut head, INT32, &sizes)?;
    element(&mut head, INT8, name.as_bytes())?;
    let data_bytes = 8 + data.len().next_multiple_of(8);
    let all = u32::try_from(head.len() + data_bytes).map_err(too_large)?;
    sink.write_all(&MATRIX.to_le_bytes())?;
    sink.write_all(&all.to_le_bytes())?;
    sink.write_all(&head)?;
    element(sink, kind, data)
}

/// Writes a data element, filled to a multiple of eight bytes.
fn element(sink: &mut impl Write, kind: u32, data: &[u8]) -> io::Result<()> {
    sink.write_all(&kind.to_le_bytes())?;
    sink.write_all(&u32::try_from(data.len()).unwrap_or(u32::MAX).to_le_bytes())?;
    sink.write_all(data)?;
    let fill = data.len().next_multiple_of(8) - data.len();
    sink.write_all(&[0; 8][..fill])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_variables_and_differ() {
        let taken = ["fl_x_n", "x2_a"];
        let name = |column| variable_name(column, |name| taken.contains(&name));
        assert_eq!(name("fr.x_n"), "fr_x_n");
        assert_eq!(name("fl.x_n"), "fl_x_n_2");
        assert_eq!(name("2.a"), "x2_a_2");
        assert_eq!(name(&"a".repeat(80)).len(), NAME_MAX);
    }
}
