//! Journals: the arrivals that a kill of the recorder would lose otherwise.
//!
//! Chunks of a second compress well and need few indexes, but a kill would lose that second.
//! Therefore arrivals are also written to a journal beside the log, every few tens of milliseconds.
//! Two files are used in turn, one for each chunk. A file is emptied only when the chunk with its
//! arrivals has reached the disk itself. Recovery appends the arrivals that are in the journals only
//! behind the last chunk.
//!
//! A third file contains the definitions of the log's channels. Until the log is closed, each
//! definition is in only one chunk of it. Without the copy, damage to that chunk would make the
//! messages of all later chunks unreadable.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use prost::Message as _;
use sample::{Arrival, LogTime, SourceId};

use crate::convert::Encoded;
use crate::file::{DAMAGED_SUFFIX, sync_directory};
use crate::proto::atvrec as pb;
use crate::{Error, Result, Session, raw, scan};

const SUFFIXES: [&str; 3] = [".journal-a", ".journal-b", ".journal-channels"];
/// Position of the file with the channels.
const CHANNELS: usize = 2;
/// First bytes of each entry; length and CRC-32 of the entry follow.
const ENTRY_MAGIC: [u8; 4] = *b"ATVJ";
const ENTRY_PREFIX: usize = 12;

/// Paths of the journals of the log whose final name is `path`.
pub(crate) fn paths(path: &Path) -> [PathBuf; 3] {
    SUFFIXES.map(|suffix| {
        let mut name = path.as_os_str().to_owned();
        name.push(suffix);
        name.into()
    })
}

/// The log that a journal of this name belongs to.
pub(crate) fn log_of(journal: &Path) -> Option<PathBuf> {
    let name = journal.to_str()?;
    SUFFIXES
        .iter()
        .find_map(|suffix| name.strip_suffix(suffix))
        .map(PathBuf::from)
}

