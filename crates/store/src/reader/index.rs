//! Index of a file: from its summary, or by reading through the file.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use mcap::records::{AttachmentIndex, Channel, Record, op};
use sample::LogTime;

use super::definitions::Definitions;
use super::{ChannelInfo, Missing};
use crate::scan::{self, Cause, Damage, Ending, Item, Scanner, Walker};
use crate::{Attachment, Error, Result, file, journal};

/// Adjacent messages outside of chunks are one part, up to this number of bytes.
const LOOSE_PART: u64 = 1 << 20;
/// Largest number of losses of a file that are listed one by one.
const LISTED_MAX: usize = 1000;

/// Index of a file.
#[derive(Default)]
pub(crate) struct Index {
    pub length: u64,
    pub span: Option<(LogTime, LogTime)>,
    /// Chunks and stretches of loose messages, by their place in the file.
    pub parts: Vec<Part>,
    pub channels: BTreeMap<u16, Arc<ChannelInfo>>,
    pub counts: BTreeMap<u16, u64>,
    pub attachments: Vec<AttachmentIndex>,
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    pub missing: Vec<Missing>,
    pub definitions: Definitions,
    /// Profile and library, as the file's first record names them.
    pub header: Option<(String, String)>,
    /// How the file ends; `None` if only its summary was read.
    pub ending: Option<Ending>,
    /// Damage of the file, in numbers.
    pub lost: Lost,
    /// Records that seem intact, but are left out because no checksum covers them; with their bytes and
    /// the chunks among them.
    pub unconfirmed: u64,
    pub unconfirmed_bytes: u64,
    pub unconfirmed_chunks: u64,
    /// Such records are not left out: because of an option, or because the file around them confirms
    /// them.
    pub gives_unchecked: bool,
    /// The checksum of the data section is right.
    data_confirmed: bool,
    channel_sets: ChannelSets,
}

/// A chunk, or messages outside of chunks.
pub(crate) struct Part {
    pub offset: u64,
    /// One past its last byte.
    pub bytes_end: u64,
    pub start: LogTime,
    pub end: LogTime,
    /// Channels with messages in it; `None` if unknown.
    pub channels: Option<Arc<BTreeSet<u16>>>,
}

/// Sets of channels, each kept once: most chunks of a log have the same channels.
#[derive(Default)]
struct ChannelSets(BTreeSet<Arc<BTreeSet<u16>>>);

impl ChannelSets {
    fn shared(&mut self, channels: BTreeSet<u16>) -> Arc<BTreeSet<u16>> {
        if let Some(known) = self.0.get(&channels) {
            return Arc::clone(known);
        }
        let channels = Arc::new(channels);
        self.0.insert(Arc::clone(&channels));
        channels
    }
}

/// Damage of a file, in numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lost {
    pub stretches: u64,
    pub bytes: u64,
    pub chunks: u64,
    /// A record that inflates or claims to be larger than allowed, bytes.
    pub too_large: Option<u64>,
    /// Log times of the intact chunks around.
    pub span: Option<(LogTime, LogTime)>,
    /// No chunk was read since the last damage.
    open: bool,
}

impl Lost {
    fn widen(&mut self, start: LogTime, end: LogTime) {
        self.span = Some(
            self.span
                .map_or((start, end), |(a, b)| (a.min(start), b.max(end))),
        );
    }
}

/// How a file is read through.
#[derive(Clone, Debug)]
pub(crate) struct ScanOptions {
    /// Return data that no checksum confirms.
    pub unchecked: bool,
    /// Bound of a record's size, bytes.
    pub bound: u64,
    /// Stops the reading once it is set.
    pub stop: Option<Arc<AtomicBool>>,
}

impl Default for ScanOptions {
    fn default() -> Self {
        Self {
            unchecked: false,
            bound: scan::max_chunk(),
            stop: None,
        }
    }
}

