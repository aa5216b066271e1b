//! The estimate again, from the raw bytes of a log alone.

mod changes;

use std::iter::Peekable;

use sample::{Arrival, LogTime, Payload};
use store::{LogWriter, MessageIter, Missing, Reader, Record, Selection, Session, Stage};

use crate::feed::Entry;
use crate::read_ahead::ReadAhead;
use crate::session;
use crate::verify::{Verification, Verifier};
use crate::{Config, Engine, Error, Result, Skipped};

pub use changes::{Changes, FileSource};

/// How a log is replayed.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReplayOptions {
    /// Smooth too: estimates that also know what came after their instant.
    pub smooth: bool,
    /// Compare every message with what the log holds.
    pub verify: bool,
    /// Hand on what a simulation states as true, too.
    pub truth: bool,
}

/// What a replay did.
#[derive(Debug, Default)]
pub struct Replayed {
    /// Arrivals of the log.
    pub arrivals: u64,
    /// Records that followed from them.
    pub records: u64,
    /// Arrivals that the estimator left out while recording, and here again.
    pub left_out: u64,
    /// Estimates of the verified log that this version no longer gives.
    pub during_silence: u64,
    /// Times of the first and the last arrival.
    pub span: Option<(LogTime, LogTime)>,
    /// What the log turned out not to hold.
    pub missing: Vec<Missing>,
    /// Closed files are not what was written; only a verification looks for that.
    pub changed: bool,
    /// Result of the comparison, if one was asked for.
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
            "left_out": self.left_out,
            "estimates_during_silence": self.during_silence,
            "log_s": self.log_s(),
            "missing": missing,
            "verify": self.verification.as_ref().map(Verification::as_json),
        })
    }
}

/// A replay that is ready to begin.
pub struct Replay<'r> {
    reader: &'r Reader,
    session: Session,
    options: ReplayOptions,
    engine: Engine,
    verifier: Option<Verifier>,
    /// Computes what the verifier expects, where that is not what is handed on.
    earlier: Option<(Engine, Vec<Record>)>,
    records: Vec<Record>,
    /// Number of the next arrival, and log clock of the last one.
    next: (Option<u64>, LogTime),
}

impl<'r> Replay<'r> {
    /// Makes the engines for a replay of `reader` under `config`.
    ///
    /// # Errors
    /// If the configuration's sources are not the log's, no engine can be made of it, or the log is
    /// to be verified and lacks parts.
    pub fn new(reader: &'r Reader, config: &Config, options: ReplayOptions) -> Result<Self> {
        if let (true, Some(missing)) = (options.verify, reader.missing_parts().first()) {
            return Err(Error::PartsMissing(missing.clone()));
        }
        let original = reader.session();
        check_sources(config, original)?;
        let session = session::replayed(config, original);
        let verifier = match options.verify {
            true => {
                let how = config.storage.options.clone();
                let encoder = LogWriter::new(std::io::sink(), session.clone(), how, 0)?;
                Some(Verifier::new(reader, encoder))
            }
            false => None,
        };
        let engine = || match options.smooth || options.verify && holds_smoothed(reader) {
            true => Engine::smoothing(config),
            false => Engine::new(config),
        };
        let through_silence = options.verify && original.silence_ns == 0;
        Ok(Self {
            reader,
            session,
            options,
            engine: engine()?,
            verifier,
            earlier: match through_silence {
                true => Some((engine()?.through_silence(), Vec::new())),
                false => None,
            },
            records: Vec::new(),
            next: (None, LogTime(0)),
        })
    }

