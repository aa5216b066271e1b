//! `atvrec export`: write a topic as a table.

mod cells;
#[cfg(feature = "formats")]
mod dataset;
mod gpx;
mod mat;
mod mf4;
#[cfg(feature = "formats")]
mod parquet;
mod raw;
mod ros2;
mod text;
mod topic;
mod wide;

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
use topic::Topic;

/// Kind of the output.
const TABLE: Kind = Kind::Table {
    parquet: cfg!(feature = "formats"),
};

/// Name of the column with the UTC of `publish_time_ns`.
const UTC_COLUMN: &str = "utc_ns";

/// Runs the command.
pub fn run(args: &ExportArgs, quiet: bool) -> anyhow::Result<Outcome> {
    if let Some((from_s, to_s)) = args.from_s.zip(args.to_s).filter(|(from, to)| from > to) {
        let text = format!("--from {from_s} is later than --to {to_s}; exchange the two values");
        return Err(UsageError(text).into());
    }
    if let (true, Some(path)) = (args.all, &args.output) {
        #[cfg(feature = "formats")]
        return dataset::run(args, path, quiet);
        #[cfg(not(feature = "formats"))]
        return Err(UsageError(format!(
            "{} is not written: this build has no Parquet (feature formats)",
            path.display()
        ))
        .into());
    }
    if args.ros2 {
        return bag(args, quiet);
    }
    let target = target(args)?;
    let reader = Reader::open(&args.logs)?;
    let mut missing = reader.info().missing;
    let span = Span::new(&reader, args)?;
    let progress = Progress::seconds("export", span.seconds, quiet);
    if let Some(format) = args.raw {
        let raw = raw::Raw::new(&reader, format, &args.source)?;
        raw.write(target.as_ref(), span.times, &progress)?;
        return Ok(report_missing(missing));
    }
    let left_out = LeftOut::of(&reader);
    for topic in &args.topic {
        check_topic(topic, &reader.info(), &left_out)?;
    }
    // A channel without a schema concerns its own topic only, whose table reports it.
    missing.retain(|missing| !matches!(missing, Missing::NoSchema { .. }));
    let written = if args.wide.wide {
        let mut wide = wide::Wide::new(&reader, &left_out, &span, args, &progress)?;
        wide.write(target.as_ref())?;
        Written {
            missing: wide.missing,
            ..Written::default()
        }
    } else {
        let input = Input {
            reader: &reader,
            left_out: &left_out,
            span: &span,
            interrupt: &Interrupt::listen()?,
            progress: &progress,
        };
        tables(args, &input, target.as_ref())?
    };
    progress.finish();
    missing.extend(written.missing);
    Ok(report_missing(missing))
}

/// Checks the options and the output of all formats that are files.
fn target(args: &ExportArgs) -> anyhow::Result<Option<Target>> {
    let kind = if args.raw.is_some() { Kind::Any } else { TABLE };
    let inputs = args.logs.iter().map(|log| &**log);
    let force = args.replace.force;
    let target = args
        .output
        .as_ref()
        .map(|path| Target::new(path, kind, force, inputs))
        .transpose()?;
    let is = |name| {
        target
            .as_ref()
            .is_some_and(|target| target.has_extension(name))
    };
    let problem = if args.compress && !is("mf4") {
        "--compress is for .mf4 files; leave it out, or use this extension"
    } else if args.wide.wide && ["mat", "gpx", "mf4"].into_iter().any(is) {
        "--wide writes a .csv or .parquet file; use one of these extensions"
    } else if args.wide.wide || args.raw.is_some() || is("gpx") || is("mf4") {
        return Ok(target);
    } else if args.topic.is_empty() {
        "a table needs a topic: give --topic TOPIC (`atvrec info` lists the topics), or export more than \
         one topic with --all, --wide or --ros2, or to a .mf4 file"
    } else if args.topic.len() > 1 {
        "a table contains one topic: give --topic once, or export several topics with --wide, or to a \
         .mf4 file"
    } else {
        return Ok(target);
    };
    Err(UsageError(problem.to_owned()).into())
}

/// Exports a log as a ROS 2 bag.
fn bag(args: &ExportArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let Some(path) = &args.output else {
        let text =
            "--ros2 needs an output: -o FILE.mcap, or -o DIR for a folder with metadata.yaml";
        return Err(UsageError(text.to_owned()).into());
    };
    let output = ros2::Output::new(path, args)?;
    let reader = Reader::open(&args.logs)?;
    let span = Span::new(&reader, args)?;
    let progress = Progress::seconds("export", span.seconds, quiet);
    let (left_out, interrupt) = (LeftOut::of(&reader), Interrupt::listen()?);
    let export = ros2::Export::new(Input {
        reader: &reader,
        left_out: &left_out,
        span: &span,
        interrupt: &interrupt,
        progress: &progress,
    })?;
    let mut missing = export.write(&output)?.missing;
    progress.finish();
    missing.extend(reader.info().missing);
    Ok(report_missing(missing))
}

