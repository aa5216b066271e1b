//! Messages of one chunk, encoded.

use std::collections::BTreeMap;

use mcap::records::{MessageHeader, op};

use super::{bytes, numbers, record};
use crate::scan;

/// A chunk that is being filled.
#[derive(Default)]
pub(crate) struct Chunk {
    records: Vec<u8>,
    /// Log time and place of each message, by channel.
    index: Vec<Vec<(u64, u64)>>,
    span: Option<(u64, u64)>,
    count: u64,
}

impl Chunk {
    /// Adds a message, whose data `encode` appends.
    pub(crate) fn push(&mut self, header: MessageHeader, encode: impl FnOnce(&mut Vec<u8>)) {
        let (place, time) = (self.records.len() as u64, header.log_time);
        record(&mut self.records, op::MESSAGE, |out| {
            out.extend_from_slice(&header.channel_id.to_le_bytes());
            out.extend_from_slice(&header.sequence.to_le_bytes());
            numbers(out, &[time, header.publish_time]);
            encode(out);
        });
        let channel = usize::from(header.channel_id);
        if self.index.len() <= channel {
            self.index.resize_with(channel + 1, Vec::new);
        }
        self.index[channel].push((time, place));
        let (first, last) = self.span.unwrap_or((time, time));
        self.span = Some((first.min(time), last.max(time)));
        self.count += 1;
    }

    /// Log times of the first and the last message; `None` without messages.
    pub(crate) fn span(&self) -> Option<(u64, u64)> {
        self.span
    }

    /// Number of messages.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Bytes of the records.
    pub(crate) fn bytes(&self) -> usize {
        self.records.len()
    }

    /// Removes all messages.
    pub(crate) fn clear(&mut self) {
        self.records.clear();
        self.index.iter_mut().for_each(Vec::clear);
        self.span = None;
        self.count = 0;
    }

    /// The messages in their order.
    pub(crate) fn messages(&self) -> impl Iterator<Item = (MessageHeader, &[u8])> {
        let mut rest = self.records.as_slice();
        let records = std::iter::from_fn(move || {
            let (kind, body, after) = scan::split_record(rest)?;
            rest = after;
            Some((kind, body))
        });
        let messages = records.filter(|(kind, _)| *kind == op::MESSAGE);
        messages.filter_map(|(_, body)| scan::message(body))
    }

    /// Puts records before the messages.
    pub(super) fn prepend(&mut self, records: &[u8]) {
        self.records.splice(..0, records.iter().copied());
        for (_, place) in self.index.iter_mut().flatten() {
            *place += records.len() as u64;
        }
    }

    /// The records.
    pub(super) fn contents(&self) -> &[u8] {
        &self.records
    }

    /// Messages by channel.
    pub(super) fn counts(&self) -> impl Iterator<Item = (u16, u64)> {
        self.entries()
            .map(|(channel, entries)| (channel, entries.len() as u64))
    }

    /// Appends the index of each channel to `out`, whose first byte is at `start` in the file, and
    /// returns the places of the indexes.
    pub(super) fn write_indexes(&self, out: &mut Vec<u8>, start: u64) -> BTreeMap<u16, u64> {
        let mut places = BTreeMap::new();
        for (channel, entries) in self.entries() {
            places.insert(channel, start + out.len() as u64);
            record(out, op::MESSAGE_INDEX, |out| {
                out.extend_from_slice(&channel.to_le_bytes());
                bytes(out, &[]);
                let begin = out.len();
                for (time, place) in entries {
                    numbers(out, &[*time, *place]);
                }
                let length = (out.len() - begin) as u32;
                out[begin - 4..begin].copy_from_slice(&length.to_le_bytes());
            });
        }
        places
    }

    fn entries(&self) -> impl Iterator<Item = (u16, &Vec<(u64, u64)>)> {
        let channels = (0..=u16::MAX).zip(&self.index);
        channels.filter(|(_, entries)| !entries.is_empty())
    }
}
