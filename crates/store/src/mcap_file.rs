//! Writes MCAP files whose chunks are encoded in memory.
//!
//! The writer of the `mcap` crate passes each field of a message to the compressor. Here a message
//! is encoded into its chunk once, and the compressor gets the whole chunk. A test compares the bytes
//! with those of the crate.

mod chunk;

use std::collections::{BTreeMap, HashMap};
use std::io::Write;

use mcap::records::op;
use mcap::{MAGIC, McapError, McapResult};

pub(crate) use chunk::Chunk;

/// Name of the compression in the file.
const COMPRESSION: &str = "zstd";

/// Writes one file.
pub(crate) struct McapFile<W> {
    sink: W,
    position: u64,
    checksum: crc32fast::Hasher,
    /// `None` writes chunks without compression.
    compressor: Option<zstd::bulk::Compressor<'static>>,
    /// Schemas by name and data.
    schema_ids: HashMap<(String, Vec<u8>), u16>,
    /// Records of schemas and channels, for the end of the file.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    channel_count: u16,
    /// Records of schemas and channels that the next chunk must contain.
    new: Vec<u8>,
    /// Messages by channel.
    counts: BTreeMap<u16, u64>,
    span: Option<(u64, u64)>,
    chunks: Indexes,
    attachments: Indexes,
    metadata: Indexes,
    /// Buffers that are kept between chunks.
    compressed: Vec<u8>,
    out: Vec<u8>,
}

/// Records of indexes for the end of the file.
#[derive(Default)]
struct Indexes {
    records: Vec<u8>,
    count: u32,
}

impl<W: Write> McapFile<W> {
    /// Begins a file; no level is no compression.
    pub(crate) fn create(sink: W, library: &str, level: Option<u32>) -> McapResult<Self> {
        let compressor = level
            .map(|level| zstd::bulk::Compressor::new(i32::try_from(level).unwrap_or(i32::MAX)))
            .transpose()?;
        let mut file = Self {
            sink,
            position: 0,
            checksum: crc32fast::Hasher::new(),
            compressor,
            schema_ids: HashMap::new(),
            schemas: Vec::new(),
            channels: Vec::new(),
            channel_count: 0,
            new: Vec::new(),
            counts: BTreeMap::new(),
            span: None,
            chunks: Indexes::default(),
            attachments: Indexes::default(),
            metadata: Indexes::default(),
            compressed: Vec::new(),
            out: MAGIC.to_vec(),
        };
        record(&mut file.out, op::HEADER, |out| {
            text(out, "");
            text(out, library);
        });
        file.put_out()?;
        Ok(file)
    }

    /// Writes what is in the buffer.
    fn put_out(&mut self) -> McapResult<()> {
        self.sink.write_all(&self.out)?;
        self.checksum.update(&self.out);
        self.position += self.out.len() as u64;
        self.out.clear();
        Ok(())
    }

    pub(crate) fn write_metadata(
        &mut self,
        name: &str,
        metadata: &BTreeMap<String, String>,
    ) -> McapResult<()> {
        let start = self.position;
        record(&mut self.out, op::METADATA, |out| {
            text(out, name);
            map(out, metadata);
        });
        self.put_out()?;
        let length = self.position - start;
        self.metadata.push(op::METADATA_INDEX, |out| {
            numbers(out, &[start, length]);
            text(out, name);
        });
        Ok(())
    }

    pub(crate) fn attach(&mut self, attachment: &mcap::Attachment<'_>) -> McapResult<()> {
        let start = self.position;
        let times = [attachment.log_time, attachment.create_time];
        let size = attachment.data.len() as u64;
        record(&mut self.out, op::ATTACHMENT, |out| {
            let body = out.len();
            numbers(out, &times);
            text(out, &attachment.name);
            text(out, &attachment.media_type);
            numbers(out, &[size]);
            out.extend_from_slice(&attachment.data);
            let checksum = crc32fast::hash(&out[body..]);
            out.extend_from_slice(&checksum.to_le_bytes());
        });
        self.put_out()?;
        let length = self.position - start;
        self.attachments.push(op::ATTACHMENT_INDEX, |out| {
            numbers(out, &[start, length, times[0], times[1], size]);
            text(out, &attachment.name);
            text(out, &attachment.media_type);
        });
        Ok(())
    }

