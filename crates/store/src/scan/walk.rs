//! Walks through a file from record to record, and continues after damage.

use std::collections::{BTreeMap, VecDeque};
use std::io::{Read, Seek};

use mcap::records::{Record, op};

use super::chunk::Decompressor;
use super::{
    Chunk, MAGIC, PREFIX, Proof, Refusal, Scanner, for_each_record, is_known, message, parse,
    split_record,
};

/// Opcode, length, two offsets, checksum; then the magic.
pub(crate) const FOOTER_LENGTH: u64 = PREFIX + 20 + 8;
/// A run of zeros of at least this length at the end of a file was not written, but left by a power cut.
const ZERO_TAIL: u64 = 512;
/// Block size for the search of zeros at the end of a file, bytes.
const ZEROS_MAX: u64 = 64 << 20;

/// An item of a file.
pub(crate) enum Item {
    /// A chunk.
    Chunk {
        offset: u64,
        /// One past its last byte.
        end: u64,
        chunk: Chunk,
    },
    /// Another record of the data section.
    Record {
        opcode: u8,
        offset: u64,
        body: Vec<u8>,
    },
    /// Bytes that are left out.
    Damage(Damage),
}

/// A stretch of a file that was changed, or that no checksum confirms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Damage {
    pub offset: u64,
    pub length: u64,
    /// Chunks whose records are lost, as far as they can be counted.
    pub chunks: u64,
    pub cause: Cause,
}

/// Kind of damage of a stretch of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Cause {
    /// A chunk whose checksum is wrong, or which is overwritten.
    Chunk,
    /// The header of a chunk, whose records are intact.
    ChunkHeader,
    /// A chunk of a compression that is not known.
    Compression(String),
    /// A record of so many bytes, more than allowed.
    TooLarge(u64),
    /// An index of messages.
    Index,
    /// Any other record.
    Record,
    /// The first bytes of the file.
    Magic,
    /// Bytes that only the checksum of the data section covers.
    DataSection,
}

/// How a file ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Closed, with the right checksums.
    Closed,
    /// Between two records.
    Unfinished,
    /// Inside of a record, in zeros after a power cut, or in an incomplete summary.
    Cut {
        offset: u64,
        /// What the record is; `None` in zeros.
        opcode: Option<u8>,
        /// The existing bytes of a chunk.
        chunk: Option<Vec<u8>>,
        /// Messages, attachments or metadata may have been here.
        data: bool,
    },
}

/// Walks through a file from record to record, and on behind what is damaged.
pub(crate) struct Walker<R> {
    pub(super) scanner: Scanner<R>,
    pub(super) bound: u64,
    /// Bytes that searches have read for candidates.
    pub(super) searched: u64,
    decompressor: Decompressor,
    pub(super) position: u64,
    pub(super) pending: VecDeque<Item>,
    pub(super) ending: Option<Ending>,
    /// End of the last byte that is not zero.
    pub(super) written: u64,
    /// End of the data section by an intact footer.
    pub(super) data_end: Option<u64>,
    /// Checksum of all bytes since the beginning, or since the end of the data section; `None` after bytes
    /// were left out.
    checksum: Option<crc32fast::Hasher>,
    in_summary: bool,
    data_confirmed: bool,
    /// Indexes that should follow the last chunk: log times and places of its messages.
    pub(super) indexes: BTreeMap<u16, Vec<(u64, u64)>>,
}

/// The record at an offset, by its own bytes.
pub(super) enum Framed {
    Chunk {
        end: u64,
        chunk: Chunk,
        raw: Vec<u8>,
    },
    Record {
        opcode: u8,
        body: Vec<u8>,
    },
    /// It is not intact; its end if its length is right.
    Bad {
        cause: Cause,
        end: Option<u64>,
    },
    /// The file ends before the record does.
    Short {
        opcode: Option<u8>,
    },
}

