//! The bytes of data blocks one after another: `DT`, `SD`, `DZ`, and lists of them.

use std::collections::HashSet;
use std::io::{Read, Seek};

use super::block::{File, HEADER};
use crate::can_log::Error;
use crate::can_log::bytes::{u8_at, u16_at, u32_at, u64_at};
use crate::can_log::defects::Defects;
use crate::can_log::inflate::{Inflate, PART, Progress};

/// Bytes of an uncompressed data block that are read at a time.
const READ: u64 = 64 * 1024;
/// Largest content of a compressed block, bytes. The standard allows 4 MiB.
const CONTENT_MAX: u64 = 64 * 1024 * 1024;
/// Length of the fields of a `DZ` block, bytes.
const DZ_FIELDS: u64 = 24;

enum Item {
    /// A block of any kind.
    Block(u64),
    /// Bytes of the file.
    Bytes { place: u64, len: u64 },
}

/// The bytes of a list of data blocks.
pub(super) struct Stream {
    first: u64,
    /// What is to be read, the next one last.
    items: Vec<Item>,
    buffer: Vec<u8>,
    /// Start of the unread bytes in `buffer`.
    start: usize,
    /// Bytes since the start of the stream.
    pub position: u64,
    /// Bytes of the file that were read.
    read: u64,
    /// Lists that were read: a list that leads to itself is read once.
    lists: HashSet<u64>,
}

impl Stream {
    pub fn new(first: u64) -> Self {
        Self {
            first,
            items: if first == 0 {
                Vec::new()
            } else {
                vec![Item::Block(first)]
            },
            buffer: Vec::new(),
            start: 0,
            position: 0,
            read: 0,
            lists: HashSet::new(),
        }
    }

    /// Begins again.
    pub fn rewind(&mut self) {
        *self = Self::new(self.first);
    }

