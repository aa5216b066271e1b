//! Continuation of a walk behind a damaged record, or at a file end inside of a record.

use std::io::{Read, Seek};

use mcap::records::op;

use super::chunk;
use super::search::repaired;
use super::walk::Framed;
use super::{Cause, Chunk, Ending, Fields, Item, PREFIX, Walker, is_known, parse};

impl<R: Read + Seek> Walker<R> {
    /// The file ends before the record at `offset` does.
    pub(super) fn short(&mut self, offset: u64, opcode: Option<u8>) -> std::io::Result<()> {
        if opcode.is_none_or(|opcode| opcode == op::CHUNK)
            && let Some(found) = repaired(&mut self.scanner, self.bound, offset)?
        {
            self.take_repaired(offset, found.end, found.chunk);
            return Ok(());
        }
        let mut chunks = 0;
        if let Some(next) = self.search(offset + 1, self.scanner.length(), &mut chunks)? {
            let lost = chunks + u64::from(opcode == Some(op::CHUNK));
            self.leave_out(offset, next, lost, Cause::Chunk);
            return Ok(());
        }
        self.cut(offset, opcode)
    }

    /// No intact record follows: the file was cut here, or the rest is damaged.
    fn cut(&mut self, offset: u64, opcode: Option<u8>) -> std::io::Result<()> {
        let rest = self.scanner.length() - offset;
        let body = self
            .scanner
            .read_at(offset + PREFIX, rest.min(self.bound))?;
        let length = self.scanner.prefix(offset)?.map(|(_, length)| length);
        let plausible = match (opcode, length) {
            (_, _) if offset >= self.written => true,
            (Some(op::CHUNK), Some(length)) => match chunk::header(&body) {
                Some((header, _)) => chunk::adds_up(&header, length),
                None => true,
            },
            (Some(op::MESSAGE_INDEX), Some(length)) => Fields(&body).take(6).is_none_or(|head| {
                let list = u32::from_le_bytes([head[2], head[3], head[4], head[5]]);
                u64::from(list) + 6 == length
            }),
            (Some(_), Some(length)) => length <= self.bound,
            (opcode, None) => opcode.is_some() || offset >= self.written,
            (None, Some(_)) => false,
        };
        if plausible {
            let index = opcode.is_some_and(|opcode| {
                (op::MESSAGE_INDEX..=op::CHUNK_INDEX).contains(&opcode)
                    || (op::ATTACHMENT_INDEX..=op::STATISTICS).contains(&opcode)
                    || (op::METADATA_INDEX..=op::DATA_END).contains(&opcode)
                    || opcode == op::FOOTER
            });
            self.ending = Some(Ending::Cut {
                offset,
                opcode,
                chunk: (opcode == Some(op::CHUNK)).then_some(body),
                data: !index,
            });
        } else {
            let lost = u64::from(self.indexes.is_empty());
            self.leave_out(offset, self.scanner.length(), lost, Cause::Chunk);
            self.ending = Some(Ending::Unfinished);
        }
        Ok(())
    }

    /// Finds the next intact record after the damaged record at `offset`.
    pub(super) fn damaged(
        &mut self,
        offset: u64,
        cause: Cause,
        end: Option<u64>,
    ) -> std::io::Result<()> {
        if let Some(found) = repaired(&mut self.scanner, self.bound, offset)? {
            self.take_repaired(offset, found.end, found.chunk);
            return Ok(());
        }
        if let Some((end, body)) = self.repaired_metadata(offset)? {
            self.leave_out(offset, offset + PREFIX, 0, Cause::Record);
            self.position = end;
            let opcode = op::METADATA;
            self.pending.push_back(Item::Record {
                opcode,
                offset,
                body,
            });
            return Ok(());
        }
        let is_chunk = !matches!(cause, Cause::Record | Cause::Magic | Cause::Index);
        // Zeros after a power cut may reach into the record.
        if let Some(end) = end.filter(|end| *end <= self.written)
            && self.goes_on_at(end)?
        {
            self.leave_out(offset, end, u64::from(is_chunk), cause);
            return Ok(());
        }
        // The record behind a damaged chunk is a chunk, unless its indexes follow.
        let mut chunks = u64::from(is_chunk || self.indexes.is_empty());
        let limit = self.data_end.filter(|end| *end > offset);
        let limit = limit.unwrap_or(self.scanner.length());
        let next = self.search(offset + 1, limit, &mut chunks)?;
        if next.is_none()
            && limit == self.scanner.length()
            && end.is_none_or(|end| end >= self.written)
        {
            let opcode = self.scanner.prefix(offset)?.map(|(opcode, _)| opcode);
            return self.cut(offset, opcode.filter(|opcode| is_known(*opcode)));
        }
        self.leave_out(offset, next.unwrap_or(limit), chunks, cause);
        Ok(())
    }

    /// Whether the bytes at `offset` confirm that the record before ends there.
    fn goes_on_at(&mut self, offset: u64) -> std::io::Result<bool> {
        if offset >= self.scanner.length() {
            return Ok(offset == self.scanner.length());
        }
        Ok(match self.framed(offset)? {
            Framed::Chunk { .. } => true,
            Framed::Record { opcode, body } => match opcode {
                op::MESSAGE_INDEX | op::METADATA => body.len() > 8,
                op::HEADER | op::ATTACHMENT | op::DATA_END => true,
                _ => false,
            },
            _ => false,
        })
    }

    /// End of the metadata record at `offset`, whose opcode or length is damaged, by its contents, if
    /// another record follows there.
    fn repaired_metadata(&mut self, offset: u64) -> std::io::Result<Option<(u64, Vec<u8>)>> {
        let mut body = self.scanner.read_at(offset + PREFIX, 1 << 16)?;
        let mut rest = Fields(&body);
        let Some(name) = rest.blob().filter(|name| name.starts_with(b"atvrec.")) else {
            return Ok(None);
        };
        let Some(map) = rest.blob() else {
            return Ok(None);
        };
        let length = 8 + name.len() + map.len();
        let end = offset + PREFIX + length as u64;
        body.truncate(length);
        let intact = parse(op::METADATA, &body).is_some() && self.goes_on_at(end)?;
        Ok(intact.then_some((end, body)))
    }

    fn take_repaired(&mut self, offset: u64, end: u64, chunk: Chunk) {
        let header = PREFIX + chunk::HEADER_LENGTH;
        self.leave_out(offset, offset + header, 0, Cause::ChunkHeader);
        self.take_chunk(offset, end, chunk);
    }
}