/// Removes the journals of a log that is whole.
pub(crate) fn remove(path: &Path) -> Result<()> {
    for journal in paths(path) {
        match std::fs::remove_file(&journal) {
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::file("remove", &journal)(cause));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Renames the journals of a damaged log so that they stay with its original.
pub(crate) fn keep_damaged(path: &Path) -> Result<()> {
    for journal in paths(path).into_iter().filter(|path| path.is_file()) {
        let mut kept = journal.clone().into_os_string();
        kept.push(DAMAGED_SUFFIX);
        std::fs::rename(&journal, &kept).map_err(Error::file("rename", &journal))?;
    }
    Ok(())
}

/// Writes the arrivals of the open group to the journals.
pub(crate) struct Journal {
    files: [File; 3],
    paths: [PathBuf; 3],
    session: Session,
    interval: Duration,
    encoder: raw::Encoder,
    /// Number of arrivals of the open group that are in the journal.
    written: usize,
    /// Log clock of the last arrival in it.
    written_until: LogTime,
    /// Chunks written; the open group is in the file of this number's parity.
    chunks: u64,
}

impl Journal {
    pub(crate) fn create(path: &Path, session: Session, interval: Duration) -> Result<Self> {
        let paths = paths(path);
        let create = |path: &PathBuf| {
            OpenOptions::new()
                .write(true)
                .create(true)
                .truncate(true)
                .open(path)
                .map_err(Error::file("create", path))
        };
        let files = [create(&paths[0])?, create(&paths[1])?, create(&paths[2])?];
        sync_directory(path)?;
        Ok(Self {
            files,
            paths,
            session,
            interval,
            encoder: raw::Encoder::new(raw::Packing::Fast),
            written: 0,
            written_until: LogTime::default(),
            chunks: 0,
        })
    }

    /// Handles for syncing.
    pub(crate) fn handles(&self) -> Result<[File; 3]> {
        let again = |index: usize| {
            self.files[index]
                .try_clone()
                .map_err(Error::file("open again", &self.paths[index]))
        };
        Ok([again(0)?, again(1)?, again(2)?])
    }

    /// Whether arrivals of the open group are not in the journal yet.
    pub(crate) const fn is_behind(&self, group: &[Arrival]) -> bool {
        group.len() > self.written
    }

    /// Writes the new arrivals of the open group. If the last write is less than the interval ago, by
    /// the log clock and by the host's clock (`since`), nothing is written, and the result is the time
    /// to wait.
    pub(crate) fn append(
        &mut self,
        group: &[Arrival],
        since: Duration,
    ) -> Result<Option<Duration>> {
        let left = self.interval.saturating_sub(since);
        let gone = group
            .last()
            .map_or(0, |last| last.log_time - self.written_until);
        if !left.is_zero() && gone < self.interval.as_nanos() as i64 {
            return Ok(Some(left));
        }
        self.flush(group)?;
        Ok(None)
    }

    /// Writes the new arrivals of the open group.
    fn flush(&mut self, group: &[Arrival]) -> Result<()> {
        let waiting = group.get(self.written..).unwrap_or_default();
        let Some(last) = waiting.last() else {
            return Ok(());
        };
        let end = last.sequence.saturating_add(1);
        let batches = self
            .encoder
            .encode_group(&self.session, waiting, end, false)
            .into_iter()
            .map(|batch| pb::JournalBatch {
                topic: batch.topic.to_string(),
                schema: batch.schema.to_string(),
                source: batch.source.map(|source| source.0.into()),
                log_time_ns: batch.log_time.0,
                data: batch.data,
            })
            .collect();
        let channels = Vec::new();
        self.write(
            (self.chunks % 2) as usize,
            &pb::JournalEntry { batches, channels },
        )?;
        self.written = group.len();
        self.written_until = last.log_time;
        Ok(())
    }

    /// Adds the definitions of channels.
    pub(crate) fn define(&mut self, channels: Vec<pb::JournalChannel>) -> Result<()> {
        let batches = Vec::new();
        self.write(CHANNELS, &pb::JournalEntry { batches, channels })
    }

    fn write(&mut self, file: usize, entry: &pb::JournalEntry) -> Result<()> {
        let body = entry.encode_to_vec();
        let mut entry = Vec::with_capacity(body.len() + ENTRY_PREFIX);
        entry.extend(ENTRY_MAGIC);
        entry.extend((body.len() as u32).to_le_bytes());
        entry.extend(crc32fast::hash(&body).to_le_bytes());
        entry.extend(body);
        self.files[file]
            .write_all(&entry)
            .map_err(Error::file("write", &self.paths[file]))
    }

    /// Begins the next group: the chunk of the open group is written. `chunks` are written in all,
    /// `synced` of them have reached the disk.
    pub(crate) fn begin_group(&mut self, chunks: u64, synced: u64) -> Result<()> {
        self.written = 0;
        self.chunks = chunks;
        // The other file contains the group of the chunk before the last.
        if synced + 1 >= chunks {
            let turn = (chunks % 2) as usize;
            let file = &mut self.files[turn];
            file.set_len(0)
                .and_then(|()| file.seek(SeekFrom::Start(0)))
                .map_err(Error::file("empty", &self.paths[turn]))?;
        }
        Ok(())
    }
}

/// Contents of the journals of a log, as far as they are intact.
#[derive(Default)]
pub(crate) struct Contents {
    /// There is a journal, which may be empty.
    pub is_there: bool,
    /// Raw batches by the first sequence of their group, in that order.
    pub batches: Vec<(u64, Encoded)>,
    pub channels: Vec<Channel>,
}

/// A channel of the log, with name and data of its schema.
pub(crate) type Channel = (mcap::records::Channel, String, Arc<[u8]>);

/// Contents of the journals of the log `path`; empty without journals.
pub(crate) fn read(path: &Path) -> Result<Contents> {
    let mut journals = Vec::new();
    let mut is_there = false;
    for journal in paths(path) {
        // Opening a FIFO would wait for its writer.
        if !journal.is_file() {
            continue;
        }
        let mut bytes = Vec::new();
        let mut file = File::open(&journal)
            .map_err(Error::file("open", &journal))?
            .take(scan::max_chunk());
        file.read_to_end(&mut bytes)
            .map_err(Error::file("read", &journal))?;
        journals.push(bytes);
        is_there = true;
    }
    let mut contents = parse(journals.iter().map(Vec::as_slice));
    contents.is_there = is_there;
    Ok(contents)
}

/// The channels in the journals of the log `path`.
pub(crate) fn channels(path: &Path) -> Result<Vec<Channel>> {
    Ok(read(path)?.channels)
}

/// Contents of journals in memory, as [`read`] gives them.
pub(crate) fn parse<'a>(journals: impl Iterator<Item = &'a [u8]>) -> Contents {
    let mut contents = Contents::default();
    for bytes in journals {
        contents.is_there = true;
        read_entries(bytes, &mut contents);
    }
    contents.batches.sort_by_key(|(first, _)| *first);
    contents
}

fn read_entries(mut bytes: &[u8], contents: &mut Contents) {
    while let Some((entry, rest)) = split_entry(bytes) {
        bytes = rest;
        contents
            .channels
            .extend(entry.channels.into_iter().filter_map(channel));
        for batch in entry.batches {
            let Some(group) = raw::group(&batch.data) else {
                continue;
            };
            let source = batch.source.and_then(|id| u16::try_from(id).ok());
            let time = LogTime(batch.log_time_ns);
            let encoded = Encoded {
                topic: batch.topic.into(),
                schema: batch.schema.into(),
                source: source.map(SourceId),
                log_time: time,
                publish_time: time,
                data: batch.data,
            };
            contents.batches.push((group.first_sequence, encoded));
        }
    }
}

fn channel(channel: pb::JournalChannel) -> Option<Channel> {
    let record = mcap::records::Channel {
        id: channel.id.try_into().ok()?,
        schema_id: channel.schema_id.try_into().ok().filter(|id| *id != 0)?,
        topic: channel.topic,
        message_encoding: "protobuf".to_owned(),
        metadata: channel.metadata.into_iter().collect(),
    };
    Some((record, channel.schema, channel.schema_data.into()))
}

/// The first entry, if it is complete and its checksum is right.
fn split_entry(bytes: &[u8]) -> Option<(pb::JournalEntry, &[u8])> {
    let (prefix, rest) = bytes.split_first_chunk::<ENTRY_PREFIX>()?;
    let (magic, numbers) = prefix.split_first_chunk::<4>()?;
    let (length, checksum) = numbers.split_first_chunk::<4>()?;
    let length = u32::from_le_bytes(*length) as usize;
    let checksum = u32::from_le_bytes(checksum.try_into().ok()?);
    let (body, rest) = rest.split_at_checked(length)?;
    let sound = *magic == ENTRY_MAGIC && crc32fast::hash(body) == checksum;
    let entry = pb::JournalEntry::decode(body).ok()?;
    sound.then_some((entry, rest))
}
