//! Records of MCAP files: checks of a record, and reading of a file in bounded memory.

mod chunk;
mod resync;
mod search;
mod walk;

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use mcap::records::{Record, op};

pub(crate) use chunk::{Chunk, Decompressor, Proof, Refusal, of_cut};
pub(crate) use search::repaired;
pub(crate) use walk::{Cause, Damage, Ending, Item, Walker, summary};

use crate::{Error, Result};

pub(crate) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Opcode and length.
pub(crate) const PREFIX: u64 = 9;
/// Bytes that are read together. A longer record is read into its place without a second copy.
const BUFFER: usize = 1 << 15;

/// The bound of [`max_chunk`] when nothing else is set, bytes.
pub const DEFAULT_MAX_CHUNK: u64 = 64 << 20;

static MAX_CHUNK: AtomicU64 = AtomicU64::new(DEFAULT_MAX_CHUNK);

/// Largest size of an inflated chunk, and of any other record, bytes; larger ones are rejected. The
/// memory for reading a file is a small multiple of this.
#[must_use]
pub fn max_chunk() -> u64 {
    MAX_CHUNK.load(Ordering::Relaxed)
}

/// Sets [`max_chunk`] for the whole process.
pub fn set_max_chunk(bytes: u64) {
    MAX_CHUNK.store(bytes, Ordering::Relaxed);
}

/// A file of which any part can be read, with a bounded allocation for each.
pub(crate) struct Scanner<R> {
    file: BufReader<R>,
    position: u64,
    length: u64,
    /// Finds the next byte of a sparse file that is stored.
    next_data: fn(&R, u64) -> Option<u64>,
    stop: Option<Arc<AtomicBool>>,
}

impl Scanner<File> {
    /// Opens a file.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::file("open", path))?;
        let mut scanner = Self::new(file).map_err(Error::file("read", path))?;
        scanner.next_data = next_data;
        Ok(scanner)
    }
}

/// The first stored byte at or after `offset`; `None` if the file system does not know, or if none
/// follows.
#[cfg(target_os = "linux")]
fn next_data(file: &File, offset: u64) -> Option<u64> {
    match rustix::fs::seek(file, rustix::fs::SeekFrom::Data(offset)) {
        Err(rustix::io::Errno::NXIO) => Some(u64::MAX),
        found => found.ok(),
    }
}

#[cfg(not(target_os = "linux"))]
fn next_data(_: &File, _: u64) -> Option<u64> {
    None
}

impl<R: Read + Seek> Scanner<R> {
    pub(crate) fn new(mut file: R) -> std::io::Result<Self> {
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(0))?;
        Ok(Self {
            file: BufReader::with_capacity(BUFFER, file),
            position: 0,
            length,
            next_data: |_, _| None,
            stop: None,
        })
    }

    /// After `stop` is set, reading fails with an error that [`is_stop`] recognises.
    pub(crate) fn stop_at(&mut self, stop: Option<Arc<AtomicBool>>) {
        self.stop = stop;
    }

    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Reads `length` bytes at `offset`, fewer at the end of the file. The allocation is bounded by
    /// the file's length; the caller bounds it further.
    pub(crate) fn read_at(&mut self, offset: u64, length: u64) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.read_into(offset, length, &mut bytes)?;
        Ok(bytes)
    }

    /// As [`Self::read_at`], in place of what `bytes` contains.
    pub(crate) fn read_into(
        &mut self,
        offset: u64,
        length: u64,
        bytes: &mut Vec<u8>,
    ) -> std::io::Result<()> {
        if self
            .stop
            .as_ref()
            .is_some_and(|s| s.load(Ordering::Relaxed))
        {
            return Err(interrupted());
        }
        // A relative seek keeps what is buffered.
        let distance = offset.wrapping_sub(self.position) as i64;
        self.file.seek_relative(distance)?;
        self.position = offset;
        let available = length.min(self.length.saturating_sub(offset));
        bytes.clear();
        bytes.reserve_exact(available as usize);
        self.file.by_ref().take(available).read_to_end(bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Opcode and length of the record at `offset`; `None` if fewer bytes are there.
    pub(crate) fn prefix(&mut self, offset: u64) -> std::io::Result<Option<(u8, u64)>> {
        let bytes = self.read_at(offset, PREFIX)?;
        Ok(<[u8; PREFIX as usize]>::try_from(bytes.as_slice())
            .ok()
            .map(|[opcode, length @ ..]| (opcode, u64::from_le_bytes(length))))
    }

    /// The first byte at or after `offset` that is not in a hole of a sparse file.
    fn skip_hole(&mut self, offset: u64) -> std::io::Result<u64> {
        let found = (self.next_data)(self.file.get_ref(), offset);
        // The search moved the file position without the buffer.
        self.file.seek(SeekFrom::Start(offset))?;
        self.position = offset;
        Ok(found.map_or(offset, |found| found.clamp(offset, self.length)))
    }
}

/// Reading was stopped.
fn interrupted() -> std::io::Error {
    // Not `Interrupted`: that kind is tried again by the standard library.
    std::io::Error::new(std::io::ErrorKind::TimedOut, Stopped)
}

/// Whether an error is that of [`interrupted`].
pub(crate) fn is_stop(error: &std::io::Error) -> bool {
    error.get_ref().is_some_and(|inner| inner.is::<Stopped>())
}

/// The cause inside of the error that [`interrupted`] makes.
#[derive(Debug, thiserror::Error)]
#[error("the reading was stopped")]
struct Stopped;

/// The records of a chunk, as far as they are whole; `true` if all are.
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

/// Parses any record except messages and chunks; `None` if its lengths do not add up to that of its
/// body, or its checksum is wrong.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    if !is_well_formed(opcode, body) {
        return None;
    }
    mcap::parse_record(opcode, body).ok()
}

