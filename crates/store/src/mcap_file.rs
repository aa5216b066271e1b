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
use zstd::bulk::Compressor;
use zstd::zstd_safe::compress_bound;

pub(crate) use chunk::Chunk;

/// Bytes of the kind and the length of a record.
const HEAD_BYTES: usize = 9;

/// Writes one file.
pub(crate) struct McapFile<W> {
    sink: W,
    position: u64,
    checksum: crc32fast::Hasher,
    /// zstd level; `None` writes chunks without compression.
    level: Option<i32>,
    compressor: Compressor<'static>,
    /// Schemas by name and data.
    schema_ids: HashMap<(String, Vec<u8>), u16>,
    /// Records for the end of the file and their number, by kind.
    summary: BTreeMap<u8, (Vec<u8>, u32)>,
    /// Records of schemas and channels that the next chunk must contain.
    new: Vec<u8>,
    /// Messages by channel.
    counts: BTreeMap<u16, u64>,
    span: Option<[u64; 2]>,
    /// Buffers that are kept between chunks.
    compressed: Vec<u8>,
    out: Vec<u8>,
}

impl<W: Write> McapFile<W> {
    /// Begins a file. No level is no compression; with level zero, each chunk has its own level.
    pub(crate) fn create(sink: W, library: &str, level: Option<u32>) -> McapResult<Self> {
        let mut file = Self {
            sink,
            position: 0,
            checksum: crc32fast::Hasher::new(),
            level: level.map(|level| i32::try_from(level).unwrap_or(i32::MAX)),
            compressor: Compressor::new(0)?,
            schema_ids: HashMap::new(),
            summary: BTreeMap::new(),
            new: Vec::new(),
            counts: BTreeMap::new(),
            span: None,
            compressed: Vec::new(),
            out: MAGIC.to_vec(),
        };
        file.put(op::HEADER, &[&sized(""), &sized(library)])?;
        Ok(file)
    }

    /// Writes a record, and returns its place and length.
    fn put(&mut self, kind: u8, body: &[&[u8]]) -> McapResult<[u64; 2]> {
        record(&mut self.out, kind, body);
        self.put_out()
    }

    /// Writes what is in the buffer, and returns its place and length.
    fn put_out(&mut self) -> McapResult<[u64; 2]> {
        self.sink.write_all(&self.out)?;
        self.checksum.update(&self.out);
        let place = [self.position, self.out.len() as u64];
        self.position += place[1];
        self.out.clear();
        Ok(place)
    }

    /// Adds a record to the end of the file.
    fn index(&mut self, kind: u8, body: &[&[u8]]) {
        let (records, count) = self.summary.entry(kind).or_default();
        record(records, kind, body);
        *count += 1;
    }

    /// Number of the records of a kind at the end of the file.
    fn number_of(&self, kind: u8) -> u32 {
        self.summary.get(&kind).map_or(0, |(_, count)| *count)
    }

    pub(crate) fn write_metadata(
        &mut self,
        name: &str,
        metadata: &BTreeMap<String, String>,
    ) -> McapResult<()> {
        let place = self.put(op::METADATA, &[&sized(name), &texts(metadata)])?;
        self.index(op::METADATA_INDEX, &[&numbers(place), &sized(name)]);
        Ok(())
    }

    pub(crate) fn attach(&mut self, attachment: &mcap::Attachment<'_>) -> McapResult<()> {
        let times = numbers([attachment.log_time, attachment.create_time]);
        let names = [&attachment.name, &attachment.media_type]
            .map(sized)
            .concat();
        let size = numbers([attachment.data.len() as u64]);
        let body = [&times, &names, &size, &*attachment.data].concat();
        let checksum = crc32fast::hash(&body).to_le_bytes();
        let place = self.put(op::ATTACHMENT, &[&body, &checksum])?;
        let body: [&[u8]; 4] = [&numbers(place), &times, &size, &names];
        self.index(op::ATTACHMENT_INDEX, &body);
        Ok(())
    }

    /// Number of a schema; a known one with the same contents keeps its number.
    pub(crate) fn add_schema(&mut self, name: &str, data: &[u8]) -> McapResult<u16> {
        let key = (name.to_owned(), data.to_vec());
        if let Some(id) = self.schema_ids.get(&key) {
            return Ok(*id);
        }
        let id = u16::try_from(self.schema_ids.len() + 1).map_err(|_| McapError::TooManySchemas)?;
        self.schema_ids.insert(key, id);
        let texts = [sized(name), sized("protobuf"), sized(data)].concat();
        self.define(op::SCHEMA, &[&id.to_le_bytes(), &texts]);
        Ok(id)
    }

    /// Number of a new channel. Its record is in the next chunk.
    pub(crate) fn add_channel(
        &mut self,
        schema: u16,
        topic: &str,
        metadata: &BTreeMap<String, String>,
    ) -> McapResult<u16> {
        let id = self.number_of(op::CHANNEL) + 1;
        let id = u16::try_from(id).map_err(|_| McapError::TooManyChannels)?;
        let ids = [id, schema].map(u16::to_le_bytes).concat();
        let texts = [sized(topic), sized("protobuf"), texts(metadata)].concat();
        self.define(op::CHANNEL, &[&ids, &texts]);
        Ok(id)
    }

    fn define(&mut self, kind: u8, body: &[&[u8]]) {
        self.index(kind, body);
        record(&mut self.new, kind, body);
    }