    /// What a log of the replay states about its run.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Replays to the end, and hands what belongs into a log of the replay to `sink`.
    ///
    /// # Errors
    /// If the log cannot be read; as `sink`.
    pub fn run<E: From<Error>>(
        mut self,
        mut sink: impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<Replayed, E> {
        let mut done = Replayed::default();
        let skipped = skipped(self.reader)?;
        let mut truth = self.options.truth.then(|| Truth::of(self.reader));
        let ahead = ReadAhead::start(self.reader.arrivals());
        while let Some(batch) = ahead.next() {
            for arrival in batch.map_err(Error::from)? {
                let time = arrival.log_time;
                let (first, _) = *done.span.get_or_insert((time, time));
                done.span = Some((first, time));
                done.arrivals += 1;
                self.watch_sequence(&arrival, &skipped);
                self.records.clear();
                if skipped.contains(arrival.sequence) {
                    done.left_out += 1;
                } else {
                    self.step(&arrival)?;
                    done.records += self.records.len() as u64;
                }
                if let Some(truth) = &mut truth {
                    truth.until(time, &mut sink)?;
                }
                sink(Entry::Arrival(arrival))?;
                self.hand_on(&mut sink)?;
            }
        }
        done.missing = self.missing(ahead);
        if self.options.verify {
            let changed = self.reader.changed().map_err(Error::from)?;
            done.changed = !changed.is_empty();
            done.missing.extend(changed);
        }
        done.during_silence = self.during_silence();
        self.finish_engines()?;
        if let Some(truth) = &mut truth {
            truth.until(END, &mut sink)?;
        }
        self.hand_on(&mut sink)?;
        done.verification = self.verifier.map(Verifier::finish).transpose()?;
        Ok(done)
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

    /// Lets the engines work on an arrival.
    fn step(&mut self, arrival: &Arrival) -> Result<()> {
        self.engine.push(arrival, &mut self.records);
        self.expect(arrival.log_time, |engine, records| {
            engine.push(arrival, records);
        })
    }

    fn finish_engines(&mut self) -> Result<()> {
        self.records.clear();
        self.engine.finish(&mut self.records);
        self.expect(END, Engine::finish)
    }

    /// Compares what the engine gave; an engine of earlier versions gives it by `work`.
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
                verifier.expect(records, now)
            }
            None => verifier.expect(&self.records, now),
        }
    }

    fn hand_on<E>(
        &mut self,
        sink: &mut impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let mut records = self.records.drain(..);
        records.try_for_each(|record| sink(Entry::Record(record)))
    }

    fn missing(&self, ahead: ReadAhead) -> Vec<Missing> {
        let known = self.reader.info().missing;
        let found = ahead.missing().into_iter();
        let new: Vec<Missing> = found.filter(|found| !known.contains(found)).collect();
        [known, new].concat()
    }

    fn during_silence(&self) -> u64 {
        let earlier = self.earlier.as_ref().map(|(engine, _)| engine);
        earlier.unwrap_or(&self.engine).estimates_during_silence()
    }
}

/// Behind every time of a log.
const END: LogTime = LogTime(u64::MAX);

/// Whether the log is one of a replay that smoothed.
fn holds_smoothed(reader: &Reader) -> bool {
    let mut channels = reader.channels();
    channels.any(|channel| Stage::from_topic(&channel.topic) == Some(Stage::Smoothed))
}

/// What a simulation knows to be true, which no engine computes.
struct Truth(Peekable<MessageIter>);

impl Truth {
    fn of(reader: &Reader) -> Self {
        Self(reader.messages(Selection::topics(["/truth/*"])).peekable())
    }

    fn until<E: From<Error>>(
        &mut self,
        until: LogTime,
        sink: &mut impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        while let Some(message) = self.0.next_if(|message| match message {
            Ok(message) => message.log_time <= until,
            Err(_) => true,
        }) {
            let record = message.and_then(|message| message.record());
            if let Some(record) = record.map_err(Error::from)? {
                sink(Entry::Record(record))?;
            }
        }
        Ok(())
    }
}

/// Which arrivals the estimator left out: the log states it after the fact, so it must be known
/// beforehand.
fn skipped(reader: &Reader) -> Result<Skipped> {
    let mut skipped = Skipped::default();
    for arrival in reader.notices() {
        if let Payload::Notice(notice) = arrival?.payload {
            skipped.add(&notice);
        }
    }
    Ok(skipped)
}

/// Source numbers of the log must mean the same in the configuration.
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
