//! Decoded and estimated messages as a stream of frames, for a process that shows them live.
//!
//! A frame is its length (32 bits, little-endian, without these four bytes), one byte for its kind,
//! and its body:
//!
//! | kind | body |
//! |---|---|
//! | 1 | a channel: `atvrec.JournalChannel` |
//! | 2 | a message: channel (16 bits), log time and publish time (64 bits each), the encoded message |
//! | 3 | number of records that were left out because the reader was slow (64 bits) |
//! | 4 | log time of the writer (64 bits) |
//! | 5 | a JSON text that says what the writer is |

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::mem::Discriminant;
use std::sync::Arc;

use prost::Message as _;
use sample::{LogTime, Measurement, SourceId};

use crate::channels::Channels;
use crate::convert::{self, Encoded, Envelope};
use crate::dynamic::DynamicMessage;
use crate::proto::atvrec as pb;
use crate::reader::ChannelInfo;
use crate::{Error, Record, Result, Session};

const CHANNEL: u8 = 1;
const MESSAGE: u8 = 2;
const LOST: u8 = 3;
const TIME: u8 = 4;
const HELLO: u8 = 5;

/// Longest frame that a reader accepts, bytes.
const FRAME_MAX: usize = 16 << 20;
/// Bytes of a message before its data.
const MESSAGE_HEAD: usize = 18;
/// A kind of records that nobody wants is encoded again after this time: it may have a new topic.
const LOOK_AGAIN_NS: i64 = sample::NANOS_PER_SECOND;
/// Channels that are announced at the start, so that a reader misses no rare message of theirs.
const ANNOUNCED: [(&str, &str); 16] = [
    ("/estimate/motion", "atvrec.Motion"),
    ("/estimate/tyre_forces", "atvrec.TyreForces"),
    ("/estimate/contact_forces", "atvrec.TyreForces"),
    ("/estimate/rollover", "atvrec.Rollover"),
    ("/estimate/road", "atvrec.Road"),
    ("/estimate/limits", "atvrec.Limits"),
    ("/estimate/terrain", "atvrec.Terrain"),
    ("/estimate/parameters", "atvrec.Parameters"),
    ("/estimate/events", "atvrec.Event"),
    ("/model/tyre_forces", "atvrec.TyreForces"),
    ("/tf", "foxglove.FrameTransforms"),
    ("/scene", "foxglove.SceneUpdate"),
    ("/health", "atvrec.Health"),
    ("/utc_offset", "atvrec.UtcOffset"),
    ("/mark", "atvrec.Mark"),
    ("/log", "foxglove.Log"),
];

/// A channel of a tap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TapChannel {
    /// Number of the channel in this connection.
    pub id: u16,
    /// Topic, schema and metadata.
    pub info: Arc<ChannelInfo>,
}

/// A message of a tap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TapMessage {
    /// Number of its channel.
    pub channel: u16,
    /// Log clock when it was recorded or computed.
    pub log_time: LogTime,
    /// Log clock when it was true.
    pub publish_time: LogTime,
    /// Contents, by the schema of the channel.
    pub data: Arc<[u8]>,
}

impl TapMessage {
    /// The record of the message; `None` for schemas that are derived or foreign.
    ///
    /// # Errors
    /// If the data does not fit the schema.
    pub fn record(&self, channel: &ChannelInfo) -> Result<Option<Record>> {
        let envelope = Envelope {
            topic: &channel.topic,
            schema: &channel.schema,
            source: channel.source.unwrap_or(SourceId::HOST),
            log_time: self.log_time,
            publish_time: self.publish_time,
        };
        convert::decode(&envelope, &self.data).map_err(|error| Error::Tap(error.to_string()))
    }
}

/// A frame of a tap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TapFrame {
    /// A channel, before its first message. A channel of the same topic that was announced before
    /// ends.
    Channel(TapChannel),
    /// A message.
    Message(TapMessage),
    /// Records that were left out so far because the reader was slow.
    Lost(u64),
    /// Log time of the writer, several times a second.
    Time(LogTime),
    /// What the writer is, as JSON.
    Hello(String),
}

/// Writes the frames of one connection.
pub struct TapEncoder {
    names: BTreeMap<SourceId, String>,
    /// Channels; those that are announced have numbers.
    channels: Channels,
    next_id: u16,
    dynamic: BTreeMap<String, DynamicMessage>,
    /// Topics that the reader wants; `None` is all.
    wanted: Option<BTreeSet<String>>,
    kinds: HashMap<Kind, Topics>,
}

/// Kind of records that have the same topics.
type Kind = (
    Discriminant<Record>,
    Option<(Discriminant<Measurement>, SourceId, u32)>,
);