impl<R: Read + Seek> Walker<R> {
    /// Starts at the beginning of a file; no record of more than `bound` bytes is read.
    pub(crate) fn new(mut scanner: Scanner<R>, bound: u64) -> std::io::Result<Self> {
        let magic = scanner.read_at(0, MAGIC.len() as u64)?;
        let written = written(&mut scanner)?;
        let mut walker = Self {
            bound,
            searched: 0,
            decompressor: Decompressor::default(),
            position: magic.len() as u64,
            pending: VecDeque::new(),
            ending: None,
            written,
            data_end: None,
            checksum: Some(crc32fast::Hasher::new()),
            in_summary: false,
            data_confirmed: false,
            indexes: BTreeMap::new(),
            scanner,
        };
        walker.data_end = walker.data_end_of_footer()?;
        if magic == MAGIC[..magic.len()] {
            walker.hash(&magic);
        } else {
            let from = 0;
            let end = walker.position;
            if matches!(
                walker.framed(end)?,
                Framed::Record {
                    opcode: op::HEADER,
                    ..
                }
            ) {
                walker.leave_out(from, end, 0, Cause::Magic);
            } else {
                walker.position = 0;
                walker.damaged(from, Cause::Magic, None)?;
            }
        }
        Ok(walker)
    }

    /// The next item of the file.
    pub(crate) fn next(&mut self) -> std::io::Result<Option<Item>> {
        loop {
            if let Some(item) = self.pending.pop_front() {
                return Ok(Some(item));
            }
            if self.ending.is_some() {
                return Ok(None);
            }
            self.advance()?;
        }
    }

    /// How the file ends, once [`Walker::next`] has given its last item.
    pub(crate) fn ending(&self) -> &Ending {
        self.ending.as_ref().unwrap_or(&Ending::Unfinished)
    }

    fn advance(&mut self) -> std::io::Result<()> {
        let offset = self.position;
        if offset >= self.scanner.length() {
            self.ending = Some(Ending::Unfinished);
            return Ok(());
        }
        if self.in_summary {
            return self.summary_record(offset);
        }
        match self.framed(offset)? {
            Framed::Chunk { end, chunk, raw } => {
                self.hash_record(op::CHUNK, &raw);
                self.take_chunk(offset, end, chunk);
            }
            Framed::Record { opcode, body } => self.take_record(opcode, offset, body),
            Framed::Bad { cause, end } => self.damaged(offset, cause, end)?,
            Framed::Short { opcode } => self.short(offset, opcode)?,
        }
        Ok(())
    }

    pub(super) fn framed(&mut self, offset: u64) -> std::io::Result<Framed> {
        let Some((opcode, length)) = self.scanner.prefix(offset)? else {
            let first = self.scanner.read_at(offset, 1)?;
            let opcode = first.first().copied().filter(|opcode| is_known(*opcode));
            return Ok(Framed::Short { opcode });
        };
        let start = offset + PREFIX;
        let bad = |cause, end| Ok(Framed::Bad { cause, end });
        if !is_known(opcode) {
            let end = start.checked_add(length);
            return bad(Cause::Record, end);
        }
        let Some(end) = start
            .checked_add(length)
            .filter(|end| *end <= self.scanner.length())
        else {
            return Ok(Framed::Short {
                opcode: Some(opcode),
            });
        };
        // Compression enlarges random bytes a little.
        if length > self.bound + self.bound / 64 + 4096 {
            return bad(Cause::TooLarge(length), Some(end));
        }
        let body = self.scanner.read_at(start, length)?;
        if opcode == op::CHUNK {
            return match self.decompressor.chunk(&body, self.bound) {
                Ok(chunk) => Ok(Framed::Chunk {
                    end,
                    chunk,
                    raw: body,
                }),
                Err(Refusal::Damaged) => bad(Cause::Chunk, Some(end)),
                Err(Refusal::Compression(name)) => bad(Cause::Compression(name), Some(end)),
                Err(Refusal::TooLarge(size)) => bad(Cause::TooLarge(size), Some(end)),
            };
        }
        let intact = match opcode {
            op::MESSAGE => message(&body).is_some(),
            0x80.. => true,
            _ => parse(opcode, &body).is_some(),
        };
        if intact {
            Ok(Framed::Record { opcode, body })
        } else {
            bad(Cause::Record, Some(end))
        }
    }

