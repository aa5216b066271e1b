//! Making logs whole that were cut short.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Record, op};
use mcap::write::{Metadata, NoSeek, WriteOptions};
use sample::SourceId;

use crate::convert::Encoded;
use crate::file::{ACTIVE_SUFFIX, active_path, lock, sync_directory};
use crate::reader::{Index, Missing};
use crate::scan::{self, Decompressor, Scanner, Step};
use crate::session::{COUNTERS_METADATA, RUN_METADATA};
use crate::{Error, Result, Session, WriteCounters, journal, log_writer, raw, schema};

/// Name of the metadata record that tells of a recovery.
pub(crate) const RECOVERED_METADATA: &str = "atvrec.recovered";

/// What a recovery did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// The whole log.
    pub path: PathBuf,
    /// It needed no more than its name.
    pub was_whole: bool,
    /// It had been cut before its first arrival, as just behind a rotation, and was removed.
    pub was_empty: bool,
    /// Messages saved.
    pub messages: u64,
    /// Those of them that were in a chunk which was cut.
    pub messages_of_cut_chunk: u64,
    /// Arrivals that stood in the journals only.
    pub arrivals_of_journal: u64,
    /// What could not be saved.
    pub missing: Vec<Missing>,
}

/// Makes every unfinished log of a directory whole; one result a log. Logs that another process is
/// writing are left alone. Journals of logs that are whole are removed.
///
/// # Errors
/// If the directory cannot be read.
pub fn recover_directory(directory: &Path) -> Result<Vec<(PathBuf, Result<Recovered>)>> {
    let read = || Error::file("read the directory", directory);
    let mut unfinished = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(read())? {
        let path = entry.map_err(read())?.path();
        if let Some(log) = journal::log_of(&path)
            && log.exists()
            && !active_path(&log).exists()
        {
            journal::remove(&log)?;
        }
        if path
            .as_os_str()
            .to_string_lossy()
            .ends_with(&format!(".mcap{ACTIVE_SUFFIX}"))
        {
            unfinished.push(path);
        }
    }
    unfinished.sort();
    let recovered = unfinished.into_iter().map(|path| {
        let result = recover(&path);
        (path, result)
    });
    Ok(recovered
        .filter(|(_, result)| !matches!(result, Err(Error::InUse(_))))
        .collect())
}

/// Makes a log whole in place: saves all intact chunks, and the intact messages of a chunk that is
/// cut, writes summary and indexes, and takes the place of the old file in one step. Nothing is in
/// the result that was not in the old file or its journals, except counters of what is saved and a
/// metadata record that tells of the recovery. An unfinished log without any arrival of its own is
/// removed.
///
/// # Errors
/// If the file cannot be read, is no MCAP file, is being written, or the result cannot be written;
/// the old file is then as it was.
pub fn recover(path: &Path) -> Result<Recovered> {
    let file = File::open(path).map_err(Error::file("open", path))?;
    lock(&file, path)?;
    let target = final_path(path);
    let index = Index::read(path)?;
    if index.missing.is_empty() {
        if target != path {
            std::fs::rename(path, &target).map_err(Error::file("give its final name to", path))?;
            sync_directory(&target)?;
        }
        journal::remove(&target)?;
        return Ok(Recovered {
            path: target,
            was_whole: true,
            was_empty: false,
            messages: index.counts.values().sum(),
            messages_of_cut_chunk: 0,
            arrivals_of_journal: 0,
            missing: Vec::new(),
        });
    }
    let temporary = with_suffix(&target, ".recovering");
    let result = rewrite(path, &temporary, &index, journal::read(&target)?);
    let saved = match result {
        Ok(saved) => saved,
        Err(error) => {
            let _ = std::fs::remove_file(&temporary);
            return Err(error);
        }
    };
    let was_empty = target != path && saved.is_empty();
    if was_empty {
        std::fs::remove_file(&temporary).map_err(Error::file("remove", &temporary))?;
    } else {
        std::fs::rename(&temporary, &target).map_err(Error::file("replace", &target))?;
    }
    if target != path {
        std::fs::remove_file(path).map_err(Error::file("remove", path))?;
    }
    sync_directory(&target)?;
    journal::remove(&target)?;
    Ok(Recovered {
        path: target,
        was_whole: false,
        was_empty,
        messages: saved.messages,
        messages_of_cut_chunk: saved.messages_of_cut_chunk,
        arrivals_of_journal: saved.arrivals_of_journal,
        missing: index.missing,
    })
}