/// Topics of a kind of records, and when they were last looked at.
#[derive(Default)]
struct Topics {
    topics: BTreeSet<Arc<str>>,
    is_wanted: bool,
    looked_at: LogTime,
}

impl TapEncoder {
    /// Encoder of the records of a session; the reader wants no topic so far.
    #[must_use]
    pub fn new(session: &Session) -> Self {
        let sources = session.sources.iter();
        Self {
            names: sources.map(|s| (s.id, s.name.clone())).collect(),
            channels: Channels::default(),
            next_id: 0,
            dynamic: session
                .dynamic
                .iter()
                .map(|message| (message.topic.clone(), message.clone()))
                .collect(),
            wanted: Some(BTreeSet::new()),
            kinds: HashMap::new(),
        }
    }

    /// Appends the frames with which a connection begins.
    pub fn begin(&mut self, hello: &str, out: &mut Vec<u8>) {
        frame(out, HELLO, |out| {
            out.extend_from_slice(hello.as_bytes());
        });
        for (topic, schema) in ANNOUNCED {
            let channel = self.channels.named(topic, schema, None);
            self.announce(channel, out);
        }
    }

    /// Sets the topics that the reader wants; `None` is all.
    pub fn select(&mut self, topics: Option<BTreeSet<String>>) {
        self.wanted = topics;
        self.kinds.clear();
    }

    /// Appends the messages of a record on wanted topics. A record without such topics is not
    /// encoded, except the first of its kind and one each second.
    pub fn record(&mut self, record: &Record, out: &mut Vec<u8>) {
        let now = time_of(record);
        let kind = kind_of(record);
        if let Some(known) = self.kinds.get(&kind)
            && !known.is_wanted
            && now - known.looked_at < LOOK_AGAIN_NS
        {
            return;
        }
        let names = &self.names;
        let name = |id: SourceId| names.get(&id).cloned().unwrap_or_default();
        let mut messages = Vec::new();
        let dynamic = &mut self.dynamic;
        (self.channels).messages(record, &name, dynamic, &mut |channels, message, _| {
            let encoded = channels.get_mut(message.channel).encoded(&message);
            messages.push((message.channel, encoded));
        });
        let topics = self.kinds.entry(kind).or_default();
        topics.looked_at = now;
        for (_, message) in &messages {
            if !topics.topics.contains(&message.topic) {
                topics.topics.insert(Arc::clone(&message.topic));
                let wanted = self.wanted.as_ref();
                topics.is_wanted |= wanted.is_none_or(|set| set.contains(&*message.topic));
            }
        }
        for (channel, message) in messages {
            self.message(channel, &message, out);
        }
    }

    fn message(&mut self, channel: usize, message: &Encoded, out: &mut Vec<u8>) {
        let id = self.announce(channel, out);
        let wanted = self.wanted.as_ref();
        if wanted.is_some_and(|topics| !topics.contains(&*message.topic)) {
            return;
        }
        frame(out, MESSAGE, |out| {
            out.extend_from_slice(&id.to_le_bytes());
            out.extend_from_slice(&message.log_time.0.to_le_bytes());
            out.extend_from_slice(&message.publish_time.0.to_le_bytes());
            out.extend_from_slice(&message.data);
        });
    }

    /// Number of a channel; announces it if it is new.
    fn announce(&mut self, channel: usize, out: &mut Vec<u8>) -> u16 {
        let channel = self.channels.get_mut(channel);
        if let Some(id) = channel.id {
            return id;
        }
        let id = self.next_id;
        self.next_id = self.next_id.wrapping_add(1);
        channel.id = Some(id);
        let (schema_data, metadata) = channel.description(&self.dynamic);
        let message = pb::JournalChannel {
            id: id.into(),
            topic: channel.topic.to_string(),
            metadata: metadata.into_iter().collect(),
            schema_id: 0,
            schema: channel.schema.to_string(),
            schema_data,
        };
        frame(out, CHANNEL, |out| {
            out.extend_from_slice(&message.encode_to_vec());
        });
        id
    }

    /// Appends the number of records that were left out so far.
    pub fn lost(&self, count: u64, out: &mut Vec<u8>) {
        frame(out, LOST, |out| out.extend_from_slice(&count.to_le_bytes()));
    }

    /// Appends the log time of the writer.
    pub fn time(&self, now: LogTime, out: &mut Vec<u8>) {
        frame(out, TIME, |out| out.extend_from_slice(&now.0.to_le_bytes()));
    }
}

fn frame(out: &mut Vec<u8>, kind: u8, body: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.extend_from_slice(&[0, 0, 0, 0, kind]);
    body(out);
    let length = u32::try_from(out.len() - start - 4).unwrap_or(u32::MAX);
    out[start..start + 4].copy_from_slice(&length.to_le_bytes());
}

