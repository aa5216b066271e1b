//! What one receiver port carries: NovAtel binary and ASCII, SBF, NMEA and plain-text answers to
//! commands, in any mixture.

use crate::frame::{Frame, Framer, Scan};
use crate::{Item, Measurements, Message, Protocol, Statistics, nmea, novatel, sbf};

const MAX_FRAME: usize = sbf::MAX_FRAME;
/// Longest plain-text answer.
const MAX_REPLY: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Novatel(novatel::Form),
    Sbf,
    Nmea,
    Reply,
}

fn tag<A, B>(scan: Scan<A>, kind: impl FnOnce(A) -> B) -> Scan<B> {
    match scan {
        Scan::Frame { len, kind: inner } => Scan::Frame {
            len,
            kind: kind(inner),
        },
        Scan::Skip(n) => Scan::Skip(n),
        Scan::Need(n) => Scan::Need(n),
        Scan::BadChecksum => Scan::BadChecksum,
    }
}

fn begins_message(byte: u8) -> bool {
    matches!(byte, 0xAA | b'#' | b'%' | b'$' | b'<')
}

fn scan(bytes: &[u8]) -> Scan<Kind> {
    match (bytes[0], bytes.get(1)) {
        (0xAA | b'#' | b'%', _) => tag(novatel::scan(bytes), Kind::Novatel),
        (b'$' | b'<', None) => Scan::Need(2),
        (b'$', Some(b'@')) => tag(sbf::scan(bytes), |()| Kind::Sbf),
        (b'$', Some(b'R')) => match bytes.get(2) {
            None => Scan::Need(3),
            Some(b':' | b';' | b'?' | b'!') => scan_reply(bytes),
            Some(_) => tag(nmea::scan(bytes), |()| Kind::Nmea),
        },
        (b'$', Some(_)) => tag(nmea::scan(bytes), |()| Kind::Nmea),
        (b'<', Some(_)) => {
            let candidates: [&[u8]; 2] = [b"<OK", b"<ERROR"];
            if candidates.iter().any(|c| bytes.starts_with(c)) {
                scan_reply(bytes)
            } else if candidates.iter().any(|c| c.starts_with(bytes)) {
                Scan::Need(bytes.len() + 1)
            } else {
                Scan::Skip(1)
            }
        }
        _ => Scan::Skip(
            bytes
                .iter()
                .position(|b| begins_message(*b))
                .unwrap_or(bytes.len()),
        ),
    }
}

/// An answer has no checksum: it ends with its line, and anything that could begin a message
/// before that shows that it was none.
fn scan_reply(bytes: &[u8]) -> Scan<Kind> {
    let window = &bytes[1..bytes.len().min(MAX_REPLY)];
    let end = window
        .iter()
        .position(|b| begins_message(*b) || !matches!(b, b' '..=b'~'));
    match end {
        Some(end) if matches!(window[end], b'\r' | b'\n') => Scan::Frame {
            len: end + 1,
            kind: Kind::Reply,
        },
        None if bytes.len() < MAX_REPLY => Scan::Need(bytes.len() + 1),
        _ => Scan::Skip(1),
    }
}

/// Incremental decoder of one receiver's stream.
#[derive(Clone, Debug)]
pub struct Decoder {
    framer: Framer,
    statistics: Statistics,
    memory: sbf::Memory,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder at the beginning of a stream.
    #[must_use]
    pub fn new() -> Self {
        Self {
            framer: Framer::new(MAX_FRAME),
            statistics: Statistics::default(),
            memory: sbf::Memory::default(),
        }
    }

    /// Takes bytes and hands on each message that they complete.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let memory = &mut self.memory;
        self.framer
            .push(bytes, &mut self.statistics, scan, |frame, statistics| {
                sink(item(frame, memory, statistics));
            });
    }

    /// The stream is over: hands on what still waits.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        let memory = &mut self.memory;
        self.framer
            .finish(&mut self.statistics, scan, |frame, statistics| {
                sink(item(frame, memory, statistics));
            });
    }

    /// Counts since the start.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}

fn item<'a>(
    frame: Frame<'a, Kind>,
    memory: &mut sbf::Memory,
    statistics: &mut Statistics,
) -> Item<'a> {
    let mut item = Item {
        protocol: Protocol::Reply,
        name: "unknown",
        device_time: None,
        latency_s: None,
        measurements: Measurements::none(),
        message: Message::Unknown(None),
        raw: frame.bytes,
        range: frame.range,
    };
    match frame.kind {
        Kind::Novatel(form) => fill_novatel(&mut item, form),
        Kind::Sbf => fill_sbf(&mut item, memory),
        Kind::Nmea => fill_nmea(&mut item),
        Kind::Reply => {
            item.name = "reply";
            item.message = Message::Reply;
        }
    }
    match item.message {
        Message::Unknown(_) => statistics.unknown += 1,
        Message::Malformed(_) => statistics.malformed += 1,
        _ => {}
    }
    item
}

fn fill_novatel(item: &mut Item<'_>, form: novatel::Form) {
    item.protocol = if form.is_ascii() {
        Protocol::NovatelAscii
    } else {
        Protocol::NovatelBinary
    };
    match novatel::decode(form, item.raw) {
        novatel::Decoded::Log(name, log) => {
            item.name = name;
            item.device_time = log.header.device_time();
            item.latency_s = log.latency_s();
            item.measurements = log.measurements();
            item.message = Message::Novatel(log);
        }
        novatel::Decoded::Response(header) => {
            item.name = "response";
            item.device_time = header.device_time();
            item.message = Message::Reply;
        }
        novatel::Decoded::Unknown(header) => {
            item.device_time = header.device_time();
            item.message = Message::Unknown((header.id != 0).then_some(header.id));
        }
        novatel::Decoded::Malformed(id) => item.message = Message::Malformed(id),
    }
}

fn fill_sbf(item: &mut Item<'_>, memory: &mut sbf::Memory) {
    item.protocol = Protocol::Sbf;
    match sbf::decode(item.raw) {
        sbf::Decoded::Block(name, block) => {
            item.name = name;
            item.device_time = block.device_time();
            item.measurements = memory.measurements(&block);
            item.message = Message::Sbf(block);
        }
        sbf::Decoded::Unknown(number) => item.message = Message::Unknown(Some(number)),
        sbf::Decoded::Malformed(number) => item.message = Message::Malformed(Some(number)),
    }
}

fn fill_nmea(item: &mut Item<'_>) {
    item.protocol = Protocol::Nmea;
    match nmea::decode(item.raw) {
        nmea::Decoded::Sentence(name, sentence) => {
            item.name = name;
            item.device_time = sentence.device_time();
            item.measurements = sentence.measurements();
            item.message = Message::Nmea(sentence);
        }
        nmea::Decoded::Unknown => {}
        nmea::Decoded::Malformed => item.message = Message::Malformed(None),
    }
}
