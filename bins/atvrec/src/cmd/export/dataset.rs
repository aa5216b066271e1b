//! `atvrec export --all`: a dataset of Parquet files in folders `vehicle=/date=/run=/topic=`.

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use engine::output::{Folder, TargetError};
use engine::{Config, Error, LeftOut};
use sample::LogTime;
use store::{Column, Missing, Reader, Table, UtcOffset, utc_ns};

use super::cells::time;
use super::parquet::{Layout, Writer};
use super::topic::Topic;
use super::{Span, add_utc};
use crate::cli::ExportArgs;
use crate::exit::Outcome;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Rows of a topic that are in memory at a time.
const BATCH_ROWS: usize = 1 << 12;
/// Value of a partition that is unknown, as Hive writes it.
const UNKNOWN: &str = "__HIVE_DEFAULT_PARTITION__";
/// Name of the file of a topic.
const FILE: &str = "part-0.parquet";

/// Runs the command.
pub fn run(args: &ExportArgs, path: &Path, quiet: bool) -> anyhow::Result<Outcome> {
    let interrupt = Interrupt::listen()?;
    let runs: Vec<Run> = (runs(&args.logs)?.iter())
        .map(|logs| Run::open(logs, args))
        .collect::<anyhow::Result<_>>()?;
    let is_own = |name: &std::ffi::OsStr| name.to_string_lossy().starts_with("vehicle=");
    let folder = Folder::open(path, is_own)?;
    for run in &runs {
        if let Some(place) = run.find(path)?
            && !args.replace.force
        {
            let (path, run) = (path.to_owned(), run.name.clone());
            return Err(Error::from(TargetError::RunExists { path, run, place }).into());
        }
    }
    let total_s = runs.iter().map(|run| run.span.seconds).sum();
    let progress = Progress::seconds("export", total_s, quiet);
    let (mut missing, mut done_s, mut rows) = (Vec::new(), 0.0, Vec::new());
    for (number, run) in runs.iter().enumerate() {
        let partial = folder.partial().join(number.to_string());
        let mut export = RunExport {
            run,
            folder: &partial,
            files: Vec::new(),
            columns: vec![None; run.topics.len()],
            missing: Vec::new(),
        };
        let show = |time: LogTime| {
            interrupt.check()?;
            progress.set(done_s + time.seconds_since(run.span.begin));
            Ok(())
        };
        rows.push(export.write(&show)?);
        missing.append(&mut export.missing);
        done_s += run.span.seconds;
    }
    for (number, run) in runs.iter().enumerate() {
        let replaced = run.find(path)?;
        folder.publish(
            Path::new(&number.to_string()),
            &run.place(),
            replaced.as_deref(),
        )?;
    }
    progress.finish();
    for (run, rows) in runs.iter().zip(rows) {
        let place = path.join(run.place());
        let topics = run.topics.len();
        println!("{}: {rows} rows, {topics} topics", place.display());
    }
    let infos = runs.iter().map(|run| run.reader.info().missing);
    missing.extend(infos.flatten());
    Ok(super::report_missing(missing))
}

/// The logs of each run, in the order of the command line.
fn runs(logs: &[PathBuf]) -> anyhow::Result<Vec<Vec<PathBuf>>> {
    let mut runs: Vec<(String, Vec<PathBuf>)> = Vec::new();
    for log in logs {
        let name = run_name(&Reader::open([log])?, log);
        match runs.iter_mut().find(|(known, _)| *known == name) {
            Some((_, files)) => files.push(log.clone()),
            None => runs.push((name, vec![log.clone()])),
        }
    }
    Ok(runs.into_iter().map(|(_, files)| files).collect())
}

/// Name of the run of a log: that of its file, if the log states none.
fn run_name(reader: &Reader, path: &Path) -> String {
    let run = &reader.session().run_id;
    if !run.is_empty() {
        return run.clone();
    }
    let stem = path.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// A run that is exported.
struct Run {
    reader: Reader,
    left_out: LeftOut,
    name: String,
    vehicle: Option<String>,
    /// In UTC, as 2026-11-27.
    date: String,
    utc: Option<UtcOffset>,
    span: Span,
    topics: Vec<Topic>,
}

impl Run {
    fn open(logs: &[PathBuf], args: &ExportArgs) -> anyhow::Result<Self> {
        let reader = Reader::open(logs)?;
        let left_out = LeftOut::of(&reader);
        let topics = Topic::all(&reader, &left_out);
        if topics.is_empty() {
            let log = logs[0].display();
            anyhow::bail!("{log} has no topic that is a table, so that there is nothing to export");
        }
        let config = Config::from_attachments(&reader.attachments()?).ok();
        let estimator = config.and_then(|config| config.estimator);
        let utc = reader.utc_offset()?;
        let span = Span::new(&reader, args)?;
        let start = reader.info().span.map_or(LogTime(0), |(first, _)| first);
        let started = match reader.session().started {
            LogTime(0) => start,
            started => started,
        };
        Ok(Self {
            name: run_name(&reader, &logs[0]),
            vehicle: estimator.map(|estimator| estimator.vehicle.name),
            date: date(utc_ns(started, utc).cast_signed()),
            topics,
            utc,
            span,
            left_out,
            reader,
        })
    }

    fn folder_name(&self) -> String {
        partition("run", &self.name)
    }

    /// Where the run is in the dataset.
    fn place(&self) -> PathBuf {
        let vehicle = self.vehicle.as_deref().map_or_else(
            || format!("vehicle={UNKNOWN}"),
            |name| partition("vehicle", name),
        );
        let date = partition("date", &self.date);
        [vehicle, date, self.folder_name()].iter().collect()
    }

    /// Where the dataset contains a run of this name, below any vehicle and date.
    fn find(&self, dataset: &Path) -> anyhow::Result<Option<PathBuf>> {
        let name = self.folder_name();
        let below = |path: &Path, key: &str| -> std::io::Result<Vec<PathBuf>> {
            let entries = fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
            let mut all = entries.collect::<std::io::Result<Vec<_>>>()?;
            all.retain(|path| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                name.starts_with(key) && path.is_dir()
            });
            Ok(all)
        };
        for vehicle in below(dataset, "vehicle=")? {
            for date in below(&vehicle, "date=")? {
                let place = date.join(&name);
                if place.is_dir() {
                    let place = place.strip_prefix(dataset).unwrap_or(&place);
                    return Ok(Some(place.to_owned()));
                }
            }
        }
        Ok(None)
    }

    /// Metadata of the file of a topic.
    fn metadata(&self, topic: &Topic) -> HashMap<String, String> {
        let session = self.reader.session();
        let mut all = vec![
            ("topic", topic.name.clone()),
            ("schema", topic.schema.clone()),
            ("source", topic.source.clone()),
            ("run", self.name.clone()),
            ("recorded_by", session.version.clone()),
        ];
        all.extend(self.vehicle.clone().map(|name| ("vehicle", name)));
        if let Some(utc) = self.utc {
            all.push(("utc_minus_log_time_ns", utc.offset_ns.to_string()));
            all.push(("utc_sigma_s", utc.sigma_s.to_string()));
        }
        all.into_iter()
            .map(|(key, value)| (format!("atvrec.{key}"), value))
            .collect()
    }
}

