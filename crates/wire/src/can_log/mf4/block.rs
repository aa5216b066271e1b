//! Blocks of the file: header, links and data.

use std::io::{Read, Seek, SeekFrom};

use crate::can_log::Error;
use crate::can_log::bytes::u64_at;

/// Length of a block's header, bytes.
pub(super) const HEADER: u64 = 24;
/// Longest block that is read as a whole, bytes. Larger ones are data blocks, which are read in parts,
/// or damaged.
const BLOCK_MAX: u64 = 64 * 1024 * 1024;

/// The file.
pub(super) struct File<'r, R> {
    input: &'r mut R,
    pub length: u64,
    /// The file was not closed: counters and lengths are not valid.
    pub unfinished: bool,
    /// Offsets of values in groups of their own are not valid: the values have the order of the records
    /// that they belong to.
    pub by_order: bool,
    /// Bytes of blocks that may still be read: blocks that many links lead to are read often.
    rest: u64,
}

/// Header of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header {
    /// The two letters behind `##`.
    pub id: [u8; 2],
    /// Length of the block by its header, bytes.
    pub length: u64,
    pub links: u64,
}

/// A block that describes something.
#[derive(Debug)]
pub(super) struct Block {
    pub links: Vec<u64>,
    pub data: Vec<u8>,
}

impl Block {
    /// A link; 0 if the block has no such link.
    pub fn link(&self, index: usize) -> u64 {
        self.links.get(index).copied().unwrap_or_default()
    }
}

impl<'r, R: Read + Seek> File<'r, R> {
    pub fn new(input: &'r mut R) -> Result<Self, Error> {
        let length = input.seek(SeekFrom::End(0))?;
        Ok(Self {
            input,
            length,
            unfinished: false,
            by_order: false,
            rest: length.saturating_mul(16).saturating_add(16 * 1024 * 1024),
        })
    }

    /// Appends up to `len` bytes at a place to `output`: fewer at the end of the file. Returns their
    /// number.
    pub fn read_into(
        &mut self,
        place: u64,
        len: u64,
        output: &mut Vec<u8>,
    ) -> Result<usize, Error> {
        if place >= self.length {
            return Ok(0);
        }
        self.input.seek(SeekFrom::Start(place))?;
        Ok((&mut *self.input).take(len).read_to_end(output)?)
    }

    pub fn read_at(&mut self, place: u64, len: u64) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::new();
        self.read_into(place, len, &mut bytes)?;
        Ok(bytes)
    }

    /// Header of the block at a place; `None` if there is no block.
    pub fn header(&mut self, place: u64) -> Result<Option<Header>, Error> {
        let bytes = self.read_at(place, HEADER)?;
        if (bytes.len() as u64) < HEADER || !bytes.starts_with(b"##") {
            return Ok(None);
        }
        Ok(Some(Header {
            id: [bytes[2], bytes[3]],
            length: u64_at(&bytes, 8),
            links: u64_at(&bytes, 16),
        }))
    }

    /// The block of a kind at a place; `None` if there is no such block. A block that the end of the
    /// file cuts has fewer bytes.
    pub fn block(&mut self, place: u64, id: [u8; 2]) -> Result<Option<Block>, Error> {
        let header = match self.header(place)? {
            Some(header) if header.id == id => header,
            _ => return Ok(None),
        };
        let len = header.length.saturating_sub(HEADER).min(BLOCK_MAX);
        let len = len.min(self.length.saturating_sub(place));
        let Some(rest) = self.rest.checked_sub(len + HEADER) else {
            return Ok(None);
        };
        self.rest = rest;
        let bytes = self.read_at(place + HEADER, len)?;
        let Some(links_len) = header.links.checked_mul(8) else {
            return Ok(None);
        };
        if links_len > bytes.len() as u64 {
            return Ok(None);
        }
        let (links, data) = bytes.split_at(links_len as usize);
        Ok(Some(Block {
            links: links.chunks_exact(8).map(|link| u64_at(link, 0)).collect(),
            data: data.to_vec(),
        }))
    }

    /// The text of a `TX` block, or of the `TX` element of an `MD` block.
    pub fn text(&mut self, place: u64) -> Result<Option<String>, Error> {
        if place == 0 {
            return Ok(None);
        }
        let (block, markup) = match self.block(place, *b"TX")? {
            Some(block) => (Some(block), false),
            None => (self.block(place, *b"MD")?, true),
        };
        let Some(block) = block else {
            return Ok(None);
        };
        let end = block.data.iter().position(|byte| *byte == 0);
        let bytes = &block.data[..end.unwrap_or(block.data.len())];
        let text = String::from_utf8_lossy(bytes).into_owned();
        if !markup {
            return Ok(Some(text));
        }
        let inner = text
            .split_once("<TX>")
            .and_then(|(_, rest)| rest.split_once("</TX>"));
        Ok(inner.map(|(inner, _)| inner.to_owned()))
    }
}
