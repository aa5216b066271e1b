//! Walking through an MCAP file record by record, as far as it goes.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{ChunkHeader, Record, op};

use crate::{Error, Result};

pub(crate) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Opcode and length.
const PREFIX: u64 = 9;
/// Chunks that claim to be larger than this when decompressed are not believed.
const CHUNK_LIMIT: u64 = 1 << 30;

/// A file and how far it has been read.
pub(crate) struct Scanner<R> {
    file: BufReader<R>,
    position: u64,
    length: u64,
}

/// One step through a file.
pub(crate) enum Step {
    /// A whole record.
    Record {
        opcode: u8,
        offset: u64,
        body: Vec<u8>,
    },
    /// The file ends inside of a record: what is there of it.
    Cut {
        opcode: u8,
        offset: u64,
        body: Vec<u8>,
    },
    /// The file ends between two records.
    End,
}

impl Scanner<File> {
    /// Opens a file and checks that it begins like MCAP. A file shorter than the magic is an empty
    /// log.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::file("open", path))?;
        let (scanner, magic) = Self::new(file).map_err(Error::file("read", path))?;
        if magic != MAGIC[..magic.len()] {
            return Err(Error::NotMcap {
                path: path.to_owned(),
                found: magic,
            });
        }
        Ok(scanner)
    }
}

impl<R: Read + Seek> Scanner<R> {
    /// Starts behind the magic, and gives what stands in its place.
    pub(crate) fn new(mut file: R) -> std::io::Result<(Self, Vec<u8>)> {
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(0))?;
        let mut scanner = Self {
            file: BufReader::with_capacity(1 << 18, file),
            position: 0,
            length,
        };
        let magic = scanner.take(MAGIC.len() as u64)?;
        Ok((scanner, magic))
    }

    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    pub(crate) fn seek(&mut self, offset: u64) -> std::io::Result<()> {
        // A relative seek keeps what is buffered.
        let distance = offset.wrapping_sub(self.position) as i64;
        self.file.seek_relative(distance)?;
        self.position = offset;
        Ok(())
    }

    /// Reads `length` bytes at `offset`, fewer at the end of the file.
    pub(crate) fn read_at(&mut self, offset: u64, length: u64) -> std::io::Result<Vec<u8>> {
        self.file.seek(SeekFrom::Start(offset))?;
        self.position = offset;
        self.take(length)
    }

    fn take(&mut self, length: u64) -> std::io::Result<Vec<u8>> {
        // The allocation is bounded by what the file can hold, whatever a length field claims.
        let available = length.min(self.length.saturating_sub(self.position));
        let mut bytes = Vec::with_capacity(available as usize);
        self.file.by_ref().take(available).read_to_end(&mut bytes)?;
        self.position += bytes.len() as u64;
        Ok(bytes)
    }

    /// The next record.
    pub(crate) fn step(&mut self) -> std::io::Result<Step> {
        let offset = self.position;
        let prefix = self.take(PREFIX)?;
        let Ok(prefix) = <[u8; PREFIX as usize]>::try_from(prefix.as_slice()) else {
            return Ok(if prefix.is_empty() {
                Step::End
            } else {
                Step::Cut {
                    opcode: prefix[0],
                    offset,
                    body: Vec::new(),
                }
            });
        };
        let [opcode, length @ ..] = prefix;
        let length = u64::from_le_bytes(length);
        let body = self.take(length)?;
        Ok(if (body.len() as u64) < length {
            Step::Cut {
                opcode,
                offset,
                body,
            }
        } else {
            Step::Record {
                opcode,
                offset,
                body,
            }
        })
    }
}

/// What came out of a chunk.
pub(crate) struct ChunkContents {
    /// Records, one after the other; the last may be cut.
    pub records: Vec<u8>,
}

/// Decompresses chunks, keeping the decoder between them.
#[derive(Default)]
pub(crate) struct Decompressor {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
}

