//! Messages of one chunk, encoded.

use std::collections::BTreeMap;

use mcap::records::{MessageHeader, op};

use super::HEAD_BYTES;
use crate::scan;

/// Bytes of a message's record before its data.
const MESSAGE_HEAD_BYTES: usize = HEAD_BYTES + 22;

/// A chunk that is being filled.
#[derive(Default)]
pub(crate) struct Chunk {
    /// zstd level, unless the file has one of its own; zero is the default of zstd.
    pub(super) level: i32,
    pub(super) records: Vec<u8>,
    /// Log time and place of each message, by channel.
    pub(super) index: BTreeMap<u16, Vec<[u64; 2]>>,
    /// Log times of the first and the last message; `None` without messages.
    pub(super) span: Option<[u64; 2]>,
}

impl Chunk {
    pub(crate) fn new(level: i32) -> Self {
        Self {
            level,
            ..Self::default()
        }
    }

    /// Adds a message, whose data `encode` appends.
    pub(crate) fn push(&mut self, header: MessageHeader, encode: impl FnOnce(&mut Vec<u8>)) {
        let (start, time) = (self.records.len(), header.log_time);
        let mut head = [0; MESSAGE_HEAD_BYTES];
        head[0] = op::MESSAGE;
        head[9..11].copy_from_slice(&header.channel_id.to_le_bytes());
        head[11..15].copy_from_slice(&header.sequence.to_le_bytes());
        head[15..23].copy_from_slice(&time.to_le_bytes());
        head[23..31].copy_from_slice(&header.publish_time.to_le_bytes());
        self.records.extend_from_slice(&head);
        encode(&mut self.records);
        let length = (self.records.len() - start - HEAD_BYTES) as u64;
        self.records[start + 1..start + HEAD_BYTES].copy_from_slice(&length.to_le_bytes());
        let entries = self.index.entry(header.channel_id).or_default();
        entries.push([time, start as u64]);
        let [first, last] = self.span.unwrap_or([time; 2]);
        self.span = Some([first.min(time), last.max(time)]);
    }

    /// Bytes of the records.
    pub(crate) fn bytes(&self) -> usize {
        self.records.len()
    }

    /// Removes all messages.
    pub(crate) fn clear(&mut self) {
        self.records.clear();
        self.index.clear();
        self.span = None;
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
        for [_, place] in self.index.values_mut().flatten() {
            *place += records.len() as u64;
        }
    }
}
