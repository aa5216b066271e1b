use std::collections::BTreeMap;

use sample::{Arrival, LossPlace, Notice, Payload, SourceId};

use crate::{Session, raw};

/// What went into a log.
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
    /// Decoded records lost on the way to the disk.
    pub lost_records: u64,
    /// First sequence in the log.
    pub first_sequence: Option<u64>,
    /// Last sequence in the log.
    pub last_sequence: Option<u64>,
    /// Items lost, by source and place: before they became arrivals, as the sources told, and on the
    /// way to the disk, as the recorder counted.
    pub lost: BTreeMap<(u16, &'static str), u64>,
}

impl WriteCounters {
    pub(crate) fn count(&mut self, arrival: &Arrival) {
        let sequence = arrival.sequence;
        self.arrivals += 1;
        // Recovery reads channel by channel, so that sequences do not only rise.
        self.first_sequence = Some(self.first_sequence.map_or(sequence, |s| s.min(sequence)));
        self.last_sequence = self.last_sequence.max(Some(sequence));
        match &arrival.payload {
            Payload::Bytes(bytes) => self.serial_bytes += bytes.len() as u64,
            Payload::Can(frames) => self.can_frames += frames.len() as u64,
            Payload::Notice(Notice::Lost { place, count }) if *place != LossPlace::Disk => {
                self.lose(arrival.source, *place, *count);
            }
            Payload::Tick | Payload::Notice(_) => {}
        }
    }

    /// Counts what a notice tells of losses on the way to the disk. A recorder counts its own, and
    /// each of its files tells of those since the file before, so that notices would tell twice.
    pub(crate) fn count_disk_notice(&mut self, arrival: &Arrival) {
        if let Payload::Notice(Notice::Lost {
            place: LossPlace::Disk,
            count,
        }) = arrival.payload
        {
            self.lose(arrival.source, LossPlace::Disk, count);
        }
    }

    /// Counts the arrivals of a raw message; copies of earlier ones, and damaged ones, are none.
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

    pub(crate) fn lose(&mut self, source: SourceId, place: LossPlace, count: u64) {
        let lost = self.lost.entry((source.0, place.name())).or_default();
        *lost = lost.saturating_add(count);
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
        if self.lost_records > 0 {
            map.insert("lost_records".to_owned(), self.lost_records.to_string());
        }
        for ((source, place), count) in &self.lost {
            let name = session.source_name(SourceId(*source));
            map.insert(format!("lost.{name}.{place}"), count.to_string());
        }
        map
    }
}
