//! Reading logs.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use engine::{LeftOut, Window, read_drive};
use estimator::identification::{self, tyre};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use report::score::{
    ForceScore, LOW_PASS_HZ, ScoreOptions, compare, innovations, innovations_json, score_methods,
    score_with,
};
use sample::LogTime;
use store::align::{Grid, Method, MethodError, align, intervals_ns};
use store::{Column, Reader, Stage, Table};

use crate::{arrays, errors, findings, interrupt};

/// One or more files of a run. What Python users see is `atvrec.Log`, which wraps this.
#[pyclass(frozen, module = "atvrec._atvrec")]
pub struct LogReader {
    pub reader: Arc<Reader>,
    left_out: Arc<LeftOut>,
    pub paths: Vec<PathBuf>,
}

/// Columns, units, and what is missing.
type ReadTopic<'py> = (Bound<'py, PyDict>, Bound<'py, PyDict>, Vec<String>);

/// Times, and what was read of each topic.
type Frame<'py> = (Bound<'py, PyArray1<i64>>, Vec<ReadTopic<'py>>);

/// What is to be read.
struct Wanted {
    reader: Arc<Reader>,
    left_out: Arc<LeftOut>,
    topics: Vec<String>,
    fields: Vec<Vec<String>>,
    joined: bool,
}

/// Rows that are read before those of an instant are joined.
const BATCH_ROWS: usize = 1 << 14;

impl Wanted {
    /// The wanted columns of each topic.
    fn tables(self, py: Python<'_>, span: [LogTime; 2]) -> PyResult<Vec<Table>> {
        interrupt::detached(py, move || {
            let mut tables = vec![Table::default(); self.topics.len()];
            let rows = if self.joined { BATCH_ROWS } else { usize::MAX };
            let (reader, topics) = (&self.reader, &self.topics);
            let read = self
                .left_out
                .each_batch(reader, topics, span, rows, |position, table| {
                    tables[position].append(self.part(position, table));
                    Ok::<(), engine::Error>(())
                });
            read.map_err(|error| errors::engine(&error))?;
            for (position, table) in tables.iter_mut().enumerate() {
                self.check(position, table)?;
                if self.joined {
                    // The rows of an instant on both sides of the end of a batch.
                    *table = std::mem::take(table).joined_by_instant();
                }
            }
            Ok(tables)
        })?
    }

    /// What is wanted of a batch.
    fn part(&self, position: usize, table: Table) -> Table {
        let mut table = if self.joined {
            table.joined_by_instant()
        } else {
            table
        };
        let fields = &self.fields[position];
        if !fields.is_empty() {
            let is_wanted =
                |column: &Column| fields.iter().any(|field| is_field(field, &column.name));
            table.columns.retain(is_wanted);
        }
        table
    }

    /// Whether the topic has all fields that were asked for.
    fn check(&self, position: usize, table: &Table) -> PyResult<()> {
        let topic = &self.topics[position];
        for field in &self.fields[position] {
            let is_there = |column: &Column| is_field(field, &column.name);
            if !table.columns.iter().any(is_there) {
                let all = self.left_out.columns(&self.reader, topic, EMPTY);
                let all = all.map_err(|error| errors::engine(&error))?;
                let names: Vec<&str> = all.columns.iter().map(|one| one.name.as_str()).collect();
                return Err(errors::argument(format!(
                    "the topic {topic} has no field {field}; it has {}",
                    names.join(", ")
                )));
            }
        }
        Ok(())
    }
}

/// A stretch of time without messages: gives columns without rows.
const EMPTY: [LogTime; 2] = [LogTime(1), LogTime(0)];

