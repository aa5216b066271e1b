//! Writes the intact data of a log as a finished log.

use std::collections::BTreeMap;
use std::io::{BufWriter, Read, Seek, Write};

use mcap::records::{Channel, MessageHeader, Record, op};
use mcap::write::{Metadata, NoSeek, WriteOptions};
use sample::SourceId;

use super::{Loss, RECOVERED_METADATA};
use crate::channels::channel_metadata;
use crate::convert::Encoded;
use crate::reader::{Definitions, Index, ScanOptions, placeholder};
use crate::scan::{self, Ending, Item, Scanner, Walker};
use crate::session::{COUNTERS_METADATA, RUN_METADATA};
use crate::{Losses, Result, Session, WriteCounters, journal, raw, schema};

/// Largest number of losses that are listed in the log.
const NAMED_MAX: usize = 64;

#[derive(Default)]
pub(super) struct Saved {
    pub messages: u64,
    /// Those of them that repeat states of the file before.
    messages_latched: u64,
    pub messages_of_cut_chunk: u64,
    pub arrivals_of_journal: u64,
    pub loss: Option<Loss>,
    /// The file has its own counters, which may state losses.
    counters: bool,
}

impl Saved {
    /// There is no data of the file's own.
    pub const fn is_empty(&self) -> bool {
        self.messages == self.messages_latched && !self.counters
    }
}

/// Writes all that is intact as a finished log.
pub(super) fn copy<R: Read + Seek, W: Write>(
    scanner: Scanner<R>,
    output: W,
    index: &Index,
    journal: journal::Contents,
    options: &ScanOptions,
    is_active: bool,
) -> Result<Saved> {
    let (profile, library) = index
        .header
        .clone()
        .unwrap_or_else(|| (String::new(), "atvrec".to_owned()));
    let writer = WriteOptions::new()
        .profile(profile)
        .library(library)
        .compression_threads(0)
        .disable_seeking(true)
        .create(NoSeek::new(BufWriter::with_capacity(1 << 16, output)))?;
    let mut copy = Copy {
        writer,
        definitions: &index.definitions,
        is_active,
        journal_is_there: journal.is_there,
        journal: journal.batches,
        next_sequence: None,
        in_cut_chunk: false,
        raw_channels: BTreeMap::new(),
        counters: WriteCounters::default(),
        counters_before: BTreeMap::new(),
        saved: Saved::default(),
    };
    let outcome = copy.run(scanner, index, options);
    let saved = copy.saved;
    let buffer = copy.writer.into_inner().into_inner();
    outcome?;
    buffer
        .into_inner()
        .map_err(|refused| crate::Error::Sink(refused.into_error()))?;
    Ok(saved)
}

struct Copy<'a, W: Write> {
    writer: mcap::Writer<NoSeek<BufWriter<W>>>,
    /// Definitions of the whole file, because a message may be before its definition.
    definitions: &'a Definitions,
    /// The file has the name of an unfinished log.
    is_active: bool,
    journal_is_there: bool,
    /// Batches by the first sequence of their group.
    journal: Vec<(u64, Encoded)>,
    /// One past the last sequence of the whole chunks.
    next_sequence: Option<u64>,
    in_cut_chunk: bool,
    /// Channels of raw data: their schemas and sources.
    raw_channels: BTreeMap<u16, (String, SourceId)>,
    /// Counts of the saved data.
    counters: WriteCounters,
    /// The file's own counters, if it was cut behind them.
    counters_before: BTreeMap<String, String>,
    saved: Saved,
}