    pub(super) fn take_chunk(&mut self, offset: u64, end: u64, chunk: Chunk) {
        self.position = end;
        self.indexes.clear();
        let base = chunk.records.as_ptr() as usize;
        for_each_record(&chunk.records, |opcode, body| {
            if opcode == op::MESSAGE
                && let Some((header, _)) = message(body)
            {
                let place = (body.as_ptr() as usize - base) as u64 - PREFIX;
                let index = self.indexes.entry(header.channel_id).or_default();
                index.push((header.log_time, place));
            }
        });
        self.pending.push_back(Item::Chunk { offset, end, chunk });
    }

    fn take_record(&mut self, opcode: u8, offset: u64, body: Vec<u8>) {
        let end = offset + PREFIX + body.len() as u64;
        self.position = end;
        match opcode {
            op::MESSAGE_INDEX => {
                self.hash_record(opcode, &body);
                if !self.index_is_right(&body) {
                    self.leave_out(offset, end, 0, Cause::Index);
                }
            }
            op::DATA_END => {
                let (stored, counted) = (
                    body.first_chunk::<4>()
                        .map_or(0, |crc| u32::from_le_bytes(*crc)),
                    self.checksum.take().map(crc32fast::Hasher::finalize),
                );
                self.data_confirmed = stored != 0 && counted == Some(stored);
                if stored != 0 && counted.is_some_and(|counted| counted != stored) {
                    self.pending.push_back(Item::Damage(Damage {
                        offset: 0,
                        length: 0,
                        chunks: 0,
                        cause: Cause::DataSection,
                    }));
                }
                self.in_summary = true;
                self.checksum = Some(crc32fast::Hasher::new());
            }
            op::FOOTER => {
                let data = false;
                let (opcode, chunk) = (Some(opcode), None);
                self.ending = Some(Ending::Cut {
                    offset,
                    opcode,
                    chunk,
                    data,
                });
            }
            _ => {
                self.hash_record(opcode, &body);
                self.pending.push_back(Item::Record {
                    opcode,
                    offset,
                    body,
                });
            }
        }
    }

    /// Whether an index is that of the chunk before it, which is not known if that chunk is lost.
    fn index_is_right(&mut self, body: &[u8]) -> bool {
        let Some(Record::MessageIndex(index)) = parse(op::MESSAGE_INDEX, body) else {
            return false;
        };
        let Some(mut expected) = self.indexes.remove(&index.channel_id) else {
            return index.records.is_empty() || self.indexes.is_empty();
        };
        let mut found: Vec<(u64, u64)> = index
            .records
            .iter()
            .map(|entry| (entry.log_time, entry.offset))
            .collect();
        expected.sort_unstable();
        found.sort_unstable();
        found == expected
    }

    /// A record of the summary, or the footer.
    fn summary_record(&mut self, offset: u64) -> std::io::Result<()> {
        let cut = Ending::Cut {
            offset,
            opcode: Some(op::FOOTER),
            chunk: None,
            data: false,
        };
        let Framed::Record { opcode, body } = self.framed(offset)? else {
            self.ending = Some(cut);
            return Ok(());
        };
        self.position = offset + PREFIX + body.len() as u64;
        if opcode != op::FOOTER {
            self.hash_record(opcode, &body);
            return Ok(());
        }
        self.hash_record(opcode, &body[..16]);
        let stored = body[16..]
            .first_chunk::<4>()
            .map_or(0, |crc| u32::from_le_bytes(*crc));
        let counted = self.checksum.take().map_or(0, crc32fast::Hasher::finalize);
        let magic = self
            .scanner
            .read_at(self.position, MAGIC.len() as u64 + 1)?;
        let whole = magic == MAGIC && (stored == 0 || stored == counted);
        self.ending = Some(if whole { Ending::Closed } else { cut });
        Ok(())
    }

