//! Measured signals: each channel group is a table, each record a row.

use std::collections::{BTreeMap, HashMap};
use std::io::{Read, Seek};
use std::ops::ControlFlow;

use super::block::File;
use super::channel::{Channel, Kind, Raw, Record};
use super::conversion::Physical;
use super::data::{Stream, record_id};
use super::layout::{DataGroup, Group};
use super::values::{InGroup, Values};
use crate::can_log::Error;
use crate::can_log::bytes::u32_at;
use crate::can_log::defects::Defects;

/// Longest record, bytes. Longer ones are damage.
const RECORD_MAX: u64 = 16 * 1024 * 1024;
/// Longest text that is read, bytes.
const TEXT_MAX: u64 = 1024 * 1024;

/// One column of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name of the channel.
    pub name: String,
    /// Unit as it is in the file.
    pub unit: Option<String>,
    /// The column is the axis of the table: mostly time since the start, s.
    pub is_master: bool,
}

/// One table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name of the channel group.
    pub name: Option<String>,
    /// Columns in the order of the file.
    pub columns: Vec<Column>,
}

/// One value.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// The value, through the conversion of its channel.
    pub physical: Physical,
    /// Whether the file marks the value as valid.
    pub is_valid: bool,
}

/// Where the rows of a table are.
struct Place {
    data_group: usize,
    group: usize,
}

/// The tables of a file.
pub struct Tables<'r, R> {
    file: File<'r, R>,
    data_groups: Vec<DataGroup>,
    places: Vec<Place>,
    tables: Vec<Table>,
    start_ns: Option<i64>,
    defects: Defects,
}

/// Takes the rows of a table; `Break` ends the reading.
pub type RowSink<'s> = dyn FnMut(&[Value]) -> ControlFlow<()> + 's;

impl<'r, R: Read + Seek> Tables<'r, R> {
    /// Reads the layout of a file. Parts of channels and elements of arrays are columns; a channel that
    /// has parts is none.
    ///
    /// # Errors
    /// The file cannot be read; it is no MDF file, or an MDF 3 file; its header block is damaged.
    pub fn open(input: &'r mut R) -> Result<Self, Error> {
        let mut file = File::new(input)?;
        let mut defects = Defects::default();
        let (data_groups, start_ns) = super::open(&mut file, &mut defects)?;
        let (mut places, mut tables) = (Vec::new(), Vec::new());
        for (data_group, groups) in data_groups.iter().enumerate() {
            for (number, group) in groups.groups.iter().enumerate() {
                if group.variable_length {
                    continue;
                }
                places.push(Place {
                    data_group,
                    group: number,
                });
                let columns = columns(group).map(|channel| Column {
                    name: channel.name.clone(),
                    unit: channel.unit.clone(),
                    is_master: channel.is_master(),
                });
                tables.push(Table {
                    name: group.name.clone(),
                    columns: columns.collect(),
                });
            }
        }
        Ok(Self {
            file,
            data_groups,
            places,
            tables,
            start_ns,
            defects,
        })
    }

    /// The tables in the order of the file.
    #[must_use]
    pub fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// Start of the measurement, UNIX time in ns; `None`: not in the file.
    #[must_use]
    pub const fn start_ns(&self) -> Option<i64> {
        self.start_ns
    }

    /// Gives the rows of a table. There is no row if the file has no such table.
    ///
    /// # Errors
    /// The file cannot be read. Every other defect is counted.
    pub fn rows(&mut self, table: usize, sink: &mut RowSink<'_>) -> Result<(), Error> {
        let Some(place) = self.places.get(table) else {
            return Ok(());
        };
        let data_group = &self.data_groups[place.data_group];
        let group = &data_group.groups[place.group];
        let mut rows = Rows::new(data_group, group, self.file.unfinished);
        loop {
            match rows.next(&mut self.file, &mut self.defects)? {
                Next::End => return Ok(()),
                Next::Other => {}
                Next::Row(row) => {
                    if sink(&row).is_break() {
                        return Ok(());
                    }
                }
            }
        }
    }

    /// Defects that were found up to now, in plain words.
    #[must_use]
    pub fn into_defects(self) -> Vec<String> {
        self.defects.sentences()
    }
}

fn columns(group: &Group) -> impl Iterator<Item = &Channel> {
    let is_column = |channel: &&Channel| !channel.has_parts && channel.kind != Kind::Other;
    group.channels.iter().filter(is_column)
}

enum Next {
    Row(Vec<Value>),
    /// A record of another group.
    Other,
    End,
}

struct Rows<'g> {
    stream: Stream,
    record_id_len: usize,
    record_id: u64,
    /// Length of the records of the data group's groups; `None`: values of their own length.
    lengths: HashMap<u64, Option<u64>>,
    channels: Vec<&'g Channel>,
    /// Values of their own length, by column.
    values: BTreeMap<usize, Values>,
    invalidation: usize,
    rest: u64,
    index: u64,
    place: u64,
}

