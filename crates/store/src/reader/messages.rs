//! Messages, chunk by chunk.

use std::collections::{BTreeSet, VecDeque};
use std::fs::File;
use std::sync::Arc;

use mcap::records::op;
use sample::{Estimate, ForceFrame, LogTime, Measurement, Sample, Signal, SignalFrame, SourceId};

use super::{ChannelInfo, LogFile, Missing, unknown_estimate};
use crate::convert::{self, Envelope};
use crate::scan::{self, Decompressor, Refusal, Scanner};
use crate::{CAN_ID, Error, Record, Result, Stage, dynamic, earlier};

/// Which messages to read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Topics, or beginnings of topics followed by `*`; `None` for all.
    pub topics: Option<Vec<String>>,
    /// Earliest log time.
    pub start: LogTime,
    /// Latest log time.
    pub end: LogTime,
}

impl Default for Selection {
    fn default() -> Self {
        Self {
            topics: None,
            start: LogTime(0),
            end: LogTime(u64::MAX),
        }
    }
}

impl Selection {
    /// All messages of some topics.
    #[must_use]
    pub fn topics<T: Into<String>>(topics: impl IntoIterator<Item = T>) -> Self {
        Self {
            topics: Some(topics.into_iter().map(Into::into).collect()),
            ..Self::default()
        }
    }

    /// The same topics within a stretch of time, both ends included.
    #[must_use]
    pub fn between(self, start: LogTime, end: LogTime) -> Self {
        Self { start, end, ..self }
    }

    fn wants(&self, topic: &str) -> bool {
        self.topics.as_ref().is_none_or(|topics| {
            topics.iter().any(|wanted| match wanted.strip_suffix('*') {
                Some(beginning) => topic.starts_with(beginning),
                None => topic == wanted,
            })
        })
    }
}

/// A message of the log, in the present layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Its channel.
    pub channel: Arc<ChannelInfo>,
    /// Its number on the channel.
    pub sequence: u32,
    /// Log clock when it was recorded or computed.
    pub log_time: LogTime,
    /// Log clock when it was true.
    pub publish_time: LogTime,
    /// Contents, by the channel's schema.
    pub data: Vec<u8>,
}

/// Messages of a [`super::Reader`], in the order of writing.
pub struct MessageIter {
    files: VecDeque<Arc<LogFile>>,
    selection: Selection,
    open: Option<OpenFile>,
    missing: Vec<Missing>,
    decompressor: Decompressor,
}

struct OpenFile {
    file: Arc<LogFile>,
    scanner: Scanner<File>,
    wanted: BTreeSet<u16>,
    next_part: usize,
    /// Records of the part that is being read, and the number of bytes that are done.
    records: Vec<u8>,
    done: usize,
}

impl MessageIter {
    pub(super) fn new(files: Vec<Arc<LogFile>>, selection: Selection) -> Self {
        Self {
            files: files.into(),
            selection,
            open: None,
            missing: Vec::new(),
            decompressor: Decompressor::default(),
        }
    }

    /// Damage that was found while reading, so far.
    #[must_use]
    pub fn missing(&self) -> &[Missing] {
        &self.missing
    }

    /// Reads the next part of the files; `false` at the end of the last.
    fn advance(&mut self) -> Result<bool> {
        let Some(open) = &mut self.open else {
            let Some(file) = self.files.pop_front() else {
                return Ok(false);
            };
            let channels = &file.index.channels;
            let wanted = channels
                .iter()
                .filter(|(_, channel)| self.selection.wants(&channel.topic))
                .map(|(id, _)| *id)
                .collect();
            self.open = Some(OpenFile {
                scanner: Scanner::open(&file.path)?,
                file,
                wanted,
                next_part: 0,
                records: Vec::new(),
                done: 0,
            });
            return Ok(true);
        };
        let Some(part) = open.file.index.parts.get(open.next_part) else {
            self.open = None;
            return Ok(true);
        };
        open.next_part += 1;
        let in_time = part.start <= self.selection.end && part.end >= self.selection.start;
        let has_wanted = part
            .channels
            .as_ref()
            .is_none_or(|channels| !channels.is_disjoint(&open.wanted));
        if in_time && has_wanted {
            let (offset, bytes) = (part.offset, part.bytes_end.saturating_sub(part.offset));
            let records = records_of(&mut open.scanner, &mut self.decompressor, offset, bytes)
                .map_err(Error::file("read", &open.file.path))?;
            open.done = 0;
            open.records = records.unwrap_or_else(|what| {
                self.missing.push(Missing::Damaged {
                    path: open.file.path.clone(),
                    offset,
                    bytes,
                    what,
                });
                Vec::new()
            });
        }
        Ok(true)
    }

    /// The next message of the part that is being read.
    fn next_of_part(&mut self) -> Option<Message> {
        let open = self.open.as_mut()?;
        while let Some((opcode, body, _)) = scan::split_record(&open.records[open.done..]) {
            open.done += scan::PREFIX as usize + body.len();
            if opcode == op::MESSAGE
                && let Some((header, data)) = scan::message(body)
                && open.wanted.contains(&header.channel_id)
                && (self.selection.start.0..=self.selection.end.0).contains(&header.log_time)
                && let Some(channel) = open.file.index.channels.get(&header.channel_id)
            {
                let log_time = LogTime(header.log_time);
                let data = match channel.is_earlier {
                    true => earlier::message(&channel.schema, data),
                    false => Ok(data.to_vec()),
                };
                match data {
                    Ok(data) => {
                        return Some(Message {
                            channel: Arc::clone(channel),
                            sequence: header.sequence,
                            log_time,
                            publish_time: LogTime(header.publish_time),
                            data,
                        });
                    }
                    Err(cause) => self.missing.push(Missing::BadMessage {
                        topic: channel.topic.clone(),
                        log_time,
                        text: cause.to_string(),
                    }),
                }
            }
        }
        open.records = Vec::new();
        open.done = 0;
        None
    }
}

