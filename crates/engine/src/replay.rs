//! Replay: repeats the estimate from the raw data of a log.

mod changes;

use std::collections::BTreeMap;
use std::iter::Peekable;
use std::vec::IntoIter;

use estimator::{LatencyEstimate, MistakeReport};
use sample::{Arrival, LogTime, Payload};
use store::{LogWriter, Missing, Options, Reader, Record, Selection, Session, Stage};

use crate::config::{Meaning, Source};
use crate::feed::Entry;
use crate::read_ahead::ReadAhead;
use crate::session;
use crate::verify::{Verification, Verifier};
use crate::{Config, Engine, Error, LeftOut, Result, Skipped};

pub use changes::{Changes, FileSource};

/// Options of a replay.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReplayOptions {
    /// Compute smoothed estimates too, which also use the data after their time.
    pub smooth: bool,
    /// Compare every message with the message in the log.
    pub verify: bool,
    /// Pass the truth of a simulation to the sink too.
    pub truth: bool,
    /// Pass only arrivals to the sink: a verification then takes the records without a copy.
    pub without_records: bool,
}

/// Result of a replay.
#[derive(Debug, Default)]
pub struct Replayed {
    /// Arrivals of the log.
    pub arrivals: u64,
    /// Records that the engine computed from them.
    pub records: u64,
    /// Arrivals that the estimator skipped while recording, and in the replay.
    pub skipped: u64,
    /// Estimates during silence in the verified log, which this version does not compute any more.
    pub during_silence: u64,
    /// Times of the first and the last arrival.
    pub span: Option<(LogTime, LogTime)>,
    /// Losses and faults of the log.
    pub missing: Vec<Missing>,
    /// Whether closed files were changed later; only a verification checks this.
    pub changed: bool,
    /// What the run says of its configuration; `None` without a vehicle with linkages.
    pub mistakes: Option<MistakeReport>,
    /// What the run says of the latencies that the configuration does not know.
    pub latencies: Vec<LatencyEstimate>,
    /// Result of the verification, if it was requested.
    pub verification: Option<Verification>,
}

impl Replayed {
    /// Time from the first arrival to the last, s.
    pub fn log_s(&self) -> f64 {
        self.span
            .map_or(0.0, |(first, last)| last.seconds_since(first))
    }

    /// As JSON.
    pub fn to_json(&self) -> serde_json::Value {
        let missing: Vec<String> = self.missing.iter().map(ToString::to_string).collect();
        serde_json::json!({
            "arrivals": self.arrivals,
            "records": self.records,
            "left_out": self.skipped,
            "estimates_during_silence": self.during_silence,
            "log_s": self.log_s(),
            "missing": missing,
            "verify": self.verification.as_ref().map(Verification::as_json),
        })
    }
}

/// A replay that can start.
pub struct Replay<'r> {
    reader: &'r Reader,
    session: Session,
    log_options: Options,
    options: ReplayOptions,
    engine: Engine,
    verifier: Option<Verifier>,
    /// Engine of the verifier, if the log is of a version that estimated during silence.
    earlier: Option<(Engine, Vec<Record>)>,
    records: Vec<Record>,
    /// Sequence number of the next arrival, and log time of the last one.
    next: (Option<u64>, LogTime),
    /// Sequence number with which the run begins; `None` if an unfinished log does not state it.
    begin: Option<u64>,
}

impl<'r> Replay<'r> {
    /// Creates the engines for a replay of `reader` with `config`.
    ///
    /// # Errors
    /// If the configuration does not have the sources of the log, if the engine cannot be created, or
    /// if parts of a log to be verified are missing.
    pub fn new(reader: &'r Reader, config: &Config, options: ReplayOptions) -> Result<Self> {
        if let (true, Some(missing)) = (options.verify, reader.missing_parts().first()) {
            return Err(Error::PartsMissing(missing.clone()));
        }
        let original = reader.session();
        check_sources(config, original)?;
        let session = session::replayed(config, original);
        // A replay decodes all messages, and its log contains them.
        let log_options = Options {
            left_out: BTreeMap::new(),
            ..config.storage.options.clone()
        };
        let verifier = match options.verify {
            true => {
                let options = log_options.clone();
                let encoder = LogWriter::new(std::io::sink(), session.clone(), options, 0)?;
                let left_out = LeftOut::with(config.clone(), reader);
                let mut verifier = Verifier::new(reader, encoder, &left_out);
                if let Some(origin) = original.origin.clone().filter(|origin| origin.is_continued) {
                    verifier.continued(origin, has_table(config));
                }
                Some(verifier)
            }
            false => None,
        };
        let engine = || match options.smooth || options.verify && has_smoothed(reader) {
            true => Engine::smoothing(config),
            false => Engine::new(config),
        };
        let through_silence = options.verify && original.silence_ns == 0;
        Ok(Self {
            reader,
            session,
            log_options,
            options,
            engine: engine()?,
            verifier,
            earlier: match through_silence {
                true => Some((engine()?.through_silence(), Vec::new())),
                false => None,
            },
            records: Vec::new(),
            next: (None, LogTime(0)),
            begin: begin(reader),
        })
    }