    pub(super) fn leave_out(&mut self, offset: u64, end: u64, chunks: u64, cause: Cause) {
        self.checksum = None;
        self.indexes.clear();
        self.position = end;
        self.pending.push_back(Item::Damage(Damage {
            offset,
            length: end - offset,
            chunks,
            cause,
        }));
    }

    fn hash(&mut self, bytes: &[u8]) {
        if let Some(checksum) = &mut self.checksum {
            checksum.update(bytes);
        }
    }

    fn hash_record(&mut self, opcode: u8, body: &[u8]) {
        let length = if opcode == op::FOOTER {
            20
        } else {
            body.len() as u64
        };
        self.hash(&[opcode]);
        self.hash(&length.to_le_bytes());
        self.hash(body);
    }

    /// Whether the data section has a checksum and it is right.
    pub(crate) fn data_confirmed(&self) -> bool {
        self.data_confirmed
    }

    /// Returns the file.
    pub(crate) fn into_scanner(self) -> Scanner<R> {
        self.scanner
    }

    /// End of the data section, if the file ends in an intact footer after an intact summary.
    fn data_end_of_footer(&mut self) -> std::io::Result<Option<u64>> {
        let Some((start, _)) = summary(&mut self.scanner, self.bound)? else {
            return Ok(None);
        };
        let Some(end) = start.checked_sub(PREFIX + 4) else {
            return Ok(None);
        };
        let is_there = self.scanner.prefix(end)? == Some((op::DATA_END, 4));
        Ok(is_there.then_some(end))
    }
}

/// Start of the summary of a closed file, and its bytes, if its checksum is right.
pub(crate) fn summary<R: Read + Seek>(
    scanner: &mut Scanner<R>,
    bound: u64,
) -> std::io::Result<Option<(u64, Vec<u8>)>> {
    let Some(footer_start) = scanner.length().checked_sub(FOOTER_LENGTH) else {
        return Ok(None);
    };
    let tail = scanner.read_at(footer_start, FOOTER_LENGTH)?;
    let footer = tail
        .ends_with(MAGIC)
        .then(|| split_record(&tail))
        .flatten()
        .and_then(|(opcode, body, _)| parse(opcode, body));
    let Some(Record::Footer(footer)) = footer else {
        return Ok(None);
    };
    let length = footer_start.saturating_sub(footer.summary_start);
    if footer.summary_start == 0 || length == 0 || length > bound {
        return Ok(None);
    }
    let mut summary = scanner.read_at(footer.summary_start, length)?;
    // The checksum covers the summary and the footer up to itself.
    summary.extend_from_slice(&tail[..PREFIX as usize + 16]);
    if footer.summary_crc != 0 && crc32fast::hash(&summary) != footer.summary_crc {
        return Ok(None);
    }
    summary.truncate(length as usize);
    Ok(Some((footer.summary_start, summary)))
}

/// End of the file without zeros after a power cut.
fn written<R: Read + Seek>(scanner: &mut Scanner<R>) -> std::io::Result<u64> {
    let length = scanner.length();
    let mut end = length;
    while end > length.saturating_sub(ZEROS_MAX) {
        let start = end.saturating_sub(1 << 16);
        let block = scanner.read_at(start, end - start)?;
        if let Some(last) = block.iter().rposition(|byte| *byte != 0) {
            end = start + last as u64 + 1;
            break;
        }
        end = start;
    }
    Ok(if length - end >= ZERO_TAIL {
        end
    } else {
        length
    })
}

impl Chunk {
    /// Whether its records may be returned.
    pub(crate) fn is_confirmed(&self) -> bool {
        self.proof == Proof::Checksum || self.records.is_empty()
    }
}