/// The records of a chunk or of a stretch of messages outside of chunks; a description if it is
/// damaged.
fn records_of(
    scanner: &mut Scanner<File>,
    decompressor: &mut Decompressor,
    offset: u64,
    bytes: u64,
) -> std::io::Result<std::result::Result<Vec<u8>, String>> {
    let bound = scan::max_chunk();
    let first = scanner.prefix(offset)?;
    if let Some((op::MESSAGE, _)) = first {
        return Ok(Ok(scanner.read_at(offset, bytes.min(bound))?));
    }
    if let Some((op::CHUNK, length)) = first
        && length <= bound + bound / 64 + 4096
    {
        let body = scanner.read_at(offset + scan::PREFIX, length)?;
        match decompressor.chunk(&body, bound) {
            Ok(chunk) => return Ok(Ok(chunk.records)),
            Err(Refusal::Compression(name)) => {
                return Ok(Err(format!("chunk of unknown compression {name:?}")));
            }
            Err(Refusal::TooLarge(size)) => {
                return Ok(Err(format!(
                    "chunk of {size} bytes, more than --max-chunk allows,"
                )));
            }
            Err(Refusal::Damaged) => {}
        }
    }
    let found = scan::repaired(scanner, bound, offset)?;
    Ok(found
        .map(|found| found.chunk.records)
        .ok_or_else(|| "chunk".to_owned()))
}

impl Iterator for MessageIter {
    type Item = Result<Message>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(message) = self.next_of_part() {
                return Some(Ok(message));
            }
            match self.advance() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => {
                    self.open = None;
                    return Some(Err(error));
                }
            }
        }
    }
}

fn bad_message(message: &Message) -> impl FnOnce(crate::error::MessageError) -> Error {
    let topic = message.channel.topic.clone();
    let log_time = message.log_time.0;
    move |cause| Error::BadMessage {
        topic,
        log_time,
        cause,
    }
}

pub(super) fn record(message: &Message) -> Result<Option<Record>> {
    let channel = &message.channel;
    let source = channel.source.unwrap_or(SourceId(0));
    if channel.schema.starts_with("atvrec.signals.") && channel.has_no_schema() {
        return Ok(None);
    }
    if channel.schema.starts_with("atvrec.signals.") {
        let signals = signals(message)?;
        let measurement = if channel.topic.starts_with("/control/") {
            Measurement::Control(sample::ControlSample { values: signals })
        } else {
            let name = channel.topic.rsplit('/').next().unwrap_or_default();
            let id = channel.metadata.get("can_id");
            let of_frame = signals.iter().find(|signal| signal.name == CAN_ID);
            Measurement::Signals(SignalFrame {
                message: name.to_owned(),
                id: match (id, of_frame) {
                    (None, Some(signal)) => signal.value as u32,
                    (id, _) => id.and_then(|id| id.parse().ok()).unwrap_or_default(),
                },
                signals,
            })
        };
        return Ok(Some(Record::Sample(Sample {
            source,
            log_time: message.log_time,
            valid_time: message.publish_time,
            device_time: None,
            measurement,
        })));
    }
    let envelope = Envelope {
        topic: &channel.topic,
        schema: &channel.schema,
        source,
        log_time: message.log_time,
        publish_time: message.publish_time,
    };
    convert::decode(&envelope, &message.data).map_err(bad_message(message))
}

pub(super) fn signals(message: &Message) -> Result<Vec<Signal>> {
    let channel = &message.channel;
    dynamic::decode(&channel.schema_data, &channel.metadata, &message.data)
        .map_err(|cause| bad_message(message)(cause.into()))
}

/// Joins the parts of each instant, which are adjacent in the log.
pub(super) fn joined(
    messages: MessageIter,
    stage: Stage,
) -> impl Iterator<Item = Result<Estimate>> {
    let mut messages = messages.fuse();
    let mut open: Option<Estimate> = None;
    std::iter::from_fn(move || {
        loop {
            let Some(message) = messages.next() else {
                return open.take().map(Ok);
            };
            let record = match message.and_then(|message| message.record()) {
                Ok(record) => record,
                Err(error) => return Some(Err(error)),
            };
            let time = match &record {
                Some(
                    Record::Motion { time, .. }
                    | Record::TyreForces { time, .. }
                    | Record::Rollover { time, .. },
                ) => *time,
                _ => continue,
            };
            let done = open.take_if(|open| open.time != time);
            let estimate = open.get_or_insert_with(|| unknown_estimate(time));
            match record {
                Some(Record::Motion { motion, .. }) => estimate.motion = motion,
                Some(Record::Rollover { rollover, .. }) => estimate.rollover = rollover,
                Some(Record::TyreForces {
                    forces,
                    frame,
                    stage: of,
                    ..
                }) => match frame {
                    _ if of != stage => estimate.expected = forces,
                    ForceFrame::Contact => estimate.measured = forces,
                    ForceFrame::WheelCarrier => estimate.carrier = forces,
                },
                _ => {}
            }
            if let Some(done) = done {
                return Some(Ok(done));
            }
        }
    })
}
