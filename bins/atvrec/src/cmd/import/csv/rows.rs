//! The rows of a table with their times.

use std::path::{Path, PathBuf};

use engine::config::CsvMap;
use sample::LogTime;
use wire::column::{self, Column, Quantity};
use wire::csv::{BadCell, Format, Held, Line, LineError, MAX_LINE, Reader};

use super::super::clock::TimeReader;
use super::{Piece, Reference, RowErrors, described, shortened};
use crate::exit::UsageError;

/// The rows of a file.
pub struct Rows {
    /// Lines before the first row: comments and header.
    pub preamble: String,
    rows: Vec<Row>,
    /// What a user should know of single rows.
    warnings: Vec<String>,
}

struct Row {
    time: LogTime,
    /// Number of its line, from one.
    line: usize,
    /// Text of the line, with the comments before it.
    text: String,
    values: Vec<Option<f64>>,
}

impl Rows {
    /// Reads the rows; those with errors are left out.
    pub fn read(
        path: &Path,
        text: &str,
        map: &CsvMap,
        errors: &mut RowErrors,
    ) -> anyhow::Result<Self> {
        let mut reader = RowReader::new(path, map);
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        let last_row = lines.iter().rposition(|line| !map.format.is_blank(line));
        let mut before = String::new();
        let mut read = Self {
            preamble: String::new(),
            rows: Vec::new(),
            warnings: Vec::new(),
        };
        for (index, line) in lines.iter().enumerate() {
            let place = match (Some(index) == last_row, line.ends_with('\n')) {
                (false, _) => Position::Inner,
                (true, true) => Position::Last,
                (true, false) => Position::Cut,
            };
            match reader.take(index, line, place, errors)? {
                Taken::Comment => before.push_str(line),
                Taken::LeftOut => {}
                Taken::Row(time, values) => {
                    if read.rows.is_empty() {
                        read.preamble = std::mem::take(&mut before);
                    }
                    let text = std::mem::take(&mut before) + line;
                    read.rows.push(Row {
                        time,
                        line: index + 1,
                        text,
                        values,
                    });
                }
            }
        }
        if let Some(last) = read.rows.last_mut() {
            // Comments after the last row belong to it.
            if !before.is_empty() && !last.text.ends_with('\n') {
                last.text.push('\n');
            }
            last.text.push_str(&before);
        }
        reader.finish()?;
        read.warnings = reader.warnings;
        read.order(path, map, errors);
        read.find_halves(path, &map.format);
        Ok(read)
    }

    fn order(&mut self, path: &Path, map: &CsvMap, errors: &mut RowErrors) {
        if map.times.sort {
            // Comments stay with the row after them.
            self.rows.sort_by_key(|row| row.time);
            return;
        }
        for (index, pair) in self.rows.windows(2).enumerate() {
            if pair[1].time < pair[0].time {
                let back_s = pair[0].time.seconds_since(pair[1].time);
                errors.add(|| {
                    format!(
                        "{}: data row {}: the time decreases by {back_s:.6} s; correct the \
                         file, or set sort = true under [time] of the column map",
                        path.display(),
                        index + 2
                    )
                });
            }
        }
    }

    /// Counts rows that have one half of a pair only, such as a latitude without a longitude.
    fn find_halves(&mut self, path: &Path, format: &Format) {
        let (mut count, mut first) = (0, None);
        for row in &self.rows {
            let present = row.present(format);
            let columns: Vec<&Column> = present.iter().map(|(column, _)| *column).collect();
            if let Some((index, absent)) = column::incomplete(&columns).into_iter().next() {
                count += 1;
                let names: Vec<String> = absent.iter().map(|quantity| quantity.name()).collect();
                let quantity = columns[index].quantity.name();
                first.get_or_insert((row.line, quantity, names.join(" and ")));
            }
        }
        if let Some((line, quantity, absent)) = first {
            self.warnings.push(format!(
                "{}:{line}: {quantity} without {absent} is no measurement; {count} such rows have none",
                path.display()
            ));
        }
    }

    /// Leaves out the values that the file repeats until it has new ones.
    pub fn leave_out_held(&mut self, format: &Format) {
        let mut held = Held::default();
        for row in &mut self.rows {
            held.leave_out(format, &mut row.values);
        }
    }