/// Whether `field` names this column, or the message or wheel that it belongs to.
fn is_field(field: &str, column: &str) -> bool {
    column
        .strip_prefix(field)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// The times of a frame on the log clock: at a rate, on whole seconds of UTC, over the time that all topics
/// span, or those of the first topic.
fn targets(tables: &[Table], rate_hz: Option<f64>, utc_minus_log_ns: i64) -> PyResult<Vec<i64>> {
    let Some(rate_hz) = rate_hz else {
        let first = tables.first().map(|table| table.publish_time_ns.clone());
        let mut times = first.unwrap_or_default();
        times.sort_unstable();
        times.dedup();
        return Ok(times);
    };
    let all = || tables.iter().flat_map(|table| &table.publish_time_ns);
    let (Some(start), Some(end)) = (all().min(), all().max()) else {
        return Ok(Vec::new());
    };
    let [start, end] = [*start, *end].map(|time| time.saturating_add(utc_minus_log_ns));
    let grid = Grid::new(start, rate_hz).map_err(|e| errors::argument(e.to_string()))?;
    let utc = grid.times_ns(start, end.saturating_add(1));
    Ok(utc
        .into_iter()
        .map(|time| time - utc_minus_log_ns)
        .collect())
}

/// `schema` is the name of the topic's schema, by which the units are known that the log does not tell.
fn read_topic<'py>(py: Python<'py>, table: Table, schema: &str) -> PyResult<ReadTopic<'py>> {
    let columns = PyDict::new(py);
    let units = PyDict::new(py);
    columns.set_item("log_time_ns", table.log_time_ns.into_pyarray(py))?;
    columns.set_item("publish_time_ns", table.publish_time_ns.into_pyarray(py))?;
    for column in table.columns {
        let name = column.name.clone();
        if let Some(unit) = store::describe::unit(schema, &column) {
            units.set_item(&name, unit)?;
        }
        columns.set_item(name, arrays::column(py, column)?)?;
    }
    let missing = table.missing.iter().map(ToString::to_string).collect();
    Ok((columns, units, missing))
}

impl LogReader {
    /// Names of the topics' schemas; empty for topics that are left out of the log.
    fn schemas(&self, topics: &[String]) -> Vec<String> {
        let channels = self.reader.info().channels;
        let names = topics.iter().map(|topic| {
            let channel = channels.get(topic);
            channel
                .map(|(schema, _)| schema.clone())
                .unwrap_or_default()
        });
        names.collect()
    }

    fn wanted(
        &self,
        topics: Vec<String>,
        fields: Vec<Vec<String>>,
        joined: bool,
    ) -> PyResult<Wanted> {
        if fields.len() != topics.len() {
            return Err(errors::argument("fields: one list for each topic"));
        }
        Ok(Wanted {
            reader: Arc::clone(&self.reader),
            left_out: Arc::clone(&self.left_out),
            topics,
            fields,
            joined,
        })
    }
}

fn read_topics<'py>(
    py: Python<'py>,
    tables: Vec<Table>,
    schemas: &[String],
) -> PyResult<Vec<ReadTopic<'py>>> {
    let pairs = tables.into_iter().zip(schemas);
    pairs
        .map(|(table, schema)| read_topic(py, table, schema))
        .collect()
}

#[pymethods]
impl LogReader {
    #[new]
    fn new(py: Python<'_>, paths: Vec<PathBuf>) -> PyResult<Self> {
        let named = paths.clone();
        let opened = interrupt::detached(py, move || {
            let reader = Reader::open(&named)?;
            let left_out = LeftOut::of(&reader);
            Ok((Arc::new(reader), Arc::new(left_out)))
        })?;
        let (reader, left_out) = opened.map_err(|e| errors::log(&e))?;
        Ok(Self {
            reader,
            left_out,
            paths,
        })
    }

    /// Topics that are in the log or left out of it, sorted.
    fn topics(&self) -> Vec<String> {
        let in_log = self.reader.info().channels.into_keys();
        let all = in_log.chain(self.left_out.topics().map(str::to_owned));
        all.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Log clock of the first and last message, ns since 1970; None for an empty log.
    fn span_ns(&self) -> Option<(u64, u64)> {
        let span = self.reader.info().span?;
        Some((span.0.0, span.1.0))
    }

    /// What the log holds, in numbers.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = self.reader.info();
        let dict = PyDict::new(py);
        let files = PyList::empty(py);
        for (path, bytes) in &info.files {
            files.append((path, bytes))?;
        }
        dict.set_item("files", files)?;
        dict.set_item("start_ns", info.span.map(|span| span.0.0))?;
        dict.set_item("end_ns", info.span.map(|span| span.1.0))?;
        dict.set_item("channels", info.channels)?;
        dict.set_item("chunks", info.chunks)?;
        dict.set_item("counters", info.counters)?;
        dict.set_item("metadata", self.reader.metadata())?;
        let missing: Vec<String> = info.missing.iter().map(ToString::to_string).collect();
        dict.set_item("missing", missing)?;
        Ok(dict)
    }