fn kind_of(record: &Record) -> Kind {
    let sample = match record {
        Record::Sample(sample) => {
            let id = match &sample.measurement {
                Measurement::Signals(frame) => frame.id,
                _ => 0,
            };
            let measurement = std::mem::discriminant(&sample.measurement);
            Some((measurement, sample.source, id))
        }
        _ => None,
    };
    (std::mem::discriminant(record), sample)
}

fn time_of(record: &Record) -> LogTime {
    match record {
        Record::Sample(sample) => sample.log_time,
        Record::Estimate(estimate) => estimate.time,
        Record::Truth(truth) => truth.time,
        Record::Motion { time, .. }
        | Record::TyreForces { time, .. }
        | Record::Rollover { time, .. }
        | Record::Friction { time, .. }
        | Record::Ground { time, .. }
        | Record::Pose { time, .. }
        | Record::Mark { time, .. }
        | Record::Transforms { time, .. } => *time,
        Record::Road { road, .. } => road.time,
        Record::Limits(limits) => limits.time,
        Record::Terrain(terrain) => terrain.time,
        Record::Parameters(parameters) => parameters.time,
        Record::Event(event) => event.time,
        Record::Health(health) => health.time,
        Record::ClockFit(fit) => fit.time,
        Record::UtcOffset(offset) => offset.time,
        Record::Log(message) => message.time,
        Record::Scene(scene) => scene.time,
    }
}

/// Reads the frames of one connection from its bytes.
#[derive(Default)]
pub struct TapDecoder {
    bytes: Vec<u8>,
    used: usize,
}

impl TapDecoder {
    /// Takes the next bytes of the connection.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.used);
        self.used = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// The next complete frame. Frames of unknown kinds are left out.
    ///
    /// # Errors
    /// If the bytes are not those of a tap.
    pub fn next_frame(&mut self) -> Result<Option<TapFrame>> {
        loop {
            let rest = &self.bytes[self.used..];
            let Some((head, rest)) = rest.split_first_chunk::<4>() else {
                return Ok(None);
            };
            let length = u32::from_le_bytes(*head) as usize;
            if length == 0 || length > FRAME_MAX {
                return Err(Error::Tap(format!("a frame has {length} bytes")));
            }
            let Some(body) = rest.get(..length) else {
                return Ok(None);
            };
            let found = decode(body)?;
            self.used += 4 + length;
            if found.is_some() {
                return Ok(found);
            }
        }
    }
}

fn decode(frame: &[u8]) -> Result<Option<TapFrame>> {
    let short = || Error::Tap("a frame ends early".to_owned());
    let (kind, body) = frame.split_first().ok_or_else(short)?;
    let number = |at: usize| {
        let bytes = body.get(at..).and_then(<[u8]>::first_chunk::<8>);
        bytes.map(|b| u64::from_le_bytes(*b)).ok_or_else(short)
    };
    Ok(Some(match *kind {
        CHANNEL => {
            let channel = pb::JournalChannel::decode(body);
            let channel = channel.map_err(|error| Error::Tap(error.to_string()))?;
            let mut metadata: BTreeMap<String, String> = channel.metadata.into_iter().collect();
            let source = metadata.remove("source").and_then(|s| s.parse().ok());
            TapFrame::Channel(TapChannel {
                id: channel.id as u16,
                info: Arc::new(ChannelInfo {
                    topic: channel.topic,
                    schema: channel.schema,
                    schema_data: channel.schema_data.into(),
                    message_encoding: "protobuf".to_owned(),
                    source: source.map(SourceId),
                    metadata,
                    is_earlier: false,
                }),
            })
        }
        MESSAGE => TapFrame::Message(TapMessage {
            channel: body
                .first_chunk::<2>()
                .map(|b| u16::from_le_bytes(*b))
                .ok_or_else(short)?,
            log_time: LogTime(number(2)?),
            publish_time: LogTime(number(10)?),
            data: body.get(MESSAGE_HEAD..).ok_or_else(short)?.into(),
        }),
        LOST => TapFrame::Lost(number(0)?),
        TIME => TapFrame::Time(LogTime(number(0)?)),
        HELLO => TapFrame::Hello(String::from_utf8_lossy(body).into_owned()),
        _ => return Ok(None),
    }))
}

#[cfg(test)]
mod tests {
    use sample::{ControlSample, Sample, Signal};

    use super::*;
    fn session() -> Session {
        Session {
            sources: vec![crate::Source {
                id: SourceId(0),
                name: "bus".to_owned(),
                kind: crate::SourceKind::Serial,
            }],
            ..Session::default()
        }
    }

