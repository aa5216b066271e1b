//! `atvrec replay`: the estimate again, from the raw bytes alone.

mod changes;

use std::iter::Peekable;
use std::time::{Duration, Instant};

use engine::Config;
use engine::ReadAhead;
use engine::missing;
use engine::{Engine, Skipped};
use engine::{Report, Verifier};
use sample::text::printable;
use sample::{Arrival, LogTime, Payload};
use store::{LogWriter, MessageIter, Missing, Reader, Record, Selection, Session, Stage, Writer};

use crate::cli::ReplayArgs;
use crate::exit::{Outcome, UsageError};
use crate::output::target::{Kind, LogFile, Target};
use crate::progress::Progress;
use crate::session;

/// What a replay did.
#[derive(Debug, Default)]
struct Done {
    arrivals: u64,
    records: u64,
    left_out: u64,
    /// Estimates of the verified log that this version no longer gives.
    during_silence: u64,
    span: Option<(LogTime, LogTime)>,
    missing: Vec<Missing>,
    /// Closed files are not what was written.
    changed: bool,
}

/// Replays.
pub fn run(args: &ReplayArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let output = output(args)?;
    let reader = Reader::open(&args.logs)?;
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => Config::from_attachments(&changes::apply(&args.changes, reader.attachments()?)?)?,
    };
    if let (true, Some(missing)) = (args.verify, reader.missing_parts().first()) {
        anyhow::bail!(
            "{missing}: the state of the estimator at the beginning of the next part is unknown, so \
             that the log cannot be verified; give all parts of the run"
        );
    }
    let original = reader.session().clone();
    check_sources(&config, &original)?;
    let begin = Instant::now();
    let mut replay = Replay::new(&reader, &config, &original, args, output.as_ref())?;
    let progress = Progress::seconds("replay", log_seconds(&reader), quiet);
    let mut pace = args.rate.map(Pace::new);
    let mut done = Done::default();
    let skipped = skipped(&reader)?;
    let ahead = ReadAhead::start(reader.arrivals());
    while let Some(batch) = ahead.next() {
        for arrival in batch? {
            if let Some(pace) = &mut pace {
                pace.wait(arrival.log_time);
            }
            let (first, _) = *done
                .span
                .get_or_insert((arrival.log_time, arrival.log_time));
            replay.watch_sequence(&arrival, &skipped);
            done.span = Some((first, arrival.log_time));
            done.arrivals += 1;
            if done.arrivals.is_multiple_of(512) {
                progress.set(arrival.log_time.seconds_since(first));
            }
            if skipped.contains(arrival.sequence) {
                done.left_out += 1;
            } else {
                done.records += replay.step(&arrival)?;
            }
            replay.keep(arrival)?;
        }
    }
    done.missing = reader.info().missing;
    let known = done.missing.clone();
    let found = ahead.missing().into_iter();
    done.missing
        .extend(found.filter(|missing| !known.contains(missing)));
    let changed = if args.verify {
        reader.changed()?
    } else {
        Vec::new()
    };
    progress.finish();
    done.during_silence = replay.during_silence();
    let report = replay.finish()?;
    done.changed = !changed.is_empty();
    done.missing.extend(changed);
    let made_by = other_program(&original);
    tell(args, &done, report.as_ref(), made_by, begin.elapsed());
    Ok(match report {
        Some(report) if report.is_partial() && !done.changed => Outcome::DataLoss,
        Some(report) if !report.is_identical() || done.changed => Outcome::Failed,
        _ => Outcome::Good,
    })
}

/// The engine and what its records go to.
struct Replay {
    engine: Engine,
    records: Vec<Record>,
    writer: Option<(LogFile, Truth)>,
    verifier: Option<Verifier>,
    /// Computes what the verifier expects, where that is not what is written.
    earlier: Option<(Engine, Vec<Record>)>,
    /// Number of the next arrival, and log clock of the last one.
    next: (Option<u64>, LogTime),
}

