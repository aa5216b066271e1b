//! `atvrec import csv`: convert delimited text, and `import mf4 --columns`: convert measured signals.

mod mf4;
mod rows;

use std::path::{Path, PathBuf};

use engine::config::{CsvMap, Meaning, Problems, csv_map};
use wire::csv::Place;

use super::log::{self, Piece, Source};
use super::truth::Reference;
use super::{
    RowErrors, Table, configuration, output, refuse, shortened, signals, source_names, text,
};
use crate::cli::{ImportCsvArgs, ImportInto, ImportRows};
use crate::exit::{Outcome, UsageError};
use rows::Rows;

/// Runs the command.
pub fn run(args: &ImportCsvArgs, quiet: bool) -> anyhow::Result<Outcome> {
    convert((&args.input, &args.columns), &args.into, args.rows, quiet)
}

/// Converts files with their column maps.
pub fn convert(
    (input, columns): (&[PathBuf], &[PathBuf]),
    into: &ImportInto,
    rows: ImportRows,
    quiet: bool,
) -> anyhow::Result<Outcome> {
    if columns.len() != 1 && columns.len() != input.len() {
        return Err(UsageError(format!(
            "there are {} files and {} column maps; give one --columns for all files, or one for \
             each file",
            input.len(),
            columns.len()
        ))
        .into());
    }
    let inputs = input.iter().chain(columns);
    let output = output(into, Some(rows), inputs, quiet)?;
    let map_of = |file: usize| &columns[file.min(columns.len() - 1)];
    let names = source_names(input);
    let (mut tables, mut errors) = (Vec::new(), RowErrors::default());
    let (mut pieces, mut reference) = (Vec::new(), Reference::default());
    let mut sources = Vec::new();
    for (source, path) in input.iter().enumerate() {
        let file = File::read(path, map_of(source), &mut errors, into.config.is_none())?;
        file.rows.reference(&file.map.format, &mut reference);
        sources.push(Source {
            name: &names[source],
            path,
            preamble: file.rows.preamble.as_bytes().to_vec(),
        });
        pieces.extend(file.rows.pieces(source, &file.map.format));
        tables.push(Table {
            kind: "csv",
            path,
            columns: map_of(source).to_str().unwrap_or_default(),
            held: file.held,
            meaning: Meaning::Csv(file.map),
        });
    }
    errors.finish()?;
    pieces.sort_by_key(|piece: &Piece| piece.time);
    let config = configuration(&names, &tables, into)?;
    let truth = reference.on_grid();
    log::write(&config, &sources, pieces, &truth, &output)
}

/// A file with its map.
struct File {
    map: CsvMap,
    rows: Rows,
    /// Columns whose values are held, and for how many rows.
    held: Vec<(String, u32)>,
}

impl File {
    /// Reads a file. Values that are held are left out if `hold` is set, else they are reported.
    fn read(
        path: &Path,
        map_path: &Path,
        errors: &mut RowErrors,
        hold: bool,
    ) -> anyhow::Result<Self> {
        let map_name = map_path.display().to_string();
        let mut map = csv_map(&map_name, &text::read(map_path)?).map_err(Problems)?;
        refuse(map.contradictions(&map_name))?;
        let text = if mf4::is_mdf(path) {
            mf4::text(path, &mut map)?
        } else {
            text::read(path)?
        };
        let mut rows = Rows::read(path, &text, &map, errors)?;
        warn_of_overflows(path, &rows, &map);
        let mut held = Vec::new();
        for (index, (place, column)) in map.format.columns.iter_mut().enumerate() {
            let is_signal = column.quantity == wire::column::Quantity::Signal;
            if is_signal || column.held_rows > 1 {
                continue;
            }
            if let Some(count) = signals::held_rows(&rows.column(index)) {
                tracing::warn!(
                    "{}: column {place} has a new value every {count} rows and repeats it between them{}",
                    path.display(),
                    if hold {
                        "; only the new values are used".to_owned()
                    } else {
                        format!(
                            "; set held_rows = {count} under [column.{}] of the map",
                            column.name
                        )
                    }
                );
                if hold {
                    column.held_rows = count;
                    held.push((column.name.clone(), count));
                }
            }
        }
        rows.leave_out_held(&map.format);
        rows.warn(path);
        Ok(Self { map, rows, held })
    }
}

fn warn_of_overflows(path: &Path, rows: &Rows, map: &CsvMap) {
    for (index, (place, column)) in map.format.columns.iter().enumerate() {
        let number = |value: f64| (value / column.factor - column.offset) / column.scale;
        let numbers: Vec<Option<f64>> = rows
            .column(index)
            .into_iter()
            .map(|v| v.map(number))
            .collect();
        if let Some(found) = signals::overflow(&numbers) {
            tracing::warn!(
                "{}:{}: column {place} jumps by 256 of its units of {} {}, {} times: it looks like a \
                 counter of 8 bits that overflowed; check how the file was made",
                path.display(),
                rows.line(found.row),
                found.unit,
                column.unit,
                found.count
            );
        }
    }
}

/// A column in a message.
fn described(place: &Place, quantity: &str) -> String {
    format!("column {place} ({quantity})")
}