    /// Logs the warnings.
    pub fn warn(&self, path: &Path) {
        for warning in &self.warnings {
            tracing::warn!("{warning}");
        }
        if self.rows.is_empty() {
            tracing::warn!("{}: no row has data", path.display());
        }
    }

    /// Values of a column by row.
    pub fn column(&self, index: usize) -> Vec<Option<f64>> {
        self.rows.iter().map(|row| row.values[index]).collect()
    }

    /// Line of a row.
    pub fn line(&self, row: usize) -> usize {
        self.rows.get(row).map_or(0, |row| row.line)
    }

    /// Adds the values of a reference instrument.
    pub fn reference(&self, format: &Format, reference: &mut Reference) {
        for row in &self.rows {
            for ((_, column), value) in format.columns.iter().zip(&row.values) {
                if let (Quantity::Truth(truth), Some(value)) = (column.quantity, value) {
                    let time = row.time.offset_seconds(-column.latency_s);
                    reference.push(truth, time, *value);
                }
            }
        }
    }

    /// The rows as bytes of the log.
    pub fn pieces(self, source: usize, format: &Format) -> impl Iterator<Item = Piece> + use<'_> {
        self.rows.into_iter().map(move |row| {
            let measurements = column::measurements(&row.present(format)).len();
            let mut bytes = row.text.into_bytes();
            if !bytes.ends_with(b"\n") {
                // The decoder needs the end of the line.
                bytes.push(b'\n');
            }
            Piece {
                source,
                time: row.time,
                line: row.line,
                rows: 1,
                measurements: Some(measurements),
                run: 0,
                bytes,
            }
        })
    }
}

impl Row {
    fn present<'f>(&self, format: &'f Format) -> Vec<(&'f Column, f64)> {
        let columns = format.columns.iter().map(|(_, column)| column);
        columns
            .zip(&self.values)
            .filter_map(|(column, value)| Some((column, (*value)?)))
            .collect()
    }
}

/// Position of a line in the file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Position {
    /// Rows follow.
    Inner,
    /// The last row.
    Last,
    /// The last row, without a line end.
    Cut,
}

enum Taken {
    /// A comment, the header or a line that is to be skipped.
    Comment,
    /// A row that is not imported.
    LeftOut,
    Row(LogTime, Vec<Option<f64>>),
}

/// Reads a file line by line.
struct RowReader<'m> {
    path: PathBuf,
    map: &'m CsvMap,
    reader: Reader,
    clock: TimeReader<'m>,
    /// Cells of the row before, and the fewest decimals of the last cells of all rows.
    cells: usize,
    decimals: Option<usize>,
    without_time: usize,
    warnings: Vec<String>,
}

impl<'m> RowReader<'m> {
    fn new(path: &Path, map: &'m CsvMap) -> Self {
        Self {
            path: path.to_owned(),
            map,
            reader: Reader::new(map.format.clone(), map.times.row.places()).strict(),
            clock: TimeReader::new(&map.times, map.format.decimal_comma),
            cells: 0,
            decimals: None,
            without_time: 0,
            warnings: Vec::new(),
        }
    }

