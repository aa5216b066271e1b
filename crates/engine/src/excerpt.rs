//! A stretch of a log as a log of its own.

use std::iter::Peekable;

use sample::{Arrival, LogTime};
use store::{ArrivalIter, Encoded, MessageRef, Options, Origin, Reader, Selection, Session};

use crate::output::LogFile;
use crate::{Config, Entry, Error, Result, session};

/// Schemas of the raw data, which the arrivals contain.
const RAW: &str = "atvrec.Raw";
/// Schema of scenes for viewers, which no record is made of.
const SCENE: &str = "foxglove.SceneUpdate";
/// Beginnings of the names of the program's own schemas. The positions for viewers repeat records.
const OWN: [&str; 2] = ["atvrec.", "foxglove."];

/// A stretch of a log: its raw data and its decoded and estimated messages as they are, with the
/// configuration, and a mark in the metadata of where the stretch is from.
///
/// The estimates depend on the data before the stretch: a replay of the stretch cannot repeat them.
/// `replay --verify` reads the mark and says so.
pub struct Excerpt<'r> {
    reader: &'r Reader,
    from: LogTime,
    to: LogTime,
    session: Session,
    options: Options,
}

/// What was copied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Copied {
    /// Arrivals.
    pub arrivals: u64,
    /// Decoded and estimated messages.
    pub records: u64,
    /// Messages of other programs, which are left out.
    pub foreign: u64,
}

impl<'r> Excerpt<'r> {
    /// The stretch of `reader` from `from` to `to`, both included.
    ///
    /// # Errors
    /// If the log has no data in this time, or cannot be read.
    pub fn new(reader: &'r Reader, from: LogTime, to: LogTime) -> Result<Self> {
        let (first, last) = reader.info().span.unwrap_or_default();
        let (from, to) = (from.max(first), to.min(last));
        let empty = || Error::EmptyStretch {
            from_s: from.seconds_since(first),
            to_s: to.seconds_since(first),
            log_s: last.seconds_since(first),
        };
        let selection = Selection::default().between(from, to);
        if from > to || reader.messages(selection).next_ref().is_none() {
            return Err(empty());
        }
        let attachments = reader.attachments()?;
        let original = reader.session();
        let config = Config::from_attachments(&attachments).ok();
        let known = config
            .as_ref()
            .map(|config| session::replayed(config, original));
        let info = reader.info();
        let is_part = !reader.missing_parts().is_empty();
        let earlier = original.origin.as_ref();
        let origin = Origin {
            run_id: original.run_id.clone(),
            from,
            to,
            is_continued: from > first || is_part || earlier.is_some_and(|one| one.is_continued),
            counters: info.counters,
        };
        Ok(Self {
            reader,
            from,
            to,
            session: Session {
                run_id: format!("{}-from-{}", original.run_id, from.0),
                dynamic: known.map(|known| known.dynamic).unwrap_or_default(),
                attachments,
                origin: Some(origin),
                ..original.clone()
            },
            options: Options {
                left_out: std::collections::BTreeMap::new(),
                ..config
                    .map(|config| config.storage.options)
                    .unwrap_or_default()
            },
        })
    }

    /// The whole log: its parts as one.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn whole(reader: &'r Reader) -> Result<Self> {
        let mut whole = Self::new(reader, LogTime(0), LogTime(u64::MAX))?;
        let own = whole.session.origin.take();
        whole.session.origin = match own.filter(|origin| origin.is_continued) {
            Some(own) => Some(own),
            None => reader.session().origin.clone(),
        };
        whole.session.run_id = format!("{}-whole", reader.session().run_id);
        Ok(whole)
    }

    /// Session of a log of the stretch.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Options of a log of the stretch.
    pub const fn log_options(&self) -> &Options {
        &self.options
    }

    /// Copies the stretch to `log`, by log time. `progress` is called with times of the stretch, and can end
    /// the work with an error.
    ///
    /// # Errors
    /// If a log cannot be read or written, and the errors of `progress`.
    pub fn copy_to<E: From<Error>>(
        self,
        log: &mut LogFile,
        mut progress: impl FnMut(LogTime) -> std::result::Result<(), E>,
    ) -> std::result::Result<Copied, E> {
        let mut copied = Copied::default();
        let mut arrivals = self.reader.arrivals_between(self.from, self.to).peekable();
        let channels = self.reader.info().channels.into_iter();
        let decoded = channels.filter(|(_, (schema, _))| !schema.starts_with(RAW));
        let selection = Selection::topics(decoded.map(|(topic, _)| topic));
        let mut messages = self.reader.messages(selection.between(self.from, self.to));
        while let Some(message) = messages.next_ref() {
            let message = message.map_err(Error::from)?;
            progress(message.log_time)?;
            while let Some(arrival) = until(&mut arrivals, message.log_time) {
                copied.arrival(arrival.map_err(Error::from)?, log)?;
            }
            copied.message(&message, log)?;
        }
        for arrival in arrivals {
            let arrival = arrival.map_err(Error::from)?;
            progress(arrival.log_time)?;
            copied.arrival(arrival, log)?;
        }
        Ok(copied)
    }
}

impl Copied {
    fn arrival(&mut self, arrival: Arrival, log: &mut LogFile) -> Result<()> {
        self.arrivals += 1;
        log.push(Entry::Arrival(arrival))
    }

    /// Copies a message. Positions for viewers come from the records of the same messages.
    fn message(&mut self, message: &MessageRef<'_>, log: &mut LogFile) -> Result<()> {
        let schema = message.channel.schema.as_str();
        if let Some(record) = message.record()? {
            self.records += 1;
            log.push(Entry::Record(record))
        } else if schema == SCENE {
            self.records += 1;
            log.push_message(Encoded {
                topic: message.channel.topic.as_str().into(),
                schema: schema.into(),
                source: message.channel.source,
                log_time: message.log_time,
                publish_time: message.publish_time,
                data: message.data.to_vec(),
            })
        } else {
            let is_own = OWN.iter().any(|own| schema.starts_with(own));
            self.foreign += u64::from(!is_own);
            Ok(())
        }
    }
}

/// The next arrival at or before a time. An error comes at once.
fn until(arrivals: &mut Peekable<ArrivalIter>, time: LogTime) -> Option<store::Result<Arrival>> {
    arrivals.next_if(|next| {
        next.as_ref()
            .map_or(true, |arrival| arrival.log_time <= time)
    })
}
