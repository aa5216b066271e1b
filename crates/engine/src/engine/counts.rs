//! Messages of a source by name.

use std::collections::BTreeMap;

use sample::{CanFrame, Measurement, MessageCount, Sample};
use wire::{Item, Message};

/// Name of frames whose message is in no DBC file.
const NO_MESSAGE: &str = "frames without a DBC message";
/// Most names that are counted.
const NAMES_MAX: usize = 4_096;

/// Messages of a source since the start, by name.
#[derive(Clone, Debug, Default)]
pub struct MessageCounts {
    /// What a decoder gave.
    decoded: BTreeMap<String, u64>,
    /// What the decoder knows by name and does not decode.
    known: BTreeMap<&'static str, u64>,
    /// Frames whose message is in no DBC file.
    frames: u64,
    /// Sum of the decoded ones.
    understood: u64,
}

impl MessageCounts {
    /// Counts a message of a serial port. Answers to commands and messages without a name do not count.
    pub(super) fn count_item(&mut self, item: &Item<'_>) {
        match item.message {
            Message::Reply | Message::Malformed(_) => {}
            Message::Unknown(_) if item.name == "unknown" => {}
            Message::Unknown(_) => *self.known.entry(item.name).or_default() += 1,
            _ => self.count(item.name),
        }
    }

    /// Counts a frame, and the first sample that it gave.
    pub(super) fn count_frame(&mut self, frame: &CanFrame, first: Option<&Sample>) {
        match first.map(|sample| &sample.measurement) {
            Some(Measurement::Signals(signals)) => self.count(&signals.message),
            _ if frame.flags.error || frame.flags.remote => {}
            _ => self.frames += 1,
        }
    }

    fn count(&mut self, name: &str) {
        self.understood += 1;
        if let Some(count) = self.decoded.get_mut(name) {
            *count += 1;
        } else if self.decoded.len() < NAMES_MAX {
            self.decoded.insert(name.to_owned(), 1);
        }
    }

    /// Messages that were decoded, by name.
    pub fn decoded(&self) -> impl Iterator<Item = (&str, u64)> {
        let all = self.decoded.iter();
        all.map(|(name, count)| (name.as_str(), *count))
    }

    /// Number of messages that were decoded.
    #[must_use]
    pub const fn understood(&self) -> u64 {
        self.understood
    }

    /// Messages that were not decoded, by name, with the frames that no DBC file has.
    pub fn not_decoded(&self) -> impl Iterator<Item = (&str, u64)> {
        let known = self.known.iter().map(|(name, count)| (*name, *count));
        let frames = (self.frames > 0).then_some((NO_MESSAGE, self.frames));
        known.chain(frames)
    }

    /// What the decoder knows by name and does not decode.
    pub(super) fn undecoded(&self) -> Vec<MessageCount> {
        let all = self.known.iter().map(|(name, count)| MessageCount {
            name: (*name).to_owned(),
            count: *count,
        });
        all.collect()
    }
}
