//! `atvrec export --wide`: the topics of a log as one table at a rate.

use std::io::{BufWriter, Write};
#[cfg(feature = "formats")]
use std::{collections::HashMap, fs::File};

use engine::LeftOut;
use engine::output::Target;
use sample::LogTime;
use store::align::{Grid, Method, align, intervals_ns, max_gap_ns};
use store::{Column, Missing, Reader, Table, Values};

#[cfg(feature = "formats")]
use super::parquet::{self, Layout};
use super::topic::Topic;
use super::{Span, has_value, text};
use crate::cli::{ExportArgs, WideArgs};
use crate::exit::UsageError;
use crate::interrupt::Interrupt;
use crate::output;
use crate::progress::Progress;

/// Rows of a topic that are in memory at a time while its columns are found.
const BATCH_ROWS: usize = 1 << 12;
/// The median of this number of intervals of a column decides what is a gap.
const INTERVALS: usize = 1_000;
/// Length of the stretch that is in memory at a time, ns.
const BLOCK_NS: i64 = 60_000_000_000;
/// A value is recorded at most this long after it was true, ns. The estimator ignores later ones, too.
const LATE_NS: i64 = 1_000_000_000;
/// Rate without `--rate`: that of the estimates, Hz.
const RATE_HZ: f64 = 100.0;

/// What the gap rule is, for the file.
#[cfg(feature = "formats")]
const GAP_RULE: &str = "a column has no value between two values that are more than max_gap_s apart: \
    previous holds a value for at most max_gap_s, nearest for half of it before and after its time";

/// The topics of a log as one table.
pub struct Wide<'r> {
    reader: &'r Reader,
    left_out: &'r LeftOut,
    span: &'r Span,
    grid: Grid,
    rate_hz: f64,
    method: Method,
    topics: Vec<Wanted>,
    interrupt: Interrupt,
    progress: &'r Progress,
    /// What cannot be read.
    pub missing: Vec<Missing>,
}

/// A topic of the table.
struct Wanted {
    topic: Topic,
    columns: Vec<WantedColumn>,
    /// All rows of a topic that is left out of the log: reading it again takes the time of the whole log.
    whole: Option<Table>,
}

/// A column of the table.
struct WantedColumn {
    /// Without rows.
    column: Column,
    /// The first intervals between its values, ns.
    intervals_ns: Vec<i64>,
    has_value: bool,
    max_gap_ns: i64,
}

impl<'r> Wide<'r> {
    /// The chosen topics, or all topics that are in the log. Reads the log once to find the columns with
    /// values.
    pub fn new(
        reader: &'r Reader,
        left_out: &'r LeftOut,
        span: &'r Span,
        args: &ExportArgs,
        progress: &'r Progress,
    ) -> anyhow::Result<Self> {
        let topics = match args.topic.is_empty() {
            true => {
                let mut all = Topic::all(reader, left_out);
                all.retain(|topic| !left_out.contains(&topic.name));
                all
            }
            false => {
                let chosen = args.topic.iter();
                chosen
                    .map(|name| Topic::new(reader, left_out, name))
                    .collect()
            }
        };
        let WideArgs {
            rate_hz,
            method,
            max_gap_s,
            ..
        } = args.wide;
        let rate_hz = rate_hz.unwrap_or(RATE_HZ);
        let begin_ns = span.begin.0.cast_signed();
        let mut wide = Self {
            reader,
            left_out,
            span,
            grid: Grid::new(begin_ns, rate_hz).map_err(|error| UsageError(error.to_string()))?,
            rate_hz,
            method: method.unwrap_or(Method::Previous),
            topics: topics.into_iter().map(Wanted::new).collect(),
            interrupt: Interrupt::listen()?,
            progress,
            missing: Vec::new(),
        };
        wide.find_columns()?;
        for column in wide.topics.iter_mut().flat_map(|topic| &mut topic.columns) {
            let usual_ns = max_gap_ns(&mut column.intervals_ns);
            column.max_gap_ns = max_gap_s.map_or(usual_ns, |s| (s * 1e9) as i64);
        }
        Ok(wide)
    }