/// Writes all that is intact in `input` and in the `journals` beside it as a finished log to
/// `output`: what [`recover`] does, without files. Gives the number of messages.
///
/// # Errors
/// If `input` does not begin like MCAP, or one of them fails.
pub fn salvage<R: Read + Seek, W: Write>(
    mut input: R,
    journals: &[&[u8]],
    output: W,
) -> Result<u64> {
    let index = Index::scan_through(&mut input)?;
    let (scanner, _) = Scanner::new(input).map_err(Error::Sink)?;
    let journal = journal::parse(journals.iter().copied());
    Ok(copy(scanner, output, &index, journal)?.messages)
}

fn final_path(path: &Path) -> PathBuf {
    let name = path.as_os_str().to_string_lossy();
    name.strip_suffix(ACTIVE_SUFFIX)
        .map_or_else(|| path.to_owned(), PathBuf::from)
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

fn rewrite(
    path: &Path,
    temporary: &Path,
    index: &Index,
    journal: Vec<(u64, Encoded)>,
) -> Result<Saved> {
    let output = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .open(temporary)
        .map_err(Error::file("create", temporary))?;
    let scanner = Scanner::open(path)?;
    let saved = copy(scanner, &output, index, journal).map_err(|error| error.at(temporary))?;
    output.sync_all().map_err(Error::file("sync", temporary))?;
    Ok(saved)
}

#[derive(Default)]
struct Saved {
    messages: u64,
    /// Those of them that repeat the states of the file before.
    messages_latched: u64,
    messages_of_cut_chunk: u64,
    arrivals_of_journal: u64,
    /// The file's own counters were there, which may tell of losses.
    counters: bool,
}

impl Saved {
    /// Nothing of the file's own.
    const fn is_empty(&self) -> bool {
        self.messages == self.messages_latched && !self.counters
    }
}

/// Writes all that is intact as a finished log.
fn copy<R: Read + Seek, W: Write>(
    mut scanner: Scanner<R>,
    output: W,
    index: &Index,
    journal: Vec<(u64, Encoded)>,
) -> Result<Saved> {
    let writer = WriteOptions::new()
        .profile("")
        .library("atvrec")
        .compression_threads(0)
        .disable_seeking(true)
        .create(NoSeek::new(BufWriter::with_capacity(1 << 16, output)))?;
    let mut copy = Copy {
        writer,
        decompressor: Decompressor::default(),
        journal,
        next_sequence: 0,
        in_cut_chunk: false,
        schema_names: BTreeMap::new(),
        raw_channels: BTreeMap::new(),
        counters: WriteCounters::default(),
        counters_before: BTreeMap::new(),
        saved: Saved::default(),
    };
    let outcome = copy.run(&mut scanner, index);
    let saved = copy.saved;
    let buffer = copy.writer.into_inner().into_inner();
    outcome?;
    buffer
        .into_inner()
        .map_err(|refused| Error::Sink(refused.into_error()))?;
    Ok(saved)
}

struct Copy<W: Write> {
    writer: mcap::Writer<NoSeek<BufWriter<W>>>,
    decompressor: Decompressor,
    /// Batches by the first sequence of their group.
    journal: Vec<(u64, Encoded)>,
    /// One past the last sequence of the whole chunks.
    next_sequence: u64,
    in_cut_chunk: bool,
    schema_names: BTreeMap<u16, String>,
    /// Channels of raw data: their schemas and sources.
    raw_channels: BTreeMap<u16, (String, SourceId)>,
    /// What is saved.
    counters: WriteCounters,
    /// The file's own counters, if it was cut behind them.
    counters_before: BTreeMap<String, String>,
    saved: Saved,
}

impl<W: Write> Copy<W> {
    fn run<R: Read + Seek>(&mut self, scanner: &mut Scanner<R>, index: &Index) -> Result<()> {
        loop {
            match scanner.step().map_err(Error::Sink)? {
                Step::End => break,
                Step::Cut { opcode, body, .. } => {
                    if opcode == op::CHUNK {
                        let before = self.saved.messages;
                        self.in_cut_chunk = true;
                        self.chunk(&body, true)?;
                        self.saved.messages_of_cut_chunk = self.saved.messages - before;
                    }
                    break;
                }
                Step::Record { opcode, body, .. } => match opcode {
                    op::DATA_END | op::FOOTER => break,
                    op::CHUNK => self.chunk(&body, false)?,
                    _ if !scan::is_known(opcode) => break,
                    _ => self.record(opcode, &body)?,
                },
            }
        }
        self.add_journal()?;
        self.write_counters(index)?;
        let mut metadata = BTreeMap::from([
            ("messages".to_owned(), self.saved.messages.to_string()),
            (
                "messages_of_cut_chunk".to_owned(),
                self.saved.messages_of_cut_chunk.to_string(),
            ),
            (
                "arrivals_of_journal".to_owned(),
                self.saved.arrivals_of_journal.to_string(),
            ),
            ("bytes_before".to_owned(), index.length.to_string()),
        ]);
        for (number, missing) in index.missing.iter().enumerate() {
            // Without the path: the same bytes recover to the same bytes, wherever they are.
            metadata.insert(format!("missing.{number}"), missing.without_path());
        }
        self.writer.write_metadata(&Metadata {
            name: RECOVERED_METADATA.to_owned(),
            metadata,
        })?;
        self.writer.finish()?;
        Ok(())
    }

    /// Counts of what is saved. What was lost on the way to the disk cannot be counted again: that
    /// is known only if the old counters are there.
    fn write_counters(&mut self, index: &Index) -> Result<()> {
        let run = index.metadata.get(RUN_METADATA);
        let session = run.map(Session::from_metadata).unwrap_or_default();
        let mut metadata = self.counters.to_metadata(&session);
        let before = std::mem::take(&mut self.counters_before).into_iter();
        metadata.extend(before.filter(|(name, _)| name.starts_with("lost")));
        Ok(self.writer.write_metadata(&Metadata {
            name: COUNTERS_METADATA.to_owned(),
            metadata,
        })?)
    }

    fn chunk(&mut self, body: &[u8], cut: bool) -> Result<()> {
        let Some(contents) = self.decompressor.chunk(body, cut) else {
            return Ok(());
        };
        let mut rest = contents.records.as_slice();
        while let Some((opcode, body, tail)) = scan::split_record(rest) {
            self.record(opcode, body)?;
            rest = tail;
        }
        // Chunks keep their bounds: what was written together is read together.
        Ok(self.writer.flush()?)
    }

    fn record(&mut self, opcode: u8, body: &[u8]) -> Result<()> {
        if opcode == op::MESSAGE {
            return self.message(body);
        }
        match scan::parse(opcode, body) {
            Some(Record::Schema { header, data }) if header.id != 0 => {
                self.schema_names.insert(header.id, header.name.clone());
                let added = self.writer.add_schema_with_id(
                    header.id,
                    &header.name,
                    &header.encoding,
                    &data,
                );
                ignore_conflict(added.map(drop))
            }
            Some(Record::Channel(channel)) => {
                if let Some(schema) = self.schema_names.get(&channel.schema_id)
                    && raw::SCHEMAS.contains(&schema.as_str())
                {
                    let source = channel.metadata.get("source");
                    let source = source.and_then(|id| id.parse().ok()).unwrap_or_default();
                    self.raw_channels
                        .insert(channel.id, (schema.clone(), SourceId(source)));
                }
                let added = self.writer.add_channel_with_id(
                    channel.id,
                    channel.schema_id,
                    &channel.topic,
                    &channel.message_encoding,
                    &channel.metadata,
                );
                ignore_conflict(added.map(drop))
            }
            Some(Record::Metadata(metadata)) if metadata.name == COUNTERS_METADATA => {
                self.counters_before = metadata.metadata;
                self.saved.counters = true;
                Ok(())
            }
            Some(Record::Metadata(metadata)) => Ok(self.writer.write_metadata(&metadata)?),
            Some(Record::Attachment { header, data, crc }) => {
                let sound = body
                    .len()
                    .checked_sub(4)
                    .is_some_and(|end| crc == 0 || crc32fast::hash(&body[..end]) == crc);
                if sound {
                    self.writer.attach(&mcap::Attachment {
                        log_time: header.log_time,
                        create_time: header.create_time,
                        name: header.name,
                        media_type: header.media_type,
                        data,
                    })?;
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Adds what stands in the journals only, one group after the other.
    fn add_journal(&mut self) -> Result<()> {
        let mut group_before = None;
        for (first, batch) in std::mem::take(&mut self.journal) {
            if first < self.next_sequence {
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
            let metadata = log_writer::channel_metadata(batch.source);
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
        let is_raw = self.raw_channels.contains_key(&header.channel_id);
        let group = is_raw.then(|| raw::group(data)).flatten();
        let latched = group.as_ref().is_some_and(|group| group.latched);
        if let Some(group) = group.filter(|group| !group.latched) {
            if !self.in_cut_chunk {
                self.next_sequence = self.next_sequence.max(group.end_sequence);
            } else if self
                .journal
                .iter()
                .any(|(first, _)| *first == group.first_sequence)
            {
                // The journals hold the whole of this group, the chunk perhaps a part of it.
                return Ok(());
            }
        }
        match self.writer.write_to_known_channel(&header, data) {
            Ok(()) => {
                self.saved.messages += 1;
                self.saved.messages_latched += u64::from(latched);
                match self.raw_channels.get(&header.channel_id) {
                    Some((schema, source)) => self.counters.count_batch(schema, *source, data),
                    None => self.counters.messages += 1,
                }
                Ok(())
            }
            // The chunk that introduced the channel is lost, so nobody can read the message.
            Err(mcap::McapError::UnknownChannel(..)) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

/// Definitions that contradict each other come from damage: the first one stands.
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