impl Decompressor {
    /// The records of a chunk's body. A chunk that is cut, or whose checksum is wrong, gives what
    /// its compression lets through: nothing if the checksum is wrong, since its bytes cannot be
    /// trusted.
    pub(crate) fn chunk(&mut self, body: &[u8], cut: bool) -> Option<ChunkContents> {
        let (header, data) = chunk_header(body)?;
        if header.uncompressed_size > CHUNK_LIMIT {
            return None;
        }
        let size = header.uncompressed_size as usize;
        let complete = !cut && data.len() as u64 == header.compressed_size;
        if !complete {
            let records = decompress_stream(&header.compression, data, size)?;
            return Some(ChunkContents { records });
        }
        let records = if header.compression == "zstd" {
            if self.zstd.is_none() {
                self.zstd = zstd::bulk::Decompressor::new().ok();
            }
            self.zstd.as_mut()?.decompress(data, size).ok()?
        } else {
            decompress_stream(&header.compression, data, size)?
        };
        let sound = records.len() == size
            && (header.uncompressed_crc == 0
                || crc32fast::hash(&records) == header.uncompressed_crc);
        sound.then_some(ChunkContents { records })
    }
}

/// The header of a chunk, and its compressed bytes as far as they are there.
pub(crate) fn chunk_header(body: &[u8]) -> Option<(ChunkHeader, &[u8])> {
    let mut rest = body;
    let mut take = |count: usize| {
        let (head, tail) = rest.split_at_checked(count)?;
        rest = tail;
        Some(head)
    };
    let message_start_time = u64::from_le_bytes(take(8)?.try_into().ok()?);
    let message_end_time = u64::from_le_bytes(take(8)?.try_into().ok()?);
    let uncompressed_size = u64::from_le_bytes(take(8)?.try_into().ok()?);
    let uncompressed_crc = u32::from_le_bytes(take(4)?.try_into().ok()?);
    let name_length = u32::from_le_bytes(take(4)?.try_into().ok()?) as usize;
    let compression = String::from_utf8(take(name_length)?.to_vec()).ok()?;
    let compressed_size = u64::from_le_bytes(take(8)?.try_into().ok()?);
    let header = ChunkHeader {
        message_start_time,
        message_end_time,
        uncompressed_size,
        uncompressed_crc,
        compression,
        compressed_size,
    };
    Some((header, rest))
}

/// Decompresses as far as the data goes.
fn decompress_stream(compression: &str, data: &[u8], size: usize) -> Option<Vec<u8>> {
    match compression {
        "" => Some(data[..data.len().min(size)].to_vec()),
        "zstd" => Some(read_while_good(
            zstd::stream::read::Decoder::with_buffer(data).ok()?,
            size,
        )),
        "lz4" => Some(read_while_good(lz4::Decoder::new(data).ok()?, size)),
        _ => None,
    }
}

fn read_while_good(mut from: impl Read, size: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut buffer = [0; 4096];
    while bytes.len() < size {
        match from.read(&mut buffer) {
            Ok(0) | Err(_) => break,
            Ok(count) => bytes.extend_from_slice(&buffer[..count]),
        }
    }
    bytes.truncate(size);
    bytes
}

/// The records of a chunk, as far as they are whole. Says whether all were.
pub(crate) fn for_each_record<'a>(records: &'a [u8], mut f: impl FnMut(u8, &'a [u8])) -> bool {
    let mut rest = records;
    while !rest.is_empty() {
        let Some((opcode, body, tail)) = split_record(rest) else {
            return false;
        };
        f(opcode, body);
        rest = tail;
    }
    true
}

/// The first record of `bytes`: opcode, body, and what follows.
pub(crate) fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (prefix, rest) = bytes.split_first_chunk::<9>()?;
    let [opcode, length @ ..] = *prefix;
    let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
    let (body, tail) = rest.split_at_checked(length)?;
    Some((opcode, body, tail))
}

/// A message record's header and data.
pub(crate) fn message(body: &[u8]) -> Option<(mcap::records::MessageHeader, &[u8])> {
    let (header, data) = body.split_first_chunk::<22>()?;
    let header = mcap::records::MessageHeader {
        channel_id: u16::from_le_bytes(header[0..2].try_into().ok()?),
        sequence: u32::from_le_bytes(header[2..6].try_into().ok()?),
        log_time: u64::from_le_bytes(header[6..14].try_into().ok()?),
        publish_time: u64::from_le_bytes(header[14..22].try_into().ok()?),
    };
    Some((header, data))
}

/// Parses any other record; `None` if it is malformed.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    mcap::parse_record(opcode, body).ok()
}

/// Whether a file may hold this record at its top level.
pub(crate) fn is_known(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80
}
