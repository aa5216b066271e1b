//! u-blox UBX (interface descriptions of the M8, F9 and M10 receivers).
//!
//! Decoded are NAV-PVT, NAV-RELPOSNED, NAV-ATT, NAV-DOP, ESF-MEAS, ESF-RAW and TIM-TM2; other messages
//! are known by name. NAV messages carry the GPS time of week; the week follows from the date of NAV-PVT.

mod body;
mod convert;
mod sensors;

pub use body::{Attitude, Body, Dop, Pvt, RelativePosition, TimeMark};
pub(crate) use convert::Memory;
pub use sensors::{READINGS_MAX, Reading, Readings};

use crate::codec::{BinaryReader, BinaryWriter};
use crate::frame::Scan;

const SYNC: [u8; 2] = [0xB5, 0x62];
/// Bytes before and after the payload.
const OVERHEAD: usize = 8;
/// Longest message that is waited for: RXM-RAWX of 90 signals takes a third of it.
pub(crate) const MAX_FRAME: usize = 8192;

/// Class and number of the messages that are decoded.
const MESSAGES: [([u8; 2], &str); 7] = [
    ([0x01, 0x04], "NAV-DOP"),
    ([0x01, 0x05], "NAV-ATT"),
    ([0x01, 0x07], "NAV-PVT"),
    ([0x01, 0x3C], "NAV-RELPOSNED"),
    ([0x0D, 0x03], "TIM-TM2"),
    ([0x10, 0x02], "ESF-MEAS"),
    ([0x10, 0x03], "ESF-RAW"),
];

/// Class and number of the messages that are known by name alone.
const KNOWN: [([u8; 2], &str); 48] = [
    ([0x01, 0x01], "NAV-POSECEF"),
    ([0x01, 0x02], "NAV-POSLLH"),
    ([0x01, 0x03], "NAV-STATUS"),
    ([0x01, 0x06], "NAV-SOL"),
    ([0x01, 0x09], "NAV-ODO"),
    ([0x01, 0x11], "NAV-VELECEF"),
    ([0x01, 0x12], "NAV-VELNED"),
    ([0x01, 0x13], "NAV-HPPOSECEF"),
    ([0x01, 0x14], "NAV-HPPOSLLH"),
    ([0x01, 0x17], "NAV-PVAT"),
    ([0x01, 0x20], "NAV-TIMEGPS"),
    ([0x01, 0x21], "NAV-TIMEUTC"),
    ([0x01, 0x22], "NAV-CLOCK"),
    ([0x01, 0x23], "NAV-TIMEGLO"),
    ([0x01, 0x24], "NAV-TIMEBDS"),
    ([0x01, 0x25], "NAV-TIMEGAL"),
    ([0x01, 0x26], "NAV-TIMELS"),
    ([0x01, 0x27], "NAV-TIMEQZSS"),
    ([0x01, 0x30], "NAV-SVINFO"),
    ([0x01, 0x32], "NAV-SBAS"),
    ([0x01, 0x34], "NAV-ORB"),
    ([0x01, 0x35], "NAV-SAT"),
    ([0x01, 0x36], "NAV-COV"),
    ([0x01, 0x39], "NAV-GEOFENCE"),
    ([0x01, 0x3D], "NAV-EELL"),
    ([0x01, 0x42], "NAV-SLAS"),
    ([0x01, 0x43], "NAV-SIG"),
    ([0x01, 0x60], "NAV-AOPSTATUS"),
    ([0x01, 0x61], "NAV-EOE"),
    ([0x02, 0x13], "RXM-SFRBX"),
    ([0x02, 0x15], "RXM-RAWX"),
    ([0x02, 0x32], "RXM-RTCM"),
    ([0x0A, 0x04], "MON-VER"),
    ([0x0A, 0x06], "MON-MSGPP"),
    ([0x0A, 0x09], "MON-HW"),
    ([0x0A, 0x0B], "MON-HW2"),
    ([0x0A, 0x31], "MON-SPAN"),
    ([0x0A, 0x36], "MON-COMMS"),
    ([0x0A, 0x37], "MON-HW3"),
    ([0x0A, 0x38], "MON-RF"),
    ([0x0D, 0x01], "TIM-TP"),
    ([0x10, 0x10], "ESF-STATUS"),
    ([0x10, 0x14], "ESF-ALG"),
    ([0x10, 0x15], "ESF-INS"),
    ([0x28, 0x00], "HNR-PVT"),
    ([0x28, 0x01], "HNR-ATT"),
    ([0x28, 0x02], "HNR-INS"),
    ([0x13, 0x10], "MGA-SF"),
];
/// Classes of answers and settings.
const CLASSES: [(u8, &str); 3] = [(0x05, "ACK"), (0x06, "CFG"), (0x04, "INF")];