impl Replay {
    fn new(
        reader: &Reader,
        config: &Config,
        original: &Session,
        args: &ReplayArgs,
        output: Option<&Target>,
    ) -> anyhow::Result<Self> {
        let session = engine::session::replayed(config, session::PROGRAM, original);
        let options = config.storage.options.clone();
        let writer = match output {
            Some(target) => {
                let writer = target.log(session.clone(), options.clone())?;
                let truth = reader.messages(Selection::topics(["/truth/*"]));
                Some((writer, truth.peekable()))
            }
            None => None,
        };
        let verifier = match args.verify {
            true => {
                let encoder = LogWriter::new(std::io::sink(), session, options, 0)?;
                Some(Verifier::new(reader, encoder))
            }
            false => None,
        };
        let engine = || match args.smooth || args.verify && holds_smoothed(reader) {
            true => Engine::smoothing(config),
            false => Engine::new(config),
        };
        let (engine, earlier) = match args.verify && original.silence_ns == 0 {
            true if writer.is_none() => (engine()?.through_silence(), None),
            true => (engine()?, Some((engine()?.through_silence(), Vec::new()))),
            false => (engine()?, None),
        };
        Ok(Self {
            engine,
            records: Vec::new(),
            writer,
            verifier,
            earlier,
            next: (None, LogTime(0)),
        })
    }

    /// Tells the verification where arrivals are missing that the estimator saw while recording.
    fn watch_sequence(&mut self, arrival: &Arrival, skipped: &Skipped) {
        let (next, time) = self.next;
        self.next = (Some(arrival.sequence.saturating_add(1)), arrival.log_time);
        if let (Some(first), Some(verifier)) = (next, &mut self.verifier) {
            let seen = |number: &u64| !skipped.contains(*number);
            if let Some(missing) = (first..arrival.sequence).find(seen) {
                verifier.arrivals_missing(missing, time);
            }
        }
    }

    /// Feeds the engine and hands its records on; says how many there were.
    fn step(&mut self, arrival: &Arrival) -> anyhow::Result<u64> {
        self.records.clear();
        self.engine.push(arrival, &mut self.records);
        if let Some(verifier) = &mut self.verifier {
            let expected = match &mut self.earlier {
                Some((engine, records)) => {
                    records.clear();
                    engine.push(arrival, records);
                    records
                }
                None => &self.records,
            };
            verifier.expect(expected, arrival.log_time)?;
        }
        Ok(self.records.len() as u64)
    }

    /// Writes the arrival and what followed from it.
    fn keep(&mut self, arrival: Arrival) -> anyhow::Result<()> {
        if let Some((log, truth)) = &mut self.writer {
            let writer = log.writer();
            copy_truth(writer, truth, arrival.log_time)?;
            writer.push(arrival)?;
            for record in &self.records {
                writer.record(record);
            }
        }
        self.records.clear();
        Ok(())
    }

    fn during_silence(&self) -> u64 {
        let earlier = self.earlier.as_ref().map(|(engine, _)| engine);
        earlier.unwrap_or(&self.engine).estimates_during_silence()
    }

    fn finish(mut self) -> anyhow::Result<Option<Report>> {
        const END: LogTime = LogTime(u64::MAX);
        self.engine.finish(&mut self.records);
        if let Some(verifier) = &mut self.verifier {
            let expected = match &mut self.earlier {
                Some((engine, records)) => {
                    records.clear();
                    engine.finish(records);
                    records
                }
                None => &self.records,
            };
            verifier.expect(expected, END)?;
        }
        if let Some((mut log, mut truth)) = self.writer {
            copy_truth(log.writer(), &mut truth, END)?;
            for record in &self.records {
                log.writer().record(record);
            }
            log.finish()?;
        }
        Ok(self.verifier.map(Verifier::finish).transpose()?)
    }
}

/// Whether the log is one of a replay that smoothed.
fn holds_smoothed(reader: &Reader) -> bool {
    let mut channels = reader.channels();
    channels.any(|channel| Stage::from_topic(&channel.topic) == Some(Stage::Smoothed))
}

/// What a simulation knows to be true, which no engine computes.
type Truth = Peekable<MessageIter>;

fn copy_truth(writer: &mut Writer, truth: &mut Truth, until: LogTime) -> anyhow::Result<()> {
    while let Some(message) = truth.next_if(|message| match message {
        Ok(message) => message.log_time <= until,
        Err(_) => true,
    }) {
        if let Some(record) = message?.record()? {
            writer.record(&record);
        }
    }
    Ok(())
}

/// Holds a replay back to a multiple of real time.
struct Pace {
    rate: f64,
    start: Option<(Instant, LogTime)>,
}

