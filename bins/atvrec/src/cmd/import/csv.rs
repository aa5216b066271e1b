//! `atvrec import csv`: convert delimited text.

use std::path::{Path, PathBuf};

use engine::config::{CsvMap, Problems, RowTime, csv_map};
use sample::LogTime;
use wire::column::{Column, Quantity};
use wire::csv::{Format, MAX_LINE, Place};

use super::log::{self, Piece, Source};
use super::truth::Reference;
use super::{
    RowErrors, START_DEFAULT_NS, Table, UNIX_TIME_FROM_NS, configuration, nanos, output, read_text,
    shortened, source_names,
};
use crate::cli::ImportCsvArgs;
use crate::exit::{Outcome, UsageError};

/// Runs the command.
pub fn run(args: &ImportCsvArgs) -> anyhow::Result<Outcome> {
    let columns = &args.columns;
    if columns.len() != 1 && columns.len() != args.input.len() {
        return Err(UsageError(format!(
            "there are {} files and {} column maps; give one --columns for all files, or one for \
             each file",
            args.input.len(),
            columns.len()
        ))
        .into());
    }
    let output = output(&args.into, args.input.iter().chain(columns))?;
    let map_of = |file: usize| &columns[file.min(columns.len() - 1)];
    let names = source_names(&args.input);
    let (mut tables, mut errors) = (Vec::new(), RowErrors::default());
    let (mut pieces, mut reference) = (Vec::new(), Reference::default());
    let mut sources = Vec::new();
    for (source, path) in args.input.iter().enumerate() {
        let map_path = map_of(source);
        let map_name = map_path.display().to_string();
        let map = csv_map(&map_name, &read_text(map_path)?).map_err(Problems)?;
        let text = read_text(path)?;
        let rows = Rows::read(path, &text, &map, &mut errors)?;
        rows.reference(&map.format, &mut reference);
        sources.push(Source {
            name: &names[source],
            path,
            preamble: rows.preamble.as_bytes().to_vec(),
        });
        pieces.extend(rows.pieces(source));
        tables.push((path, map_name));
    }
    errors.finish()?;
    pieces.sort_by_key(|piece| piece.time);
    let tables: Vec<Table<'_>> = tables
        .iter()
        .map(|(path, map)| Table {
            kind: "csv",
            path,
            columns: map,
        })
        .collect();
    let config = configuration(&names, &tables, &args.into)?;
    let truth = reference.on_grid();
    log::write(&config, &sources, pieces, &truth, &output)
}

/// The rows of a file.
struct Rows<'t> {
    /// Lines before the first row: comments and header.
    preamble: &'t str,
    rows: Vec<Row<'t>>,
}

struct Row<'t> {
    time: LogTime,
    /// Number of its line, from one.
    line: usize,
    /// Text of the line, with the comments before it.
    text: &'t str,
    values: Vec<Option<f64>>,
}

impl<'t> Rows<'t> {
    fn read(
        path: &Path,
        text: &'t str,
        map: &CsvMap,
        errors: &mut RowErrors,
    ) -> anyhow::Result<Self> {
        let mut reader = RowReader::new(path, map);
        let (mut at, mut begin) = (0, 0);
        let mut preamble = "";
        let mut rows: Vec<Row<'t>> = Vec::new();
        for (number, line) in text.split_inclusive('\n').enumerate() {
            let line_begin = at;
            at += line.len();
            if let Some((time, values)) = reader.take(number, line, errors)? {
                if rows.is_empty() {
                    preamble = &text[..line_begin];
                    begin = line_begin;
                }
                rows.push(Row {
                    time,
                    line: number + 1,
                    text: &text[begin..at],
                    values,
                });
                begin = at;
            }
        }
        if let Some(last) = rows.last_mut() {
            // Comments after the last row belong to it.
            let length = last.text.len() + (at - begin);
            last.text = &text[begin - last.text.len()..][..length];
        }
        if reader.positions.is_none() {
            anyhow::bail!(
                "{} has no header line; set header = false under [table] of the column map if the \
                 file has none",
                path.display()
            );
        }
        if map.times.sort {
            // Comments stay with the row after them.
            rows.sort_by_key(|row| row.time);
        } else {
            for (index, pair) in rows.windows(2).enumerate() {
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
        Ok(Self { preamble, rows })
    }

    fn reference(&self, format: &Format, reference: &mut Reference) {
        for row in &self.rows {
            for ((_, column), value) in format.columns.iter().zip(&row.values) {
                if let (Quantity::Truth(truth), Some(value)) = (column.quantity, value) {
                    let time = row.time.offset_seconds(-column.delay_s);
                    reference.push(truth, time, *value);
                }
            }
        }
    }

    fn pieces(self, source: usize) -> impl Iterator<Item = Piece> {
        self.rows.into_iter().map(move |row| {
            let mut bytes = row.text.as_bytes().to_vec();
            if !bytes.ends_with(b"\n") {
                // The decoder needs the end of the line.
                bytes.push(b'\n');
            }
            Piece {
                source,
                time: row.time,
                line: row.line,
                bytes,
            }
        })
    }
}

/// Reads a file line by line.
struct RowReader<'m> {
    path: PathBuf,
    map: &'m CsvMap,
    to_skip: usize,
    positions: Option<Vec<usize>>,
    time_position: Option<usize>,
    rows: u64,
    start_ns: Option<u64>,
}

impl<'m> RowReader<'m> {
    fn new(path: &Path, map: &'m CsvMap) -> Self {
        let mut reader = Self {
            path: path.to_owned(),
            map,
            to_skip: map.format.skip_lines,
            positions: None,
            time_position: None,
            rows: 0,
            start_ns: map.times.start_unix_ns,
        };
        if !map.format.header {
            reader.positions = reader.find(&[]).ok();
        }
        reader
    }