impl<'g> Rows<'g> {
    fn new(data_group: &'g DataGroup, group: &'g Group, unfinished: bool) -> Self {
        let single = data_group.record_id_len == 0;
        let id_of = |group: &Group| if single { 0 } else { group.record_id };
        let length = |group: &Group| (!group.variable_length).then_some(group.record_len);
        let channels: Vec<_> = columns(group).collect();
        let groups = &data_group.groups;
        let lengths: HashMap<_, _> = groups.iter().map(|g| (id_of(g), length(g))).collect();
        let values_of = |channel: &Channel| {
            let of_channel = |group: &&Group| group.variable_length && group.place == channel.data;
            let in_group = groups.iter().find(of_channel).map(|group| InGroup {
                id: group.record_id,
                id_len: data_group.record_id_len,
                lengths: lengths.clone(),
            });
            let first = if in_group.is_some() {
                data_group.data
            } else {
                channel.data
            };
            Values::new(first, in_group)
        };
        let values = channels.iter().enumerate();
        let values = values.filter(|(_, channel)| channel.kind == Kind::VariableLength);
        let values = values
            .map(|(column, channel)| (column, values_of(channel)))
            .collect();
        Self {
            stream: Stream::new(data_group.data),
            record_id_len: data_group.record_id_len,
            record_id: id_of(group),
            lengths,
            values,
            channels,
            invalidation: group.invalidation,
            rest: if unfinished { u64::MAX } else { group.records },
            index: 0,
            place: data_group.data,
        }
    }

    fn next<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
    ) -> Result<Next, Error> {
        let id_len = self.record_id_len;
        if self.rest == 0 || !matches!(id_len, 0 | 1 | 2 | 4 | 8) {
            return Ok(Next::End);
        }
        let Some(id) = self.stream.peek(file, defects, id_len)? else {
            return Ok(Next::End);
        };
        let id = if id_len == 0 { 0 } else { record_id(id) };
        let len = match self.lengths.get(&id) {
            Some(Some(len)) => *len,
            Some(None) => {
                let Some(bytes) = self.stream.peek(file, defects, id_len + 4)? else {
                    return Ok(Next::End);
                };
                4 + u64::from(u32_at(bytes, id_len))
            }
            None => {
                let kind = "a record of an unknown group; the rest of its data is not readable";
                defects.note(kind, self.place);
                return Ok(Next::End);
            }
        };
        let wide = len + id_len as u64;
        if wide == 0 {
            return self.empty(file, defects);
        }
        if id != self.record_id || wide > RECORD_MAX {
            let whole = self.stream.skip(file, defects, wide)?;
            return Ok(if whole { Next::Other } else { Next::End });
        }
        let Some(bytes) = self.stream.peek(file, defects, wide as usize)? else {
            if self.stream.rest() > 0 {
                defects.note("the data ends inside a record", self.place);
            }
            return Ok(Next::End);
        };
        let bytes = bytes[id_len..].to_vec();
        self.stream.skip(file, defects, wide)?;
        Ok(Next::Row(self.row(file, defects, &bytes)?))
    }

    /// A row of a group whose channels are all virtual: it has no bytes.
    fn empty<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
    ) -> Result<Next, Error> {
        // More rows than the file has bytes are damage.
        if self.index >= file.length || file.unfinished {
            defects.note("records without bytes", self.place);
            return Ok(Next::End);
        }
        Ok(Next::Row(self.row(file, defects, &[])?))
    }

    fn row<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        bytes: &[u8],
    ) -> Result<Vec<Value>, Error> {
        let record = Record {
            bytes,
            invalidation: self.invalidation,
            index: self.index,
        };
        self.index += 1;
        self.rest -= 1;
        let mut row = Vec::with_capacity(self.channels.len());
        for (column, channel) in self.channels.iter().enumerate() {
            let physical = match (channel.raw(record), self.values.get_mut(&column)) {
                (Some(Raw::Unsigned(offset)), Some(values)) => {
                    let offset = values.offset(file, offset, record.index);
                    match values.get(file, defects, offset, TEXT_MAX)? {
                        Some(bytes) => channel.physical(Raw::Bytes(&bytes)),
                        None => Physical::Unknown,
                    }
                }
                (Some(raw), _) => channel.physical(raw),
                (None, _) => Physical::Unknown,
            };
            if physical == Physical::Unknown {
                defects.note(
                    format!("values of `{}` that are not readable", channel.name),
                    self.place,
                );
            }
            row.push(Value {
                physical,
                is_valid: channel.is_valid(record),
            });
        }
        Ok(row)
    }
}
