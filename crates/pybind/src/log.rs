//! Reading logs.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use engine::LeftOut;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use report::score::{
    ForceScore, LOW_PASS_HZ, ScoreOptions, compare, innovations, innovations_json, score_methods,
    score_with,
};
use sample::LogTime;
use store::{Reader, Stage, Table};

use crate::{arrays, errors, interrupt};

/// One or more files of a run. What Python users see is `atvrec.Log`, which wraps this.
#[pyclass(frozen, module = "atvrec._atvrec")]
pub struct LogReader {
    pub reader: Arc<Reader>,
    left_out: Arc<LeftOut>,
    pub paths: Vec<PathBuf>,
}

/// Columns, units, and what is missing.
type ReadTopic<'py> = (Bound<'py, PyDict>, Bound<'py, PyDict>, Vec<String>);

fn read_topic(py: Python<'_>, table: Table) -> PyResult<ReadTopic<'_>> {
    let columns = PyDict::new(py);
    let units = PyDict::new(py);
    columns.set_item("log_time_ns", table.log_time_ns.into_pyarray(py))?;
    columns.set_item("publish_time_ns", table.publish_time_ns.into_pyarray(py))?;
    for column in table.columns {
        let name = column.name.clone();
        if !column.unit.is_empty() {
            units.set_item(&name, &column.unit)?;
        }
        columns.set_item(name, arrays::column(py, column)?)?;
    }
    let missing = table.missing.iter().map(ToString::to_string).collect();
    Ok((columns, units, missing))
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
    /// The ends of the stretch, both included, are ns of the log clock. All topics are read in one pass.
    fn read<'py>(
        &self,
        py: Python<'py>,
        topics: Vec<String>,
        start_ns: u64,
        end_ns: u64,
    ) -> PyResult<Vec<ReadTopic<'py>>> {
        let (reader, left_out) = (Arc::clone(&self.reader), Arc::clone(&self.left_out));
        let span = [LogTime(start_ns), LogTime(end_ns)];
        let tables = interrupt::detached(py, move || left_out.tables(&reader, &topics, span))?;
        let tables = tables.map_err(|e| errors::engine(&e))?;
        tables
            .into_iter()
            .map(|table| read_topic(py, table))
            .collect()
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
        // An empty stretch of time gives the columns without rows.
        let span = [LogTime(1), LogTime(0)];
        let table = self.left_out.columns(&self.reader, topic, span);
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
