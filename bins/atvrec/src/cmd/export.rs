//! `atvrec export`: a topic as a table.

mod parquet;
mod text;

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use anyhow::Context;
use sample::LogTime;
use store::{Column, Missing, Reader, Table, UtcOffset, Values};

use crate::cli::ExportArgs;
use crate::exit::{Outcome, UsageError};
use crate::{missing, output};

/// Exports.
pub fn run(args: &ExportArgs) -> anyhow::Result<Outcome> {
    let form = Form::of(args.output.as_deref())?;
    if let Some((from_s, to_s)) = args.from_s.zip(args.to_s).filter(|(from, to)| from > to) {
        let text = format!("--from {from_s} is later than --to {to_s}; nothing lies between them");
        return Err(UsageError(text).into());
    }
    let reader = Reader::open(&args.logs)?;
    let begin = reader.info().span.map_or(LogTime(0), |(first, _)| first);
    let start = args
        .from_s
        .map_or(LogTime(0), |from_s| begin.offset_seconds(from_s));
    let end = args
        .to_s
        .map_or(LogTime(u64::MAX), |to_s| begin.offset_seconds(to_s));
    let mut table = reader.table(&args.topic, start, end)?;
    if let Some(utc) = reader.utc_offset()? {
        table.columns.push(utc_column(&table, utc));
    }
    let mut missing = reader.info().missing;
    missing.extend(table.missing.iter().cloned());
    for line in missing::summary(&missing) {
        tracing::warn!("{line}");
    }
    match &args.output {
        None => text::write(&table, std::io::stdout().lock()).or_else(output::reader_left)?,
        Some(path) => {
            let file =
                File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
            let write = match form {
                Form::Csv => text::write(&table, BufWriter::new(file)).map_err(Into::into),
                Form::Parquet => parquet::write(&table, file),
            };
            write.with_context(|| format!("cannot write {}", path.display()))?;
            println!(
                "{}: {} rows, {} columns",
                path.display(),
                table.log_time_ns.len(),
                table.columns.len() + 2
            );
        }
    }
    // A log that is still being recorded lacks nothing.
    let lacks =
        |missing: &Missing| !matches!(missing, Missing::Unfinished { .. } | Missing::Cut { .. });
    Ok(if missing.iter().any(lacks) {
        Outcome::DataLoss
    } else {
        Outcome::Good
    })
}

/// UTC of `publish_time_ns` by a receiver.
fn utc_column(table: &Table, utc: UtcOffset) -> Column {
    let times = table.publish_time_ns.iter();
    Column {
        name: "utc_ns".to_owned(),
        unit: String::new(),
        names: Vec::new(),
        values: Values::I64(times.map(|ns| ns.saturating_add(utc.offset_ns)).collect()),
        present: None,
    }
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Csv,
    Parquet,
}

impl Form {
    /// By the ending of the file's name; without a file it is CSV.
    fn of(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            return Ok(Self::Csv);
        };
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            _ => Err(UsageError(format!(
                "{} is neither a .csv nor a .parquet file; end its name in one of them",
                path.display()
            ))
            .into()),
        }
    }
}

/// Heading of a column: `name[unit]`, or the name alone where the unit is a part of it.
fn heading(column: &Column) -> String {
    if column.unit.is_empty() {
        column.name.clone()
    } else {
        format!("{}[{}]", column.name, column.unit)
    }
}

/// An enumeration's value in words; one without a name as its number.
fn word(column: &Column, value: i32) -> String {
    let named = column.names.iter().find(|(number, _)| *number == value);
    named.map_or_else(|| value.to_string(), |(_, name)| name.clone())
}