    /// Session of a log of the replay.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Options of a log of the replay, which contains all decoded messages.
    pub const fn log_options(&self) -> &Options {
        &self.log_options
    }

    /// Replays to the end, and passes the entries of a log of the replay to `sink`.
    ///
    /// # Errors
    /// If the log cannot be read, and the errors of `sink`.
    pub fn run<E: From<Error>>(
        mut self,
        mut sink: impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<Replayed, E> {
        let mut done = Replayed::default();
        let skipped = skipped(self.reader, self.options.verify)?;
        let mut truth = self.options.truth.then(|| Truth::of(self.reader));
        let ahead = ReadAhead::start(self.reader.arrivals(), |arrivals| arrivals.missing());
        while let Some(batch) = ahead.next() {
            for arrival in batch.map_err(Error::from)? {
                let time = arrival.log_time;
                let (first, _) = *done.span.get_or_insert((time, time));
                done.span = Some((first, time));
                done.arrivals += 1;
                self.watch_sequence(&arrival, &skipped);
                self.records.clear();
                if skipped.contains(arrival.sequence) {
                    done.skipped += 1;
                } else {
                    done.records += self.step(&arrival)?;
                }
                if let Some(truth) = &mut truth {
                    truth.until(time, &mut sink)?;
                }
                sink(Entry::Arrival(arrival))?;
                self.pass_records(&mut sink)?;
            }
        }
        self.watch_end();
        done.missing = self.missing(ahead);
        if self.options.verify {
            let changed = self.reader.changed().map_err(Error::from)?;
            done.changed = !changed.is_empty();
            done.missing.extend(changed);
        }
        done.during_silence = self.during_silence();
        self.finish_engines()?;
        done.mistakes = self.engine.mistake_report();
        done.latencies = self.engine.latencies();
        if let Some(truth) = &mut truth {
            truth.until(END, &mut sink)?;
        }
        self.pass_records(&mut sink)?;
        done.verification = self.verifier.map(Verifier::finish).transpose()?;
        Ok(done)
    }

    /// Reports missing arrivals to the verifier, except those that the estimator skipped.
    fn watch_sequence(&mut self, arrival: &Arrival, skipped: &Skipped) {
        let (next, time) = self.next;
        self.next = (Some(arrival.sequence.saturating_add(1)), arrival.log_time);
        let Some(verifier) = &mut self.verifier else {
            return;
        };
        let seen = |number: &u64| !skipped.contains(*number);
        match (next, self.begin) {
            (Some(first), _) => {
                if let Some(missing) = (first..arrival.sequence).find(seen) {
                    verifier.arrivals_missing(missing, time);
                }
            }
            (None, Some(begin)) if (begin..arrival.sequence).any(|number| seen(&number)) => {
                verifier.beginning_missing(arrival.sequence);
            }
            (None, _) => {}
        }
    }

    /// Reports to the verifier if the log ends before the last arrival that its counters state, or has
    /// fewer messages than they state.
    fn watch_end(&mut self) {
        let info = self.reader.info();
        let counted = |name: &str| info.counters.get(name).copied();
        let messages: u64 = info.channels.values().map(|(_, count)| count).sum();
        let is_short = counted("messages").is_some_and(|counted| messages < counted);
        if let (Some(last), Some(next), Some(verifier)) =
            (counted("last_sequence"), self.next.0, &mut self.verifier)
            && (next <= last || is_short)
        {
            verifier.end_missing(last);
        }
    }

    /// Processes an arrival with the engines, and returns the number of records.
    fn step(&mut self, arrival: &Arrival) -> Result<u64> {
        self.engine.push(arrival, &mut self.records);
        let count = self.records.len() as u64;
        self.expect(arrival.log_time, |engine, records| {
            engine.push(arrival, records);
        })?;
        Ok(count)
    }

    fn finish_engines(&mut self) -> Result<()> {
        self.records.clear();
        self.engine.finish(&mut self.records);
        self.expect(END, Engine::finish)
    }

    /// Compares the records of the engine with the log. `work` computes them with the engine of an
    /// earlier version.
    fn expect(
        &mut self,
        now: LogTime,
        work: impl FnOnce(&mut Engine, &mut Vec<Record>),
    ) -> Result<()> {
        let Some(verifier) = &mut self.verifier else {
            return Ok(());
        };
        match &mut self.earlier {
            Some((engine, records)) => {
                records.clear();
                work(engine, records);
                verifier.expect(records.drain(..), now)
            }
            None if self.options.without_records => verifier.expect(self.records.drain(..), now),
            None => verifier.expect(self.records.iter().cloned(), now),
        }
    }

    fn pass_records<E>(
        &mut self,
        sink: &mut impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        if self.options.without_records {
            return Ok(());
        }
        let mut records = self.records.drain(..);
        records.try_for_each(|record| sink(Entry::Record(record)))
    }

    fn missing(&self, ahead: ReadAhead<Arrival, Vec<Missing>>) -> Vec<Missing> {
        let known = self.reader.info().missing;
        let found = ahead.finish().into_iter();
        let new: Vec<Missing> = found.filter(|found| !known.contains(found)).collect();
        [known, new].concat()
    }

    fn during_silence(&self) -> u64 {
        let earlier = self.earlier.as_ref().map(|(engine, _)| engine);
        earlier.unwrap_or(&self.engine).estimates_during_silence()
    }
}

/// Time after every time of a log.
const END: LogTime = LogTime(u64::MAX);

/// Sequence number with which the run begins.
fn begin(reader: &Reader) -> Option<u64> {
    let info = reader.info();
    let is_unfinished = |missing: &Missing| matches!(missing, Missing::Unfinished { .. });
    let default = (!info.missing.iter().any(is_unfinished)).then_some(0);
    info.counters.get("first_sequence").copied().or(default)
}

/// Whether the log contains smoothed estimates.
fn has_smoothed(reader: &Reader) -> bool {
    let mut channels = reader.channels();
    channels.any(|channel| Stage::from_topic(&channel.topic) == Some(Stage::Smoothed))
}

/// Truth messages of the log, which no engine computes.
struct Truth {
    ahead: ReadAhead<(LogTime, Record), ()>,
    batch: Peekable<IntoIter<(LogTime, Record)>>,
}

impl Truth {
    fn of(reader: &Reader) -> Self {
        let messages = reader.messages(Selection::topics(["/truth/*"]));
        let records = messages.filter_map(|message| {
            let message = match message {
                Ok(message) => message,
                Err(error) => return Some(Err(error)),
            };
            let record = message.record().transpose()?;
            Some(record.map(|record| (message.log_time, record)))
        });
        Self {
            ahead: ReadAhead::start(records, drop),
            batch: Vec::new().into_iter().peekable(),
        }
    }