    /// Number of a schema; a known one with the same contents keeps its number.
    pub(crate) fn add_schema(&mut self, name: &str, data: &[u8]) -> McapResult<u16> {
        let key = (name.to_owned(), data.to_vec());
        if let Some(id) = self.schema_ids.get(&key) {
            return Ok(*id);
        }
        let id = u16::try_from(self.schema_ids.len() + 1).map_err(|_| McapError::TooManySchemas)?;
        let start = self.schemas.len();
        record(&mut self.schemas, op::SCHEMA, |out| {
            out.extend_from_slice(&id.to_le_bytes());
            text(out, name);
            text(out, "protobuf");
            bytes(out, data);
        });
        self.new.extend_from_slice(&self.schemas[start..]);
        self.schema_ids.insert(key, id);
        Ok(id)
    }

    /// Number of a new channel. Its record is in the next chunk.
    pub(crate) fn add_channel(
        &mut self,
        schema: u16,
        topic: &str,
        metadata: &BTreeMap<String, String>,
    ) -> McapResult<u16> {
        let id = (self.channel_count.checked_add(1)).ok_or(McapError::TooManyChannels)?;
        self.channel_count = id;
        let start = self.channels.len();
        record(&mut self.channels, op::CHANNEL, |out| {
            out.extend_from_slice(&id.to_le_bytes());
            out.extend_from_slice(&schema.to_le_bytes());
            text(out, topic);
            text(out, "protobuf");
            map(out, metadata);
        });
        self.new.extend_from_slice(&self.channels[start..]);
        Ok(id)
    }

    /// Writes a chunk with its indexes, and empties it. A chunk that the sink refuses keeps its messages.
    pub(crate) fn write_chunk(&mut self, chunk: &mut Chunk) -> McapResult<()> {
        let Some((first, last)) = chunk.span() else {
            return Ok(());
        };
        chunk.prepend(&self.new);
        self.new.clear();
        let contents = chunk.contents();
        let stored = match &mut self.compressor {
            Some(compressor) => {
                self.compressed
                    .resize(zstd::zstd_safe::compress_bound(contents.len()), 0);
                let length = compressor.compress_to_buffer(contents, &mut self.compressed[..])?;
                &self.compressed[..length]
            }
            None => contents,
        };
        let compression = self.compressor.as_ref().map_or("", |_| COMPRESSION);
        let sizes = [contents.len() as u64, stored.len() as u64];
        record(&mut self.out, op::CHUNK, |out| {
            numbers(out, &[first, last, sizes[0]]);
            out.extend_from_slice(&crc32fast::hash(contents).to_le_bytes());
            text(out, compression);
            numbers(out, &[sizes[1]]);
            out.extend_from_slice(stored);
        });
        let start = self.position;
        let length = self.out.len() as u64;
        let offsets = chunk.write_indexes(&mut self.out, start);
        let indexes = self.out.len() as u64 - length;
        self.put_out()?;
        self.chunks.push(op::CHUNK_INDEX, |out| {
            numbers(out, &[first, last, start, length]);
            pairs(out, &offsets);
            numbers(out, &[indexes]);
            text(out, compression);
            numbers(out, &[sizes[1], sizes[0]]);
        });
        let (begin, end) = self.span.unwrap_or((first, last));
        self.span = Some((begin.min(first), end.max(last)));
        for (channel, count) in chunk.counts() {
            *self.counts.entry(channel).or_default() += count;
        }
        chunk.clear();
        Ok(())
    }

