//! Search for the next record that a checksum confirms, at any offset.

use std::io::{Read, Seek};

use mcap::records::op;

use super::chunk::{self, HEADER_LENGTH, LZ4_MAGIC, ZSTD_MAGIC};
use super::{Chunk, PREFIX, Proof, Scanner, Walker, attachment_is_sound};

/// Bytes read at once.
const BLOCK: u64 = 1 << 20;
/// Longest beginning of a record that is checked before the record is read.
const HEAD: usize = 64;
/// Bytes between the beginning of a chunk and the length of its compression's name.
const NAME_LENGTH_AT: usize = 37;
/// Bytes that wrong candidates may cost, as a multiple of the file's length.
const ROUNDS: u64 = 8;

/// A chunk at an offset, confirmed by its checksum.
pub(crate) struct Found {
    pub end: u64,
    pub chunk: Chunk,
}

impl<R: Read + Seek> Walker<R> {
    /// The first offset from `from` to `end` with a chunk or an attachment that its checksum confirms.
    /// `chunks` counts the chunks before it that are rejected.
    pub(super) fn search(
        &mut self,
        from: u64,
        end: u64,
        chunks: &mut u64,
    ) -> std::io::Result<Option<u64>> {
        let mut start = from;
        while start < end {
            start = self.scanner.skip_hole(start)?;
            let block = self.scanner.read_at(start, BLOCK + HEAD as u64)?;
            let last = block.len().min(BLOCK as usize);
            for index in 0..last {
                let offset = start + index as u64;
                if offset >= end {
                    return Ok(None);
                }
                let head = &block[index..block.len().min(index + HEAD)];
                if looks_like_record(head) && self.is_confirmed(offset, head, chunks)? {
                    return Ok(Some(offset));
                }
            }
            if last == 0 {
                break;
            }
            start += last as u64;
        }
        Ok(None)
    }

    fn is_confirmed(
        &mut self,
        offset: u64,
        head: &[u8],
        chunks: &mut u64,
    ) -> std::io::Result<bool> {
        let length = u64_at(head, 1).unwrap_or(u64::MAX);
        let size = length.min(self.bound + BLOCK);
        if self.searched + size > ROUNDS * self.scanner.length() + self.bound {
            return Ok(false);
        }
        if head[0] == op::ATTACHMENT {
            if length > self.bound || offset + PREFIX + length > self.scanner.length() {
                return Ok(false);
            }
            self.searched += size;
            let body = self.scanner.read_at(offset + PREFIX, length)?;
            let crc = body.last_chunk::<4>();
            return Ok(crc.is_some_and(|crc| *crc != [0; 4]) && attachment_is_sound(&body));
        }
        self.searched += size;
        if repaired(&mut self.scanner, self.bound, offset)?.is_some() {
            return Ok(true);
        }
        *chunks += u64::from(adds_up(head));
        Ok(false)
    }
}

/// The chunk at `offset`, also with a damaged header, if its checksum confirms it.
pub(crate) fn repaired<R: Read + Seek>(
    scanner: &mut Scanner<R>,
    bound: u64,
    offset: u64,
) -> std::io::Result<Option<Found>> {
    let head = scanner.read_at(offset, HEAD as u64)?;
    let (Some(length), Some(crc)) = (u64_at(&head, 1), u32_at(&head, 33)) else {
        return Ok(None);
    };
    for (name, magic) in [("zstd", &ZSTD_MAGIC[..]), ("lz4", &LZ4_MAGIC), ("", &[])] {
        let data_at = PREFIX + HEADER_LENGTH + name.len() as u64;
        let data = head.get(data_at as usize..).unwrap_or_default();
        let is_it = data.starts_with(magic) && (!magic.is_empty() || plain_sizes_agree(&head));
        let Some(compressed) = u64_at(&head, data_at as usize - 8).filter(|_| is_it) else {
            continue;
        };
        let by_length = length.saturating_add(PREFIX);
        let by_size = (by_length != compressed.saturating_add(data_at))
            .then(|| compressed.saturating_add(data_at));
        for end in std::iter::once(by_length).chain(by_size) {
            let fits = end > data_at
                && end - data_at <= bound
                && end <= scanner.length().saturating_sub(offset);
            if !fits {
                continue;
            }
            let data = scanner.read_at(offset + data_at, end - data_at)?;
            if let Some(records) = chunk::confirmed(name, &data, crc, bound) {
                let proof = Proof::Checksum;
                let chunk = Chunk { records, proof };
                let end = offset + end;
                return Ok(Some(Found { end, chunk }));
            }
        }
    }
    Ok(None)
}

/// Whether a chunk or an attachment may begin here.
fn looks_like_record(head: &[u8]) -> bool {
    if head.get(NAME_LENGTH_AT..NAME_LENGTH_AT + 8) == Some(b"\x04\0\0\0zstd") {
        return true;
    }
    match head.first() {
        Some(&op::CHUNK) => adds_up(head),
        Some(&op::ATTACHMENT) => {
            let (length, name) = (u64_at(head, 1), u32_at(head, 25));
            length
                .zip(name)
                .is_some_and(|(length, name)| length >= 32 && u64::from(name) <= length - 32)
        }
        _ => false,
    }
}

/// Whether the lengths of a candidate for a chunk agree.
fn adds_up(head: &[u8]) -> bool {
    let Some((length, name)) = u64_at(head, 1).zip(u32_at(head, NAME_LENGTH_AT)) else {
        return false;
    };
    let compressed = (name as usize <= 16)
        .then(|| u64_at(head, NAME_LENGTH_AT + 4 + name as usize))
        .flatten();
    compressed.is_some_and(|compressed| {
        compressed.checked_add(HEADER_LENGTH + u64::from(name)) == Some(length)
    })
}

/// Whether two of the three sizes of an uncompressed chunk agree.
fn plain_sizes_agree(head: &[u8]) -> bool {
    let sizes = [
        u64_at(head, 1).and_then(|l| l.checked_sub(HEADER_LENGTH)),
        u64_at(head, 25),
        u64_at(head, 41),
    ];
    let [Some(a), Some(b), Some(c)] = sizes else {
        return false;
    };
    a == b || b == c || a == c
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    let bytes = bytes.get(at..)?.first_chunk::<8>()?;
    Some(u64::from_le_bytes(*bytes))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let bytes = bytes.get(at..)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*bytes))
}
