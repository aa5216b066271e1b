//! What goes into a log, and how arrivals that are made rather than recorded go through an engine.

use sample::{Arrival, LogTime, Payload, SourceId};
use store::Record;

use crate::{Config, Engine, Result};

/// One thing that goes into a log.
#[derive(Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "entries are handed on one by one and not stored"
)]
pub enum Entry {
    /// What a source delivered.
    Arrival(Arrival),
    /// What followed from it, or what is true in a simulation.
    Record(Record),
}

/// Numbers arrivals and lets an engine work on them.
pub struct Feed {
    engine: Engine,
    sequence: u64,
    records: Vec<Record>,
}

impl Feed {
    /// A feed of a new engine.
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

    /// How many arrivals there were.
    pub const fn arrivals(&self) -> u64 {
        self.sequence
    }

    /// Hands the next arrival to `sink`, and the records that follow from it.
    ///
    /// # Errors
    /// As `sink`.
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
