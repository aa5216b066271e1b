mod filling;
mod handover;

use std::collections::{BTreeMap, VecDeque};
use std::io::Write;

use sample::{Arrival, LogTime};

use crate::channels::Channels;
use crate::convert::Encoded;
use crate::counters::WriteCounters;
use crate::mcap_file::{Chunk, McapFile};
use crate::proto::atvrec as pb;
use crate::session::{COUNTERS_METADATA, RESERVED_TOPIC, RUN_METADATA, UTC_METADATA};
use crate::{Error, Losses, Options, Record, Result, Session, raw};

use filling::Filling;
pub(crate) use handover::{Latched, Pending};

/// zstd level of the decoded messages of sensors. A replay makes them again from the raw data, so that
/// a short time to write them is worth more than the last bytes.
const SENSORS_LEVEL: i32 = 1;

/// Writes one log to a [`Write`]. It reads no clock: the same input gives the same bytes.
///
/// Arrivals are collected in groups. A group is closed, compressed and written when
/// [`Options::raw_interval`] has passed on the log clock. Decoded records are in separate chunks, one
/// of sensors and one of estimates and truth, which are larger, so that indexes stay small.
pub struct LogWriter<W: Write> {
    mcap: McapFile<W>,
    session: Session,
    options: Options,
    channels: Channels,
    encoder: raw::Encoder,
    group: Vec<Arrival>,
    /// Decoded messages that wait for the next flush: those of sensors, and those of estimates and truth, so
    /// that a reader of one kind does not inflate the other.
    decoded: [Chunk; 2],
    decoded_since: Option<LogTime>,
    /// Why a decoded message could not get a channel; the next flush returns it.
    refused: Option<Error>,
    /// Buffer of the chunk that is being written.
    chunk: Chunk,
    latched: Latched,
    last_log_time: Option<LogTime>,
    groups: u64,
    /// Channels that are not in the journal yet.
    new_channels: Vec<pb::JournalChannel>,
    /// The last groups in the log, which may not have reached the disk; `None` if they are not kept.
    unsynced: Option<VecDeque<Vec<Arrival>>>,
    counters: WriteCounters,
}

impl<W: Write> LogWriter<W> {
    /// Begins a log: its part number within the run, session and attachments.
    ///
    /// # Errors
    /// If `sink` refuses the first bytes, or a message of the session has a reserved topic.
    pub fn new(sink: W, session: Session, options: Options, part: u32) -> Result<Self> {
        let mut dynamic = session.dynamic.iter();
        if dynamic.any(|message| message.topic == RESERVED_TOPIC) {
            return Err(Error::ReservedTopic(RESERVED_TOPIC));
        }
        let mut mcap = McapFile::create(sink, "atvrec", options.compression_level)?;
        mcap.write_metadata(RUN_METADATA, &session.to_metadata(part))?;
        for attachment in &session.attachments {
            mcap.attach(&mcap::Attachment {
                log_time: session.started.0,
                create_time: session.started.0,
                name: attachment.name.clone(),
                media_type: attachment.media_type.clone(),
                data: attachment.data.as_slice().into(),
            })?;
        }
        let dynamic = session
            .dynamic
            .iter()
            .map(|message| (message.topic.clone(), message.clone()))
            .collect();
        Ok(Self {
            mcap,
            session,
            options,
            channels: Channels::default(),
            encoder: raw::Encoder::new(raw::Packing::Compact),
            group: Vec::new(),
            decoded: [SENSORS_LEVEL, 0].map(Chunk::new),
            decoded_since: None,
            refused: None,
            chunk: Chunk::default(),
            latched: Latched {
                dynamic,
                ..Latched::default()
            },
            last_log_time: None,
            groups: 0,
            new_channels: Vec::new(),
            unsynced: None,
            counters: WriteCounters::default(),
        })
    }

    /// Continues where another file of the run ended: takes the data that it could not take, and repeats the
    /// last states.
    pub(crate) fn continue_from(&mut self, mut latched: Latched, pending: Pending) -> Result<()> {
        let known = std::mem::take(&mut self.latched.dynamic);
        for (topic, message) in known {
            latched.dynamic.entry(topic).or_insert(message);
        }
        self.latched.dynamic = latched.dynamic.clone();
        // Channels of the pending messages need the schemas.
        self.resume(pending);
        let mut notices: Vec<Arrival> = latched.notices.values().cloned().collect();
        notices.sort_by_key(|arrival| arrival.sequence);
        let end = notices.last().map_or(0, |last| last.sequence + 1);
        let messages = self
            .encoder
            .encode_group(&self.session, &notices, end, true);
        for message in &messages {
            self.write(message)?;
        }
        for message in latched.messages.values() {
            self.write(message)?;
            self.counters.messages += 1;
        }
        self.latched = latched;
        self.mcap.write_chunk(&mut self.chunk)?;
        Ok(())
    }

    /// Takes the data that a failed log could not take; nothing is written before the next flush.
    fn resume(&mut self, pending: Pending) {
        for message in &pending.messages {
            self.keep(message);
        }
        for arrival in pending.arrivals {
            self.take(arrival);
        }
    }