    /// Contents of the attached files by name.
    fn attachments<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let attachments = py
            .detach(|| self.reader.attachments())
            .map_err(|e| errors::log(&e))?;
        let dict = PyDict::new(py);
        for attachment in attachments {
            dict.set_item(attachment.name, PyBytes::new(py, &attachment.data))?;
        }
        Ok(dict)
    }

    /// For each topic its columns, their units, and what is missing, as a tuple of two dicts and a list.
    /// `fields` names the columns to read of each topic, none for all; `joined` asks for one row an
    /// instant. The ends of the stretch, both included, are ns of the log clock. All topics are read in
    /// one pass.
    fn read<'py>(
        &self,
        py: Python<'py>,
        topics: Vec<String>,
        fields: Vec<Vec<String>>,
        start_ns: u64,
        end_ns: u64,
        joined: bool,
    ) -> PyResult<Vec<ReadTopic<'py>>> {
        let span = [LogTime(start_ns), LogTime(end_ns)];
        let schemas = self.schemas(&topics);
        let tables = self.wanted(topics, fields, joined)?.tables(py, span)?;
        read_topics(py, tables, &schemas)
    }

    /// Times of UTC, and for each topic the columns at these times, their units, and what is missing.
    /// Without a rate, the times are those of the first topic.
    #[allow(
        clippy::too_many_arguments,
        reason = "the arguments of Python's Log.frame, one by one"
    )]
    fn frame<'py>(
        &self,
        py: Python<'py>,
        topics: Vec<String>,
        fields: Vec<Vec<String>>,
        start_ns: u64,
        end_ns: u64,
        rate_hz: Option<f64>,
        method: &str,
        max_gap_ns: Option<i64>,
    ) -> PyResult<Frame<'py>> {
        let method: Method = method
            .parse()
            .map_err(|e: MethodError| errors::argument(e.to_string()))?;
        let span = [LogTime(start_ns), LogTime(end_ns)];
        let schemas = self.schemas(&topics);
        let tables = self.wanted(topics, fields, true)?.tables(py, span)?;
        let utc = self
            .reader
            .utc_offset()
            .map_err(|error| errors::log(&error))?;
        let utc_minus_log_ns = utc.map_or(0, |utc| utc.offset_ns);
        let targets = targets(&tables, rate_hz, utc_minus_log_ns)?;
        let (tables, targets) = interrupt::detached(py, move || {
            let aligned = tables.into_iter().map(|table| {
                let times = table.publish_time_ns;
                let columns = table.columns.iter().map(|column| {
                    let gap = max_gap_ns.unwrap_or_else(|| {
                        store::align::max_gap_ns(&mut intervals_ns(&times, column))
                    });
                    align(&times, column, &targets, method, gap)
                });
                Table {
                    columns: columns.collect(),
                    missing: table.missing,
                    ..Table::default()
                }
            });
            let aligned: Vec<Table> = aligned.collect();
            let utc: Vec<i64> = targets.iter().map(|time| time + utc_minus_log_ns).collect();
            (aligned, utc)
        })?;
        Ok((targets.into_pyarray(py), read_topics(py, tables, &schemas)?))
    }

    /// What `atvrec identify KIND` finds in the drive, after `from_s`.
    fn identify<'py>(
        &self,
        py: Python<'py>,
        kind: &str,
        from_s: f64,
        seed: u64,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let methods = [
            identification::Method::Cornering,
            identification::Method::Tyre(tyre::Kind::ALL.to_vec()),
            identification::Method::RollPitch,
            identification::Method::YawInertia,
            identification::Method::Understeer,
            identification::Method::Response {
                step_min_rad: 1.5_f64.to_radians(),
                window_s: 10.0,
            },
            identification::Method::Friction,
            identification::Method::Slip,
            identification::Method::Camber,
            identification::Method::Aligning,
            identification::Method::Toe,
        ];
        let known = methods.each_ref().map(identification::Method::title);
        let method = methods.into_iter().find(|method| method.title() == kind);
        let Some(method) = method else {
            return Err(errors::argument(format!(
                "{kind:?} is no kind of identification; use one of {}",
                known.join(", ")
            )));
        };
        let reader = Arc::clone(&self.reader);
        let found = interrupt::detached(py, move || {
            let window = Window { from_s, to_s: None };
            let drive = read_drive(&reader, None, window, &method);
            let drive = drive.map_err(|error| errors::engine(&error))?;
            let found = method.identify(&drive, seed);
            found.map_err(|error| findings::estimator(&error))
        })??;
        let results = found.results.iter();
        results.map(|one| findings::dict(py, one)).collect()
    }

    /// What `atvrec identify mistakes --json` prints.
    fn mistakes_json(&self, py: Python<'_>) -> PyResult<String> {
        let reader = Arc::clone(&self.reader);
        let report = interrupt::detached(py, move || {
            let attachments = reader.attachments().map_err(engine::Error::from)?;
            let config = engine::Config::from_attachments(&attachments)?;
            engine::find_mistakes(&reader, &config)
        })?;
        let report = report.map_err(|error| errors::engine(&error))?;
        Ok(engine::mistakes_as_json(&report).to_string())
    }

    /// What `atvrec identify latency --json` prints.
    fn latencies_json(&self, py: Python<'_>) -> PyResult<String> {
        let reader = Arc::clone(&self.reader);
        let found = interrupt::detached(py, move || {
            let attachments = reader.attachments().map_err(engine::Error::from)?;
            let config = engine::Config::from_attachments(&attachments)?;
            engine::find_latencies(&reader, &config)
        })?;
        let found = found.map_err(|error| errors::engine(&error))?;
        Ok(engine::latencies_as_json(&found).to_string())
    }

    /// The numbers of `atvrec report --json`.
    fn report_json(&self, py: Python<'_>, smoothed: bool) -> PyResult<String> {
        let paths = self.paths.clone();
        let options = report::Options {
            smoothed,
            ..report::Options::default()
        };
        let found = interrupt::detached(py, move || {
            report::report(&paths, &options, "", &mut |_| Ok(()))
        })?;
        let found = found.map_err(|error| errors::report(&error))?;
        Ok(found.numbers.to_string())
    }

    /// What `atvrec score --json` prints: against the truth in the log, with the simple methods or not,
    /// or against another log's estimates.
    fn score_json(
        &self,
        py: Python<'_>,
        against: Option<&Self>,
        smoothed: bool,
        from_s: f64,
        methods: bool,
        low_pass_hz: Option<f64>,
    ) -> PyResult<String> {
        let [least, most] = LOW_PASS_HZ;
        if let Some(hz) = low_pass_hz.filter(|hz| !(least..=most).contains(hz)) {
            return Err(errors::argument(format!(
                "low_pass_hz = {hz}: must be from {least} to {most} Hz"
            )));
        }
        let stage = if smoothed {
            Stage::Smoothed
        } else {
            Stage::Estimate
        };
        let reader = Arc::clone(&self.reader);
        let against = against.map(|other| Arc::clone(&other.reader));
        let found = interrupt::detached(py, move || {
            let found = match against {
                Some(other) => compare(&reader, &other, stage, from_s).map(|found| found.to_json()),
                None => {
                    let options = ScoreOptions {
                        stage,
                        from_s,
                        low_pass_hz,
                    };
                    score_with(&reader, options, &mut |_| Ok(())).map(|found| found.to_json())
                }
            };
            let mut json = found.map_err(|error| errors::score(&error))?;
            if methods {
                let simple = engine::simple_methods_of(&reader);
                let simple = simple.map_err(|error| errors::engine(&error))?;
                let found = score_methods(&reader, simple.by_name(), from_s);
                let found = found.map_err(|error| errors::score(&error))?;
                json["methods"] = found.iter().map(ForceScore::to_json).collect();
            }
            Ok::<_, PyErr>(json)
        })?;
        Ok(found?.to_string())
    }

    /// The innovations of `atvrec score --innovations --json`.
    fn innovations_json(&self, py: Python<'_>, from_s: f64) -> PyResult<String> {
        let reader = Arc::clone(&self.reader);
        let found = interrupt::detached(py, move || innovations(&reader, from_s))?;
        let found = found.map_err(|error| errors::score(&error))?;
        Ok(innovations_json(&found).to_string())
    }

    /// Names of an enumeration's values, by field, for the fields of a topic that are one.
    fn enums<'py>(&self, py: Python<'py>, topic: &str) -> PyResult<Bound<'py, PyDict>> {
        let table = self.left_out.columns(&self.reader, topic, EMPTY);
        let dict = PyDict::new(py);
        for column in table.map_err(|e| errors::engine(&e))?.columns {
            if !column.names.is_empty() {
                let names = PyDict::new(py);
                for (value, name) in column.names {
                    names.set_item(value, name)?;
                }
                dict.set_item(column.name, names)?;
            }
        }
        Ok(dict)
    }
}

/// Counts, and positions of both turning points.
type Cycles<'py> = (Bound<'py, PyArray1<f64>>, [Bound<'py, PyArray1<i64>>; 2]);

/// Counts (1 or 0.5) of the rainflow cycles of a load, and the positions of their turning points.
#[pyfunction]
pub fn rainflow<'py>(py: Python<'py>, load: PyReadonlyArray1<'py, f64>) -> PyResult<Cycles<'py>> {
    let load = load.as_slice()?;
    let cycles = py.detach(|| report::rainflow(load));
    let counts: Vec<f64> = cycles.iter().map(|cycle| cycle.count).collect();
    let turns = [0, 1].map(|end| {
        let rows = cycles.iter().map(|cycle| cycle.turns[end] as i64);
        rows.collect::<Vec<i64>>().into_pyarray(py)
    });
    Ok((counts.into_pyarray(py), turns))
}