    /// The next `len` bytes, which stay unread; `None` if the stream ends before.
    pub fn peek<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        len: usize,
    ) -> Result<Option<&[u8]>, Error> {
        while self.buffer.len() - self.start < len {
            if !self.fill(file, defects)? {
                return Ok(None);
            }
        }
        Ok(Some(&self.buffer[self.start..self.start + len]))
    }

    /// Number of bytes that are read but not taken.
    pub fn rest(&self) -> usize {
        self.buffer.len() - self.start
    }

    /// Passes over bytes. Returns whether the stream has them.
    pub fn skip<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        mut len: u64,
    ) -> Result<bool, Error> {
        loop {
            let step = len.min(self.rest() as u64);
            self.start += step as usize;
            self.position += step;
            len -= step;
            if len == 0 {
                return Ok(true);
            }
            if !self.fill(file, defects)? {
                return Ok(false);
            }
        }
    }

    /// Appends to the buffer. Returns `false` at the end.
    fn fill<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
    ) -> Result<bool, Error> {
        self.buffer.drain(..self.start);
        self.start = 0;
        while let Some(item) = self.items.pop() {
            let before = self.buffer.len();
            match item {
                Item::Block(place) => self.open(file, defects, place)?,
                Item::Bytes { place, len } => {
                    let read = file.read_into(place, len.min(READ), &mut self.buffer)? as u64;
                    self.read += read;
                    if read == 0 && !file.unfinished {
                        defects.note("the file ends inside a data block", place);
                    } else if read > 0 && len > read {
                        let (place, len) = (place + read, len - read);
                        self.items.push(Item::Bytes { place, len });
                    }
                }
            }
            if self.read > file.length {
                defects.note("the lists of data blocks name blocks twice", self.first);
                self.items.clear();
            }
            if self.buffer.len() > before {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn open<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        place: u64,
    ) -> Result<(), Error> {
        let Some(header) = file.header(place)? else {
            defects.note("a data block is missing", place);
            return Ok(());
        };
        match &header.id {
            b"DT" | b"SD" | b"RD" => {
                let place = place + HEADER;
                let mut len = header.length.saturating_sub(HEADER);
                if len == 0 && file.unfinished && file.header(place)?.is_none() {
                    // The length of the last block of an unfinished file is not valid.
                    len = file.length.saturating_sub(place);
                }
                if len > 0 {
                    self.items.push(Item::Bytes { place, len });
                }
            }
            b"DZ" => self.inflate(file, defects, place)?,
            b"HL" | b"DL" => {
                if !self.lists.insert(place) {
                    defects.note("a list of data blocks leads to itself", place);
                } else if let Some(list) = file.block(place, header.id)? {
                    // The first link is the next list.
                    let blocks = list.links.iter().rev().filter(|link| **link != 0);
                    if header.id == *b"HL" {
                        self.items.extend(blocks.map(|link| Item::Block(*link)));
                    } else if let Some((next, _)) = list.links.split_first() {
                        if *next != 0 {
                            self.items.push(Item::Block(*next));
                        }
                        let blocks = list.links[1..].iter().rev().filter(|link| **link != 0);
                        self.items.extend(blocks.map(|link| Item::Block(*link)));
                    }
                }
            }
            id => {
                let id = id.escape_ascii();
                defects.note(format!("data blocks of the unknown kind `{id}`"), place);
            }
        }
        Ok(())
    }

    fn inflate<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        place: u64,
    ) -> Result<(), Error> {
        let fields = file.read_at(place + HEADER, DZ_FIELDS)?;
        let (method, columns) = (u8_at(&fields, 2), u32_at(&fields, 4));
        let (content_len, len) = (u64_at(&fields, 8), u64_at(&fields, 16));
        if method > 1 {
            defects.note(format!("data blocks with the compression {method}"), place);
            return Ok(());
        }
        if content_len > CONTENT_MAX {
            defects.note("a compressed block claims more than 64 MiB", place);
            return Ok(());
        }
        let mut content = Vec::new();
        let (mut inflate, mut part) = (Inflate::new(), Vec::new());
        let (mut at, end) = (place + HEADER + DZ_FIELDS, len.min(file.length));
        let end = at.saturating_add(end);
        let mut complete = false;
        while at < end && content.len() as u64 <= content_len {
            part.clear();
            let read = file.read_into(at, (end - at).min(PART as u64), &mut part)?;
            at += read as u64;
            self.read += read as u64;
            match inflate.push(&part, &mut content) {
                Progress::More if read > 0 => {}
                Progress::More | Progress::Damaged => break,
                Progress::End(_) => {
                    complete = true;
                    break;
                }
            }
        }
        if !complete || content.len() as u64 != content_len {
            defects.note("the compressed data of a block is damaged or cut", place);
            content.truncate(content_len as usize);
        }
        if method == 1 {
            if !complete {
                // The start of every column but the first ones is missing.
                return Ok(());
            }
            content = transposed(&content, columns as usize);
        }
        self.buffer.extend_from_slice(&content);
        Ok(())
    }
}

/// Rows of a table whose columns are stored one after another. Bytes behind the last whole row stay
/// where they are.
fn transposed(columns: &[u8], row_len: usize) -> Vec<u8> {
    if row_len == 0 {
        return columns.to_vec();
    }
    let rows = columns.len() / row_len;
    let mut table = Vec::with_capacity(columns.len());
    for row in 0..rows {
        table.extend((0..row_len).map(|column| columns[column * rows + row]));
    }
    table.extend_from_slice(&columns[rows * row_len..]);
    table
}

/// Number of a record's group.
pub(super) fn record_id(bytes: &[u8]) -> u64 {
    match bytes.len() {
        1 => u64::from(u8_at(bytes, 0)),
        2 => u64::from(u16_at(bytes, 0)),
        4 => u64::from(u32_at(bytes, 0)),
        _ => u64_at(bytes, 0),
    }
}
