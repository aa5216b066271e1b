//! Tables as comma-separated values.

use std::fmt::Write as _;
use std::io::{self, Write};

use sample::text::csv_cell;
use store::{Column, Table, Values};

use super::{heading, value_name};

/// Writes a table: a line of headings, then a line per row. An absent cell is empty, or `NaN` in a
/// column of floating-point numbers. The values of a list are separated by `;`. Text has no control
/// characters, and an apostrophe precedes text that a spreadsheet could evaluate as a formula.
pub struct Writer<W: Write> {
    lines: csv::Writer<W>,
    cell: String,
    /// Number of columns of times.
    times: usize,
}

impl<W: Write> Writer<W> {
    /// Writes the headings. `times` are those of `log_time_ns`, and of `publish_time_ns` if the file has it.
    pub fn new(sink: W, times: &[&str], columns: &[Column]) -> io::Result<Self> {
        let mut writer = Self {
            lines: csv::Writer::from_writer(sink),
            cell: String::new(),
            times: times.len(),
        };
        writer.headings(times, columns).map_err(cause)?;
        Ok(writer)
    }

    /// Writes rows.
    pub fn write(&mut self, table: &Table) -> io::Result<()> {
        self.rows(table).map_err(cause)
    }

    /// Writes what is in memory.
    pub fn finish(mut self) -> io::Result<()> {
        self.lines.flush()
    }

    fn headings(&mut self, times: &[&str], columns: &[Column]) -> csv::Result<()> {
        for name in times {
            self.lines.write_field(name)?;
        }
        for column in columns {
            self.lines
                .write_field(csv_cell(&heading(column)).as_bytes())?;
        }
        self.lines.write_record(None::<&[u8]>)
    }

    fn rows(&mut self, table: &Table) -> csv::Result<()> {
        let Self { lines, cell, times } = self;
        for row in 0..table.log_time_ns.len() {
            for times_ns in [&table.log_time_ns, &table.publish_time_ns]
                .iter()
                .take(*times)
            {
                lines.write_field(times_ns[row].to_string())?;
            }
            for column in &table.columns {
                cell.clear();
                write_cell(column, row, cell);
                if is_text(column) {
                    lines.write_field(csv_cell(cell).as_bytes())?;
                } else {
                    lines.write_field(&*cell)?;
                }
            }
            lines.write_record(None::<&[u8]>)?;
        }
        Ok(())
    }
}

fn cause(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(cause) => cause,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// Whether the cells of a column are text, which a spreadsheet could evaluate as a formula.
fn is_text(column: &Column) -> bool {
    let values = match &column.values {
        Values::List { values, .. } => values,
        values => values,
    };
    matches!(values, Values::Text(_)) || !column.names.is_empty()
}

fn write_cell(column: &Column, row: usize, cell: &mut String) {
    if column.present.as_ref().is_some_and(|present| !present[row]) {
        return;
    }
    match &column.values {
        Values::List { ends, values } => {
            let begin = row.checked_sub(1).map_or(0, |before| ends[before]);
            for at in begin..ends[row] {
                if at > begin {
                    cell.push(';');
                }
                write_value(column, values, at, cell);
            }
        }
        values => write_value(column, values, row, cell),
    }
}

/// Writing to a string cannot fail.
fn write_value(column: &Column, values: &Values, at: usize, cell: &mut String) {
    let _ = match values {
        Values::F64(list) => write!(cell, "{}", list[at]),
        Values::I32(list) if column.names.is_empty() => write!(cell, "{}", list[at]),
        Values::I32(list) => write!(cell, "{}", value_name(column, list[at])),
        Values::I64(list) => write!(cell, "{}", list[at]),
        Values::U32(list) => write!(cell, "{}", list[at]),
        Values::U64(list) => write!(cell, "{}", list[at]),
        Values::Bool(list) => write!(cell, "{}", list[at]),
        Values::Text(list) => write!(cell, "{}", list[at]),
        Values::Bytes(list) => list[at]
            .iter()
            .try_for_each(|byte| write!(cell, "{byte:02x}")),
        // The reader creates no lists of lists.
        Values::List { .. } => Ok(()),
    };
}