/// Scans bytes that begin with `B5`.
pub(crate) fn scan(bytes: &[u8]) -> Scan<()> {
    match bytes.get(1) {
        None => return Scan::Need(2),
        Some(second) if *second != SYNC[1] => return Scan::Skip(1),
        Some(_) => {}
    }
    if bytes.len() < 6 {
        return Scan::Need(6);
    }
    let len = OVERHEAD + usize::from(u16::from_le_bytes([bytes[4], bytes[5]]));
    if len > MAX_FRAME {
        return Scan::Skip(1);
    }
    if bytes.len() < len {
        return Scan::Need(len);
    }
    if checksum(&bytes[2..len - 2]) == bytes[len - 2..len] {
        Scan::Frame { len, kind: () }
    } else {
        Scan::BadChecksum
    }
}

/// The checksum of RFC 1145.
pub(crate) fn checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b], byte| {
        let a: u8 = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    })
}

/// What a message with a good checksum turned out to be.
#[expect(
    clippy::large_enum_variant,
    reason = "it lives for one message, on the stack"
)]
pub(crate) enum Decoded {
    Message(&'static str, Body),
    /// With its name if that is known, and class and number.
    Unknown(Option<&'static str>, u16),
    Malformed(u16),
}

/// Decodes a message that [`scan`] has checked.
pub(crate) fn decode(bytes: &[u8]) -> Decoded {
    let kind = [bytes[2], bytes[3]];
    let number = u16::from_be_bytes(kind);
    let Some((_, name)) = MESSAGES.iter().find(|(known, _)| *known == kind) else {
        let known = KNOWN.iter().find(|(known, _)| *known == kind);
        let class = CLASSES.iter().find(|(class, _)| *class == kind[0]);
        let name = known
            .map(|(_, name)| *name)
            .or(class.map(|(_, name)| *name));
        return Decoded::Unknown(name, number);
    };
    let payload = &bytes[6..bytes.len() - 2];
    match Body::read(kind, &mut BinaryReader(payload)) {
        Some(body) => Decoded::Message(name, body),
        None => Decoded::Malformed(number),
    }
}

/// Appends a message with this class, number and payload.
pub fn encode_frame(kind: [u8; 2], payload: &[u8], out: &mut Vec<u8>) {
    out.extend(SYNC);
    let start = out.len();
    out.extend(kind);
    out.extend((payload.len() as u16).to_le_bytes());
    out.extend(payload);
    let sum = checksum(&out[start..]);
    out.extend(sum);
}

impl Body {
    /// Appends this message.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let mut payload = Vec::new();
        let kind = self.write(&mut BinaryWriter(&mut payload));
        encode_frame(kind, &payload, out);
    }
}

/// The command that sets how often the receiver sends a message on the port that receives the command:
/// every `period`th solution, 0 for never (CFG-MSG, M8; F9 and M10 take it too).
#[must_use]
pub fn rate_command(kind: [u8; 2], period: u8) -> Vec<u8> {
    let mut out = Vec::new();
    encode_frame([0x06, 0x01], &[kind[0], kind[1], period], &mut out);
    out
}