impl Pace {
    const fn new(rate: f64) -> Self {
        Self { rate, start: None }
    }

    fn wait(&mut self, log_time: LogTime) {
        let (start, first) = *self.start.get_or_insert((Instant::now(), log_time));
        let due_s = log_time.seconds_since(first) / self.rate;
        let ahead_s = due_s - start.elapsed().as_secs_f64();
        if ahead_s > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(ahead_s));
        }
    }
}

/// Which arrivals the estimator left out: told after the fact, so it must be known beforehand.
fn skipped(reader: &Reader) -> anyhow::Result<Skipped> {
    let mut skipped = Skipped::default();
    for arrival in reader.notices() {
        if let Payload::Notice(notice) = arrival?.payload {
            skipped.add(&notice);
        }
    }
    Ok(skipped)
}

fn log_seconds(reader: &Reader) -> f64 {
    reader
        .info()
        .span
        .map_or(0.0, |(first, last)| last.seconds_since(first))
}

/// Source numbers of the log must mean the same in the configuration.
fn check_sources(config: &Config, original: &Session) -> anyhow::Result<()> {
    let known = |id, name: &str| {
        config
            .sources
            .iter()
            .any(|source| source.spec.id == id && source.spec.name == name)
    };
    let other: Vec<&str> = original
        .sources
        .iter()
        .filter(|source| source.kind != store::SourceKind::Recorder)
        .filter(|source| !known(source.id, &source.name))
        .map(|source| source.name.as_str())
        .collect();
    if other.is_empty() {
        return Ok(());
    }
    Err(UsageError(format!(
        "the configuration does not have the log's sources {} in the same order; \
         name all sources of the log in it",
        other.join(", ")
    ))
    .into())
}

/// The new log, if one is wanted.
fn output(args: &ReplayArgs) -> anyhow::Result<Option<Target>> {
    let Some(path) = &args.output else {
        return Ok(None);
    };
    let changes = &args.changes;
    let files = [
        &args.config,
        &changes.vehicle,
        &changes.sensors,
        &changes.calibration,
    ];
    let inputs = args.logs.iter().chain(files.into_iter().flatten());
    let inputs = inputs.chain(&changes.overrides).map(|path| &**path);
    Target::new(path, Kind::Log, args.replace.force, inputs).map(Some)
}

/// The program that made the log, if it was not this one.
fn other_program(original: &Session) -> Option<String> {
    let hash = &original.git_hash;
    (hash != session::PROGRAM.git_hash).then(|| format!("{} ({hash})", original.version))
}

fn tell(
    args: &ReplayArgs,
    done: &Done,
    report: Option<&Report>,
    made_by: Option<String>,
    took: Duration,
) {
    let span_s = done
        .span
        .map_or(0.0, |(first, last)| last.seconds_since(first));
    let took_s = took.as_secs_f64();
    if args.json {
        let value = serde_json::json!({
            "arrivals": done.arrivals,
            "records": done.records,
            "left_out": done.left_out,
            "estimates_during_silence": done.during_silence,
            "log_s": span_s,
            "took_s": took_s,
            "missing": done.missing.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "verify": report.map(Report::as_json),
        });
        println!("{value:#}");
        return;
    }
    println!(
        "replayed {span_s:.1} s in {took_s:.2} s ({:.0} times real time): {} arrivals, {} records",
        span_s / took_s.max(1e-9),
        done.arrivals,
        done.records
    );
    if done.left_out > 0 {
        println!(
            "  {} arrivals that the estimator left out while recording are left out again",
            done.left_out
        );
    }
    if done.during_silence > 0 {
        println!(
            "  {} estimates during silence, which this version no longer gives",
            done.during_silence
        );
    }
    for line in missing::summary(&done.missing) {
        println!("  {line}");
    }
    if done.changed && report.is_some_and(Report::is_identical) {
        println!(
            "NOT VERIFIED: the estimates are identical, but other bytes of the log were changed"
        );
    } else if let Some(report) = report {
        print!("{report}");
        if let Some(made_by) = made_by.filter(|_| !report.is_identical()) {
            let made_by = printable(&made_by);
            println!(
                "  the log was made by atvrec {made_by}; another program may estimate otherwise"
            );
        }
    }
    if let Some(output) = &args.output {
        println!("  {}", output.display());
    }
}

#[cfg(test)]
mod tests;