    fn until<E: From<Error>>(
        &mut self,
        until: LogTime,
        sink: &mut impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        loop {
            while let Some((_, record)) = self.batch.next_if(|(time, _)| *time <= until) {
                sink(Entry::Record(record))?;
            }
            if self.batch.peek().is_some() {
                return Ok(());
            }
            let Some(batch) = self.ahead.next() else {
                return Ok(());
            };
            self.batch = batch.map_err(Error::from)?.into_iter().peekable();
        }
    }
}

/// Arrivals that the estimator skipped. The log reports them afterwards, so that they are read before
/// the replay. `at_end`: also those at the end of the recording, whose notice covers itself. Nothing that the
/// log contains depends on these.
pub(crate) fn skipped(reader: &Reader, at_end: bool) -> Result<Skipped> {
    let mut skipped = Skipped::default();
    for arrival in reader.notices() {
        let arrival = arrival?;
        if let Payload::Notice(notice) = &arrival.payload {
            let mut these = Skipped::default();
            these.add(notice);
            if at_end || !these.contains(arrival.sequence) {
                skipped.add(notice);
            }
        }
    }
    Ok(skipped)
}

/// Whether a source is a table of another program.
fn has_table(config: &Config) -> bool {
    let is_table = |source: &Source| matches!(source.meaning, Meaning::Csv(_) | Meaning::Alog(_));
    config.sources.iter().any(is_table)
}

/// Checks that the sources of the log have the same numbers in the configuration.
fn check_sources(config: &Config, original: &Session) -> Result<()> {
    let known = |id, name: &str| {
        let mut sources = config.sources.iter();
        sources.any(|source| source.spec.id == id && source.spec.name == name)
    };
    let other: Vec<String> = original
        .sources
        .iter()
        .filter(|source| source.kind != store::SourceKind::Recorder)
        .filter(|source| !known(source.id, &source.name))
        .map(|source| source.name.clone())
        .collect();
    if other.is_empty() {
        return Ok(());
    }
    Err(Error::OtherSources(other))
}

#[cfg(test)]
mod tests;