    /// Takes a line.
    fn take(
        &mut self,
        number: usize,
        line: &str,
        position: Position,
        errors: &mut RowErrors,
    ) -> anyhow::Result<Taken> {
        let is_cut = position == Position::Cut;
        let place = format!("{}:{}", self.path.display(), number + 1);
        if line.len() > MAX_LINE {
            anyhow::bail!(
                "{place}: the line has {} bytes, but the limit is {MAX_LINE}; check the delimiter \
                 and the line ends of the file",
                line.len()
            );
        }
        let was_read = self.reader.also().is_some();
        let values = match self.reader.take(line) {
            Ok(Line::Row(values)) => values,
            Ok(Line::Nothing | Line::Header) => return Ok(Taken::Comment),
            Err(LineError::Cell(bad)) if was_read || self.reader.also().is_some() => {
                if is_cut {
                    self.leave_out_cut(&place);
                } else if position == Position::Last && bad.text.is_none() {
                    let text = self.cell_error(&place, &bad);
                    self.warnings
                        .push(format!("{text}; it is the last row, and is left out"));
                } else {
                    errors.add(|| self.cell_error(&place, &bad));
                }
                return Ok(Taken::LeftOut);
            }
            Err(error) => return Err(self.header_error(&place, line, error)),
        };
        let cells = self.map.format.cells(line);
        if is_cut && self.ends_early(&cells) {
            self.leave_out_cut(&place);
            return Ok(Taken::LeftOut);
        }
        self.cells = cells.len();
        if let Some(last) = cells.last().filter(|last| !last.is_empty()) {
            let found = decimals(last);
            self.decimals = Some(self.decimals.map_or(found, |fewest| fewest.min(found)));
        }
        let time_cells: Vec<&str> = (self.reader.also().unwrap_or_default().iter())
            .map(|position| cells.get(*position).copied().unwrap_or_default())
            .collect();
        let is_empty = |cell: &&str| matches!(self.map.format.number(cell), Ok(None));
        if time_cells.iter().any(is_empty) {
            // A row of another table in the same file.
            self.without_time += usize::from(values.iter().any(Option::is_some));
            return Ok(Taken::LeftOut);
        }
        match self.clock.read(&time_cells) {
            Ok(time) => Ok(Taken::Row(time, values)),
            Err(_) if is_cut => {
                self.leave_out_cut(&place);
                Ok(Taken::LeftOut)
            }
            Err(text) => {
                errors.add(|| format!("{place}: {text}"));
                Ok(Taken::LeftOut)
            }
        }
    }

    /// Whether a last row without a line end lacks cells, or digits that all rows before it have.
    fn ends_early(&self, cells: &[&str]) -> bool {
        let last = cells.last().copied().unwrap_or_default();
        let cut = |fewest: usize| !last.is_empty() && decimals(last) < fewest;
        cells.len() < self.cells || last.ends_with('.') || self.decimals.is_some_and(cut)
    }

    fn leave_out_cut(&mut self, place: &str) {
        self.warnings
            .push(format!("{place}: the last row was cut; it is left out"));
    }

    fn finish(&mut self) -> anyhow::Result<()> {
        let path = self.path.display();
        if self.reader.also().is_none() {
            anyhow::bail!(
                "{path} has no header line; set header = false under [table] of the column map if the \
                 file has none"
            );
        }
        if self.without_time > 0 {
            self.warnings.push(format!(
                "{path}: {} rows with values have no time; they are left out",
                self.without_time
            ));
        }
        match self.clock.doubt() {
            Some(text) => Err(UsageError(format!("{path}: {text}")).into()),
            None => Ok(()),
        }
    }

    fn header_error(&self, place: &str, line: &str, error: LineError) -> anyhow::Error {
        let header = self.map.format.cells(line);
        let path = self.path.display();
        UsageError(match error {
            LineError::Absent(column) => {
                let taken = if self.map.format.header {
                    String::new()
                } else {
                    "; the map says header = false".to_owned()
                };
                format!(
                    "{path} has no column {column}; its columns are: {}{taken}",
                    super::super::listed(&header)
                )
            }
            LineError::Twice(column, [first, second]) => format!(
                "{place}: column {column} occurs twice, at positions {first} and {second}; set from = \
                 {first} or from = {second} in the column map"
            ),
            LineError::Numbers => format!(
                "{place}: the columns are given by number, and the line that should be the header has \
                 numbers; set header = false under [table] of the column map"
            ),
            LineError::Unit(index, unit) => {
                let (column, map) = &self.map.format.columns[index];
                format!(
                    "{place}: {} has the unit {unit}, but the column map states {}; correct the map",
                    described(column, &map.quantity.name()),
                    map.unit
                )
            }
            LineError::Cell(bad) => self.cell_error(place, &bad),
        })
        .into()
    }

    fn cell_error(&self, place: &str, bad: &BadCell) -> String {
        let (name, column) = &self.map.format.columns[bad.column];
        let column = described(name, &column.quantity.name());
        match &bad.text {
            Some(text) => format!(
                "{place}: {column}: \"{}\" is not a number; correct the cell, or add the text to missing \
                 under [table] of the column map",
                shortened(text)
            ),
            None => format!(
                "{place}: the row ends before {column}; correct the row, or set the delimiter under \
                 [table] of the column map"
            ),
        }
    }
}

/// Digits after the decimal separator.
fn decimals(cell: &str) -> usize {
    let part = cell.find(['.', ',']).map_or("", |at| &cell[at + 1..]);
    part.bytes().take_while(u8::is_ascii_digit).count()
}