    fn mark(time: u64) -> Record {
        Record::Mark {
            time: LogTime(time),
            text: "gravel".to_owned(),
        }
    }

    fn control(time: u64, names: &[&str]) -> Record {
        let values = names.iter().map(|name| Signal {
            name: (*name).into(),
            value: 2.0,
            unit: "V".into(),
        });
        Record::Sample(Sample {
            source: SourceId(0),
            log_time: LogTime(time),
            valid_time: LogTime(time),
            device_time: None,
            measurement: Measurement::Control(ControlSample {
                values: values.collect(),
            }),
        })
    }

    fn frames(bytes: &[u8], piece: usize) -> Vec<TapFrame> {
        let mut decoder = TapDecoder::default();
        let mut found = Vec::new();
        for piece in bytes.chunks(piece) {
            decoder.push(piece);
            while let Some(frame) = decoder.next_frame().expect("valid frames") {
                found.push(frame);
            }
        }
        found
    }

    fn topics_of_messages(frames: &[TapFrame]) -> Vec<String> {
        let mut known = HashMap::new();
        let mut topics = Vec::new();
        for frame in frames {
            match frame {
                TapFrame::Channel(channel) => {
                    known.insert(channel.id, channel.info.topic.clone());
                }
                TapFrame::Message(message) => topics.push(known[&message.channel].clone()),
                _ => {}
            }
        }
        topics
    }

    #[test]
    fn frames_survive_any_division_into_pieces() {
        let mut encoder = TapEncoder::new(&session());
        encoder.select(None);
        let mut bytes = Vec::new();
        encoder.begin("{}", &mut bytes);
        encoder.record(&mark(5), &mut bytes);
        encoder.lost(7, &mut bytes);
        encoder.time(LogTime(9), &mut bytes);
        let whole = frames(&bytes, usize::MAX);
        for piece in [1, 3, 64] {
            assert_eq!(frames(&bytes, piece), whole);
        }
        let TapFrame::Message(message) = &whole[ANNOUNCED.len() + 1] else {
            panic!("{whole:?}");
        };
        let channel = whole.iter().find_map(|frame| match frame {
            TapFrame::Channel(channel) if channel.id == message.channel => Some(&channel.info),
            _ => None,
        });
        let channel = channel.expect("announced before");
        assert_eq!(message.record(channel).expect("valid"), Some(mark(5)));
        assert_eq!(whole[whole.len() - 2], TapFrame::Lost(7));
        assert_eq!(whole[whole.len() - 1], TapFrame::Time(LogTime(9)));
    }

    #[test]
    fn only_wanted_topics_are_sent_and_all_are_announced() {
        let mut encoder = TapEncoder::new(&session());
        let mut bytes = Vec::new();
        encoder.record(&mark(0), &mut bytes);
        encoder.record(&control(0, &["a"]), &mut bytes);
        let found = frames(&bytes, usize::MAX);
        assert_eq!(topics_of_messages(&found), [""; 0]);
        assert_eq!(found.len(), 2, "two channels: {found:?}");

        // Nobody wants these: they are not encoded again.
        let before = bytes.len();
        encoder.record(&mark(1), &mut bytes);
        encoder.record(&control(1, &["a"]), &mut bytes);
        assert_eq!(bytes.len(), before);

        encoder.select(Some(BTreeSet::from(["/control/bus".to_owned()])));
        encoder.record(&mark(2), &mut bytes);
        encoder.record(&control(2, &["a"]), &mut bytes);
        assert_eq!(
            topics_of_messages(&frames(&bytes, usize::MAX)),
            ["/control/bus"]
        );
    }

    #[test]
    fn a_new_signal_gives_a_new_channel() {
        let mut encoder = TapEncoder::new(&session());
        encoder.select(None);
        let mut bytes = Vec::new();
        encoder.record(&control(1, &["a"]), &mut bytes);
        encoder.record(&control(2, &["a", "b"]), &mut bytes);
        let channels: Vec<u16> = frames(&bytes, usize::MAX)
            .iter()
            .filter_map(|frame| match frame {
                TapFrame::Channel(channel) => Some(channel.id),
                _ => None,
            })
            .collect();
        assert_eq!(channels, [0, 1]);
    }

    #[test]
    fn other_bytes_are_an_error() {
        let mut decoder = TapDecoder::default();
        decoder.push(b"GET / HTTP/1.1\r\n");
        assert!(decoder.next_frame().is_err());
        let mut decoder = TapDecoder::default();
        decoder.push(&[3, 0, 0, 0, MESSAGE, 1, 0]);
        assert!(decoder.next_frame().is_err());
    }
}
