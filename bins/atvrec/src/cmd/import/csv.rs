//! `atvrec import csv`.

use std::path::{Path, PathBuf};

use engine::config::{CsvMap, Problems, RowTime, csv_map};
use sample::LogTime;
use wire::column::{Column, Quantity};
use wire::csv::{Format, MAX_LINE, Place};

use super::log::{self, Piece, Source};
use super::truth::Reference;
use super::{
    Complaints, START_DEFAULT_NS, Table, UNIX_TIME_FROM_NS, configuration, nanos, output,
    read_text, shortened, source_names,
};
use crate::cli::ImportCsvArgs;
use crate::exit::{Outcome, UsageError};

/// Imports delimited text.
pub fn run(args: &ImportCsvArgs) -> anyhow::Result<Outcome> {
    let columns = &args.columns;
    if columns.len() != 1 && columns.len() != args.input.len() {
        return Err(UsageError(format!(
            "{} files and {} column maps; give one --columns for all, or one for each file",
            args.input.len(),
            columns.len()
        ))
        .into());
    }
    let output = output(&args.into, args.input.iter().chain(columns))?;
    let map_of = |file: usize| &columns[file.min(columns.len() - 1)];
    let names = source_names(&args.input);
    let (mut tables, mut complaints) = (Vec::new(), Complaints::default());
    let (mut pieces, mut reference) = (Vec::new(), Reference::default());
    let mut sources = Vec::new();
    for (source, path) in args.input.iter().enumerate() {
        let map_path = map_of(source);
        let map_name = map_path.display().to_string();
        let map = csv_map(&map_name, &read_text(map_path)?).map_err(Problems)?;
        let text = read_text(path)?;
        let rows = Rows::read(path, &text, &map, &mut complaints)?;
        rows.reference(&map.format, &mut reference);
        sources.push(Source {
            name: &names[source],
            path,
            preamble: rows.preamble.as_bytes().to_vec(),
        });
        pieces.extend(rows.pieces(source));
        tables.push((path, map_name));
    }
    complaints.finish()?;
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
    /// What stands before the first row: remarks, the header.
    preamble: &'t str,
    rows: Vec<Row<'t>>,
}

struct Row<'t> {
    time: LogTime,
    /// Number of its line, from one.
    line: usize,
    /// Its line, with remarks that stand before it.
    text: &'t str,
    values: Vec<Option<f64>>,
}

impl<'t> Rows<'t> {
    fn read(
        path: &Path,
        text: &'t str,
        map: &CsvMap,
        complaints: &mut Complaints,
    ) -> anyhow::Result<Self> {
        let mut reader = RowReader::new(path, map);
        let (mut at, mut begin) = (0, 0);
        let mut preamble = "";
        let mut rows: Vec<Row<'t>> = Vec::new();
        for (number, line) in text.split_inclusive('\n').enumerate() {
            let line_begin = at;
            at += line.len();
            if let Some((time, values)) = reader.take(number, line, complaints)? {
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
            // Remarks behind the last row stay with it.
            let length = last.text.len() + (at - begin);
            last.text = &text[begin - last.text.len()..][..length];
        }
        if reader.positions.is_none() {
            anyhow::bail!("{} has no line that names its columns", path.display());
        }
        if map.times.sort {
            // Remarks stay before the row that they stood before.
            rows.sort_by_key(|row| row.time);
        } else {
            for (index, pair) in rows.windows(2).enumerate() {
                if pair[1].time < pair[0].time {
                    let back_s = pair[0].time.seconds_since(pair[1].time);
                    complaints.add(|| {
                        format!(
                            "{}: data row {}: time goes back by {back_s:.6} s; correct the file, \
                             or write sort = true under [time] of the column map",
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
                // The decoder takes a line when it ends.
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

/// Goes through a file line by line.
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

    /// The time and the values of a line; nothing of remarks, the header and rows without a time.
    fn take(
        &mut self,
        number: usize,
        line: &str,
        complaints: &mut Complaints,
    ) -> anyhow::Result<Option<(LogTime, Vec<Option<f64>>)>> {
        let format = &self.map.format;
        if line.len() > MAX_LINE {
            anyhow::bail!(
                "{}:{}: the line has {} bytes; at most {MAX_LINE} are read",
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
            Ok(values) => Ok(self
                .time(&place, &cells, complaints)
                .map(|time| (time, values))),
            Err(bad) => {
                let (name, column) = &format.columns[bad.column];
                complaints.add(|| complaint(&place, name, column, bad.text.as_deref()));
                Ok(None)
            }
        }
    }

    fn find(&mut self, header: &[&str]) -> anyhow::Result<Vec<usize>> {
        let format = &self.map.format;
        let absent = |place: &Place| {
            UsageError(format!(
                "{} has no column {place}; it has: {}",
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

    fn time(
        &mut self,
        place: &str,
        cells: &[&str],
        complaints: &mut Complaints,
    ) -> Option<LogTime> {
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
                    // A row of another table beside this one.
                    return None;
                }
                let Some(nanos) = nanos(&text, *unit_ns) else {
                    complaints.add(|| {
                        format!(
                            "{place}: column {name}: \"{}\" is no time; correct the cell",
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
            complaints.add(|| format!("{place}: the time {nanos} ns is out of range"));
        }
        time
    }
}

fn complaint(place: &str, name: &Place, column: &Column, text: Option<&str>) -> String {
    match text {
        Some(text) => format!(
            "{place}: column {name} ({}): \"{}\" is no number; correct the cell, or name what \
             stands for no value in missing under [table] of the column map",
            column.quantity.name(),
            shortened(text)
        ),
        None => format!(
            "{place}: the row ends before column {name} ({}); correct it, or name the delimiter \
             under [table] of the column map",
            column.quantity.name()
        ),
    }
}
