//! Values of their own length: four bytes of length and the bytes.

use std::collections::HashMap;
use std::io::{Read, Seek};

use super::block::File;
use super::data::{Stream, record_id};
use crate::can_log::Error;
use crate::can_log::bytes::u32_at;
use crate::can_log::defects::Defects;

/// Largest number of times that the values are read from their start again.
const REWINDS_MAX: u32 = 64;

/// Where values lie between the records of other groups.
#[derive(Clone)]
pub(super) struct InGroup {
    /// Number of the group of the values.
    pub id: u64,
    /// Bytes of a group's number.
    pub id_len: usize,
    /// Length of the records of the groups; `None`: values of their own length.
    pub lengths: HashMap<u64, Option<u64>>,
}

/// The values of a channel.
pub(super) struct Values {
    stream: Stream,
    group: Option<InGroup>,
    /// Offset of the next value.
    next: u64,
    rewinds: u32,
}

impl Values {
    /// The values of data blocks that have nothing else, or of a group in data blocks with records.
    pub fn new(first: u64, group: Option<InGroup>) -> Self {
        Self {
            stream: Stream::new(first),
            group,
            next: 0,
            rewinds: 0,
        }
    }

    /// Offset of the value of a record, which states `stated`.
    pub const fn offset<R>(&self, file: &File<'_, R>, stated: u64, index: u64) -> u64 {
        if file.by_order && self.group.is_some() {
            index
        } else {
            stated
        }
    }

    /// Up to `limit` bytes of the value at an offset.
    pub fn get<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        offset: u64,
        limit: u64,
    ) -> Result<Option<Vec<u8>>, Error> {
        if offset < self.next {
            if self.rewinds == REWINDS_MAX {
                return Ok(None);
            }
            self.rewinds += 1;
            self.next = 0;
            self.stream.rewind();
        }
        let Some(head) = self.find(file, defects, offset)? else {
            return Ok(None);
        };
        let Some(bytes) = self.stream.peek(file, defects, head + 4)? else {
            return Ok(None);
        };
        let len = u64::from(u32_at(bytes, head)).min(limit) as usize;
        let bytes = self.stream.peek(file, defects, head + 4 + len)?;
        Ok(bytes.map(|bytes| bytes[head + 4..].to_vec()))
    }

    /// Goes to the value at an offset. Returns the number of bytes before its length.
    fn find<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        offset: u64,
    ) -> Result<Option<usize>, Error> {
        let Self {
            stream,
            group,
            next,
            ..
        } = self;
        let Some(group) = group else {
            let found = stream.skip(file, defects, offset - *next)?;
            *next = offset;
            return Ok(found.then_some(0));
        };
        while let Some(id) = stream.peek(file, defects, group.id_len)? {
            let id = record_id(id);
            let len = match group.lengths.get(&id) {
                Some(Some(len)) => *len,
                Some(None) => {
                    if id == group.id && *next >= offset {
                        return Ok((*next == offset).then_some(group.id_len));
                    }
                    let Some(bytes) = stream.peek(file, defects, group.id_len + 4)? else {
                        break;
                    };
                    let len = 4 + u64::from(u32_at(bytes, group.id_len));
                    if id == group.id {
                        *next += if file.by_order { 1 } else { len };
                    }
                    len
                }
                None => break,
            };
            if !stream.skip(file, defects, len.saturating_add(group.id_len as u64))? {
                break;
            }
        }
        Ok(None)
    }
}
