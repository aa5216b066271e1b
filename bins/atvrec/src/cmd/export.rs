//! `atvrec export`: write a topic as a table.

#[cfg(feature = "formats")]
mod parquet;
mod text;

use std::io::BufWriter;

use engine::config::closest;
use engine::missing;
use sample::LogTime;
use store::{Column, Info, Missing, Reader, Table, UtcOffset, Values};

use crate::cli::ExportArgs;
use crate::exit::{Outcome, UsageError};
use crate::output;
use engine::output::{Kind, Target};

/// Kind of the output.
const TABLE: Kind = Kind::Table {
    parquet: cfg!(feature = "formats"),
};

/// Runs the command.
pub fn run(args: &ExportArgs) -> anyhow::Result<Outcome> {
    let target = args
        .output
        .as_ref()
        .map(|path| {
            let inputs = args.logs.iter().map(|log| &**log);
            Target::new(path, TABLE, args.replace.force, inputs)
        })
        .transpose()?;
    if let Some((from_s, to_s)) = args.from_s.zip(args.to_s).filter(|(from, to)| from > to) {
        let text = format!("--from {from_s} is later than --to {to_s}; exchange the two values");
        return Err(UsageError(text).into());
    }
    let reader = Reader::open(&args.logs)?;
    let info = reader.info();
    check_topic(&args.topic, &info)?;
    super::check_from(args.from_s, &info)?;
    let begin = info.span.map_or(LogTime(0), |(first, _)| first);
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
    // A channel without a schema concerns its own topic only, whose table reports it.
    let mut missing = reader.info().missing;
    missing.retain(|missing| !matches!(missing, Missing::NoSchema { .. }));
    missing.extend(table.missing.iter().cloned());
    for line in missing::summary(&missing) {
        tracing::warn!("{line}");
    }
    match &target {
        None => {
            text::write(&table, std::io::stdout().lock()).or_else(output::ignore_closed_pipe)?
        }
        Some(target) => {
            let is_parquet = target.has_extension("parquet");
            target.write_by(|file| match is_parquet {
                #[cfg(feature = "formats")]
                true => Ok(parquet::write(&table, file)?),
                _ => Ok(text::write(&table, BufWriter::new(file))?),
            })?;
            println!(
                "{}: {} rows, {} columns",
                target.path().display(),
                table.log_time_ns.len(),
                table.columns.len() + 2
            );
        }
    }
    // A log that is still being recorded has lost nothing, and neither have parts that were not given.
    let is_loss = |missing: &Missing| {
        use Missing::{Cut, Parts, Unfinished};
        !matches!(missing, Unfinished { .. } | Cut { .. } | Parts { .. })
    };
    Ok(if missing.iter().any(is_loss) {
        Outcome::DataLoss
    } else {
        Outcome::Good
    })
}

/// Refuses a topic that the log does not have.
fn check_topic(topic: &str, info: &Info) -> anyhow::Result<()> {
    if info.channels.contains_key(topic) {
        return Ok(());
    }
    let known: Vec<&str> = info.channels.keys().map(String::as_str).collect();
    let hint = match closest(topic, &known) {
        Some(near) => format!("did you mean {near}?"),
        None if known.is_empty() => "it has no topic".to_owned(),
        None => format!("it has {}", known.join(", ")),
    };
    anyhow::bail!("the log has no topic {topic}; {hint}")
}

/// Column with the UTC of `publish_time_ns`, from a GNSS receiver.
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

/// Heading of a column: `name[unit]`, or the name alone if it contains the unit.
fn heading(column: &Column) -> String {
    if column.unit.is_empty() {
        column.name.clone()
    } else {
        format!("{}[{}]", column.name, column.unit)
    }
}

/// Name of an enumeration value, or its number if it has no name.
fn value_name(column: &Column, value: i32) -> String {
    let named = column.names.iter().find(|(number, _)| *number == value);
    named.map_or_else(|| value.to_string(), |(_, name)| name.clone())
}
