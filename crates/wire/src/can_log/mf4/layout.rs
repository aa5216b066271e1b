//! Data groups, channel groups and channels of a file.

use std::collections::HashSet;
use std::io::{Read, Seek};

use super::block::File;
use super::channel::Channel;
use crate::can_log::Error;
use crate::can_log::bytes::{u8_at, u16_at, u32_at, u64_at};
use crate::can_log::defects::Defects;

/// Deepest nesting of channels that are parts of channels.
const DEPTH_MAX: u32 = 8;
/// Largest number of elements of an array that become columns.
const ELEMENTS_MAX: u64 = 4096;
/// Group flag: the records are values of their own length.
const VARIABLE_LENGTH: u16 = 1;

/// Groups that share data blocks.
pub(super) struct DataGroup {
    /// Bytes of the group's number before each record: 0, 1, 2, 4 or 8.
    pub record_id_len: usize,
    /// First data block.
    pub data: u64,
    pub groups: Vec<Group>,
}

/// Records of one kind.
pub(super) struct Group {
    /// Place in the file.
    pub place: u64,
    pub record_id: u64,
    /// Number of records; not valid in an unfinished file.
    pub records: u64,
    /// The records are values of their own length: four bytes of length and the bytes.
    pub variable_length: bool,
    /// Bytes of a record with its invalidation bits, without the group's number.
    pub record_len: u64,
    /// Start of the invalidation bits, bytes.
    pub invalidation: usize,
    pub name: Option<String>,
    pub channels: Vec<Channel>,
}

/// Reads the layout of a file.
pub(super) fn read<R: Read + Seek>(
    file: &mut File<'_, R>,
    defects: &mut Defects,
    first: u64,
) -> Result<Vec<DataGroup>, Error> {
    let mut layout = Layout {
        elements_rest: file.length / 8,
        file,
        defects,
        seen: HashSet::new(),
    };
    let mut data_groups = Vec::new();
    let mut place = first;
    while layout.is_new(place) {
        let Some(block) = layout.file.block(place, *b"DG")? else {
            layout.defects.note("a data group is missing", place);
            break;
        };
        data_groups.push(DataGroup {
            record_id_len: usize::from(u8_at(&block.data, 0)),
            data: block.link(2),
            groups: layout.groups(block.link(1))?,
        });
        place = block.link(0);
    }
    Ok(data_groups)
}

struct Layout<'f, 'r, R> {
    file: &'f mut File<'r, R>,
    defects: &'f mut Defects,
    /// Blocks that were read: each belongs to one list.
    seen: HashSet<u64>,
    /// Elements of arrays that may still become columns: a file has at least eight bytes for one.
    elements_rest: u64,
}

impl<R: Read + Seek> Layout<'_, '_, R> {
    /// Whether there is a block at the place of a link, read for the first time.
    fn is_new(&mut self, place: u64) -> bool {
        if place == 0 {
            return false;
        }
        let new = self.seen.insert(place);
        if !new {
            self.defects.note("a list of blocks leads to itself", place);
        }
        new
    }

    fn groups(&mut self, first: u64) -> Result<Vec<Group>, Error> {
        let mut groups = Vec::new();
        let mut place = first;
        while self.is_new(place) {
            let Some(block) = self.file.block(place, *b"CG")? else {
                self.defects.note("a channel group is missing", place);
                break;
            };
            let data = &block.data;
            let [data_len, invalidation_len] = [24, 28].map(|at| u64::from(u32_at(data, at)));
            let mut channels = Vec::new();
            self.channels(block.link(1), None, 0, &mut channels)?;
            let name = match self.file.text(block.link(2))? {
                Some(name) if !name.is_empty() => Some(name),
                _ => self.source_name(block.link(3))?,
            };
            groups.push(Group {
                place,
                record_id: u64_at(data, 0),
                records: u64_at(data, 8),
                variable_length: u16_at(data, 16) & VARIABLE_LENGTH != 0,
                record_len: data_len + invalidation_len,
                invalidation: data_len as usize,
                name,
                channels,
            });
            place = block.link(0);
        }
        Ok(groups)
    }

    fn source_name(&mut self, place: u64) -> Result<Option<String>, Error> {
        if place == 0 {
            return Ok(None);
        }
        let Some(source) = self.file.block(place, *b"SI")? else {
            return Ok(None);
        };
        let name = self.file.text(source.link(0))?;
        Ok(name.filter(|name| !name.is_empty()))
    }

    fn channels(
        &mut self,
        first: u64,
        parent: Option<&str>,
        depth: u32,
        channels: &mut Vec<Channel>,
    ) -> Result<(), Error> {
        let mut place = first;
        while self.is_new(place) {
            let Some(block) = self.file.block(place, *b"CN")? else {
                self.defects.note("a channel is missing", place);
                break;
            };
            let mut channel = Channel::read(self.file, &block, parent)?;
            let parts = block.link(1);
            let kind = match self.file.header(parts)? {
                Some(header) if parts != 0 && depth < DEPTH_MAX => Some(header.id),
                _ => None,
            };
            channel.has_parts = matches!(kind.as_ref(), Some(b"CN" | b"CA"));
            let whole = channel.clone();
            channels.push(channel);
            match kind.as_ref() {
                Some(b"CN") => self.channels(parts, Some(&whole.name), depth + 1, channels)?,
                Some(b"CA") => self.elements(parts, &whole, channels)?,
                _ => {}
            }
            place = block.link(0);
        }
        Ok(())
    }

    /// The elements of an array, the last index fastest.
    fn elements(
        &mut self,
        place: u64,
        channel: &Channel,
        channels: &mut Vec<Channel>,
    ) -> Result<(), Error> {
        let Some(block) = self.file.block(place, *b"CA")? else {
            return Ok(());
        };
        let data = &block.data;
        let (storage, dimensions) = (u8_at(data, 1), usize::from(u16_at(data, 2)));
        let stride = u32_at(data, 8);
        let sizes: Vec<u64> = (0..dimensions.min(8))
            .map(|i| u64_at(data, 16 + 8 * i))
            .collect();
        let count = sizes
            .iter()
            .try_fold(1_u64, |count, size| count.checked_mul(*size));
        let largest = ELEMENTS_MAX.min(self.elements_rest);
        if storage != 0 || count.is_none_or(|count| count > largest) {
            self.defects
                .note("an array of another form than a table in the record", place);
            return Ok(());
        }
        let count = count.unwrap_or_default();
        self.elements_rest -= count;
        for element in 0..count {
            let mut rest = element;
            let mut indices = Vec::new();
            for size in sizes.iter().rev() {
                indices.push(rest % size);
                rest /= size;
            }
            let name: String = indices
                .iter()
                .rev()
                .map(|index| format!("[{index}]"))
                .collect();
            channels.push(channel.element(&name, stride.saturating_mul(element as u32)));
        }
        Ok(())
    }
}
