mod handover;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::io::{BufWriter, Write};

use mcap::records::MessageHeader;
use mcap::write::{Metadata, NoSeek, WriteOptions};
use sample::{Arrival, LogTime, Sample, SourceId};

use crate::convert::{self, Encoded};
use crate::counters::WriteCounters;
use crate::dynamic::{self, DynamicMessage};
use crate::proto::atvrec as pb;
use crate::session::{COUNTERS_METADATA, RESERVED_TOPIC, RUN_METADATA, UTC_METADATA};
use crate::{Error, Losses, Options, Record, Result, Session, raw, schema};

pub(crate) use handover::{Latched, Pending};

/// Writes one log to a [`Write`]. It reads no clock: the same input gives the same bytes.
///
/// Arrivals are collected in groups. A group is closed, compressed and written when
/// [`Options::raw_interval`] has passed on the log clock. Decoded records are in separate chunks, which
/// are larger, so that indexes stay small.
pub struct LogWriter<W: Write> {
    mcap: mcap::Writer<NoSeek<BufWriter<W>>>,
    session: Session,
    options: Options,
    /// Channels by topic.
    channels: HashMap<String, Vec<Channel>>,
    encoder: raw::Encoder,
    group: Vec<Arrival>,
    decoded: Vec<Encoded>,
    decoded_bytes: usize,
    decoded_since: Option<LogTime>,
    latched: Latched,
    last_log_time: Option<LogTime>,
    groups: u64,
    /// Channels that are not in the journal yet.
    new_channels: Vec<pb::JournalChannel>,
    /// The last groups in the log, which may not have reached the disk; `None` if they are not kept.
    unsynced: Option<VecDeque<Vec<Arrival>>>,
    counters: WriteCounters,
}