impl<W: Write> Copy<'_, W> {
    fn run<R: Read + Seek>(
        &mut self,
        scanner: Scanner<R>,
        index: &Index,
        options: &ScanOptions,
    ) -> Result<()> {
        let mut walker = Walker::new(scanner, options.bound).map_err(crate::Error::Sink)?;
        while let Some(item) = walker.next().map_err(crate::Error::Sink)? {
            match item {
                Item::Chunk { chunk, .. } if chunk.is_confirmed() || options.unchecked => {
                    self.chunk(&chunk.records)?;
                }
                Item::Record {
                    opcode: op::MESSAGE,
                    body,
                    ..
                } if options.unchecked => self.message(&body)?,
                Item::Record { opcode, body, .. } if opcode >= 0x80 && options.unchecked => {
                    self.writer
                        .write_private_record(opcode, &body, Default::default())?;
                }
                Item::Record { opcode, body, .. } if opcode < 0x80 && opcode != op::MESSAGE => {
                    self.record(opcode, &body)?;
                }
                _ => {}
            }
        }
        self.saved.loss = self.loss(index);
        if let Ending::Cut {
            chunk: Some(body), ..
        } = walker.ending()
            && options.unchecked
        {
            let before = self.saved.messages;
            self.in_cut_chunk = true;
            self.chunk(&scan::of_cut(body, options.bound))?;
            self.saved.messages_of_cut_chunk = self.saved.messages - before;
        }
        self.add_journal()?;
        self.write_counters(index)?;
        self.write_recovered(index, options)?;
        self.writer.finish()?;
        Ok(())
    }

    /// The lost data. A cut end of an unfinished file is no loss if the journals have the arrivals that
    /// follow its last chunk, because a replay computes the decoded records from them. It is also no loss
    /// if the recorder was killed while it wrote the records before the first chunk.
    fn loss(&self, index: &Index) -> Option<Loss> {
        let lost = &index.lost;
        let mut loss = Loss {
            bytes: lost.bytes + index.unconfirmed_bytes,
            chunks: lost.chunks + index.unconfirmed_chunks,
            span: lost.span,
        };
        let mut is_lost = lost.stretches > 0 || index.unconfirmed > 0;
        if let Some(Ending::Cut {
            offset,
            opcode,
            chunk,
            data: true,
        }) = &index.ending
            && !self.journal_continues()
            && !(self.is_active && index.parts.is_empty() && is_of_beginning(*opcode))
        {
            is_lost = true;
            loss.bytes += index.length - offset;
            loss.chunks += u64::from(chunk.is_some());
            let end = index.span.map(|span| span.1);
            loss.span = loss.span.or(end.map(|end| (end, end)));
        }
        is_lost.then_some(loss)
    }

    /// Whether the journals have the arrivals that follow the last chunk, without a gap.
    fn journal_continues(&self) -> bool {
        let Some(next) = self.next_sequence else {
            return self.journal_is_there;
        };
        let mut firsts = self.journal.iter().map(|(first, _)| *first);
        let follows = firsts.find(|first| *first >= next);
        self.journal_is_there && follows.is_none_or(|first| first == next)
    }

    fn write_recovered(&mut self, index: &Index, options: &ScanOptions) -> Result<()> {
        let saved = &self.saved;
        let mut metadata = BTreeMap::from([
            ("messages".to_owned(), saved.messages.to_string()),
            (
                "messages_of_cut_chunk".to_owned(),
                saved.messages_of_cut_chunk.to_string(),
            ),
            (
                "arrivals_of_journal".to_owned(),
                saved.arrivals_of_journal.to_string(),
            ),
            ("bytes_before".to_owned(), index.length.to_string()),
        ]);
        if let Some(loss) = &saved.loss {
            metadata.insert("lost_bytes".to_owned(), loss.bytes.to_string());
            metadata.insert("lost_chunks".to_owned(), loss.chunks.to_string());
            if let Some((from, to)) = loss.span {
                metadata.insert("lost_from_ns".to_owned(), from.0.to_string());
                metadata.insert("lost_to_ns".to_owned(), to.0.to_string());
            }
        }
        if options.unchecked {
            metadata.insert("unchecked".to_owned(), "true".to_owned());
        }
        for (number, missing) in index.missing.iter().enumerate().take(NAMED_MAX) {
            // Without the path, so that the result depends on the bytes alone.
            metadata.insert(format!("missing.{number}"), missing.without_path());
        }
        self.writer.write_metadata(&Metadata {
            name: RECOVERED_METADATA.to_owned(),
            metadata,
        })?;
        Ok(())
    }

    /// Writes the counts of the saved data. Losses on the way to the disk are known only if the file has
    /// its old counters.
    fn write_counters(&mut self, index: &Index) -> Result<()> {
        let run = index.metadata.get(RUN_METADATA);
        let session = run.map(Session::from_metadata).unwrap_or_default();
        // The next closed file of the run also states the losses in the notices.
        self.counters.state_losses(&Losses::default());
        let mut metadata = self.counters.to_metadata(&session);
        let before = std::mem::take(&mut self.counters_before).into_iter();
        metadata.extend(before.filter(|(name, _)| name.starts_with("lost")));
        Ok(self.writer.write_metadata(&Metadata {
            name: COUNTERS_METADATA.to_owned(),
            metadata,
        })?)
    }

    fn chunk(&mut self, records: &[u8]) -> Result<()> {
        let mut rest = records;
        while let Some((opcode, body, tail)) = scan::split_record(rest) {
            self.record(opcode, body)?;
            rest = tail;
        }
        // Chunks keep their bounds, so that data that was written together is read together.
        Ok(self.writer.flush()?)
    }

    fn record(&mut self, opcode: u8, body: &[u8]) -> Result<()> {
        if opcode == op::MESSAGE {
            return self.message(body);
        }
        match scan::parse(opcode, body) {
            Some(Record::Schema { header, .. }) => self.add_schema(header.id),
            Some(Record::Channel(channel)) => self.add_channel(channel.id),
            Some(Record::Metadata(metadata)) if metadata.name == COUNTERS_METADATA => {
                self.counters_before = metadata.metadata;
                self.saved.counters = true;
                Ok(())
            }
            Some(Record::Metadata(metadata)) => Ok(self.writer.write_metadata(&metadata)?),
            Some(Record::Attachment { header, data, .. }) => {
                Ok(self.writer.attach(&mcap::Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })?)
            }
            _ => Ok(()),
        }
    }

    fn add_schema(&mut self, id: u16) -> Result<()> {
        let Some(schema) = self.definitions.schemas.get(&id) else {
            return Ok(());
        };
        let added =
            self.writer
                .add_schema_with_id(id, &schema.name, &schema.encoding, &schema.data);
        ignore_conflict(added.map(drop))
    }

    /// Adds a channel by its definition anywhere in the file. Without a definition the topic says so,
    /// because the messages may be intact.
    fn add_channel(&mut self, id: u16) -> Result<()> {
        let channel = self.definitions.channels.get(&id).cloned();
        let channel = channel.unwrap_or_else(|| placeholder(id));
        self.add_schema(channel.schema_id)?;
        let schema = self.definitions.schemas.get(&channel.schema_id);
        if let Some(schema) = schema
            && raw::SCHEMAS.contains(&schema.name.as_str())
        {
            let source = channel.metadata.get("source");
            let source = source.and_then(|id| id.parse().ok()).unwrap_or_default();
            self.raw_channels
                .insert(id, (schema.name.clone(), SourceId(source)));
        }
        let Channel {
            topic,
            message_encoding,
            metadata,
            ..
        } = &channel;
        let schema_id = if schema.is_some() {
            channel.schema_id
        } else {
            0
        };
        let added =
            self.writer
                .add_channel_with_id(id, schema_id, topic, message_encoding, metadata);
        ignore_conflict(added.map(drop))
    }

    /// Adds the arrivals that are in the journals only, group by group.
    fn add_journal(&mut self) -> Result<()> {
        let mut group_before = None;
        for (first, batch) in std::mem::take(&mut self.journal) {
            if self.next_sequence.is_some_and(|next| first < next) {
                continue;
            }
            if group_before.is_some_and(|before| before != first) {
                self.writer.flush()?;
            }
            group_before = Some(first);
            let schema = self.writer.add_schema(
                &batch.schema,
                "protobuf",
                &schema::descriptor_set(&batch.schema),
            )?;
            let metadata = channel_metadata(batch.source);
            let channel = self
                .writer
                .add_channel(schema, &batch.topic, "protobuf", &metadata)?;
            let header = MessageHeader {
                channel_id: channel,
                sequence: 0,
                log_time: batch.log_time.0,
                publish_time: batch.publish_time.0,
            };
            self.writer.write_to_known_channel(&header, &batch.data)?;
            self.saved.messages += 1;
            let source = batch.source.unwrap_or(SourceId(0));
            self.counters
                .count_batch(&batch.schema, source, &batch.data);
            self.saved.arrivals_of_journal += raw::group(&batch.data).map_or(0, |g| g.arrivals);
        }
        Ok(self.writer.flush()?)
    }

    fn message(&mut self, body: &[u8]) -> Result<()> {
        let Some((header, data)) = scan::message(body) else {
            return Ok(());
        };
        match self.write_message(&header, data) {
            Err(crate::Error::Mcap(mcap::McapError::UnknownChannel(..))) => {
                self.add_channel(header.channel_id)?;
                self.write_message(&header, data)
            }
            written => written,
        }
    }

    fn write_message(&mut self, header: &MessageHeader, data: &[u8]) -> Result<()> {
        let is_raw = self.raw_channels.contains_key(&header.channel_id);
        let group = is_raw.then(|| raw::group(data)).flatten();
        let latched = group.as_ref().is_some_and(|group| group.latched);
        if let Some(group) = group.filter(|group| !group.latched) {
            if !self.in_cut_chunk {
                self.next_sequence = self.next_sequence.max(Some(group.end_sequence));
            } else if self
                .journal
                .iter()
                .any(|(first, _)| *first == group.first_sequence)
            {
                // The journals have the whole group, the chunk perhaps a part of it.
                return Ok(());
            }
        }
        self.writer.write_to_known_channel(header, data)?;
        self.saved.messages += 1;
        self.saved.messages_latched += u64::from(latched);
        match self.raw_channels.get(&header.channel_id) {
            Some((schema, source)) => self.counters.count_batch(schema, *source, data),
            None => self.counters.messages += 1,
        }
        Ok(())
    }
}

/// Whether the recorder writes this record before the first chunk of a log.
fn is_of_beginning(opcode: Option<u8>) -> bool {
    matches!(opcode, Some(op::HEADER | op::METADATA | op::ATTACHMENT))
}

/// Definitions that contradict each other are caused by damage: the first one is used.
fn ignore_conflict(result: mcap::McapResult<()>) -> Result<()> {
    match result {
        Err(
            mcap::McapError::ConflictingSchemas(_)
            | mcap::McapError::ConflictingChannels(_)
            | mcap::McapError::UnknownSchema(..),
        ) => Ok(()),
        other => Ok(other?),
    }
}