    /// Finds the columns with values, and the intervals between their values.
    fn find_columns(&mut self) -> anyhow::Result<()> {
        let names: Vec<String> = self
            .topics
            .iter()
            .map(|one| one.topic.name.clone())
            .collect();
        let Self {
            reader,
            left_out,
            span,
            topics,
            interrupt,
            progress,
            missing,
            ..
        } = self;
        let mut in_log = Vec::new();
        for (place, name) in names.iter().enumerate() {
            if !left_out.contains(name) {
                in_log.push(place);
                continue;
            }
            for table in left_out.tables(reader, &[name], span.times)? {
                topics[place].add(&table);
                topics[place].whole = Some(table);
            }
        }
        let names: Vec<&String> = in_log.iter().map(|place| &names[*place]).collect();
        reader.each_batch(&names, span.times, BATCH_ROWS, |topic, mut table| {
            interrupt.check()?;
            if let Some(last) = table.log_time_ns.last() {
                let done_s = LogTime(last.cast_unsigned()).seconds_since(span.begin);
                progress.set(done_s / 2.0);
            }
            missing.append(&mut table.missing);
            topics[in_log[topic]].add(&table);
            Ok::<(), anyhow::Error>(())
        })?;
        for topic in topics {
            topic.columns.retain(|column| column.has_value);
        }
        Ok(())
    }

    /// Writes the table to the target, or to standard output.
    pub fn write(&mut self, target: Option<&Target>) -> anyhow::Result<()> {
        let Some(target) = target else {
            let result = self.write_text(std::io::stdout().lock()).map(|_| ());
            return result.or_else(|error| match error.downcast::<std::io::Error>() {
                Ok(cause) => Ok(output::ignore_closed_pipe(cause)?),
                Err(other) => Err(other),
            });
        };
        let mut rows = 0;
        target.write_by(|file| {
            rows = match target.has_extension("parquet") {
                #[cfg(feature = "formats")]
                true => self.write_parquet(file)?,
                _ => self.write_text(BufWriter::new(file))?,
            };
            Ok(())
        })?;
        let columns: usize = self.topics.iter().map(|topic| topic.columns.len()).sum();
        println!(
            "{}: {rows} rows at {} Hz, {} columns, method {}",
            target.path().display(),
            self.rate_hz,
            columns + 1,
            self.method
        );
        Ok(())
    }

    fn write_text(&mut self, sink: impl Write) -> anyhow::Result<usize> {
        let topics = self.topics.iter();
        let columns: Vec<Column> = topics
            .flat_map(|one| {
                let columns = one.columns.iter();
                columns.map(|wanted| renamed(&one.topic, wanted.column.clone()))
            })
            .collect();
        let mut writer = text::Writer::new(sink, &["time_ns"], &columns)?;
        let rows = self.each_block(|times_ns, columns| {
            Ok(writer.write(&Table {
                log_time_ns: times_ns,
                columns,
                ..Table::default()
            })?)
        })?;
        writer.finish()?;
        Ok(rows)
    }

    #[cfg(feature = "formats")]
    fn write_parquet(&mut self, file: File) -> anyhow::Result<usize> {
        let mut fields = vec![parquet::time_field("time")];
        for Wanted { topic, columns, .. } in &self.topics {
            for wanted in columns {
                let field = parquet::field(&wanted.column, topic, Layout::Dataset);
                let method = self.method.for_column(&wanted.column);
                let mut metadata = field.metadata().clone();
                metadata.extend([
                    ("topic".to_owned(), topic.name.clone()),
                    ("method".to_owned(), method.to_string()),
                    (
                        "max_gap_s".to_owned(),
                        (wanted.max_gap_ns as f64 / 1e9).to_string(),
                    ),
                ]);
                let name = full_name(topic, &wanted.column.name);
                let field = field.with_name(name).with_nullable(true);
                fields.push(field.with_metadata(metadata));
            }
        }
        let metadata = [
            ("atvrec.run", self.reader.session().run_id.clone()),
            ("atvrec.rate_hz", self.rate_hz.to_string()),
            ("atvrec.method", self.method.to_string()),
            ("atvrec.gap_rule", GAP_RULE.to_owned()),
        ];
        let metadata: HashMap<String, String> = metadata
            .into_iter()
            .map(|(key, value)| (key.to_owned(), value))
            .collect();
        let mut writer = parquet::Writer::with_fields(file, fields, Layout::Dataset, metadata)?;
        let rows = self.each_block(|times_ns, columns| {
            let mut arrays = vec![parquet::time_array(&times_ns)];
            let columns = columns.iter();
            arrays.extend(columns.map(|column| parquet::array(column, Layout::Dataset)));
            writer.write_arrays(arrays)
        })?;
        writer.finish()?;
        Ok(rows)
    }