/// Whether the lengths inside of a record add up to that of the record: the parser allocates memory by
/// these lengths.
fn is_well_formed(opcode: u8, body: &[u8]) -> bool {
    let mut rest = Fields(body);
    let parsed = match opcode {
        op::HEADER => rest.blob().and_then(|_| rest.blob()),
        op::FOOTER => rest.take(20),
        op::SCHEMA => rest
            .skip(2)
            .and_then(|()| rest.blob())
            .and_then(|_| rest.blob())
            .and_then(|_| rest.blob()),
        op::CHANNEL => rest
            .skip(4)
            .and_then(|()| rest.blob())
            .and_then(|_| rest.blob())
            .and_then(|_| rest.blob())
            .filter(|map| is_string_map(map)),
        op::MESSAGE_INDEX => rest.skip(2).and_then(|()| rest.blob()),
        op::CHUNK_INDEX => rest
            .skip(32)
            .and_then(|()| rest.blob())
            .and_then(|_| rest.skip(8))
            .and_then(|()| rest.blob())
            .and_then(|_| rest.take(16)),
        op::ATTACHMENT => return attachment_is_sound(body),
        op::ATTACHMENT_INDEX => rest
            .skip(40)
            .and_then(|()| rest.blob())
            .and_then(|_| rest.blob()),
        op::STATISTICS => rest.skip(42).and_then(|()| rest.blob()),
        op::METADATA => rest
            .blob()
            .and_then(|_| rest.blob())
            .filter(|map| is_string_map(map)),
        op::METADATA_INDEX => rest.skip(16).and_then(|()| rest.blob()),
        op::SUMMARY_OFFSET => rest.take(17),
        op::DATA_END => rest.take(4),
        _ => return true,
    };
    parsed.is_some() && rest.0.is_empty()
}

/// Whether pairs of strings fill the bytes of a map.
fn is_string_map(map: &[u8]) -> bool {
    let mut rest = Fields(map);
    while !rest.0.is_empty() {
        if rest.blob().and_then(|_| rest.blob()).is_none() {
            return false;
        }
    }
    true
}

/// Whether an attachment's lengths add up, and its checksum is right.
fn attachment_is_sound(body: &[u8]) -> bool {
    let mut rest = Fields(body);
    let parsed = rest
        .skip(16)
        .and_then(|()| rest.blob())
        .and_then(|_| rest.blob())
        .and_then(|_| rest.take(8));
    let Some(length) = parsed.and_then(|bytes| bytes.try_into().ok()) else {
        return false;
    };
    let Some(Ok(crc)) = usize::try_from(u64::from_le_bytes(length))
        .ok()
        .and_then(|length| rest.skip(length))
        .map(|()| <[u8; 4]>::try_from(rest.0))
    else {
        return false;
    };
    let crc = u32::from_le_bytes(crc);
    crc == 0 || crc32fast::hash(&body[..body.len() - 4]) == crc
}

/// Reads fields from the front of a record.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(count)?;
        self.0 = tail;
        Some(head)
    }

    fn skip(&mut self, count: usize) -> Option<()> {
        self.take(count).map(drop)
    }

    /// Bytes after their length of 32 bits.
    fn blob(&mut self) -> Option<&'a [u8]> {
        let length = u32::from_le_bytes(self.take(4)?.try_into().ok()?);
        self.take(length as usize)
    }
}

/// Whether a file may hold this record at its top level.
pub(crate) fn is_known(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80
}
