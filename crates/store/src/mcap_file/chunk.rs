//! Messages of one chunk, encoded.

use std::collections::BTreeMap;

use mcap::records::op;

use super::{bytes, numbers, record};

/// Bytes of the head of a record: kind and length.
const RECORD_HEAD: usize = 9;
/// Bytes of the head of a message: channel, sequence number, log time and publish time.
const MESSAGE_HEAD: usize = 22;

/// Head of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamps {
    pub channel: u16,
    pub sequence: u32,
    pub log_time: u64,
    pub publish_time: u64,
}

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
    pub(crate) fn push(&mut self, stamps: Stamps, encode: impl FnOnce(&mut Vec<u8>)) {
        let place = self.records.len() as u64;
        record(&mut self.records, op::MESSAGE, |out| {
            out.extend_from_slice(&stamps.channel.to_le_bytes());
            out.extend_from_slice(&stamps.sequence.to_le_bytes());
            out.extend_from_slice(&stamps.log_time.to_le_bytes());
            out.extend_from_slice(&stamps.publish_time.to_le_bytes());
            encode(out);
        });
        let channel = usize::from(stamps.channel);
        if self.index.len() <= channel {
            self.index.resize_with(channel + 1, Vec::new);
        }
        self.index[channel].push((stamps.log_time, place));
        let (first, last) = self.span.unwrap_or((stamps.log_time, stamps.log_time));
        self.span = Some((first.min(stamps.log_time), last.max(stamps.log_time)));
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
    pub(crate) fn messages(&self) -> impl Iterator<Item = (Stamps, &[u8])> {
        let mut rest = self.records.as_slice();
        std::iter::from_fn(move || {
            loop {
                let (head, after) = rest.split_first_chunk::<RECORD_HEAD>()?;
                let length = usize::try_from(u64::from_le_bytes(head[1..].try_into().ok()?));
                let (body, next) = after.split_at_checked(length.ok()?)?;
                rest = next;
                if head[0] == op::MESSAGE {
                    return message(body);
                }
            }
        })
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

fn message(body: &[u8]) -> Option<(Stamps, &[u8])> {
    let (head, data) = body.split_first_chunk::<MESSAGE_HEAD>()?;
    let (channel, rest) = head.split_first_chunk::<2>()?;
    let (sequence, rest) = rest.split_first_chunk::<4>()?;
    let (log_time, rest) = rest.split_first_chunk::<8>()?;
    let publish_time = rest.first_chunk::<8>()?;
    let stamps = Stamps {
        channel: u16::from_le_bytes(*channel),
        sequence: u32::from_le_bytes(*sequence),
        log_time: u64::from_le_bytes(*log_time),
        publish_time: u64::from_le_bytes(*publish_time),
    };
    Some((stamps, data))
}
