//! The frames of one data group, in the order of its records.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::io::{Read, Seek};

use super::WINDOW;
use super::block::File;
use super::bus::{Decoded, FrameGroup, put_data};
use super::channel::{Kind, Record};
use super::data::{Stream, record_id};
use super::layout::{DataGroup, Group};
use super::values::Values;
use crate::can_log::bytes::u32_at;
use crate::can_log::defects::Defects;
use crate::can_log::{Entry, Error};

/// Longest record of a frame, bytes. Longer ones are damage.
const RECORD_MAX: u64 = 64 * 1024;
/// Data bytes of a CAN FD frame.
const FRAME_DATA_MAX: u64 = 64;

/// A frame and its place in the order of the file: time, group, record.
pub(super) struct Ready {
    pub key: (i64, usize, u64),
    /// The frame without its channel.
    pub entry: Entry,
    /// Number or name of the channel.
    pub bus: Option<String>,
}

/// The file and what the reader counts.
pub(super) struct Context<'c, 'r, R> {
    pub file: &'c mut File<'r, R>,
    pub defects: &'c mut Defects,
    pub left_out: &'c mut BTreeMap<String, u64>,
}

/// Where the data of a group's frames is.
enum Data {
    InRecord,
    /// In records of the group with this number.
    Group(u64),
    /// In data blocks of its own.
    Blocks(Box<Values>),
}

/// Data of a frame that is not in its record.
enum Found {
    Bytes(Vec<u8>),
    /// Group and offset of data that is still to come.
    Later((u64, u64)),
    Missing,
}

impl Data {
    /// The data of a record that states an offset, by the offset or by the number of the record.
    fn find<R: Read + Seek>(
        &mut self,
        file: &mut File<'_, R>,
        defects: &mut Defects,
        early: &mut BTreeMap<(u64, u64), Vec<u8>>,
        [offset, index]: [u64; 2],
    ) -> Result<Found, Error> {
        Ok(match self {
            Self::InRecord => Found::Missing,
            Self::Group(id) => {
                let key = (*id, if file.by_order { index } else { offset });
                early.remove(&key).map_or(Found::Later(key), Found::Bytes)
            }
            Self::Blocks(values) => {
                let bytes = values.get(file, defects, offset, FRAME_DATA_MAX)?;
                bytes.map_or(Found::Missing, Found::Bytes)
            }
        })
    }
}

/// What the records of a group are.
enum Records {
    Frames {
        group: Box<FrameGroup>,
        data: Data,
        /// Place of the group in the order of the file.
        order: usize,
        invalidation: usize,
    },
    /// Values of their own length; offset of the next one, or its number.
    Values { next: u64, wanted: bool },
    /// Records that are left out, with their name.
    Other(String),
}

struct State {
    records: Records,
    record_len: u64,
    /// Number of records that are still to come.
    rest: u64,
    index: u64,
}

struct Pending {
    ready: Ready,
    /// Group and offset of the data that is still to come.
    wanted: Option<(u64, u64)>,
}

/// One data group.
pub(super) struct Source {
    stream: Stream,
    record_id_len: usize,
    groups: HashMap<u64, State>,
    pending: VecDeque<Pending>,
    /// Data that came before its frame, by group and offset.
    early: BTreeMap<(u64, u64), Vec<u8>>,
    ended: bool,
    place: u64,
}