    /// Time and values of a line; `None` for comments, the header and rows without a time.
    fn take(
        &mut self,
        number: usize,
        line: &str,
        errors: &mut RowErrors,
    ) -> anyhow::Result<Option<(LogTime, Vec<Option<f64>>)>> {
        let format = &self.map.format;
        if line.len() > MAX_LINE {
            anyhow::bail!(
                "{}:{}: the line has {} bytes, but the limit is {MAX_LINE}; check the delimiter \
                 and the line ends of the file",
                self.path.display(),
                number + 1,
                line.len()
            );
        }
        if self.to_skip > 0 {
            self.to_skip -= 1;
            return Ok(None);
        }
        if format.is_blank(line) {
            return Ok(None);
        }
        let cells = format.cells(line);
        let Some(positions) = &self.positions else {
            self.positions = Some(self.find(&cells)?);
            return Ok(None);
        };
        let place = format!("{}:{}", self.path.display(), number + 1);
        match format.row(positions, &cells) {
            Ok(values) => Ok(self.time(&place, &cells, errors).map(|time| (time, values))),
            Err(bad) => {
                let (name, column) = &format.columns[bad.column];
                errors.add(|| cell_error(&place, name, column, bad.text.as_deref()));
                Ok(None)
            }
        }
    }

    fn find(&mut self, header: &[&str]) -> anyhow::Result<Vec<usize>> {
        let format = &self.map.format;
        let absent = |place: &Place| {
            UsageError(format!(
                "{} has no column {place}; its columns are: {}",
                self.path.display(),
                super::listed(header)
            ))
        };
        let mut positions = Vec::with_capacity(format.columns.len());
        for (place, _) in &format.columns {
            positions.push(
                format
                    .position(place, header)
                    .ok_or_else(|| absent(place))?,
            );
        }
        if let RowTime::Column(place, _) = &self.map.times.row {
            let position = format.position(place, header);
            self.time_position = Some(position.ok_or_else(|| absent(place))?);
        }
        Ok(positions)
    }

    fn time(&mut self, place: &str, cells: &[&str], errors: &mut RowErrors) -> Option<LogTime> {
        let since_ns = match &self.map.times.row {
            RowTime::Rate(rate_hz) => {
                let nanos = (self.rows as f64 / rate_hz * 1e9).round() as i128;
                self.rows += 1;
                nanos
            }
            RowTime::Column(name, unit_ns) => {
                let cell = cells.get(self.time_position?).copied().unwrap_or("");
                let text = if self.map.format.decimal_comma {
                    cell.replace(',', ".")
                } else {
                    cell.to_owned()
                };
                if matches!(self.map.format.number(cell), Ok(None)) {
                    // A row of another table in the same file.
                    return None;
                }
                let Some(nanos) = nanos(&text, *unit_ns) else {
                    errors.add(|| {
                        format!(
                            "{place}: column {name}: \"{}\" is not a time; correct the cell",
                            shortened(cell)
                        )
                    });
                    return None;
                };
                nanos
            }
        };
        let start_ns = *self
            .start_ns
            .get_or_insert(if since_ns > UNIX_TIME_FROM_NS {
                0
            } else {
                START_DEFAULT_NS
            });
        let nanos = i128::from(start_ns) + since_ns;
        let time = super::log_time(nanos);
        if time.is_none() {
            errors.add(|| format!("{place}: the time {nanos} ns is out of range; correct it"));
        }
        time
    }
}

fn cell_error(place: &str, name: &Place, column: &Column, text: Option<&str>) -> String {
    match text {
        Some(text) => format!(
            "{place}: column {name} ({}): \"{}\" is not a number; correct the cell, or add the \
             text to missing under [table] of the column map",
            column.quantity.name(),
            shortened(text)
        ),
        None => format!(
            "{place}: the row ends before column {name} ({}); correct the row, or set the \
             delimiter under [table] of the column map",
            column.quantity.name()
        ),
    }
}
