use std::sync::LazyLock;

use crc::{Algorithm, CRC_32_ISO_HDLC, Crc, Table};
use sample::DeviceTime;

use super::{KNOWN, LOGS};
use crate::codec::{AsciiReader, BinaryReader, Codec, Names};
use crate::frame::Scan;
use crate::gps_time::MILLISECONDS_PER_WEEK;

/// The usual reflected CRC-32, started at zero and not inverted at the end.
static ALGORITHM: Algorithm<u32> = Algorithm {
    init: 0,
    xorout: 0,
    ..CRC_32_ISO_HDLC
};
static CRC: LazyLock<Crc<u32, Table<1>>> = LazyLock::new(|| Crc::<u32, Table<1>>::new(&ALGORITHM));

/// Longest frame that is waited for: a RANGE log of a hundred signals takes half of it.
pub(crate) const MAX_FRAME: usize = 8192;
pub(super) const LONG_HEADER: usize = 28;
pub(super) const SHORT_HEADER: usize = 12;

pub(super) const TIME_STATUS: Names = &[
    (20, "UNKNOWN"),
    (60, "APPROXIMATE"),
    (80, "COARSEADJUSTING"),
    (100, "COARSE"),
    (120, "COARSESTEERING"),
    (130, "FREEWHEELING"),
    (140, "FINEADJUSTING"),
    (160, "FINE"),
    (170, "FINEBACKUPSTEERING"),
    (180, "FINESTEERING"),
    (200, "SATTIME"),
];

/// How a frame is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Long,
    Short,
    Ascii,
    ShortAscii,
}

impl Form {
    pub fn is_ascii(self) -> bool {
        matches!(self, Self::Ascii | Self::ShortAscii)
    }
}

/// Header of a log. Short headers have id and time alone; the rest is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Message id; 0 for an ASCII log that is not decoded.
    pub id: u16,
    /// Whether this answers a command instead of being a log.
    pub response: bool,
    /// Measurement source of the message type: 0 the first antenna, 1 the second.
    pub antenna: u8,
    /// Counts down the logs that were asked for together.
    pub sequence: u16,
    /// Idle time of the receiver's processor in half percent.
    pub idle: u8,
    /// Quality of the receiver's time: 20 unknown, 60 approximate, 80 to 120 coarse,
    /// 130 freewheeling, 140 to 180 fine.
    pub time_status: u8,
    /// GPS week.
    pub week: u16,
    /// Milliseconds of the week, GPS time.
    pub milliseconds: u32,
    /// Receiver status word.
    pub receiver_status: u32,
    /// Receiver software build.
    pub software: u16,
    /// Whether this came with a short header.
    pub short: bool,
}

impl Header {
    /// The time tag; `None` while the receiver does not know the time.
    #[must_use]
    pub fn device_time(&self) -> Option<DeviceTime> {
        let known = self.short || self.time_status >= 80;
        (known && self.week > 0).then(|| DeviceTime::Gps {
            week: Some(self.week),
            time_of_week_s: f64::from(self.milliseconds) / 1000.0,
        })
    }
}

pub(super) fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Scans bytes that begin with `AA`, `#` or `%`.
pub(crate) fn scan(bytes: &[u8]) -> Scan<Form> {
    match bytes[0] {
        0xAA => scan_binary(bytes),
        b'#' => scan_ascii(bytes, Form::Ascii),
        b'%' => scan_ascii(bytes, Form::ShortAscii),
        _ => Scan::Skip(1),
    }
}

fn scan_binary(bytes: &[u8]) -> Scan<Form> {
    match bytes.get(1) {
        None => return Scan::Need(2),
        Some(0x44) => {}
        Some(_) => return Scan::Skip(1),
    }
    let (form, len) = match bytes.get(2) {
        None => return Scan::Need(3),
        Some(0x12) => {
            if bytes.len() < 20 {
                return Scan::Need(20);
            }
            let header = usize::from(bytes[3]);
            let body = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
            let ms = u32::from_le_bytes([bytes[16], bytes[17], bytes[18], bytes[19]]);
            if header < LONG_HEADER || ms >= MILLISECONDS_PER_WEEK {
                return Scan::Skip(1);
            }
            (Form::Long, header + body + 4)
        }
        Some(0x13) => {
            if bytes.len() < SHORT_HEADER {
                return Scan::Need(SHORT_HEADER);
            }
            let ms = u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]);
            if ms >= MILLISECONDS_PER_WEEK {
                return Scan::Skip(1);
            }
            (Form::Short, SHORT_HEADER + usize::from(bytes[3]) + 4)
        }
        Some(_) => return Scan::Skip(1),
    };
    if len > MAX_FRAME {
        return Scan::Skip(1);
    }
    if bytes.len() < len {
        return Scan::Need(len);
    }
    let (content, saved) = bytes[..len].split_at(len - 4);
    if checksum(content).to_le_bytes() == saved {
        Scan::Frame { len, kind: form }
    } else {
        Scan::BadChecksum
    }
}