impl Source {
    /// The source of a data group; `None` if it has no CAN frames. `order`: number of the first
    /// channel group.
    pub fn new(data_group: DataGroup, order: usize, unfinished: bool) -> Option<Self> {
        let DataGroup {
            record_id_len,
            data,
            groups,
        } = data_group;
        let mut by_place: HashMap<u64, u64> = HashMap::new();
        for group in groups.iter().filter(|group| group.variable_length) {
            by_place.insert(group.place, group.record_id);
        }
        let mut wanted = Vec::new();
        let mut states = HashMap::new();
        let mut any = false;
        for (number, group) in groups.into_iter().enumerate() {
            let records = records(&group, order + number, &by_place);
            if let Records::Frames { data, .. } = &records {
                any = true;
                if let Data::Group(id) = data {
                    wanted.push(*id);
                }
            }
            let state = State {
                records,
                record_len: group.record_len,
                rest: if unfinished { u64::MAX } else { group.records },
                index: 0,
            };
            // A group without a record id is the only one of its data group.
            states.insert(
                if record_id_len == 0 {
                    0
                } else {
                    group.record_id
                },
                state,
            );
        }
        for id in wanted {
            if let Some(State {
                records: Records::Values { wanted, .. },
                ..
            }) = states.get_mut(&id)
            {
                *wanted = true;
            }
        }
        any.then(|| Self {
            stream: Stream::new(data),
            record_id_len,
            groups: states,
            pending: VecDeque::new(),
            early: BTreeMap::new(),
            ended: false,
            place: data,
        })
    }

    /// The next frame; `None` at the end.
    pub fn next<R: Read + Seek>(
        &mut self,
        context: &mut Context<'_, '_, R>,
    ) -> Result<Option<Ready>, Error> {
        loop {
            while self.pending.front().is_some_and(|first| {
                first.wanted.is_some() && (self.ended || self.pending.len() > WINDOW)
            }) {
                self.pending.pop_front();
                context
                    .defects
                    .note("the data of a frame is missing", self.place);
            }
            match self.pending.front() {
                Some(first) if first.wanted.is_none() => {
                    return Ok(self.pending.pop_front().map(|pending| pending.ready));
                }
                None if self.ended => return Ok(None),
                _ => {}
            }
            if !self.ended && !self.record(context)? {
                self.ended = true;
            }
        }
    }

    /// Reads a record. Returns `false` at the end.
    fn record<R: Read + Seek>(&mut self, context: &mut Context<'_, '_, R>) -> Result<bool, Error> {
        let id_len = self.record_id_len;
        let Context { file, defects, .. } = context;
        let id = match id_len {
            0 => 0,
            1 | 2 | 4 | 8 => match self.stream.peek(file, defects, id_len)? {
                Some(bytes) => record_id(bytes),
                None => return Ok(self.end(defects)),
            },
            _ => {
                defects.note(format!("a record id of {id_len} bytes"), self.place);
                return Ok(false);
            }
        };
        let Some(state) = self.groups.get_mut(&id) else {
            let kind = "a record of an unknown group; the rest of its data is not readable";
            defects.note(kind, self.place);
            return Ok(false);
        };
        if id_len == 0 && state.rest == 0 {
            return Ok(false);
        }
        let wide = state.record_len + id_len as u64;
        match &state.records {
            Records::Values { .. } => self.value(id, context),
            _ if wide == 0 => {
                defects.note("records without bytes", self.place);
                Ok(false)
            }
            Records::Frames { .. } if wide <= RECORD_MAX => self.frame(id, wide, context),
            Records::Frames { .. } => {
                defects.note("records of frames of more than 64 KiB", self.place);
                self.stream.skip(file, defects, wide)
            }
            Records::Other(name) => {
                let whole = self.stream.skip(file, defects, wide)?;
                if whole {
                    *context.left_out.entry(name.clone()).or_default() += 1;
                }
                Ok(whole)
            }
        }
    }

    /// Reads a value of its own length.
    fn value<R: Read + Seek>(
        &mut self,
        id: u64,
        context: &mut Context<'_, '_, R>,
    ) -> Result<bool, Error> {
        let id_len = self.record_id_len;
        let Context { file, defects, .. } = context;
        let Some(bytes) = self.stream.peek(file, defects, id_len + 4)? else {
            return Ok(self.end(defects));
        };
        let len = u64::from(u32_at(bytes, id_len));
        self.stream.skip(file, defects, id_len as u64 + 4)?;
        let Some(bytes) = self
            .stream
            .peek(file, defects, len.min(FRAME_DATA_MAX) as usize)?
        else {
            return Ok(self.end(defects));
        };
        let bytes = bytes.to_vec();
        if let Some(State {
            records: Records::Values { next, wanted },
            ..
        }) = self.groups.get_mut(&id)
        {
            let key = (id, *next);
            let step = if file.by_order { 1 } else { 4 + len };
            *next = next.saturating_add(step);
            if *wanted {
                self.resolve(key, bytes);
            }
        }
        self.stream.skip(file, defects, len)
    }