    /// Calls `take` with the times and the columns of each stretch; number of rows.
    fn each_block(
        &mut self,
        mut take: impl FnMut(Vec<i64>, Vec<Column>) -> anyhow::Result<()>,
    ) -> anyhow::Result<usize> {
        let begin_ns = self.span.begin.0.cast_signed();
        let end_ns = begin_ns + (self.span.seconds * 1e9) as i64 + 1;
        let all = self.topics.iter().flat_map(|topic| &topic.columns);
        let margin_ns = LATE_NS
            + all
                .map(|column| column.max_gap_ns)
                .max()
                .unwrap_or_default();
        let (mut start_ns, mut rows) = (begin_ns, 0);
        while start_ns < end_ns {
            self.interrupt.check()?;
            let done_s = (start_ns - begin_ns) as f64 / 1e9;
            self.progress.set((self.span.seconds + done_s) / 2.0);
            let stop_ns = start_ns.saturating_add(BLOCK_NS).min(end_ns);
            let targets_ns = self.grid.times_ns(start_ns, stop_ns);
            let read_ns = [
                start_ns.saturating_sub(margin_ns),
                stop_ns.saturating_add(margin_ns),
            ];
            let columns = self.columns(read_ns, &targets_ns)?;
            rows += targets_ns.len();
            take(targets_ns, columns)?;
            start_ns = stop_ns;
        }
        self.progress.finish();
        Ok(rows)
    }

    /// The columns at the targets, from the rows of a stretch.
    fn columns(&self, read_ns: [i64; 2], targets_ns: &[i64]) -> anyhow::Result<Vec<Column>> {
        let in_log = self.topics.iter().filter(|topic| topic.whole.is_none());
        let names: Vec<&str> = in_log.map(|topic| &*topic.topic.name).collect();
        let [start, end] = read_ns.map(|ns| LogTime(ns.max(0).cast_unsigned()));
        let [first, last] = self.span.times;
        let mut tables = self
            .reader
            .tables(&names, start.max(first), end.min(last))?
            .into_iter();
        let mut all = Vec::new();
        for topic in &self.topics {
            let read = match &topic.whole {
                Some(_) => None,
                None => tables.next(),
            };
            let Some(table) = topic.whole.as_ref().or(read.as_ref()) else {
                continue;
            };
            for wanted in &topic.columns {
                let column = wanted.at(table, targets_ns, self.method);
                all.push(renamed(&topic.topic, column));
            }
        }
        Ok(all)
    }
}

impl Wanted {
    fn new(topic: Topic) -> Self {
        Self {
            topic,
            columns: Vec::new(),
            whole: None,
        }
    }

    /// Notes the columns of rows, and the intervals between their values.
    fn add(&mut self, table: &Table) {
        for column in &table.columns {
            if matches!(column.values, Values::List { .. } | Values::Bytes(_)) {
                continue;
            }
            let known = self
                .columns
                .iter()
                .position(|one| one.column.name == column.name);
            let at = known.unwrap_or_else(|| {
                self.columns.push(WantedColumn::new(column));
                self.columns.len() - 1
            });
            self.columns[at].add(&table.publish_time_ns, column);
        }
    }
}

impl WantedColumn {
    fn new(column: &Column) -> Self {
        Self {
            column: column.without_rows(),
            intervals_ns: Vec::new(),
            has_value: false,
            max_gap_ns: 0,
        }
    }

    fn add(&mut self, times_ns: &[i64], column: &Column) {
        self.has_value |= has_value(column);
        if self.intervals_ns.len() < INTERVALS {
            self.intervals_ns.extend(intervals_ns(times_ns, column));
            self.intervals_ns.truncate(INTERVALS);
        }
    }

    /// The column at the targets; absent in all rows if the table does not have it.
    fn at(&self, table: &Table, targets_ns: &[i64], method: Method) -> Column {
        let found = table
            .columns
            .iter()
            .find(|one| one.name == self.column.name);
        let (times_ns, column) = match found {
            Some(column) => (&*table.publish_time_ns, column),
            None => (&[][..], &self.column),
        };
        let mut aligned = align(times_ns, column, targets_ns, method, self.max_gap_ns);
        if let Values::F64(list) = &aligned.values {
            aligned.present = Some(list.iter().map(|value| !value.is_nan()).collect());
        }
        aligned
    }
}

fn full_name(topic: &Topic, column: &str) -> String {
    format!("{}.{column}", topic.name)
}

fn renamed(topic: &Topic, column: Column) -> Column {
    Column {
        name: full_name(topic, &column.name),
        ..column
    }
}