/// The files of a run that are being written.
struct RunExport<'r> {
    run: &'r Run,
    folder: &'r Path,
    /// The file of each topic.
    files: Vec<Option<Writer>>,
    /// The columns of each topic, as far as they are known.
    columns: Vec<Option<Vec<Column>>>,
    missing: Vec<Missing>,
}

impl RunExport<'_> {
    /// Writes all topics in one pass; number of rows. If a later message of a topic has columns that the
    /// first ones do not have, a second pass follows.
    fn write(&mut self, show: &dyn Fn(LogTime) -> anyhow::Result<()>) -> anyhow::Result<usize> {
        loop {
            let _ = fs::remove_dir_all(self.folder);
            self.missing.clear();
            self.files = self.run.topics.iter().map(|_| None).collect();
            let (mut rows, mut has_grown) = (0, false);
            let names: Vec<&str> = self.run.topics.iter().map(|topic| &*topic.name).collect();
            let Run {
                reader,
                left_out,
                span,
                utc,
                ..
            } = self.run;
            left_out.each_batch(
                reader,
                &names,
                span.times,
                BATCH_ROWS,
                |topic, mut table| {
                    if let Some(last) = table.log_time_ns.last() {
                        show(LogTime(last.cast_unsigned()))?;
                    }
                    self.missing.append(&mut table.missing);
                    rows += table.log_time_ns.len();
                    has_grown |= self.pad(topic, &mut table);
                    if has_grown {
                        return Ok(());
                    }
                    add_utc(&mut table, *utc);
                    self.write_batch(topic, &table)
                },
            )?;
            for file in self.files.drain(..).flatten() {
                file.finish()?;
            }
            if !has_grown {
                return Ok(rows);
            }
        }
    }

    /// Adds the columns that earlier rows had; whether the table has more columns than they.
    fn pad(&mut self, topic: usize, table: &mut Table) -> bool {
        let known = self.columns[topic].get_or_insert_with(|| without_rows(table));
        if table.columns.len() > known.len() {
            *known = without_rows(table);
            return true;
        }
        table.pad(known);
        false
    }

    fn write_batch(&mut self, topic: usize, table: &Table) -> anyhow::Result<()> {
        let file = match &mut self.files[topic] {
            Some(file) => file,
            none => {
                let of = &self.run.topics[topic];
                let folder = self.folder.join(partition("topic", &of.name));
                fs::create_dir_all(&folder)?;
                let file = File::create_new(folder.join(FILE))?;
                let metadata = self.run.metadata(of);
                let columns = &table.columns;
                none.insert(Writer::new(file, columns, of, Layout::Dataset, metadata)?)
            }
        };
        file.write(table)
    }
}

/// The columns of a table that has the columns of a batch.
fn without_rows(table: &Table) -> Vec<Column> {
    table.columns.iter().map(Column::without_rows).collect()
}

/// Date of a time in ns since 1970, as 2026-11-27.
fn date(ns: i64) -> String {
    let text = time(ns);
    let date = text.split_once('T').map(|(date, _)| date);
    date.unwrap_or_default().to_owned()
}

/// Name of the folder of a partition. All bytes except letters, digits, `-`, `_`, `.` and `~` are escaped
/// as in a URI, as readers of Hive partitions expect.
fn partition(key: &str, value: &str) -> String {
    let mut name = format!("{key}=");
    for byte in value.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte) {
            name.push(byte.into());
        } else {
            name.push_str(&format!("%{byte:02X}"));
        }
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_utc() {
        assert_eq!(date(1_795_812_300_000_000_000), "2026-11-27");
        assert_eq!(date(0), "1970-01-01");
    }

    #[test]
    fn values_of_partitions_are_escaped_as_in_a_uri() {
        assert_eq!(partition("topic", "/imu/a b"), "topic=%2Fimu%2Fa%20b");
        assert_eq!(
            partition("vehicle", "Prowler=é%"),
            "vehicle=Prowler%3D%C3%A9%25"
        );
        assert_eq!(
            partition("run", "20261121T140500Z-0a_1.b~"),
            "run=20261121T140500Z-0a_1.b~"
        );
    }
}