    /// Reads the record of a frame.
    fn frame<R: Read + Seek>(
        &mut self,
        id: u64,
        wide: u64,
        context: &mut Context<'_, '_, R>,
    ) -> Result<bool, Error> {
        let Context {
            file,
            defects,
            left_out,
        } = context;
        let Some(state) = self.groups.get_mut(&id) else {
            return Ok(false);
        };
        let Records::Frames {
            group,
            data,
            order,
            invalidation,
        } = &mut state.records
        else {
            return Ok(false);
        };
        let Some(bytes) = self.stream.peek(file, defects, wide as usize)? else {
            return Ok(self.end(defects));
        };
        let record = Record {
            bytes: &bytes[self.record_id_len..],
            invalidation: *invalidation,
            index: state.index,
        };
        let decoded = group.decode(record);
        self.stream.skip(file, defects, wide)?;
        let index = state.index;
        state.index += 1;
        state.rest = state.rest.saturating_sub(1);
        let Some(Decoded {
            mut entry,
            bus,
            data_offset,
            timeless,
        }) = decoded
        else {
            *left_out
                .entry("records marked as invalid".to_owned())
                .or_default() += 1;
            return Ok(true);
        };
        if timeless {
            defects.note("a frame without time", self.place);
        }
        let found = match data_offset {
            Some(offset) => data.find(file, defects, &mut self.early, [offset, index])?,
            None => Found::Bytes(Vec::new()),
        };
        let wanted = match found {
            Found::Bytes(bytes) => {
                put_data(&mut entry.frame, &bytes);
                None
            }
            Found::Later(key) => Some(key),
            Found::Missing => {
                defects.note("the data of a frame is missing", self.place);
                return Ok(true);
            }
        };
        let key = (entry.stamp_ns, *order, index);
        let ready = Ready { key, entry, bus };
        self.pending.push_back(Pending { ready, wanted });
        Ok(true)
    }

    /// Gives data to the frame that waits for it, or keeps it.
    fn resolve(&mut self, key: (u64, u64), bytes: Vec<u8>) {
        let mut waiting = self.pending.iter_mut();
        if let Some(pending) = waiting.find(|pending| pending.wanted == Some(key)) {
            put_data(&mut pending.ready.entry.frame, &bytes);
            pending.wanted = None;
            return;
        }
        self.early.insert(key, bytes);
        if self.early.len() > WINDOW {
            self.early.pop_first();
        }
    }

    /// The stream has ended: bytes that are left are part of a record.
    fn end(&mut self, defects: &mut Defects) -> bool {
        if self.stream.rest() > 0 {
            defects.note("the data ends inside a record", self.place);
        }
        false
    }
}

fn records(group: &Group, order: usize, by_place: &HashMap<u64, u64>) -> Records {
    if group.variable_length {
        return Records::Values {
            next: 0,
            wanted: false,
        };
    }
    let Some(frames) = FrameGroup::of(group) else {
        let first = group
            .channels
            .iter()
            .find(|channel| channel.kind != Kind::Master);
        let name = group
            .name
            .as_deref()
            .or(first.map(|channel| channel.name.as_str()));
        return Records::Other(format!(
            "records of {}",
            name.unwrap_or("a group without name")
        ));
    };
    let data = match &frames.data_bytes {
        Some(channel) if channel.kind == Kind::VariableLength => {
            by_place.get(&channel.data).map_or_else(
                || Data::Blocks(Box::new(Values::new(channel.data, None))),
                |id| Data::Group(*id),
            )
        }
        _ => Data::InRecord,
    };
    Records::Frames {
        group: Box::new(frames),
        data,
        order,
        invalidation: group.invalidation,
    }
}