    /// Abandons a failed log, without another byte to the sink.
    pub(crate) fn abandon(self) -> (Pending, Latched) {
        let messages = self.decoded.iter().flat_map(Chunk::messages);
        let messages = messages.filter_map(|(header, data)| {
            let channel = self.channels.by_id(header.channel_id)?;
            Some(Encoded {
                topic: channel.topic.clone(),
                schema: channel.schema.clone(),
                source: channel.source,
                log_time: LogTime(header.log_time),
                publish_time: LogTime(header.publish_time),
                data: data.to_owned(),
            })
        });
        let messages = messages.collect();
        let pending = Pending {
            arrivals: self.group,
            unsynced: self.unsynced.into_iter().flatten().flatten().collect(),
            messages,
        };
        (pending, self.latched)
    }

    /// Arrivals in the log that may not have reached the disk.
    pub(crate) fn take_unsynced(&mut self) -> Vec<Arrival> {
        self.unsynced
            .take()
            .into_iter()
            .flatten()
            .flatten()
            .collect()
    }

    /// The arrivals that are not in the log yet.
    pub(crate) fn group(&self) -> &[Arrival] {
        &self.group
    }

    /// Keeps groups from now on, until [`LogWriter::reached_disk`] reports that they are on the disk.
    pub(crate) fn keep_unsynced(&mut self) {
        self.unsynced.get_or_insert_default();
    }

    /// The first `groups` groups have reached the disk.
    pub(crate) fn reached_disk(&mut self, groups: u64) {
        let waiting = usize::try_from(self.groups - groups).unwrap_or(usize::MAX);
        if let Some(unsynced) = &mut self.unsynced {
            let safe = unsynced.len().saturating_sub(waiting);
            unsynced.drain(..safe);
        }
    }

    /// Groups of raw data written so far.
    pub(crate) fn groups(&self) -> u64 {
        self.groups
    }

    pub(crate) fn last_log_time(&self) -> Option<LogTime> {
        self.last_log_time
    }

    pub(crate) fn latched(&self) -> &Latched {
        &self.latched
    }

    /// Takes the next arrival of the ordered stream, and closes the chunks that are due at its log time.
    ///
    /// # Errors
    /// If the sink refuses bytes; the arrivals of the open group are then not in the log.
    pub fn push(&mut self, arrival: Arrival) -> Result<()> {
        let flushed = self.flush_due(arrival.log_time);
        self.take(arrival);
        flushed
    }

    fn take(&mut self, arrival: Arrival) {
        self.counters.count(&arrival);
        self.latched.see_arrival(&arrival);
        self.last_log_time = Some(arrival.log_time);
        self.group.push(arrival);
    }

    /// Takes a decoded record. It is in the log after the next flush, unless [`Options::left_out`] names
    /// it.
    pub fn record(&mut self, record: &Record) {
        if self.options.leaves_out(record) {
            return;
        }
        let (session, latched) = (&self.session, &mut self.latched);
        let (mcap, decoded) = (&mut self.mcap, &mut self.decoded);
        let mut new = self.unsynced.is_some().then_some(&mut self.new_channels);
        let (since, refused) = (&mut self.decoded_since, &mut self.refused);
        let messages = &mut latched.messages;
        let name = |id| session.source_name(id);
        let dynamic = &mut latched.dynamic;
        self.channels
            .messages(record, &name, dynamic, &mut |channels, message, dynamic| {
                let channel = channels.get_mut(message.channel);
                if channel.is_latched {
                    let encoded = channel.encoded(&message);
                    messages.insert((encoded.topic.clone(), encoded.source), encoded);
                }
                since.get_or_insert(message.log_time);
                let mut chunk = Filling {
                    mcap,
                    new: new.as_deref_mut(),
                    chunk: &mut decoded[usize::from(channel.is_estimate)],
                };
                if let Err(error) = chunk.push(channels, &message, dynamic) {
                    *refused = Some(error.into());
                }
            });
    }

    /// The messages that [`LogWriter::record`] makes of a record, without writing them: for
    /// comparison with those of a log.
    pub fn encode(&mut self, record: &Record) -> Vec<Encoded> {
        let session = &self.session;
        let name = |id| session.source_name(id);
        let dynamic = &mut self.latched.dynamic;
        self.channels.encode(record, &name, dynamic)
    }

    /// Takes an encoded message of another log, whose schema is one of this program's. It is in the log after
    /// the next flush.
    pub fn message(&mut self, message: &Encoded) {
        self.keep(message);
    }

    fn keep(&mut self, message: &Encoded) {
        self.latched.see_message(message);
        self.decoded_since.get_or_insert(message.log_time);
        let new = self.unsynced.is_some().then_some(&mut self.new_channels);
        let channel = self.channels.of(message);
        let is_estimate = self.channels.get_mut(channel).is_estimate;
        let mut chunk = Filling {
            mcap: &mut self.mcap,
            new,
            chunk: &mut self.decoded[usize::from(is_estimate)],
        };
        let pushed = chunk.push_encoded(&mut self.channels, message, &self.latched.dynamic);
        if let Err(error) = pushed {
            self.refused = Some(error.into());
        }
    }

