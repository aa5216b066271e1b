use std::collections::BTreeMap;

use sample::{Arrival, LossPlace, Payload, SourceId};

use crate::{Losses, Session, raw};

/// Counts of the data in a log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WriteCounters {
    /// Raw arrivals.
    pub arrivals: u64,
    /// CAN frames in them.
    pub can_frames: u64,
    /// Bytes of serial ports in them.
    pub serial_bytes: u64,
    /// Decoded messages, among them states repeated from the file before.
    pub messages: u64,
    /// First sequence in the log.
    pub first_sequence: Option<u64>,
    /// Last sequence in the log.
    pub last_sequence: Option<u64>,
    /// Losses that the notices in the log state, and losses on the way to the disk.
    pub losses: Losses,
    /// Losses that only the notices in this log state.
    pub(crate) held: Losses,
}

impl WriteCounters {
    pub(crate) fn count(&mut self, arrival: &Arrival) {
        let sequence = arrival.sequence;
        self.arrivals += 1;
        // Recovery reads channel by channel, so sequences can fall.
        self.first_sequence = Some(self.first_sequence.map_or(sequence, |s| s.min(sequence)));
        self.last_sequence = self.last_sequence.max(Some(sequence));
        self.held.add_arrival(arrival);
        match &arrival.payload {
            Payload::Bytes(bytes) => self.serial_bytes += bytes.len() as u64,
            Payload::Can(frames) => self.can_frames += frames.len() as u64,
            Payload::Notice(notice) => self.losses.add_notice(arrival.source, notice),
            Payload::Tick => {}
        }
    }

    /// Counts the arrivals of a raw message, except copies of earlier ones and damaged ones.
    pub(crate) fn count_batch(&mut self, schema: &str, source: SourceId, data: &[u8]) {
        if let Ok(Some(batch)) = raw::decode(schema, source, data)
            && !batch.latched
        {
            batch
                .arrivals
                .iter()
                .for_each(|arrival| self.count(arrival));
        }
    }

    /// Replaces the losses on the way to the disk that notices state by `losses`. Each file of a run
    /// states the losses since the file before it, so that the sum over the files is complete.
    pub(crate) fn state_losses(&mut self, losses: &Losses) {
        self.losses.retain(|place| place != LossPlace::Disk);
        self.losses.add(losses);
    }

    pub(crate) fn to_metadata(&self, session: &Session) -> BTreeMap<String, String> {
        let mut map = BTreeMap::from([
            ("arrivals".to_owned(), self.arrivals.to_string()),
            ("can_frames".to_owned(), self.can_frames.to_string()),
            ("serial_bytes".to_owned(), self.serial_bytes.to_string()),
            ("messages".to_owned(), self.messages.to_string()),
        ]);
        if let (Some(first), Some(last)) = (self.first_sequence, self.last_sequence) {
            map.insert("first_sequence".to_owned(), first.to_string());
            map.insert("last_sequence".to_owned(), last.to_string());
        }
        self.losses.put(session, &mut map);
        map
    }
}
