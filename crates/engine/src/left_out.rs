//! Decoded CAN messages that a log does not contain: they are decoded from its raw frames.

use std::collections::BTreeMap;
use std::io::Sink;

use sample::{LogTime, Measurement, SourceId};
use store::{ChannelInfo, DynamicMessage, LogWriter, Options, Reader, Record, RowDecoder, Table};

use crate::replay::skipped;
use crate::{Config, Engine, Error, Result, session};

/// Topics of a log that its configuration leaves out (`record.decoded`). Reading them runs the decoders
/// from the beginning of the log on, so that times and values are those of a log that contains them.
#[derive(Clone, Debug, Default)]
pub struct LeftOut {
    config: Option<Config>,
    /// Source, name on the bus and message of each topic.
    topics: BTreeMap<String, (SourceId, String, DynamicMessage)>,
}

impl LeftOut {
    /// What the log leaves out by the configuration among its attachments. Nothing, if it has none that
    /// can be read.
    pub fn of(reader: &Reader) -> Self {
        let config = (reader.attachments().ok())
            .and_then(|attachments| Config::from_attachments(&attachments).ok());
        config.map_or_else(Self::default, |config| Self::with(config, reader))
    }

    /// What the log leaves out by `config`.
    pub(crate) fn with(config: Config, reader: &Reader) -> Self {
        let left_out = &config.storage.options.left_out;
        if left_out.is_empty() {
            return Self::default();
        }
        let in_log = reader.info().channels;
        let mut topics = BTreeMap::new();
        for source in &config.sources {
            let Some(names) = left_out.get(&source.spec.id) else {
                continue;
            };
            for (name, message) in session::dynamic_of(source) {
                if names.contains(name) && !in_log.contains_key(&message.topic) {
                    let place = (source.spec.id, name.to_owned(), message);
                    topics.insert(place.2.topic.clone(), place);
                }
            }
        }
        Self {
            // Decoding needs no estimator.
            config: Some(Config {
                estimator: None,
                ..config
            }),
            topics,
        }
    }

    /// Topics, sorted.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.topics.keys().map(String::as_str)
    }

    /// Whether this topic is left out.
    pub fn contains(&self, topic: &str) -> bool {
        self.topics.contains_key(topic)
    }

    /// The channel that a topic that is left out would have in the log.
    pub fn channel(&self, topic: &str) -> Option<ChannelInfo> {
        let (source, _, message) = self.topics.get(topic)?;
        Some(message.channel(*source))
    }

    /// As [`Reader::columns`], for topics that are in the log or left out.
    ///
    /// # Errors
    /// As [`Reader::columns`].
    pub fn columns(&self, reader: &Reader, topic: &str, span: [LogTime; 2]) -> Result<Table> {
        match self.topics.get(topic) {
            Some((source, _, message)) => Ok(RowDecoder::new(&message.channel(*source))?.take()),
            None => Ok(reader.columns(topic, span)?),
        }
    }

    /// As [`Reader::tables`], for topics that are in the log or left out.
    ///
    /// # Errors
    /// As [`LeftOut::each_batch`].
    pub fn tables(
        &self,
        reader: &Reader,
        topics: &[impl AsRef<str>],
        span: [LogTime; 2],
    ) -> Result<Vec<Table>> {
        let mut tables = vec![Table::default(); topics.len()];
        self.each_batch(reader, topics, span, usize::MAX, |position, table| {
            tables[position] = table;
            Ok::<(), Error>(())
        })?;
        Ok(tables)
    }

    /// As [`Reader::each_batch`], for topics that are in the log or left out.
    ///
    /// # Errors
    /// As [`Reader::each_batch`], and if the sources of the configuration cannot be decoded.
    pub fn each_batch<E: From<store::Error> + From<Error>>(
        &self,
        reader: &Reader,
        topics: &[impl AsRef<str>],
        span: [LogTime; 2],
        rows: usize,
        mut take: impl FnMut(usize, Table) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let all = topics.iter().map(AsRef::as_ref).enumerate();
        let (left_out, in_log): (Vec<_>, Vec<_>) = all.partition(|(_, topic)| self.contains(topic));
        if !in_log.is_empty() {
            let names: Vec<&str> = in_log.iter().map(|(_, topic)| *topic).collect();
            reader.each_batch(&names, span, rows, |position, table| {
                take(in_log[position].0, table)
            })?;
        }
        if left_out.is_empty() {
            return Ok(());
        }
        let mut decoder = Decoder::new(self, reader, &left_out)?;
        decoder.run(reader, span, rows, &mut take)
    }
}

/// A table that is being filled, and the position of its topic.
struct Open {
    position: usize,
    rows: RowDecoder,
}

/// Decodes messages that are left out.
struct Decoder {
    engine: Engine,
    encoder: LogWriter<Sink>,
    /// Tables by source and name of the message.
    open: BTreeMap<SourceId, BTreeMap<String, Open>>,
}

impl Decoder {
    fn new(left_out: &LeftOut, reader: &Reader, topics: &[(usize, &str)]) -> Result<Self> {
        let config = left_out.config.as_ref().ok_or(Error::NoConfiguration)?;
        let mut open: BTreeMap<SourceId, BTreeMap<String, Open>> = BTreeMap::new();
        for (position, topic) in topics {
            if let Some((source, name, message)) = left_out.topics.get(*topic) {
                let rows = RowDecoder::new(&message.channel(*source))?;
                let position = *position;
                let of_source = open.entry(*source).or_default();
                of_source.insert(name.clone(), Open { position, rows });
            }
        }
        let session = session::replayed(config, reader.session());
        let encoder = LogWriter::new(std::io::sink(), session, Options::default(), 0)?;
        Ok(Self {
            engine: Engine::new(config)?,
            encoder,
            open,
        })
    }

    fn run<E: From<store::Error> + From<Error>>(
        &mut self,
        reader: &Reader,
        [start, end]: [LogTime; 2],
        rows: usize,
        take: &mut impl FnMut(usize, Table) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let skipped = skipped(reader, false)?;
        let mut records = Vec::new();
        // The decoders need all arrivals from the beginning on.
        let mut arrivals = reader.arrivals_between(LogTime(0), end);
        for arrival in arrivals.by_ref() {
            let arrival = arrival?;
            if skipped.contains(arrival.sequence) {
                continue;
            }
            records.clear();
            self.engine.push(&arrival, &mut records);
            if arrival.log_time < start {
                continue;
            }
            for record in &records {
                if let Some(open) = self.push(record)?
                    && open.rows.rows() >= rows
                {
                    take(open.position, open.rows.take())?;
                }
            }
        }
        let missing = arrivals.missing();
        for open in self.open.values_mut().flat_map(BTreeMap::values_mut) {
            let mut table = open.rows.take();
            table.missing.extend(missing.iter().cloned());
            take(open.position, table)?;
        }
        Ok(())
    }

    /// Adds a message to its table, if there is one.
    fn push(&mut self, record: &Record) -> Result<Option<&mut Open>> {
        let Record::Sample(sample) = record else {
            return Ok(None);
        };
        let Measurement::Signals(frame) = &sample.measurement else {
            return Ok(None);
        };
        let of_source = self.open.get_mut(&sample.source);
        let Some(open) = of_source.and_then(|all| all.get_mut(&*frame.message)) else {
            return Ok(None);
        };
        for message in self.encoder.encode(record) {
            open.rows.push(&message)?;
        }
        Ok(Some(open))
    }
}
