//! `atvrec export`: write a topic as a table.

mod mat;
#[cfg(feature = "formats")]
mod parquet;
mod raw;
mod text;

use std::io::{BufWriter, Write};

use engine::config::closest;
use engine::{LeftOut, missing};
use sample::LogTime;
use store::{Column, Info, Missing, Reader, Table, UtcOffset, Values};

use crate::cli::ExportArgs;
use crate::exit::{Outcome, UsageError};
use crate::interrupt::Interrupt;
use crate::output;
use crate::progress::Progress;
use engine::output::{Kind, Target};

/// Kind of the output.
const TABLE: Kind = Kind::Table {
    parquet: cfg!(feature = "formats"),
};

/// Runs the command.
pub fn run(args: &ExportArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let kind = if args.raw.is_some() { Kind::Any } else { TABLE };
    let target = args
        .output
        .as_ref()
        .map(|path| {
            let inputs = args.logs.iter().map(|log| &**log);
            Target::new(path, kind, args.replace.force, inputs)
        })
        .transpose()?;
    if let Some((from_s, to_s)) = args.from_s.zip(args.to_s).filter(|(from, to)| from > to) {
        let text = format!("--from {from_s} is later than --to {to_s}; exchange the two values");
        return Err(UsageError(text).into());
    }
    let reader = Reader::open(&args.logs)?;
    let info = reader.info();
    super::check_from(args.from_s, &info)?;
    let begin = info.span.map_or(LogTime(0), |(first, _)| first);
    let start = args
        .from_s
        .map_or(LogTime(0), |from_s| begin.offset_seconds(from_s));
    let end = args
        .to_s
        .map_or(LogTime(u64::MAX), |to_s| begin.offset_seconds(to_s));
    let span_s = end_of(&info, end).seconds_since(start.max(begin));
    let progress = Progress::seconds("export", span_s, quiet);
    if let Some(format) = args.raw {
        let raw = raw::Raw::new(&reader, format, &args.source)?;
        raw.write(target.as_ref(), [start, end], &progress)?;
        return Ok(report_missing(info.missing));
    }
    let left_out = LeftOut::of(&reader);
    let topic = args.topic.as_deref().unwrap_or_default();
    check_topic(topic, &info, &left_out)?;
    let export = Export {
        reader: &reader,
        left_out: &left_out,
        topic,
        span: [start, end],
        utc: reader.utc_offset()?,
        progress,
        interrupt: Interrupt::listen()?,
        begin: start.max(begin),
    };
    let columns = export.columns()?;
    let written = export.write(target.as_ref(), &columns)?;
    export.progress.finish();
    // A channel without a schema concerns its own topic only, whose table reports it.
    let mut missing = info.missing;
    missing.retain(|missing| !matches!(missing, Missing::NoSchema { .. }));
    missing.extend(written.missing);
    Ok(report_missing(missing))
}

/// Prints what is missing in the log.
fn report_missing(missing: Vec<Missing>) -> Outcome {
    for line in missing::summary(&missing) {
        tracing::warn!("{line}");
    }
    // A log that is still being recorded has lost nothing, and neither have parts that were not given.
    let is_loss = |missing: &Missing| {
        use Missing::{Cut, Parts, Unfinished};
        !matches!(missing, Unfinished { .. } | Cut { .. } | Parts { .. })
    };
    if missing.iter().any(is_loss) {
        Outcome::DataLoss
    } else {
        Outcome::Good
    }
}

/// Refuses a topic that is neither in the log nor left out of it.
fn check_topic(topic: &str, info: &Info, left_out: &LeftOut) -> anyhow::Result<()> {
    let known = info.channels.keys().map(String::as_str);
    let mut known: Vec<&str> = known.chain(left_out.topics()).collect();
    if known.contains(&topic) {
        return Ok(());
    }
    known.sort_unstable();
    let hint = match closest(topic, &known) {
        Some(near) => format!("did you mean {near}?"),
        None if known.is_empty() => "it has no topic".to_owned(),
        None => format!("it has {}", known.join(", ")),
    };
    anyhow::bail!("the log has no topic {topic}; {hint}")
}

/// Rows that are in memory at a time.
const BATCH_ROWS: usize = 1 << 15;

