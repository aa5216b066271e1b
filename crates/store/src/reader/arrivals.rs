//! The ordered stream, reconstructed from the raw channels.

use std::collections::VecDeque;
use std::sync::Arc;

use sample::{Arrival, LogTime, SourceId};

use super::{LogFile, MessageIter, Missing, Selection};
use crate::Result;
use crate::raw::{self, Batch};

/// Time before the start at which a batch may begin that still reaches into the selected time.
const LOOK_BACK_NANOS: i64 = 10_000_000_000;

/// Arrivals of a [`super::Reader`] by their sequence. One group of batches is held at a time.
pub struct ArrivalIter {
    messages: MessageIter,
    group: Option<u64>,
    gathered: Vec<Arrival>,
    ready: VecDeque<Arrival>,
    /// Expected next sequence, and the end of the group that was read last.
    next: Option<u64>,
    group_end: u64,
    start: LogTime,
    end: LogTime,
    missing: Vec<Missing>,
}

impl ArrivalIter {
    pub(super) fn new(files: Vec<Arc<LogFile>>, start: LogTime, end: LogTime) -> Self {
        Self::of(files, start, end, &raw::SCHEMAS)
    }

    pub(super) fn notices(files: Vec<Arc<LogFile>>) -> Self {
        Self::of(files, LogTime(0), LogTime(u64::MAX), &[raw::NOTICES_SCHEMA])
    }

    fn of(files: Vec<Arc<LogFile>>, start: LogTime, end: LogTime, schemas: &[&str]) -> Self {
        let topics = files
            .iter()
            .flat_map(|file| file.index.channels.values())
            .filter(|channel| schemas.contains(&channel.schema.as_str()))
            .map(|channel| channel.topic.clone());
        let selection = Selection::topics(topics).between(start + -LOOK_BACK_NANOS, end);
        Self {
            messages: MessageIter::new(files, selection),
            group: None,
            gathered: Vec::new(),
            ready: VecDeque::new(),
            next: None,
            group_end: 0,
            start,
            end,
            missing: Vec::new(),
        }
    }

    /// What was found missing or damaged so far; complete when the iterator has ended.
    #[must_use]
    pub fn missing(&self) -> Vec<Missing> {
        let mut missing = self.messages.missing().to_vec();
        missing.extend(self.missing.iter().cloned());
        missing
    }

    fn gather(&mut self, batch: Batch) {
        if batch.latched {
            return;
        }
        if self.group != Some(batch.group_first_sequence) {
            self.close_group();
            self.group = Some(batch.group_first_sequence);
        }
        self.group_end = self.group_end.max(batch.group_end_sequence);
        self.gathered.extend(batch.arrivals);
    }

    fn close_group(&mut self) {
        self.group = None;
        self.gathered.sort_by_key(|arrival| arrival.sequence);
        for arrival in std::mem::take(&mut self.gathered) {
            let expected = *self.next.get_or_insert(arrival.sequence);
            // A group that a failing disk wrote twice repeats earlier arrivals.
            if arrival.sequence < expected {
                continue;
            }
            self.next = Some(arrival.sequence.saturating_add(1));
            // Outside of the selected time groups are read in part, so gaps are no losses.
            if arrival.log_time >= self.start && arrival.log_time <= self.end {
                self.report_gap(expected, arrival.sequence);
                self.ready.push_back(arrival);
            }
        }
    }

    fn report_gap(&mut self, expected: u64, found: u64) {
        if found > expected {
            self.missing.push(Missing::Arrivals {
                first_sequence: expected,
                count: found - expected,
            });
        }
    }

    fn finish(&mut self) {
        self.close_group();
        if let Some(next) = self.next
            && self.end.0 == u64::MAX
        {
            self.report_gap(next, self.group_end);
            self.next = Some(self.group_end.max(next));
        }
    }
}

impl Iterator for ArrivalIter {
    type Item = Result<Arrival>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(arrival) = self.ready.pop_front() {
                return Some(Ok(arrival));
            }
            let message = match self.messages.next() {
                None => {
                    self.finish();
                    return self.ready.pop_front().map(Ok);
                }
                Some(Err(error)) => return Some(Err(error)),
                Some(Ok(message)) => message,
            };
            let channel = &message.channel;
            let source = channel.source.unwrap_or(SourceId(0));
            match raw::decode(&channel.schema, source, &message.data) {
                Ok(Some(batch)) => self.gather(batch),
                Ok(None) => {}
                Err(cause) => self.missing.push(Missing::BadMessage {
                    topic: channel.topic.clone(),
                    log_time: message.log_time,
                    text: cause.to_string(),
                }),
            }
        }
    }
}
