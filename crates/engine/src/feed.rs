//! Entries of a log, and the processing of arrivals that are generated instead of recorded.

use sample::{Arrival, LogTime, Payload, SourceId};
use store::Record;

use crate::{Config, Engine, Result};

/// Entry of a log.
#[derive(Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "entries are passed one by one and not stored"
)]
pub enum Entry {
    /// Data of a source.
    Arrival(Arrival),
    /// Record that the engine computed, or truth of a simulation.
    Record(Record),
}

/// Numbers arrivals and processes them with an engine.
pub struct Feed {
    engine: Engine,
    sequence: u64,
    records: Vec<Record>,
}

impl Feed {
    /// Feed of a new engine.
    ///
    /// # Errors
    /// As [`Engine::new`].
    pub fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            engine: Engine::new(config)?,
            sequence: 0,
            records: Vec::new(),
        })
    }

    /// Number of arrivals so far.
    pub const fn arrivals(&self) -> u64 {
        self.sequence
    }

    /// Passes the next arrival and its records to `sink`.
    ///
    /// # Errors
    /// The errors of `sink`.
    pub fn push<E>(
        &mut self,
        source: SourceId,
        time: LogTime,
        payload: Payload,
        sink: &mut impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let arrival = Arrival {
            sequence: self.sequence,
            source,
            log_time: time,
            realtime_ns: i64::try_from(time.0).unwrap_or(i64::MAX),
            payload,
        };
        self.sequence += 1;
        self.records.clear();
        self.engine.push(&arrival, &mut self.records);
        sink(Entry::Arrival(arrival))?;
        let mut records = self.records.drain(..);
        records.try_for_each(|record| sink(Entry::Record(record)))
    }
}
