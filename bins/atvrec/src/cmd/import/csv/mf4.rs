//! Tables of an MDF 4 file as delimited text: the channels that a column map names.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::ControlFlow;
use std::path::Path;

use anyhow::Context;
use engine::config::CsvMap;
use wire::can_log::mf4::{Physical, Tables, Value};
use wire::csv::{Format, Place};

use super::super::{UNIX_TIME_FROM_NS, listed};
use crate::exit::UsageError;

/// Name of the column of the time.
const TIME: &str = "time";
/// Beginning of the times that are UNIX times, s.
const UNIX_TIME_FROM_S: f64 = UNIX_TIME_FROM_NS as f64 * 1e-9;

/// Whether a file begins as an MDF file does.
pub fn is_mdf(path: &Path) -> bool {
    let mut begin = [0; 8];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut begin));
    read.is_ok() && begin == *b"MDF     "
}

/// The rows of all tables, sorted by time, with a header. The first column, `time`, has the numbers of
/// each table's own axis. If several channels have a name, the second is `NAME [2]` and so on. The start of
/// the measurement in the file is time zero, unless the map has a start or the times are UNIX times.
///
/// # Errors
/// The file cannot be read, has no such channel, or the map describes a form of text.
pub fn text(path: &Path, map: &mut CsvMap) -> anyhow::Result<String> {
    let told = |text: String| UsageError(format!("{}: {text}", path.display()));
    check(&map.format).map_err(told)?;
    let named = map.format.columns.iter().map(|(place, _)| place);
    let named: Vec<String> = (named.cloned().chain(map.times.row.places()))
        .map(|place| match place {
            Place::Name(name) => Ok(name),
            Place::Number(number) => Err(told(format!(
                "the column map has column {number}; give the name of the channel"
            ))),
        })
        .collect::<Result<_, _>>()?;
    let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut input = BufReader::new(file);
    let mut tables =
        Tables::open(&mut input).with_context(|| format!("cannot read {}", path.display()))?;
    let channels = Channels::of(&tables);
    let all: Vec<&str> = channels.names.iter().map(|(name, _)| &**name).collect();
    if let Some(absent) = named
        .iter()
        .find(|name| **name != TIME && !all.contains(&&***name))
    {
        let text = format!(
            "no channel is named {absent}; the file has {}",
            listed(&all)
        );
        return Err(told(text).into());
    }
    let start_ns = tables.start_ns().and_then(|ns| u64::try_from(ns).ok());
    let wanted: Vec<&(String, [usize; 2])> = (channels.names.iter())
        .filter(|(name, _)| named.contains(name))
        .collect();
    let delimiter = map.format.delimiter.unwrap_or(' ');
    let header = std::iter::once(TIME).chain(wanted.iter().map(|(name, _)| &**name));
    let header = header.map(quoted).collect::<Vec<_>>();
    let mut rows = Vec::new();
    for (table, axis) in channels.axes.iter().enumerate() {
        let cells: Vec<Option<usize>> = (wanted.iter())
            .map(|(_, [of, column])| (*of == table).then_some(*column))
            .collect();
        let Some(axis) = axis.filter(|_| cells.iter().any(Option::is_some)) else {
            continue;
        };
        tables.rows(table, &mut |values| {
            let time = number(values, axis);
            if time.is_finite() {
                let cells = cells.iter().map(|column| cell(values, *column));
                let line = std::iter::once(time.to_string()).chain(cells);
                rows.push((time, line.collect::<Vec<_>>().join(&delimiter.to_string())));
            }
            ControlFlow::Continue(())
        })?;
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Some writers store UNIX time in place of the time since the start.
    let is_since_start = (rows.first()).is_some_and(|(time, _)| *time < UNIX_TIME_FROM_S);
    if let Some(start_ns) = start_ns.filter(|_| is_since_start) {
        map.times.start_unix_ns.get_or_insert(start_ns);
    }
    for defect in tables.into_defects() {
        tracing::warn!("{}: {defect}", path.display());
    }
    let lines = rows.into_iter().map(|(_, line)| line + "\n");
    Ok(header.join(&delimiter.to_string()) + "\n" + &lines.collect::<String>())
}

/// Refuses what describes a form of text.
fn check(format: &Format) -> Result<(), String> {
    let is_text = format.delimiter.is_none()
        || format.decimal_comma
        || format.skip_lines > 0
        || !format.header
        || format.units_row;
    if is_text {
        return Err(
            "[table] of the column map describes text; remove it for an MF4 file".to_owned(),
        );
    }
    Ok(())
}

/// The channels of a file.
struct Channels {
    /// Name, table and column of each channel that is no axis.
    names: Vec<(String, [usize; 2])>,
    /// Column of each table's axis.
    axes: Vec<Option<usize>>,
}

impl Channels {
    fn of<R: Read + std::io::Seek>(tables: &Tables<'_, R>) -> Self {
        let mut channels = Self {
            names: Vec::new(),
            axes: Vec::new(),
        };
        // The name of the axis is taken.
        let mut counts = BTreeMap::from([(TIME, 1)]);
        for (of, table) in tables.tables().iter().enumerate() {
            let axis = table.columns.iter().position(|column| column.is_master);
            channels.axes.push(axis);
            for (index, column) in table.columns.iter().enumerate() {
                if Some(index) == axis {
                    continue;
                }
                let count = counts.entry(&column.name).or_insert(0);
                *count += 1;
                let name = match *count {
                    1 => column.name.clone(),
                    count => format!("{} [{count}]", column.name),
                };
                channels.names.push((name, [of, index]));
            }
        }
        channels
    }
}

/// A value as a number; NaN if it is none or not valid.
fn number(values: &[Value], column: usize) -> f64 {
    match values.get(column) {
        Some(Value {
            physical: Physical::Number(number),
            is_valid: true,
        }) => *number,
        _ => f64::NAN,
    }
}

/// A cell; empty without a number.
fn cell(values: &[Value], column: Option<usize>) -> String {
    let number = column.map_or(f64::NAN, |column| number(values, column));
    if number.is_finite() {
        number.to_string()
    } else {
        String::new()
    }
}

/// A name as a cell.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}
