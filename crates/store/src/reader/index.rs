//! What a file holds and where: from its summary, or else by reading through it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

use mcap::records::{AttachmentIndex, Record, op};
use sample::{LogTime, SourceId};

use super::{ChannelInfo, Missing};
use crate::scan::{self, Decompressor, Scanner, Step};
use crate::{Attachment, Error, Result};

/// Opcode, length, two offsets, checksum; then the magic.
const FOOTER_LENGTH: u64 = 9 + 20 + 8;

/// What a file holds and where.
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
    schemas: BTreeMap<u16, (String, Arc<[u8]>)>,
}

/// A chunk, or a message outside of chunks.
pub(crate) struct Part {
    pub offset: u64,
    pub start: LogTime,
    pub end: LogTime,
    /// Channels with messages in it; `None` if unknown.
    pub channels: Option<BTreeSet<u16>>,
}

impl Index {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let mut scanner = Scanner::open(path)?;
        if let Some(index) = Self::from_summary(&mut scanner).map_err(Error::file("read", path))? {
            return Ok(index);
        }
        Self::from_scan(path)
    }

    fn from_summary(scanner: &mut Scanner<File>) -> std::io::Result<Option<Self>> {
        let length = scanner.length();
        let Some(footer_start) = length.checked_sub(FOOTER_LENGTH) else {
            return Ok(None);
        };
        let tail = scanner.read_at(footer_start, FOOTER_LENGTH)?;
        let footer = tail
            .ends_with(scan::MAGIC)
            .then(|| scan::split_record(&tail))
            .flatten()
            .and_then(|(opcode, body, _)| scan::parse(opcode, body));
        let Some(Record::Footer(footer)) = footer else {
            return Ok(None);
        };
        if footer.summary_start == 0 || footer.summary_start > footer_start {
            return Ok(None);
        }
        let mut summary =
            scanner.read_at(footer.summary_start, footer_start - footer.summary_start)?;
        // The checksum covers the summary and the footer up to itself.
        summary.extend_from_slice(&tail[..9 + 16]);
        if footer.summary_crc != 0 && crc32fast::hash(&summary) != footer.summary_crc {
            return Ok(None);
        }
        summary.truncate((footer_start - footer.summary_start) as usize);
        let mut index = Self {
            length,
            ..Self::default()
        };
        let mut statistics = None;
        let mut metadata = Vec::new();
        scan::for_each_record(&summary, |opcode, body| match scan::parse(opcode, body) {
            Some(Record::ChunkIndex(chunk)) => index.parts.push(Part {
                offset: chunk.chunk_start_offset,
                start: LogTime(chunk.message_start_time),
                end: LogTime(chunk.message_end_time),
                channels: (!chunk.message_index_offsets.is_empty())
                    .then(|| chunk.message_index_offsets.keys().copied().collect()),
            }),
            Some(Record::AttachmentIndex(attachment)) => index.attachments.push(attachment),
            Some(Record::MetadataIndex(record)) => metadata.push((record.offset, record.length)),
            Some(Record::Statistics(record)) => statistics = Some(record),
            Some(record) => index.define(&record),
            None => {}
        });
        let Some(statistics) = statistics else {
            return Ok(None);
        };
        // A file without chunks, or of a writer that leaves indexes out, is read through.
        if statistics.chunk_count as usize != index.parts.len()
            || statistics.attachment_count as usize != index.attachments.len()
            || statistics.metadata_count as usize != metadata.len()
            || (statistics.message_count > 0 && index.parts.is_empty())
        {
            return Ok(None);
        }
        for (offset, length) in metadata {
            let record = scanner.read_at(offset, length)?;
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
        Ok(Some(index))
    }

    fn from_scan(path: &Path) -> Result<Self> {
        let scanner = Scanner::open(path)?;
        Self::read_through(scanner, path).map_err(Error::file("read", path))
    }

    /// The index of something that is no file, by reading through it.
    pub(crate) fn scan_through<R: Read + Seek>(input: R) -> Result<Self> {
        let (scanner, magic) = Scanner::new(input).map_err(Error::Sink)?;
        let path = Path::new("the input");
        if magic != scan::MAGIC[..magic.len()] {
            return Err(Error::NotMcap {
                path: path.to_owned(),
                found: magic,
            });
        }
        Self::read_through(scanner, path).map_err(Error::Sink)
    }

    fn read_through<R: Read + Seek>(mut scanner: Scanner<R>, path: &Path) -> std::io::Result<Self> {
        let mut index = Self {
            length: scanner.length(),
            ..Self::default()
        };
        let mut decompressor = Decompressor::default();
        if !index.scan(path, &mut scanner, &mut decompressor)? {
            let path = path.to_owned();
            index.missing.insert(0, Missing::Unfinished { path });
        }
        Ok(index)
    }

    /// Reads through the file; says whether it ends as a closed file does.
    fn scan<R: Read + Seek>(
        &mut self,
        path: &Path,
        scanner: &mut Scanner<R>,
        decompressor: &mut Decompressor,
    ) -> std::io::Result<bool> {
        loop {
            match scanner.step()? {
                Step::End => return Ok(false),
                Step::Cut {
                    opcode,
                    offset,
                    body,
                } => {
                    if opcode == op::CHUNK {
                        self.add_chunk(path, offset, &body, true, decompressor);
                    }
                    let path = path.to_owned();
                    self.missing.push(Missing::Cut { path, offset });
                    return Ok(false);
                }
                Step::Record {
                    opcode,
                    offset,
                    body,
                } => match opcode {
                    op::FOOTER => return Ok(true),
                    op::CHUNK => self.add_chunk(path, offset, &body, false, decompressor),
                    op::MESSAGE => {
                        if let Some((header, _)) = scan::message(&body) {
                            self.add_message(offset, &header);
                        }
                    }
                    op::ATTACHMENT => self.add_attachment(offset, &body),
                    _ if !scan::is_known(opcode) => {
                        // Lengths can no longer be trusted from here on.
                        let path = path.to_owned();
                        let what = "rest of the file";
                        self.missing.push(Missing::Damaged { path, offset, what });
                        return Ok(false);
                    }
                    _ => match scan::parse(opcode, &body) {
                        Some(Record::Metadata(metadata)) => {
                            self.metadata.insert(metadata.name, metadata.metadata);
                        }
                        Some(record) => self.define(&record),
                        None => {
                            let path = path.to_owned();
                            let what = "record";
                            self.missing.push(Missing::Damaged { path, offset, what });
                        }
                    },
                },
            }
        }
    }

    fn add_chunk(
        &mut self,
        path: &Path,
        offset: u64,
        body: &[u8],
        cut: bool,
        decompressor: &mut Decompressor,
    ) {
        let Some(contents) = decompressor.chunk(body, cut) else {
            if !cut {
                let path = path.to_owned();
                let what = "chunk";
                self.missing.push(Missing::Damaged { path, offset, what });
            }
            return;
        };
        let mut span: Option<(u64, u64)> = None;
        let mut channels = BTreeSet::new();
        scan::for_each_record(&contents.records, |opcode, body| {
            if opcode != op::MESSAGE {
                if let Some(record) = scan::parse(opcode, body) {
                    self.define(&record);
                }
                return;
            }
            if let Some((header, _)) = scan::message(body)
                && self.channels.contains_key(&header.channel_id)
            {
                *self.counts.entry(header.channel_id).or_default() += 1;
                channels.insert(header.channel_id);
                let time = header.log_time;
                span = Some(span.map_or((time, time), |(a, b)| (a.min(time), b.max(time))));
            }
        });
        if let Some((start, end)) = span {
            self.add_part(offset, LogTime(start), LogTime(end), Some(channels));
        }
    }

    fn add_message(&mut self, offset: u64, header: &mcap::records::MessageHeader) {
        if self.channels.contains_key(&header.channel_id) {
            *self.counts.entry(header.channel_id).or_default() += 1;
            let time = LogTime(header.log_time);
            self.add_part(offset, time, time, Some([header.channel_id].into()));
        }
    }

    fn add_part(
        &mut self,
        offset: u64,
        start: LogTime,
        end: LogTime,
        channels: Option<BTreeSet<u16>>,
    ) {
        self.span = Some(
            self.span
                .map_or((start, end), |(a, b)| (a.min(start), b.max(end))),
        );
        self.parts.push(Part {
            offset,
            start,
            end,
            channels,
        });
    }

    fn add_attachment(&mut self, offset: u64, body: &[u8]) {
        if let Some(Record::Attachment { header, data, .. }) = scan::parse(op::ATTACHMENT, body) {
            self.attachments.push(AttachmentIndex {
                offset,
                length: body.len() as u64 + 9,
                log_time: header.log_time,
                create_time: header.create_time,
                data_size: data.len() as u64,
                name: header.name,
                media_type: header.media_type,
            });
        }
    }

    fn define(&mut self, record: &Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                let schema = (header.name.clone(), Arc::from(data.as_ref()));
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => {
                let (schema, schema_data) = self
                    .schemas
                    .get(&channel.schema_id)
                    .cloned()
                    .unwrap_or_else(|| (String::new(), Arc::from([])));
                let source = channel.metadata.get("source");
                let info = ChannelInfo {
                    topic: channel.topic.clone(),
                    schema,
                    schema_data,
                    source: source.and_then(|id| id.parse().ok()).map(SourceId),
                    metadata: channel.metadata.clone(),
                };
                self.channels.insert(channel.id, Arc::new(info));
            }
            _ => {}
        }
    }
}

/// Reads one attachment; `None` if it is damaged.
pub(crate) fn attachment(path: &Path, index: &AttachmentIndex) -> Result<Option<Attachment>> {
    let mut scanner = Scanner::open(path)?;
    let record = scanner
        .read_at(index.offset, index.length)
        .map_err(Error::file("read", path))?;
    let found = scan::split_record(&record).and_then(|(opcode, body, _)| {
        let Some(Record::Attachment { header, data, crc }) = scan::parse(opcode, body) else {
            return None;
        };
        let stored = body.len().checked_sub(4)?;
        let sound = crc == 0 || crc32fast::hash(&body[..stored]) == crc;
        sound.then(|| Attachment {
            name: header.name,
            media_type: header.media_type,
            data: data.into_owned(),
        })
    });
    Ok(found)
}
