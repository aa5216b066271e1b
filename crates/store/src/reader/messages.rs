//! Messages, chunk by chunk.

use std::collections::{BTreeSet, VecDeque};
use std::fs::File;
use std::ops::Range;
use std::sync::Arc;

use mcap::records::{MessageHeader, op};
use sample::{LogTime, Measurement, Sample, Signal, SignalFrame, SourceId};

use super::estimates::{self, Part};
use super::{ChannelInfo, LogFile, Missing};
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

    /// The test of a topic, fast for many topics.
    fn filter(&self) -> impl Fn(&str) -> bool {
        let all = self.topics.iter().flatten();
        let (beginnings, whole): (Vec<&str>, Vec<&str>) = all
            .map(String::as_str)
            .partition(|topic| topic.ends_with('*'));
        let whole: BTreeSet<&str> = whole.into_iter().collect();
        let takes_all = self.topics.is_none();
        move |topic| {
            takes_all
                || whole.contains(topic)
                || beginnings
                    .iter()
                    .any(|beginning| topic.starts_with(beginning.trim_end_matches('*')))
        }
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

/// A message of the log in the buffer of the reader, in the present layout.
#[derive(Clone, Copy, Debug)]
pub struct MessageRef<'a> {
    /// Its channel.
    pub channel: &'a Arc<ChannelInfo>,
    /// Its number on the channel.
    pub sequence: u32,
    /// Log clock when it was recorded or computed.
    pub log_time: LogTime,
    /// Log clock when it was true.
    pub publish_time: LogTime,
    /// Contents, by the channel's schema.
    pub data: &'a [u8],
    /// Position of its file among those of the reader, and number of its channel in the file.
    pub(crate) place: (usize, u16),
    /// What it tells of an estimate.
    pub(crate) part: Option<(Part, Stage)>,
}

impl MessageRef<'_> {
    /// The message with contents of its own.
    #[must_use]
    pub fn to_message(&self) -> Message {
        Message {
            channel: Arc::clone(self.channel),
            sequence: self.sequence,
            log_time: self.log_time,
            publish_time: self.publish_time,
            data: self.data.to_vec(),
        }
    }

    /// As [`Message::record`].
    ///
    /// # Errors
    /// If the message does not follow its schema.
    pub fn record(&self) -> Result<Option<Record>> {
        record(*self)
    }
}

impl Message {
    pub(super) fn by_ref(&self) -> MessageRef<'_> {
        MessageRef {
            channel: &self.channel,
            sequence: self.sequence,
            log_time: self.log_time,
            publish_time: self.publish_time,
            data: self.data.as_slice(),
            place: (0, 0),
            part: estimates::part(&self.channel),
        }
    }
}

/// Messages of a [`super::Reader`], in the order of writing. A chunk is read and inflated once for all
/// topics of the selection, into a buffer that the next chunk uses again.
pub struct MessageIter {
    files: VecDeque<Arc<LogFile>>,
    /// Number of files that were opened.
    opened: usize,
    selection: Selection,
    open: Option<OpenFile>,
    missing: Vec<Missing>,
    decompressor: Decompressor,
    /// Memory for the compressed bytes of a chunk.
    body: Vec<u8>,
    /// A message of an earlier layout in the present one.
    converted: Vec<u8>,
    /// Part of the bytes of all files that is done.
    bytes_done: u64,
}

struct OpenFile {
    file: Arc<LogFile>,
    scanner: Scanner<File>,
    wanted: BTreeSet<u16>,
    /// The wanted channels by number.
    channels: Vec<Option<Wanted>>,
    next_part: usize,
    /// Records of the part that is being read, and the number of bytes that are done.
    records: Vec<u8>,
    done: usize,
}

/// A wanted channel, and what its messages tell of an estimate.
type Wanted = (Arc<ChannelInfo>, Option<(Part, Stage)>);

/// Where the contents of a message are.
struct Located {
    header: MessageHeader,
    /// Bytes of the records of the part; `None` if the contents were converted.
    data: Option<Range<usize>>,
    /// Where its record begins in the part.
    start: usize,
}

impl MessageIter {
    pub(super) fn new(files: Vec<Arc<LogFile>>, selection: Selection) -> Self {
        Self {
            files: files.into(),
            opened: 0,
            selection,
            open: None,
            missing: Vec::new(),
            decompressor: Decompressor::default(),
            body: Vec::new(),
            converted: Vec::new(),
            bytes_done: 0,
        }
    }

    /// Damage that was found while reading, so far.
    #[must_use]
    pub fn missing(&self) -> &[Missing] {
        &self.missing
    }

    /// Bytes of the files that were read or left out so far.
    #[must_use]
    pub const fn bytes_done(&self) -> u64 {
        self.bytes_done
    }

