//! What one receiver port carries: NovAtel binary and ASCII, SBF, UBX, NMEA, RTCM and plain-text answers
//! to commands, in any mixture. The port of a VectorNav unit carries its outputs too.

use crate::frame::{Frame, Framer, Scan};
use crate::{
    Item, Measurements, Message, Protocol, Statistics, nmea, novatel, rtcm, sbf, ubx, vectornav,
};

const MAX_FRAME: usize = sbf::MAX_FRAME;
/// Longest plain-text answer.
const MAX_REPLY: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Novatel(novatel::Form),
    Sbf,
    Nmea,
    Ubx,
    Rtcm,
    Vectornav(vectornav::Form),
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
    matches!(byte, 0xAA | b'#' | b'%' | b'$' | b'<' | 0xB5 | 0xD3)
}

/// Scans the port of a VectorNav unit.
fn scan_vectornav(bytes: &[u8]) -> Scan<Kind> {
    match (bytes[0], bytes.get(1), bytes.get(2)) {
        (vectornav::SYNC, ..) => tag(vectornav::scan(bytes), Kind::Vectornav),
        (b'$', None, _) => Scan::Need(2),
        (b'$', Some(b'V'), None) => Scan::Need(3),
        (b'$', Some(b'V'), Some(b'N')) => tag(vectornav::scan(bytes), Kind::Vectornav),
        _ => match scan(bytes) {
            // The receiver's scan passes over the beginnings of outputs.
            Scan::Skip(count) => {
                let skipped = &bytes[1..count.min(bytes.len())];
                let output = skipped.iter().position(|byte| *byte == vectornav::SYNC);
                Scan::Skip(output.map_or(count, |at| at + 1))
            }
            other => other,
        },
    }
}

fn scan(bytes: &[u8]) -> Scan<Kind> {
    match (bytes[0], bytes.get(1)) {
        (0xAA | b'#' | b'%', _) => tag(novatel::scan(bytes), Kind::Novatel),
        (0xB5, _) => tag(ubx::scan(bytes), |()| Kind::Ubx),
        (0xD3, _) => tag(rtcm::scan(bytes), |()| Kind::Rtcm),
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
    memory: Memory,
    /// Whether outputs of a VectorNav unit are decoded.
    has_vectornav: bool,
}

/// What earlier messages say about later ones.
#[derive(Clone, Debug, Default)]
struct Memory {
    sbf: sbf::Memory,
    nmea: nmea::Memory,
    ubx: ubx::Memory,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder at the beginning of a receiver's stream.
    #[must_use]
    pub fn new() -> Self {
        Self {
            framer: Framer::new(MAX_FRAME),
            statistics: Statistics::default(),
            memory: Memory::default(),
            has_vectornav: false,
        }
    }

    /// A decoder at the beginning of the stream of a VectorNav unit.
    #[must_use]
    pub fn vectornav() -> Self {
        Self {
            has_vectornav: true,
            ..Self::new()
        }
    }

    fn scanner(&self) -> fn(&[u8]) -> Scan<Kind> {
        if self.has_vectornav {
            scan_vectornav
        } else {
            scan
        }
    }

    /// Takes bytes and hands on each message that they complete.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let scan = self.scanner();
        let memory = &mut self.memory;
        self.framer
            .push(bytes, &mut self.statistics, scan, |frame, statistics| {
                deliver(frame, memory, statistics, &mut sink);
            });
    }

    /// The stream is over: hands on what still waits.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        let scan = self.scanner();
        let memory = &mut self.memory;
        self.framer
            .finish(&mut self.statistics, scan, |frame, statistics| {
                deliver(frame, memory, statistics, &mut sink);
            });
    }

    /// Counts since the start.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}

/// Hands on the message of a frame; several items for a message of several instants.
fn deliver(
    frame: Frame<'_, Kind>,
    memory: &mut Memory,
    statistics: &mut Statistics,
    sink: &mut impl FnMut(Item<'_>),
) {
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
        Kind::Sbf => fill_sbf(&mut item, &mut memory.sbf),
        Kind::Nmea => fill_nmea(&mut item, &mut memory.nmea),
        Kind::Ubx => fill_ubx(&mut item),
        Kind::Rtcm => {
            item.protocol = Protocol::Rtcm;
            item.name = "RTCM";
        }
        Kind::Vectornav(form) => fill_vectornav(&mut item, form),
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
    let Message::Ubx(body) = &item.message else {
        sink(item);
        return;
    };
    let mut is_delivered = false;
    memory.ubx.measured(body, |measured| {
        is_delivered = true;
        sink(Item {
            device_time: measured.device_time,
            measurements: measured.measurements,
            ..item.clone()
        });
    });
    if !is_delivered {
        sink(item);
    }
}

fn fill_ubx(item: &mut Item<'_>) {
    item.protocol = Protocol::Ubx;
    match ubx::decode(item.raw) {
        ubx::Decoded::Message(name, body) => {
            item.name = name;
            item.message = Message::Ubx(Box::new(body));
        }
        ubx::Decoded::Unknown(name, number) => {
            item.name = name.unwrap_or(item.name);
            item.message = Message::Unknown(Some(number));
        }
        ubx::Decoded::Malformed(number) => item.message = Message::Malformed(Some(number)),
    }
}

fn fill_vectornav(item: &mut Item<'_>, form: vectornav::Form) {
    item.protocol = Protocol::Vectornav;
    match vectornav::decode(form, item.raw) {
        vectornav::Decoded::Output(name, output) => {
            item.name = name;
            item.device_time = output.device_time();
            item.measurements = output.measurements();
            item.message = Message::Vectornav(Box::new(output));
        }
        vectornav::Decoded::Unknown(name) => item.name = name.unwrap_or(item.name),
        vectornav::Decoded::Malformed => item.message = Message::Malformed(None),
    }
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
        novatel::Decoded::Unknown(header, name) => {
            item.name = name.unwrap_or(item.name);
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
        sbf::Decoded::Unknown(number, name) => {
            item.name = name.unwrap_or(item.name);
            item.message = Message::Unknown(Some(number));
        }
        sbf::Decoded::Malformed(number) => item.message = Message::Malformed(Some(number)),
    }
}

fn fill_nmea(item: &mut Item<'_>, memory: &mut nmea::Memory) {
    item.protocol = Protocol::Nmea;
    match nmea::decode(item.raw) {
        nmea::Decoded::Sentence(name, sentence) => {
            item.name = name;
            item.device_time = sentence.device_time();
            item.measurements = memory.measurements(&sentence);
            item.message = Message::Nmea(sentence);
        }
        nmea::Decoded::Unknown(name) => item.name = name.unwrap_or(item.name),
        nmea::Decoded::Malformed => item.message = Message::Malformed(None),
    }
}