impl Index {
    /// By the summary if there is one, else by reading through the file.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let mut scanner = Scanner::open(path)?;
        if let Some(index) = Self::from_summary(&mut scanner).map_err(Error::file("read", path))? {
            return Ok(index);
        }
        Self::scan(path, &ScanOptions::default())
    }

    /// The index of a closed file by its summary; `None` without an intact summary.
    pub(crate) fn of_closed(path: &Path) -> Result<Option<Self>> {
        Self::from_summary(&mut Scanner::open(path)?).map_err(Error::file("read", path))
    }

    fn from_summary(scanner: &mut Scanner<File>) -> std::io::Result<Option<Self>> {
        let bound = scan::max_chunk();
        if scanner.read_at(0, 8)? != scan::MAGIC {
            return Ok(None);
        }
        let Some((_, summary)) = scan::summary(scanner, bound)? else {
            return Ok(None);
        };
        let mut index = Self {
            length: scanner.length(),
            ..Self::default()
        };
        let mut statistics = None;
        let mut metadata = Vec::new();
        scan::for_each_record(&summary, |opcode, body| match scan::parse(opcode, body) {
            Some(Record::ChunkIndex(chunk)) => index.parts.push(Part {
                offset: chunk.chunk_start_offset,
                bytes_end: chunk.chunk_start_offset.saturating_add(chunk.chunk_length),
                start: LogTime(chunk.message_start_time),
                end: LogTime(chunk.message_end_time),
                channels: (!chunk.message_index_offsets.is_empty()).then(|| {
                    let channels = chunk.message_index_offsets.keys().copied().collect();
                    index.channel_sets.shared(channels)
                }),
            }),
            Some(Record::AttachmentIndex(attachment)) => index.attachments.push(attachment),
            Some(Record::MetadataIndex(record)) => metadata.push((record.offset, record.length)),
            Some(Record::Statistics(record)) => statistics = Some(record),
            Some(record) => index.definitions.add(&record, bound),
            None => {}
        });
        let Some(statistics) = statistics else {
            return Ok(None);
        };
        // A file without chunks, or from a writer that omits indexes, channels or schemas, is read
        // through.
        let definitions = &index.definitions;
        let defined = |id: &u16| definitions.channels.contains_key(id);
        let has_schema = |channel: &Channel| {
            channel.schema_id == 0 || definitions.schemas.contains_key(&channel.schema_id)
        };
        let counted: u64 = statistics.channel_message_counts.values().sum();
        if statistics.chunk_count as usize != index.parts.len()
            || statistics.attachment_count as usize != index.attachments.len()
            || statistics.metadata_count as usize != metadata.len()
            || (statistics.message_count > 0 && index.parts.is_empty())
            || !statistics.channel_message_counts.keys().all(defined)
            || counted != statistics.message_count
            || statistics.channel_count as usize > definitions.channels.len()
            || usize::from(statistics.schema_count) > definitions.schemas.len()
            || !definitions.channels.values().all(has_schema)
        {
            return Ok(None);
        }
        for (offset, length) in metadata {
            let record = scanner.read_at(offset, length.min(bound))?;
            if let Some((opcode, body, _)) = scan::split_record(&record)
                && let Some(Record::Metadata(metadata)) = scan::parse(opcode, body)
            {
                index.metadata.insert(metadata.name, metadata.metadata);
            }
        }
        index.counts = statistics.channel_message_counts;
        index.span = (statistics.message_count > 0).then_some((
            LogTime(statistics.message_start_time),
            LogTime(statistics.message_end_time),
        ));
        index.parts.sort_by_key(|part| part.offset);
        index.channels = index.definitions.infos(index.counts.keys());
        Ok(Some(index))
    }

    /// Reads through a file and compares all checksums. A file that is no MCAP file is an error
    /// unless an intact chunk is found in it.
    pub(crate) fn scan(path: &Path, options: &ScanOptions) -> Result<Self> {
        let mut scanner = Scanner::open(path)?;
        scanner.stop_at(options.stop.clone());
        let channels = journal::channels(&file::final_path(path))?;
        Self::scan_all(scanner, path, options, &channels)
    }

    /// The index of any stream of bytes, by reading through it.
    pub(crate) fn scan_all<R: Read + Seek>(
        mut scanner: Scanner<R>,
        path: &Path,
        options: &ScanOptions,
        journal: &[journal::Channel],
    ) -> Result<Self> {
        let failed = |cause: std::io::Error| {
            if scan::is_stop(&cause) {
                Error::Stopped(path.to_owned())
            } else {
                Error::file("read", path)(cause)
            }
        };
        let found = scanner.read_at(0, 8).map_err(failed)?;
        let (mut index, scanner) =
            Self::scan_once(scanner, path, options, journal).map_err(failed)?;
        if !scan::MAGIC.starts_with(&found) && index.parts.is_empty() {
            return Err(Error::NotMcap {
                path: path.to_owned(),
                found,
            });
        }
        // An intact closed file, and the checksum of a data section, confirm all records in them.
        let is_whole = index.ending == Some(Ending::Closed) && index.lost == Lost::default();
        if index.unconfirmed > 0 && (is_whole || index.data_confirmed) {
            let options = ScanOptions {
                unchecked: true,
                ..options.clone()
            };
            index = Self::scan_once(scanner, path, &options, journal)
                .map_err(failed)?
                .0;
        }
        Ok(index)
    }

    fn scan_once<R: Read + Seek>(
        mut scanner: Scanner<R>,
        path: &Path,
        options: &ScanOptions,
        journal: &[journal::Channel],
    ) -> std::io::Result<(Self, Scanner<R>)> {
        let mut index = Self {
            length: scanner.length(),
            gives_unchecked: options.unchecked,
            ..Self::default()
        };
        let summary = scan::summary(&mut scanner, options.bound)?;
        let mut walker = Walker::new(scanner, options.bound)?;
        while let Some(item) = walker.next()? {
            match item {
                Item::Chunk { offset, end, chunk } => {
                    if chunk.is_confirmed() || options.unchecked {
                        index.add_chunk(offset, end, &chunk.records, options.bound);
                    } else {
                        index.unconfirmed_chunks += 1;
                        index.leave_unconfirmed(path, offset, end - offset, "chunk");
                    }
                }
                Item::Record {
                    opcode,
                    offset,
                    body,
                } => index.add_record(path, opcode, offset, &body, options),
                Item::Damage(damage) => index.add_damage(path, damage),
            }
        }
        if let Ending::Cut {
            offset,
            chunk: Some(body),
            ..
        } = walker.ending()
            && options.unchecked
        {
            let records = scan::of_cut(body, options.bound);
            index.add_chunk(*offset, index.length, &records, options.bound);
        }
        // The definitions in chunks have priority; those of the summary and the journal fill gaps.
        if let Some((_, summary)) = summary {
            scan::for_each_record(&summary, |opcode, body| {
                if let Some(record) = scan::parse(opcode, body) {
                    index.definitions.add(&record, options.bound);
                }
            });
        }
        index.data_confirmed = walker.data_confirmed();
        index.definitions.add_journal(journal);
        index.channels = index.definitions.infos(index.counts.keys());
        index.finish(path, walker.ending());
        Ok((index, walker.into_scanner()))
    }

    fn finish(&mut self, path: &Path, ending: &Ending) {
        let path = path.to_owned();
        let hidden = self.lost.stretches.saturating_sub(LISTED_MAX as u64);
        if hidden > 0 {
            let what = format!("{hidden} further stretches");
            self.missing.push(Missing::Damaged {
                path: path.clone(),
                offset: 0,
                bytes: 0,
                what,
            });
        }
        match ending {
            Ending::Closed => {}
            Ending::Unfinished => self.missing.insert(0, Missing::Unfinished { path }),
            Ending::Cut { offset, .. } => {
                let offset = *offset;
                self.missing.push(Missing::Cut {
                    path: path.clone(),
                    offset,
                });
                self.missing.insert(0, Missing::Unfinished { path });
            }
        }
        self.ending = Some(ending.clone());
    }

    fn add_record(
        &mut self,
        path: &Path,
        opcode: u8,
        offset: u64,
        body: &[u8],
        options: &ScanOptions,
    ) {
        let bytes = scan::PREFIX + body.len() as u64;
        match opcode {
            op::MESSAGE if options.unchecked => {
                if let Some((header, _)) = scan::message(body) {
                    self.add_loose(offset, offset + bytes, &header);
                }
            }
            op::MESSAGE => {
                let what = "message outside of a chunk";
                self.leave_unconfirmed(path, offset, bytes, what);
            }
            op::ATTACHMENT => self.add_attachment(offset, body),
            0x80.. if !options.unchecked => {
                self.leave_unconfirmed(path, offset, bytes, "record of another program");
            }
            _ => match scan::parse(opcode, body) {
                Some(Record::Metadata(metadata))
                    if self.definitions.allow(body.len() as u64, options.bound) =>
                {
                    self.metadata.insert(metadata.name, metadata.metadata);
                }
                Some(Record::Header(header)) => {
                    self.header.get_or_insert((header.profile, header.library));
                }
                Some(record) => self.definitions.add(&record, options.bound),
                None => {}
            },
        }
    }

    fn leave_unconfirmed(&mut self, path: &Path, offset: u64, bytes: u64, what: &'static str) {
        self.unconfirmed += 1;
        self.unconfirmed_bytes += bytes;
        if self.unconfirmed <= LISTED_MAX as u64 {
            let path = path.to_owned();
            self.missing
                .push(Missing::Unconfirmed { path, offset, what });
        }
    }

    fn add_damage(&mut self, path: &Path, damage: Damage) {
        let lost = &mut self.lost;
        lost.stretches += 1;
        lost.bytes += damage.length;
        lost.chunks += damage.chunks;
        lost.open = true;
        if let Some(last) = self.parts.last() {
            lost.widen(last.end, last.end);
        }
        if let Cause::TooLarge(bytes) = damage.cause {
            lost.too_large.get_or_insert(bytes);
        }
        if lost.stretches <= LISTED_MAX as u64 {
            self.missing.push(match damage.cause {
                Cause::DataSection => Missing::Changed {
                    path: path.to_owned(),
                    text: "the checksum of the data section is wrong".to_owned(),
                },
                cause => Missing::Damaged {
                    path: path.to_owned(),
                    offset: damage.offset,
                    bytes: damage.length,
                    what: name_of(&cause),
                },
            });
        }
    }

    fn add_chunk(&mut self, offset: u64, bytes_end: u64, records: &[u8], bound: u64) {
        let mut span: Option<(u64, u64)> = None;
        let mut channels = BTreeSet::new();
        scan::for_each_record(records, |opcode, body| {
            if opcode != op::MESSAGE {
                if let Some(record) = scan::parse(opcode, body) {
                    self.definitions.add(&record, bound);
                }
                return;
            }
            if let Some((header, _)) = scan::message(body) {
                *self.counts.entry(header.channel_id).or_default() += 1;
                channels.insert(header.channel_id);
                let time = header.log_time;
                span = Some(span.map_or((time, time), |(a, b)| (a.min(time), b.max(time))));
            }
        });
        if let Some((start, end)) = span {
            let channels = self.channel_sets.shared(channels);
            self.add_part(Part {
                offset,
                bytes_end,
                start: LogTime(start),
                end: LogTime(end),
                channels: Some(channels),
            });
        }
    }

    fn add_loose(&mut self, offset: u64, end: u64, header: &mcap::records::MessageHeader) {
        *self.counts.entry(header.channel_id).or_default() += 1;
        let time = LogTime(header.log_time);
        if let Some(part) = self.parts.last_mut()
            && part.bytes_end == offset
            && end - part.offset <= LOOSE_PART
            && let Some(channels) = &mut part.channels
        {
            part.bytes_end = end;
            part.start = part.start.min(time);
            part.end = part.end.max(time);
            Arc::make_mut(channels).insert(header.channel_id);
            let span = self.span.unwrap_or((time, time));
            self.span = Some((span.0.min(time), span.1.max(time)));
            return;
        }
        self.add_part(Part {
            offset,
            bytes_end: end,
            start: time,
            end: time,
            channels: Some(Arc::new([header.channel_id].into())),
        });
    }

    fn add_part(&mut self, part: Part) {
        let (start, end) = (part.start, part.end);
        self.span = Some(
            self.span
                .map_or((start, end), |(a, b)| (a.min(start), b.max(end))),
        );
        if std::mem::take(&mut self.lost.open) {
            self.lost.widen(start, start);
        }
        self.parts.push(part);
    }

    fn add_attachment(&mut self, offset: u64, body: &[u8]) {
        if let Some(Record::Attachment { header, data, .. }) = scan::parse(op::ATTACHMENT, body) {
            self.attachments.push(AttachmentIndex {
                offset,
                length: body.len() as u64 + scan::PREFIX,
                log_time: header.log_time,
                create_time: header.create_time,
                data_size: data.len() as u64,
                name: header.name,
                media_type: header.media_type,
            });
        }
    }
}