    /// Writes a chunk with its indexes, empties it, and returns the number of its messages. A chunk
    /// that the sink refuses keeps its messages.
    pub(crate) fn write_chunk(&mut self, chunk: &mut Chunk) -> McapResult<u64> {
        let Some([first, last]) = chunk.span else {
            return Ok(0);
        };
        chunk.prepend(&std::mem::take(&mut self.new));
        let contents = &*chunk.records;
        let (compression, stored) = match self.level {
            Some(level) => {
                let level = if level == 0 { chunk.level } else { level };
                self.compressor.set_compression_level(level)?;
                self.compressed.clear();
                self.compressed.reserve(compress_bound(contents.len()));
                (self.compressor).compress_to_buffer(contents, &mut self.compressed)?;
                (sized("zstd"), &*self.compressed)
            }
            None => (sized(""), contents),
        };
        let [size, stored_size] = [contents, stored].map(|bytes| bytes.len() as u64);
        let head = numbers([first, last, size]);
        let checksum = crc32fast::hash(contents).to_le_bytes();
        let tail = [&compression, &*numbers([stored_size]), stored];
        record(
            &mut self.out,
            op::CHUNK,
            &[&head, &checksum, &tail.concat()],
        );
        let length = self.out.len() as u64;
        let (mut places, mut count) = (Vec::new(), 0);
        for (channel, entries) in &chunk.index {
            let place = self.position + self.out.len() as u64;
            places.extend(pair(channel, &place));
            let mut bytes = Vec::with_capacity(16 * entries.len());
            for entry in entries {
                bytes.extend_from_slice(entry.map(u64::to_le_bytes).as_flattened());
            }
            let body: [&[u8]; 2] = [&channel.to_le_bytes(), &sized(bytes)];
            record(&mut self.out, op::MESSAGE_INDEX, &body);
        }
        let [start, whole] = self.put_out()?;
        let head = numbers([first, last, start, length]);
        let tail = [
            numbers([whole - length]),
            compression,
            numbers([stored_size, size]),
        ];
        self.index(op::CHUNK_INDEX, &[&head, &sized(places), &tail.concat()]);
        let [begin, end] = self.span.unwrap_or([first, last]);
        self.span = Some([begin.min(first), end.max(last)]);
        for (channel, entries) in &chunk.index {
            *self.counts.entry(*channel).or_default() += entries.len() as u64;
            count += entries.len() as u64;
        }
        chunk.clear();
        Ok(count)
    }

    /// Writes the end of the file, and returns the sink.
    pub(crate) fn finish(mut self) -> McapResult<W> {
        let checksum = self.checksum.clone().finalize();
        self.put(op::DATA_END, &[&checksum.to_le_bytes()])?;
        self.index_statistics();
        let (start, mut offsets) = (self.position, Vec::new());
        let definitions = [op::SCHEMA, op::CHANNEL, op::STATISTICS];
        let indexes = [op::CHUNK_INDEX, op::ATTACHMENT_INDEX, op::METADATA_INDEX];
        for kind in definitions.into_iter().chain(indexes) {
            if let Some((records, _)) = self.summary.get(&kind) {
                let place = [start + self.out.len() as u64, records.len() as u64];
                record(
                    &mut offsets,
                    op::SUMMARY_OFFSET,
                    &[&[kind], &numbers(place)],
                );
                self.out.extend_from_slice(records);
            }
        }
        let places = numbers([start, start + self.out.len() as u64]);
        self.out.extend(offsets);
        record(&mut self.out, op::FOOTER, &[&places, &[0; 4]]);
        // The last field of the footer is the checksum of everything before it.
        self.out.truncate(self.out.len() - 4);
        let checksum = crc32fast::hash(&self.out).to_le_bytes();
        self.out.extend([&checksum[..], MAGIC].concat());
        self.put_out()?;
        self.sink.flush()?;
        Ok(self.sink)
    }

    fn index_statistics(&mut self) {
        let messages = numbers([self.counts.values().sum()]);
        let schemas = (self.schema_ids.len() as u16).to_le_bytes();
        let others = [
            op::CHANNEL,
            op::ATTACHMENT_INDEX,
            op::METADATA_INDEX,
            op::CHUNK_INDEX,
        ];
        let others = others.map(|kind| self.number_of(kind).to_le_bytes());
        let span = numbers(self.span.unwrap_or_default());
        let counts = self.counts.iter().flat_map(|(k, n)| pair(k, n));
        let tail = [others.concat(), span, sized(counts.collect::<Vec<u8>>())];
        self.index(op::STATISTICS, &[&messages, &schemas, &tail.concat()]);
    }
}

/// Appends a record with the parts of its body.
fn record(out: &mut Vec<u8>, kind: u8, body: &[&[u8]]) {
    let length: usize = body.iter().map(|part| part.len()).sum();
    out.push(kind);
    out.extend((length as u64).to_le_bytes());
    body.iter().for_each(|part| out.extend_from_slice(part));
}

fn numbers<const N: usize>(numbers: [u64; N]) -> Vec<u8> {
    numbers.map(u64::to_le_bytes).concat()
}

/// Bytes behind their number.
fn sized(bytes: impl AsRef<[u8]>) -> Vec<u8> {
    let bytes = bytes.as_ref();
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

fn texts(map: &BTreeMap<String, String>) -> Vec<u8> {
    let texts = map.iter().flat_map(|(key, value)| [key, value]);
    sized(texts.flat_map(sized).collect::<Vec<u8>>())
}

fn pair(channel: &u16, number: &u64) -> Vec<u8> {
    [&channel.to_le_bytes()[..], &number.to_le_bytes()].concat()
}

#[cfg(test)]
mod tests;