/// Exports a GPX or MF4 file, or a table of one topic.
fn tables(
    args: &ExportArgs,
    input: &Input<'_>,
    target: Option<&Target>,
) -> anyhow::Result<Written> {
    let utc = input.reader.utc_offset()?;
    let of_extension = |name| target.filter(|target| target.has_extension(name));
    if let Some(target) = of_extension("gpx") {
        return gpx::write(input, &args.topic, utc, target);
    }
    if let Some(target) = of_extension("mf4") {
        let topics = match args.topic.is_empty() {
            true => Topic::all(input.reader, input.left_out),
            false => {
                let names = args.topic.iter();
                let topics = names.map(|name| Topic::new(input.reader, input.left_out, name));
                topics.collect()
            }
        };
        return mf4::write(input, &topics, utc, target, args.compress);
    }
    let name = args.topic.first().map_or("", |topic| topic);
    let export = Export {
        topic: [Topic::new(input.reader, input.left_out, name)],
        input,
        utc,
    };
    export.write(target, &export.columns()?)
}

/// The stretch of a log that is exported.
struct Span {
    /// First and last time.
    times: [LogTime; 2],
    /// Time of the first row.
    begin: LogTime,
    /// Its length, s.
    seconds: f64,
}

impl Span {
    /// The stretch that the options choose.
    fn new(reader: &Reader, args: &ExportArgs) -> anyhow::Result<Self> {
        let info = reader.info();
        super::check_from(args.from_s, &info)?;
        let (begin, last) = info.span.unwrap_or((LogTime(0), LogTime(0)));
        let start = args.from_s.map_or(LogTime(0), |s| begin.offset_seconds(s));
        let end = args
            .to_s
            .map_or(LogTime(u64::MAX), |s| begin.offset_seconds(s));
        let begin = start.max(begin);
        Ok(Self {
            times: [start, end],
            begin,
            seconds: last.min(end).seconds_since(begin),
        })
    }
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
/// The same for each of several topics.
const BATCH_ROWS_OF_MANY: usize = 1 << 12;

/// A log that is exported in batches of rows.
struct Input<'a> {
    reader: &'a Reader,
    left_out: &'a LeftOut,
    span: &'a Span,
    interrupt: &'a Interrupt,
    progress: &'a Progress,
}

impl Input<'_> {
    /// Calls `take` with the place of a topic and each batch of its rows. `part` are the parts of the work
    /// that are done before and after it.
    fn each(
        &self,
        topics: &[Topic],
        part: [f64; 2],
        missing: &mut Vec<Missing>,
        mut take: impl FnMut(usize, Table) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let names: Vec<&str> = topics.iter().map(|topic| &*topic.name).collect();
        let rows = match topics {
            [_] => BATCH_ROWS,
            _ => BATCH_ROWS_OF_MANY,
        };
        let (span, [before, after]) = (self.span, part);
        self.left_out
            .each_batch(self.reader, &names, span.times, rows, |topic, mut table| {
                self.interrupt.check()?;
                if let Some(last) = table.log_time_ns.last() {
                    let done_s = LogTime(last.cast_unsigned()).seconds_since(span.begin);
                    self.progress
                        .set(before * span.seconds + (after - before) * done_s);
                }
                missing.append(&mut table.missing);
                take(topic, table)
            })
    }
}

/// A topic that is exported as a table.
struct Export<'a> {
    topic: [Topic; 1],
    input: &'a Input<'a>,
    utc: Option<UtcOffset>,
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
        let Input {
            reader,
            left_out,
            span,
            ..
        } = self.input;
        let mut columns = left_out.columns(reader, &self.topic[0].name, span.times)?;
        add_utc(&mut columns, self.utc);
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
        let times = ["log_time_ns", "publish_time_ns"];
        let mut writer = text::Writer::new(sink, &times, &columns.columns)?;
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
        let (columns_of_file, layout) = (&columns.columns, parquet::Layout::Table);
        let topic = &self.topic[0];
        let metadata = [("atvrec.topic".to_owned(), topic.name.clone())].into();
        let mut writer = parquet::Writer::new(file, columns_of_file, topic, layout, metadata)?;
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
        let Written { rows, missing } = written;
        self.input
            .each(&self.topic, [0.0, 1.0], missing, |_, mut table| {
                *rows += table.log_time_ns.len();
                let own = columns.columns.len() - usize::from(self.utc.is_some());
                table.pad(&columns.columns[..own]);
                add_utc(&mut table, self.utc);
                write(&table)
            })
    }
}

/// Adds the column with the UTC of `publish_time_ns`, from a GNSS receiver.
fn add_utc(table: &mut Table, utc: Option<UtcOffset>) {
    let Some(utc) = utc else { return };
    let times = table.publish_time_ns.iter();
    table.columns.push(Column {
        name: UTC_COLUMN.to_owned(),
        unit: String::new(),
        names: Vec::new(),
        values: Values::I64(times.map(|ns| ns.saturating_add(utc.offset_ns)).collect()),
        present: None,
    });
}

/// Whether a column has a value in any row.
fn has_value(column: &Column) -> bool {
    match (&column.values, &column.present) {
        (Values::F64(list), _) => list.iter().any(|value| !value.is_nan()),
        (_, Some(present)) => present.contains(&true),
        (values, None) => !values.is_empty(),
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