    /// Closes the group or the decoded chunks if they are older than they may be at `now`.
    ///
    /// # Errors
    /// If the sink refuses bytes.
    pub fn flush_due(&mut self, now: LogTime) -> Result<()> {
        let raw_since = self.group.first().map(|arrival| arrival.log_time);
        let limit = self.options.raw_interval.as_nanos() as i64;
        // Raw data first: a disk that fills up should lose decoded data.
        if raw_since.is_some_and(|since| now - since >= limit) {
            self.flush_raw()?;
        }
        if self.decoded_is_due(now) {
            self.flush_decoded()?;
        }
        Ok(())
    }

    /// Whether the decoded chunks are older or larger than they may be at `now`.
    pub(crate) fn decoded_is_due(&self, now: LogTime) -> bool {
        let limit = self.options.decoded_interval.as_nanos() as i64;
        self.decoded_since.is_some_and(|since| now - since >= limit)
            || self.decoded.iter().map(Chunk::bytes).sum::<usize>()
                >= self.options.decoded_chunk_bytes
    }

    /// Whether decoded messages wait for the next flush.
    pub(crate) fn has_decoded(&self) -> bool {
        self.decoded.iter().any(|chunk| chunk.bytes() > 0)
    }

    /// Discards the decoded messages that wait for the next flush.
    pub(crate) fn drop_decoded(&mut self) {
        self.decoded.iter_mut().for_each(Chunk::clear);
        self.decoded_since = None;
    }

    /// Writes everything to the sink.
    ///
    /// # Errors
    /// If the sink refuses bytes.
    pub fn flush(&mut self) -> Result<()> {
        self.flush_raw()?;
        self.flush_decoded()
    }

    pub(crate) fn flush_raw(&mut self) -> Result<()> {
        let Some(last) = self.group.last() else {
            return Ok(());
        };
        let end = last.sequence.saturating_add(1);
        let messages = self
            .encoder
            .encode_group(&self.session, &self.group, end, false);
        // After an error it contains the group already.
        self.chunk.clear();
        for message in &messages {
            self.write(message)?;
        }
        self.mcap.write_chunk(&mut self.chunk)?;
        // Kept until here, so that the next file can take the open group of a failed log.
        let group = std::mem::take(&mut self.group);
        self.groups += 1;
        if let Some(unsynced) = &mut self.unsynced {
            unsynced.push_back(group);
            // A disk that does not respond syncs nothing for a while; the memory is bounded.
            let mut kept: usize = unsynced.iter().map(Vec::len).sum();
            while kept > self.options.backlog_capacity {
                kept -= unsynced.pop_front().map_or(kept, |group| group.len());
            }
        }
        Ok(())
    }

    fn flush_decoded(&mut self) -> Result<()> {
        if let Some(error) = self.refused.take() {
            return Err(error);
        }
        for chunk in &mut self.decoded {
            self.counters.messages += self.mcap.write_chunk(chunk)?;
        }
        self.decoded_since = None;
        Ok(())
    }

    /// Adds a message to the chunk that is being written.
    fn write(&mut self, message: &Encoded) -> Result<()> {
        let new = self.unsynced.is_some().then_some(&mut self.new_channels);
        let mut chunk = Filling {
            mcap: &mut self.mcap,
            new,
            chunk: &mut self.chunk,
        };
        Ok(chunk.push_encoded(&mut self.channels, message, &self.latched.dynamic)?)
    }

    /// Channels that were added since the last call, of a log whose groups are kept.
    pub(crate) fn take_new_channels(&mut self) -> Vec<pb::JournalChannel> {
        std::mem::take(&mut self.new_channels)
    }

    /// States the losses on the way to this log; see [`WriteCounters::state_losses`].
    pub(crate) fn state_losses(&mut self, losses: &Losses) {
        self.counters.state_losses(losses);
    }

    /// Counts of the data in the log so far, with the open group.
    #[must_use]
    pub fn counters(&self) -> &WriteCounters {
        &self.counters
    }

    /// Closes the log with its counters, statistics and indexes, and returns the sink. `extra` is added to
    /// the counters and replaces those of the same name.
    ///
    /// # Errors
    /// If the sink refuses bytes.
    pub fn finish(mut self, extra: &BTreeMap<String, String>) -> Result<W> {
        self.flush()?;
        if let Some(offset) = self.latched.utc_offset() {
            let metadata = offset.to_metadata(&self.session);
            self.mcap.write_metadata(UTC_METADATA, &metadata)?;
        }
        let mut metadata = self.counters.to_metadata(&self.session);
        metadata.extend(extra.clone());
        self.mcap.write_metadata(COUNTERS_METADATA, &metadata)?;
        Ok(self.mcap.finish()?)
    }
}

#[cfg(test)]
mod tests;