    /// The next message, without a copy of its contents.
    pub fn next_ref(&mut self) -> Option<Result<MessageRef<'_>>> {
        self.next_ref_if(|_| true)
    }

    /// The next message if its log time is accepted; otherwise it remains the next one.
    pub fn next_ref_if(
        &mut self,
        accept: impl FnOnce(LogTime) -> bool,
    ) -> Option<Result<MessageRef<'_>>> {
        let located = loop {
            if let Some(located) = self.next_of_part() {
                break located;
            }
            match self.advance() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => {
                    self.open = None;
                    return Some(Err(error));
                }
            }
        };
        let open = self.open.as_mut()?;
        let Located {
            header,
            data,
            start,
        } = located;
        if !accept(LogTime(header.log_time)) {
            open.done = start;
            return None;
        }
        let (channel, part) = open
            .channels
            .get(usize::from(header.channel_id))?
            .as_ref()?;
        Some(Ok(MessageRef {
            channel,
            sequence: header.sequence,
            log_time: LogTime(header.log_time),
            publish_time: LogTime(header.publish_time),
            data: data.map_or(&self.converted, |range| &open.records[range]),
            place: (self.opened - 1, header.channel_id),
            part: *part,
        }))
    }

    /// Reads the next part of the files; `false` at the end of the last.
    fn advance(&mut self) -> Result<bool> {
        let Some(open) = &mut self.open else {
            let Some(file) = self.files.pop_front() else {
                return Ok(false);
            };
            self.opened += 1;
            let is_wanted = self.selection.filter();
            let channels = file.index.channels.iter();
            let selected = channels.filter(|(_, channel)| is_wanted(&channel.topic));
            let mut wanted = BTreeSet::new();
            let mut channels = Vec::new();
            for (id, channel) in selected {
                wanted.insert(*id);
                channels.resize(usize::from(*id) + 1, None);
                channels[usize::from(*id)] = Some((Arc::clone(channel), estimates::part(channel)));
            }
            self.open = Some(OpenFile {
                scanner: Scanner::open(&file.path)?,
                file,
                wanted,
                channels,
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
        self.bytes_done += part.bytes_end.saturating_sub(part.offset);
        let in_time = part.start <= self.selection.end && part.end >= self.selection.start;
        let has_wanted = part
            .channels
            .as_ref()
            .is_none_or(|channels| channels.iter().any(|id| open.wanted.contains(id)));
        if in_time && has_wanted {
            let (offset, bytes) = (part.offset, part.bytes_end.saturating_sub(part.offset));
            let (scanner, decompressor) = (&mut open.scanner, &mut self.decompressor);
            let records = records_of(scanner, decompressor, &mut self.body, offset, bytes)
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
    fn next_of_part(&mut self) -> Option<Located> {
        let open = self.open.as_mut()?;
        while let Some((opcode, body, _)) = scan::split_record(&open.records[open.done..]) {
            let start = open.done;
            open.done += scan::PREFIX as usize + body.len();
            if opcode == op::MESSAGE
                && let Some((header, data)) = scan::message(body)
                && let Some(Some((channel, _))) = open.channels.get(usize::from(header.channel_id))
                && (self.selection.start.0..=self.selection.end.0).contains(&header.log_time)
            {
                if !channel.is_earlier {
                    let data = Some(open.done - data.len()..open.done);
                    return Some(Located {
                        header,
                        data,
                        start,
                    });
                }
                match earlier::message(&channel.schema, data) {
                    Ok(data) => {
                        self.converted = data;
                        return Some(Located {
                            header,
                            data: None,
                            start,
                        });
                    }
                    Err(cause) => self.missing.push(Missing::BadMessage {
                        topic: channel.topic.clone(),
                        log_time: LogTime(header.log_time),
                        text: cause.to_string(),
                    }),
                }
            }
        }
        self.decompressor.reuse(std::mem::take(&mut open.records));
        open.done = 0;
        None
    }
}

/// The records of a chunk or of a stretch of messages outside of chunks; a description if it is
/// damaged. `body` is memory for the bytes of the chunk.
fn records_of(
    scanner: &mut Scanner<File>,
    decompressor: &mut Decompressor,
    body: &mut Vec<u8>,
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
        scanner.read_into(offset + scan::PREFIX, length, body)?;
        match decompressor.chunk(body, bound) {
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
        let message = self.next_ref()?;
        Some(message.map(|message| message.to_message()))
    }
}

pub(super) fn bad_message(
    message: MessageRef<'_>,
) -> impl FnOnce(crate::error::MessageError) -> Error {
    let topic = message.channel.topic.clone();
    let log_time = message.log_time.0;
    move |cause| Error::BadMessage {
        topic,
        log_time,
        cause,
    }
}

pub(super) fn record(message: MessageRef<'_>) -> Result<Option<Record>> {
    let channel = message.channel;
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
            let of_frame = signals.iter().find(|signal| &*signal.name == CAN_ID);
            Measurement::Signals(SignalFrame {
                message: name.into(),
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
    convert::decode(&envelope, message.data).map_err(bad_message(message))
}

pub(super) fn signals(message: MessageRef<'_>) -> Result<Vec<Signal>> {
    let channel = message.channel;
    dynamic::decode(&channel.schema_data, &channel.metadata, message.data)
        .map_err(|cause| bad_message(message)(cause.into()))
}