fn name_of(cause: &Cause) -> String {
    match cause {
        Cause::Chunk => "chunk".to_owned(),
        Cause::ChunkHeader => "header of the chunk".to_owned(),
        Cause::Compression(name) => format!("chunk of unknown compression {name:?}"),
        Cause::TooLarge(bytes) => format!("record of {bytes} bytes, more than --max-chunk allows,"),
        Cause::Index => "index of messages".to_owned(),
        Cause::Record => "record".to_owned(),
        Cause::Magic => "beginning of the file".to_owned(),
        Cause::DataSection => "data section".to_owned(),
    }
}

/// Reads one attachment; `None` if it is damaged, or larger than the bound.
pub(crate) fn attachment(path: &Path, index: &AttachmentIndex) -> Result<Option<Attachment>> {
    if index.length > scan::max_chunk() {
        return Ok(None);
    }
    let mut scanner = Scanner::open(path)?;
    let record = scanner
        .read_at(index.offset, index.length)
        .map_err(Error::file("read", path))?;
    let found = scan::split_record(&record).and_then(|(opcode, body, _)| {
        let Some(Record::Attachment { header, data, .. }) = scan::parse(opcode, body) else {
            return None;
        };
        Some(Attachment {
            name: header.name,
            media_type: header.media_type,
            data: data.into_owned(),
        })
    });
    Ok(found)
}
