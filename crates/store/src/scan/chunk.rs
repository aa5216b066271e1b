//! Chunks: their header, and their records in bounded memory.

use std::io::Read;

use mcap::records::ChunkHeader;

use super::{Fields, for_each_record};

/// Bytes of a chunk's body before its records, without the name of the compression.
pub(super) const HEADER_LENGTH: u64 = 40;
/// The first bytes of a zstd frame.
pub(super) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// The first bytes of an lz4 frame.
pub(super) const LZ4_MAGIC: [u8; 4] = [0x04, 0x22, 0x4d, 0x18];

/// The records of a chunk.
pub(crate) struct Chunk {
    /// Records, one after the other.
    pub records: Vec<u8>,
    pub proof: Proof,
}

/// Confirmation that the records of a chunk are those that were written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Proof {
    /// Its checksum.
    Checksum,
    /// None: its writer omitted the checksum.
    Nothing,
}

/// Reason why a chunk has no readable records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// Its lengths contradict each other, its data cannot be inflated, or its checksum is wrong.
    Damaged,
    /// No such compression is known.
    Compression(String),
    /// It has more than the allowed bytes.
    TooLarge(u64),
}

/// The header of a chunk, and its compressed bytes as far as they are in the file.
pub(super) fn header(body: &[u8]) -> Option<(ChunkHeader, &[u8])> {
    let mut rest = Fields(body);
    let mut u64_field = || Some(u64::from_le_bytes(rest.take(8)?.try_into().ok()?));
    let message_start_time = u64_field()?;
    let message_end_time = u64_field()?;
    let uncompressed_size = u64_field()?;
    let uncompressed_crc = u32::from_le_bytes(rest.take(4)?.try_into().ok()?);
    let compression = String::from_utf8(rest.blob()?.to_vec()).ok()?;
    let compressed_size = u64::from_le_bytes(rest.take(8)?.try_into().ok()?);
    let header = ChunkHeader {
        message_start_time,
        message_end_time,
        uncompressed_size,
        uncompressed_crc,
        compression,
        compressed_size,
    };
    Some((header, rest.0))
}

/// Whether the header's sizes add up to the length of its record.
pub(super) fn adds_up(header: &ChunkHeader, length: u64) -> bool {
    let head = HEADER_LENGTH + header.compression.len() as u64;
    head.checked_add(header.compressed_size) == Some(length)
}

/// Inflates chunks, keeping the decoder between them.
#[derive(Default)]
pub(crate) struct Decompressor {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
    /// Buffer for the next records.
    spare: Vec<u8>,
}

impl Decompressor {
    /// Takes records back that are no longer needed. The next chunk uses their memory.
    pub(crate) fn reuse(&mut self, records: Vec<u8>) {
        if records.capacity() > self.spare.capacity() {
            self.spare = records;
        }
    }

    /// The records of a chunk's whole body, of at most `bound` bytes.
    pub(crate) fn chunk(&mut self, body: &[u8], bound: u64) -> Result<Chunk, Refusal> {
        let (header, data) = header(body).ok_or(Refusal::Damaged)?;
        if !adds_up(&header, body.len() as u64) {
            return Err(Refusal::Damaged);
        }
        if header.uncompressed_size > bound {
            return Err(Refusal::TooLarge(header.uncompressed_size));
        }
        let size = header.uncompressed_size as usize;
        let records = if header.compression == "zstd" {
            if self.zstd.is_none() {
                self.zstd = zstd::bulk::Decompressor::new().ok();
            }
            let zstd = self.zstd.as_mut().ok_or(Refusal::Damaged)?;
            let mut records = std::mem::take(&mut self.spare);
            records.clear();
            records.reserve(size);
            zstd.decompress_to_buffer(data, &mut records)
                .map_err(|_| Refusal::Damaged)?;
            records
        } else {
            inflate(&header.compression, data, header.uncompressed_size)?
        };
        if records.len() != size {
            return Err(Refusal::Damaged);
        }
        let proof = match header.uncompressed_crc {
            0 if size > 0 => Proof::Nothing,
            crc if crc32fast::hash(&records) == crc => Proof::Checksum,
            _ => return Err(Refusal::Damaged),
        };
        Ok(Chunk { records, proof })
    }
}

/// Inflates all of `data`, to at most `bound` bytes.
fn inflate(compression: &str, data: &[u8], bound: u64) -> Result<Vec<u8>, Refusal> {
    let mut records = Vec::new();
    let read = match compression {
        "" => (&mut &*data).take(bound + 1).read_to_end(&mut records),
        "zstd" => zstd_decoder(data).and_then(|d| d.take(bound + 1).read_to_end(&mut records)),
        "lz4" => lz4::Decoder::new(data).and_then(|d| d.take(bound + 1).read_to_end(&mut records)),
        other => return Err(Refusal::Compression(other.to_owned())),
    };
    match read {
        Err(_) => Err(Refusal::Damaged),
        Ok(count) if count as u64 > bound => Err(Refusal::TooLarge(bound + 1)),
        Ok(_) => Ok(records),
    }
}

fn zstd_decoder(data: &[u8]) -> std::io::Result<impl Read> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(data)?;
    // A frame may ask for a window of this many bytes, as a power of two.
    decoder.window_log_max(26)?;
    Ok(decoder)
}

/// The records of a chunk whose sizes may be wrong, if the checksum confirms the records.
pub(super) fn confirmed(compression: &str, data: &[u8], crc: u32, bound: u64) -> Option<Vec<u8>> {
    if crc == 0 {
        return None;
    }
    let records = inflate(compression, data, bound).ok()?;
    let sound = crc32fast::hash(&records) == crc && for_each_record(&records, |_, _| {});
    sound.then_some(records)
}

/// The records of a chunk that is cut, as far as they can be decompressed. No checksum confirms them.
pub(crate) fn of_cut(body: &[u8], bound: u64) -> Vec<u8> {
    let Some((header, data)) = header(body) else {
        return Vec::new();
    };
    let size = header.uncompressed_size.min(bound) as usize;
    match header.compression.as_str() {
        "" => data[..data.len().min(size)].to_vec(),
        "zstd" => zstd_decoder(data).map_or_else(|_| Vec::new(), |d| read_while_good(d, size)),
        "lz4" => lz4::Decoder::new(data).map_or_else(|_| Vec::new(), |d| read_while_good(d, size)),
        _ => Vec::new(),
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