    /// Writes the end of the file.
    pub(crate) fn finish(&mut self) -> McapResult<()> {
        let checksum = self.checksum.clone().finalize();
        record(&mut self.out, op::DATA_END, |out| {
            out.extend_from_slice(&checksum.to_le_bytes());
        });
        self.put_out()?;
        let start = self.position;
        let mut statistics = Vec::new();
        record(&mut statistics, op::STATISTICS, |out| self.count(out));
        let groups: [(u8, &[u8]); 6] = [
            (op::SCHEMA, &self.schemas),
            (op::CHANNEL, &self.channels),
            (op::STATISTICS, &statistics),
            (op::CHUNK_INDEX, &self.chunks.records),
            (op::ATTACHMENT_INDEX, &self.attachments.records),
            (op::METADATA_INDEX, &self.metadata.records),
        ];
        let out = &mut self.out;
        let mut offsets = Vec::new();
        for (kind, records) in groups
            .into_iter()
            .filter(|(_, records)| !records.is_empty())
        {
            record(&mut offsets, op::SUMMARY_OFFSET, |offset| {
                offset.push(kind);
                numbers(offset, &[start + out.len() as u64, records.len() as u64]);
            });
            out.extend_from_slice(records);
        }
        let offsets_start = start + out.len() as u64;
        out.extend_from_slice(&offsets);
        record(out, op::FOOTER, |out| {
            numbers(out, &[start, offsets_start]);
            // The length of the record covers the checksum, which follows.
            out.extend_from_slice(&[0; 4]);
        });
        out.truncate(out.len() - 4);
        let checksum = crc32fast::hash(out);
        out.extend_from_slice(&checksum.to_le_bytes());
        out.extend_from_slice(MAGIC);
        self.put_out()?;
        Ok(self.sink.flush()?)
    }

    /// Body of the statistics.
    fn count(&self, out: &mut Vec<u8>) {
        let messages: u64 = self.counts.values().sum();
        numbers(out, &[messages]);
        out.extend_from_slice(&(self.schema_ids.len() as u16).to_le_bytes());
        let channels = u32::from(self.channel_count);
        let counts = [
            channels,
            self.attachments.count,
            self.metadata.count,
            self.chunks.count,
        ];
        out.extend(counts.into_iter().flat_map(u32::to_le_bytes));
        let (first, last) = self.span.unwrap_or_default();
        numbers(out, &[first, last]);
        pairs(out, &self.counts);
    }

    /// The sink.
    pub(crate) fn into_inner(self) -> W {
        self.sink
    }
}

impl Indexes {
    fn push(&mut self, kind: u8, body: impl FnOnce(&mut Vec<u8>)) {
        record(&mut self.records, kind, body);
        self.count += 1;
    }
}

/// Appends a record: its kind, its length and its body.
fn record(out: &mut Vec<u8>, kind: u8, body: impl FnOnce(&mut Vec<u8>)) {
    out.push(kind);
    let start = out.len() + 8;
    out.extend_from_slice(&[0; 8]);
    body(out);
    let length = (out.len() - start) as u64;
    out[start - 8..start].copy_from_slice(&length.to_le_bytes());
}

fn numbers(out: &mut Vec<u8>, numbers: &[u64]) {
    out.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}

fn bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    out.extend_from_slice(&(bytes.len() as u32).to_le_bytes());
    out.extend_from_slice(bytes);
}

fn text(out: &mut Vec<u8>, text: &str) {
    bytes(out, text.as_bytes());
}

fn map(out: &mut Vec<u8>, map: &BTreeMap<String, String>) {
    let mut body = Vec::new();
    for (key, value) in map {
        text(&mut body, key);
        text(&mut body, value);
    }
    bytes(out, &body);
}

fn pairs(out: &mut Vec<u8>, pairs: &BTreeMap<u16, u64>) {
    let mut body = Vec::new();
    for (key, value) in pairs {
        body.extend_from_slice(&key.to_le_bytes());
        numbers(&mut body, &[*value]);
    }
    bytes(out, &body);
}

#[cfg(test)]
mod tests;