struct Channel {
    id: u16,
    schema: String,
    source: Option<SourceId>,
    messages: u32,
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
        let sink = NoSeek::new(BufWriter::with_capacity(1 << 16, sink));
        let mut mcap = WriteOptions::new()
            .profile("")
            .library("atvrec")
            .compression_level(options.compression_level)
            .compression_threads(0)
            .chunk_size(None)
            .disable_seeking(true)
            .create(sink)?;
        mcap.write_metadata(&Metadata {
            name: RUN_METADATA.to_owned(),
            metadata: session.to_metadata(part),
        })?;
        for attachment in &session.attachments {
            mcap.attach(&mcap::Attachment {
                log_time: session.started.0,
                create_time: session.started.0,
                name: attachment.name.clone(),
                media_type: attachment.media_type.clone(),
                data: attachment.data.as_slice().into(),
            })?;
        }
        mcap.flush()?;
        let dynamic = session
            .dynamic
            .iter()
            .map(|message| (message.topic.clone(), message.clone()))
            .collect();
        Ok(Self {
            mcap,
            session,
            options,
            channels: HashMap::new(),
            encoder: raw::Encoder::new(raw::Packing::Compact),
            group: Vec::new(),
            decoded: Vec::new(),
            decoded_bytes: 0,
            decoded_since: None,
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

    /// Continues where another file of the run ended: repeats the last states.
    pub(crate) fn continue_from(&mut self, mut latched: Latched) -> Result<()> {
        let known = std::mem::take(&mut self.latched.dynamic);
        for (topic, message) in known {
            latched.dynamic.entry(topic).or_insert(message);
        }
        self.latched.dynamic = latched.dynamic.clone();
        let mut notices: Vec<Arrival> = latched.notices.values().cloned().collect();
        notices.sort_by_key(|arrival| arrival.sequence);
        let end = notices.last().map_or(0, |last| last.sequence + 1);
        let messages = self
            .encoder
            .encode_group(&self.session, &notices, end, true);
        for message in messages {
            self.write(&message)?;
        }
        for message in latched.messages.values() {
            self.write(message)?;
            self.counters.messages += 1;
        }
        self.latched = latched;
        Ok(self.mcap.flush()?)
    }

    /// Takes the data that a failed log could not take; nothing is written before the next flush.
    pub(crate) fn resume(&mut self, pending: Pending) {
        for message in pending.messages {
            self.keep(message);
        }
        for arrival in pending.arrivals {
            self.take(arrival);
        }
    }

    /// Abandons a failed log, without another byte to the sink.
    pub(crate) fn abandon(self) -> (Pending, Latched) {
        // Dropping the MCAP writer would write a summary behind the gap.
        drop(self.mcap.into_inner());
        let pending = Pending {
            arrivals: self.group,
            unsynced: self.unsynced.into_iter().flatten().flatten().collect(),
            messages: self.decoded,
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
        for message in self.encode(record) {
            self.keep(message);
        }
    }

    /// The messages that [`LogWriter::record`] makes of a record, without writing them: for
    /// comparison with those of a log.
    pub fn encode(&mut self, record: &Record) -> Vec<Encoded> {
        let dynamic = match record {
            Record::Sample(sample) => self.encode_dynamic(sample),
            _ => None,
        };
        let session = &self.session;
        let mut messages = convert::encode(record, &|id| session.source_name(id));
        messages.extend(dynamic);
        messages
    }

    fn keep(&mut self, message: Encoded) {
        self.latched.see_message(&message);
        self.decoded_since.get_or_insert(message.log_time);
        self.decoded_bytes += message.data.len() + 31;
        self.decoded.push(message);
    }

    fn encode_dynamic(&mut self, sample: &Sample) -> Option<Encoded> {
        let name = self.session.source_name(sample.source);
        let (message, grew) = dynamic::encode(&mut self.latched.dynamic, sample, &name)?;
        if grew {
            // The schema has new fields: the topic continues in a new channel.
            self.channels.remove(&message.topic);
        }
        Some(message)
    }

    /// Closes the group or the decoded chunk if they are older than they may be at `now`.
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

    /// Whether the decoded chunk is older or larger than it may be at `now`.
    pub(crate) fn decoded_is_due(&self, now: LogTime) -> bool {
        let limit = self.options.decoded_interval.as_nanos() as i64;
        self.decoded_since.is_some_and(|since| now - since >= limit)
            || self.decoded_bytes >= self.options.decoded_chunk_bytes
    }

    /// Whether decoded messages wait for the next flush.
    pub(crate) fn has_decoded(&self) -> bool {
        !self.decoded.is_empty()
    }

    /// Discards the decoded messages that wait for the next flush.
    pub(crate) fn drop_decoded(&mut self) {
        self.decoded.clear();
        self.decoded_bytes = 0;
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
        for message in &messages {
            self.write(message)?;
        }
        self.mcap.flush()?;
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
        if self.decoded.is_empty() {
            return Ok(());
        }
        let messages = std::mem::take(&mut self.decoded);
        let written = messages
            .iter()
            .try_for_each(|message| self.write(message))
            .and_then(|()| Ok(self.mcap.flush()?));
        if let Err(error) = written {
            self.decoded = messages;
            return Err(error);
        }
        self.counters.messages += messages.len() as u64;
        self.decoded_bytes = 0;
        self.decoded_since = None;
        Ok(())
    }

    fn write(&mut self, message: &Encoded) -> Result<()> {
        let is_own = |channel: &Channel| {
            channel.source == message.source && channel.schema == message.schema
        };
        let known = self.channels.get(&message.topic);
        if !known.is_some_and(|channels| channels.iter().any(is_own)) {
            let channel = Channel {
                id: self.add_channel(message)?,
                schema: message.schema.clone(),
                source: message.source,
                messages: 0,
            };
            let channels = self.channels.entry(message.topic.clone()).or_default();
            channels.push(channel);
        }
        let channels = self.channels.get_mut(&message.topic);
        let Some(channel) = channels.and_then(|all| all.iter_mut().find(|one| is_own(one))) else {
            return Ok(());
        };
        channel.messages = channel.messages.wrapping_add(1);
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.messages,
            log_time: message.log_time.0,
            publish_time: message.publish_time.0,
        };
        Ok(self.mcap.write_to_known_channel(&header, &message.data)?)
    }

    fn add_channel(&mut self, message: &Encoded) -> Result<u16> {
        let dynamic = self.latched.dynamic.get(&message.topic);
        let descriptors = dynamic.map_or_else(
            || schema::descriptor_set(&message.schema),
            DynamicMessage::descriptor_set,
        );
        let mut metadata = channel_metadata(message.source);
        metadata.extend(dynamic.map(DynamicMessage::metadata).unwrap_or_default());
        let schema = self
            .mcap
            .add_schema(&message.schema, "protobuf", &descriptors)?;
        let id = self
            .mcap
            .add_channel(schema, &message.topic, "protobuf", &metadata)?;
        if self.unsynced.is_some() {
            self.new_channels.push(pb::JournalChannel {
                id: id.into(),
                topic: message.topic.clone(),
                metadata: metadata.into_iter().collect(),
                schema_id: schema.into(),
                schema: message.schema.clone(),
                schema_data: descriptors,
            });
        }
        Ok(id)
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
            self.mcap.write_metadata(&Metadata {
                name: UTC_METADATA.to_owned(),
                metadata: offset.to_metadata(&self.session),
            })?;
        }
        let mut metadata = self.counters.to_metadata(&self.session);
        metadata.extend(extra.clone());
        self.mcap.write_metadata(&Metadata {
            name: COUNTERS_METADATA.to_owned(),
            metadata,
        })?;
        if let Err(error) = self.mcap.finish() {
            drop(self.mcap.into_inner());
            return Err(error.into());
        }
        let buffered = self.mcap.into_inner().into_inner();
        Ok(buffered
            .into_inner()
            .map_err(|refused| mcap::McapError::Io(refused.into_error()))?)
    }
}

/// Metadata of a channel.
pub(crate) fn channel_metadata(source: Option<SourceId>) -> BTreeMap<String, String> {
    source
        .map(|source| ("source".to_owned(), source.0.to_string()))
        .into_iter()
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use sample::Payload;

    use super::*;

    /// Accepts a number of bytes and no more, like a disk that fills up.
    #[derive(Clone)]
    struct SmallDisk {
        taken: Arc<Mutex<Vec<u8>>>,
        room: usize,
    }

    impl Write for SmallDisk {
        fn write(&mut self, data: &[u8]) -> std::io::Result<usize> {
            let mut taken = self.taken.lock().expect("one thread");
            let room = self.room - taken.len();
            if room == 0 {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            let count = room.min(data.len());
            taken.extend_from_slice(&data[..count]);
            Ok(count)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn arrival(sequence: u64) -> Arrival {
        let bytes = (0..40).map(|n| (sequence * 37 + n * n) as u8).collect();
        Arrival {
            sequence,
            source: SourceId(1),
            log_time: LogTime(sequence * 10_000_000),
            realtime_ns: sequence as i64,
            payload: Payload::Bytes(bytes),
        }
    }

    fn read(directory: &std::path::Path, name: &str, bytes: &[u8]) -> Vec<Arrival> {
        let path = directory.join(name);
        std::fs::write(&path, bytes).expect("written");
        crate::Reader::open([path])
            .expect("a log")
            .arrivals()
            .collect::<Result<_>>()
            .expect("readable")
    }

    /// For any free space: the first log and the data that is handed over contain everything.
    #[test]
    fn data_that_a_full_disk_rejects_is_handed_over() {
        let directory = tempfile::tempdir().expect("a directory");
        let written: Vec<Arrival> = (0..200).map(arrival).collect();
        for room in (600..6_000).step_by(97) {
            let disk = SmallDisk {
                taken: Arc::default(),
                room,
            };
            let session = Session::default();
            let options = Options {
                raw_interval: Duration::from_millis(80),
                ..Options::default()
            };
            let mut log = LogWriter::new(disk.clone(), session.clone(), options, 0)
                .expect("the first bytes fit");
            let fitted = written
                .iter()
                .position(|arrival| log.push(arrival.clone()).is_err())
                .expect("the disk fills up");
            let (pending, latched) = log.abandon();
            let first = read(
                directory.path(),
                "first",
                &disk.taken.lock().expect("one thread"),
            );
            let mut second = LogWriter::new(Vec::new(), session, Options::default(), 1)
                .expect("a vector takes all");
            second.resume(pending);
            second.continue_from(latched).expect("a vector takes all");
            let second = second.finish(&BTreeMap::new()).expect("a vector takes all");
            let second = read(directory.path(), "second", &second);
            let mut both = first.clone();
            both.extend(
                second
                    .into_iter()
                    .filter(|a| a.sequence >= first.len() as u64),
            );
            assert_eq!(both, written[..=fitted], "{room} bytes");
        }
    }

    /// Data in the log that a failed sync did not write is handed over, too.
    #[test]
    fn groups_are_handed_over_until_they_have_reached_the_disk() {
        let options = Options {
            raw_interval: Duration::from_millis(100),
            ..Options::default()
        };
        let abandoned = |synced: u64| -> Vec<u64> {
            let mut log = LogWriter::new(Vec::new(), Session::default(), options.clone(), 0)
                .expect("a vector takes all");
            log.keep_unsynced();
            for sequence in 0..35 {
                log.push(arrival(sequence)).expect("a vector takes all");
            }
            assert_eq!(log.groups(), 3);
            log.reached_disk(synced);
            let (pending, _) = log.abandon();
            let all = pending.unsynced.into_iter().chain(pending.arrivals);
            all.map(|arrival| arrival.sequence).collect()
        };
        for synced in 0..=3 {
            assert!(abandoned(synced).into_iter().eq(10 * synced..35));
        }
    }
}