/// A topic that is exported in batches of rows.
struct Export<'a> {
    reader: &'a Reader,
    left_out: &'a LeftOut,
    topic: &'a str,
    span: [LogTime; 2],
    utc: Option<UtcOffset>,
    progress: Progress,
    interrupt: Interrupt,
    /// Time of the first row.
    begin: LogTime,
}

/// The last time of an export.
fn end_of(info: &Info, end: LogTime) -> LogTime {
    info.span.map_or(end, |(_, last)| last.min(end))
}

/// What was exported.
#[derive(Default)]
struct Written {
    rows: usize,
    missing: Vec<Missing>,
}

impl Export<'_> {
    /// The columns of all batches, without rows.
    fn columns(&self) -> anyhow::Result<Table> {
        let reader = self.reader;
        let mut columns = self.left_out.columns(reader, self.topic, self.span)?;
        self.add_utc(&mut columns);
        Ok(columns)
    }

    /// Writes all rows to standard output or to the target, and prints what was written there.
    fn write(&self, target: Option<&Target>, columns: &Table) -> anyhow::Result<Written> {
        let mut written = Written::default();
        match target {
            None => {
                let sink = std::io::stdout().lock();
                let result = self.write_text(sink, columns, &mut written);
                result.or_else(|error| match error.downcast::<std::io::Error>() {
                    Ok(cause) => Ok(output::ignore_closed_pipe(cause)?),
                    Err(other) => Err(other),
                })?;
            }
            Some(target) => {
                let format = ["parquet", "mat"]
                    .into_iter()
                    .find(|name| target.has_extension(name));
                target.write_by(|file| match format {
                    #[cfg(feature = "formats")]
                    Some("parquet") => Ok(self.write_parquet(file, columns, &mut written)?),
                    Some("mat") => {
                        let mut writer = mat::Writer::new(&columns.columns);
                        self.each(columns, &mut written, |table| {
                            writer.take(table);
                            Ok(())
                        })?;
                        Ok(writer.write(BufWriter::new(file))?)
                    }
                    _ => {
                        let result = self.write_text(BufWriter::new(file), columns, &mut written);
                        result.map_err(|error| match error.downcast::<std::io::Error>() {
                            Ok(cause) => cause.into(),
                            Err(other) => other.into(),
                        })
                    }
                })?;
                println!(
                    "{}: {} rows, {} columns",
                    target.path().display(),
                    written.rows,
                    columns.columns.len() + 2
                );
            }
        }
        Ok(written)
    }

    fn write_text(
        &self,
        sink: impl Write,
        columns: &Table,
        written: &mut Written,
    ) -> anyhow::Result<()> {
        let mut writer = text::Writer::new(sink, &columns.columns)?;
        self.each(columns, written, |table| Ok(writer.write(table)?))?;
        Ok(writer.finish()?)
    }

    #[cfg(feature = "formats")]
    fn write_parquet(
        &self,
        file: std::fs::File,
        columns: &Table,
        written: &mut Written,
    ) -> anyhow::Result<()> {
        let mut writer = parquet::Writer::new(file, &columns.columns)?;
        self.each(columns, written, |table| writer.write(table))?;
        writer.finish()
    }

    /// Calls `write` with each batch.
    fn each(
        &self,
        columns: &Table,
        written: &mut Written,
        mut write: impl FnMut(&Table) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let topics = [self.topic];
        let (reader, span) = (self.reader, self.span);
        self.left_out
            .each_batch(reader, &topics, span, BATCH_ROWS, |_, mut table| {
                self.interrupt.check()?;
                if let Some(last) = table.log_time_ns.last() {
                    let last = LogTime(last.cast_unsigned());
                    self.progress.set(last.seconds_since(self.begin));
                }
                written.missing.append(&mut table.missing);
                written.rows += table.log_time_ns.len();
                let own = columns.columns.len() - usize::from(self.utc.is_some());
                table.pad(&columns.columns[..own]);
                self.add_utc(&mut table);
                write(&table)
            })
    }

    /// Adds the column with the UTC of `publish_time_ns`, from a GNSS receiver.
    fn add_utc(&self, table: &mut Table) {
        let Some(utc) = self.utc else { return };
        let times = table.publish_time_ns.iter();
        table.columns.push(Column {
            name: "utc_ns".to_owned(),
            unit: String::new(),
            names: Vec::new(),
            values: Values::I64(times.map(|ns| ns.saturating_add(utc.offset_ns)).collect()),
            present: None,
        });
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