fn scan_ascii(bytes: &[u8], form: Form) -> Scan<Form> {
    match bytes.get(1) {
        None => return Scan::Need(2),
        Some(first) if first.is_ascii_uppercase() => {}
        Some(_) => return Scan::Skip(1),
    }
    let end = bytes[1..]
        .iter()
        .take(MAX_FRAME)
        .position(|b| *b == b'*' || !matches!(b, b' '..=b'~'));
    let Some(end) = end.map(|end| end + 1) else {
        return Scan::Need(bytes.len() + 1);
    };
    if bytes[end] != b'*' {
        return Scan::Skip(1);
    }
    let len = end + 9;
    let digits = &bytes[end + 1..bytes.len().min(len)];
    if !digits.iter().all(u8::is_ascii_hexdigit) {
        return Scan::Skip(1);
    }
    if bytes.len() < len {
        return Scan::Need(len);
    }
    let saved = std::str::from_utf8(digits).ok();
    let saved = saved.and_then(|text| u32::from_str_radix(text, 16).ok());
    if saved == Some(checksum(&bytes[1..end])) {
        Scan::Frame { len, kind: form }
    } else {
        Scan::BadChecksum
    }
}

/// Header and body of a checked binary frame.
pub(super) fn binary_header(form: Form, bytes: &[u8]) -> Option<(Header, &[u8])> {
    let mut header = Header::default();
    let (mut ignored, mut ignored_word) = (0u8, 0u16);
    if form == Form::Short {
        header.short = true;
        let mut reader = BinaryReader(&bytes[4..]);
        reader.u16(&mut header.id)?;
        reader.u16(&mut header.week)?;
        reader.u32(&mut header.milliseconds)?;
        return Some((header, &bytes[SHORT_HEADER..bytes.len() - 4]));
    }
    let mut reader = BinaryReader(&bytes[4..]);
    let mut kind = 0;
    reader.u16(&mut header.id)?;
    reader.u8(&mut kind)?;
    header.response = kind & 0x80 != 0;
    header.antenna = kind & 0x1F;
    reader.u8(&mut ignored)?;
    reader.u16(&mut ignored_word)?;
    reader.u16(&mut header.sequence)?;
    reader.u8(&mut header.idle)?;
    reader.u8(&mut header.time_status)?;
    reader.u16(&mut header.week)?;
    reader.u32(&mut header.milliseconds)?;
    reader.u32(&mut header.receiver_status)?;
    reader.u16(&mut ignored_word)?;
    reader.u16(&mut header.software)?;
    let header_len = usize::from(bytes[3]);
    Some((header, &bytes[header_len..bytes.len() - 4]))
}

/// Header and body of a checked ASCII frame.
pub(super) fn ascii_header(form: Form, bytes: &[u8]) -> Option<(Header, &[u8])> {
    let text = std::str::from_utf8(&bytes[1..bytes.len() - 9]).ok()?;
    let (head, body) = text.split_once(';')?;
    let mut fields = AsciiReader::new(head);
    let name = fields.text()?;
    // The number of a further antenna follows an underscore: `BESTPOSA_1` or `BESTPOS_1A`.
    let (stem, antenna) = match name.split_once('_') {
        Some((stem, number)) => (stem, number.trim_end_matches(['A', 'R']).parse().ok()?),
        None => (name, 0),
    };
    let stem = stem.strip_suffix(['A', 'R']).unwrap_or(stem);
    let known = LOGS.iter().map(|(id, name, _)| (id, name));
    let mut known = known.chain(KNOWN.iter().map(|(id, name)| (id, name)));
    let mut header = Header {
        id: known
            .find(|(_, name)| **name == stem)
            .map_or(0, |(id, _)| *id),
        response: name.ends_with('R'),
        antenna,
        short: form == Form::ShortAscii,
        ..Header::default()
    };
    let seconds: f64 = if header.short {
        fields.u16(&mut header.week)?;
        fields.number()?
    } else {
        fields.text()?;
        fields.u16(&mut header.sequence)?;
        let idle_percent: f64 = fields.number()?;
        header.idle = (idle_percent * 2.0).round() as u8;
        let mut status = 0;
        fields.named(&mut status, TIME_STATUS)?;
        header.time_status = u8::try_from(status).unwrap_or(0);
        fields.u16(&mut header.week)?;
        let seconds = fields.number()?;
        header.receiver_status = u32::from_str_radix(fields.text()?, 16).ok()?;
        fields.text()?;
        fields.u16(&mut header.software)?;
        seconds
    };
    header.milliseconds = (seconds * 1000.0).round() as u32;
    Some((header, body.as_bytes()))
}
