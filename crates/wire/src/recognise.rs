//! What a device sends, by its bytes: the protocol, whether this crate decodes it, and how the device is
//! switched to one that it decodes.
//!
//! Protocols with checksums are recognised by intact messages, the others by the form of their lines.
//! The checks of the protocols that are not decoded are those of the makers' manuals: Xsens "MT low-level
//! communication protocol", MicroStrain "MIP protocol", SBG Systems "sbgECom".

use std::fmt;

use crc::{CRC_16_IBM_SDLC, Crc, Table};

use crate::frame::Scan;
use crate::{candump, crossbow440, nmea, novatel, rtcm, sbf, slcan, ubx, vectornav};

/// Most bytes that are looked at.
pub const BYTES_MAX: usize = 1 << 14;
/// Fewest bytes by which text, or a wrong baud rate, is recognised.
const BYTES_MIN: usize = 48;
/// Least share of printable bytes of a text.
const PRINTABLE_MIN: f64 = 0.97;
/// Text at a baud rate up to twelve times too high, or up to three times too low, has few values: most
/// different ones, and least share of the sixteen most frequent ones. Random bytes have a share of 0.1, binary protocols of 0.3 to 0.55.
const VALUES_MAX: usize = 64;
const FREQUENT_MIN: f64 = 0.7;

/// A protocol or format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Format {
    /// u-blox UBX.
    Ubx,
    /// NovAtel, binary or ASCII.
    Novatel,
    /// Septentrio SBF.
    Sbf,
    /// NMEA 0183.
    Nmea,
    /// Crossbow 440.
    Crossbow440,
    /// VectorNav, binary or ASCII.
    Vectornav,
    /// Xsens MT.
    Xsens,
    /// MicroStrain (LORD, HBK) MIP.
    Mip,
    /// SBG Systems sbgECom.
    Sbg,
    /// RTCM corrections.
    Rtcm,
    /// SLCAN.
    Slcan,
    /// Lines of candump.
    Candump,
    /// Lines of candump with frames of NMEA 2000.
    Nmea2000,
    /// Lines of text.
    Text,
    /// Text, such as NMEA, at another baud rate.
    OtherBaud,
}

/// What is known of a format.
struct Row {
    format: Format,
    name: &'static str,
    /// Value of `kind` of the source that decodes it.
    kind: Option<&'static str>,
    /// What to do to get data that are decoded, if the source is of another kind.
    advice: &'static str,
}

const TABLE: [Row; 15] = [
    Row {
        format: Format::Ubx,
        name: "u-blox UBX",
        kind: Some("gnss"),
        advice: "set kind = \"gnss\", and let the receiver send NAV-PVT (u-center: UBX-CFG-MSG, or \
                 UBX-CFG-VALSET CFG-MSGOUT-UBX_NAV_PVT_UART1 = 1)",
    },
    Row {
        format: Format::Novatel,
        name: "NovAtel logs",
        kind: Some("gnss"),
        advice: "set kind = \"gnss\" and commands = [\"log bestposb ontime 0.1\", \
                 \"log bestvelb ontime 0.1\"]",
    },
    Row {
        format: Format::Sbf,
        name: "Septentrio SBF",
        kind: Some("gnss"),
        advice: "set kind = \"gnss\" and commands = [\"setSBFOutput, Stream1, COM1, \
                 PVTGeodetic+VelCovGeodetic+AttEuler+AttCovEuler, msec100\"]",
    },
    Row {
        format: Format::Nmea,
        name: "NMEA 0183",
        kind: Some("gnss"),
        advice: "set kind = \"gnss\", and let the receiver send GGA and RMC (u-blox: \
                 commands = [\"$PUBX,40,GGA,0,1,0,0,0,0*5B\", \"$PUBX,40,RMC,0,1,0,0,0,0*46\"])",
    },
    Row {
        format: Format::Crossbow440,
        name: "Crossbow 440 packets",
        kind: Some("crossbow440"),
        advice: "set kind = \"crossbow440\"",
    },
    Row {
        format: Format::Vectornav,
        name: "VectorNav",
        kind: Some("vectornav"),
        advice: "set kind = \"vectornav\"; for inertial data commands = [\"$VNWRG,06,14*XX\"] (VNYMR)",
    },
    Row {
        format: Format::Xsens,
        name: "Xsens MT",
        kind: None,
        advice: "this version does not decode Xsens MT; let the device send NMEA (MT Manager: Output \
                 configuration, string output, GGA and RMC), and set kind = \"gnss\"",
    },
    Row {
        format: Format::Mip,
        name: "MicroStrain MIP",
        kind: None,
        advice: "this version does not decode MIP; let the device send NMEA (SensorConnect: NMEA message \
                 format, GGA, RMC and HDT), and set kind = \"gnss\"",
    },
    Row {
        format: Format::Sbg,
        name: "SBG Systems sbgECom",
        kind: None,
        advice: "this version does not decode sbgECom; let the device send NMEA (sbgCenter: data output, \
                 NMEA GGA, RMC and HDT), and set kind = \"gnss\"",
    },
    Row {
        format: Format::Rtcm,
        name: "RTCM corrections",
        kind: None,
        advice: "RTCM corrections measure nothing of the vehicle; read the port of the receiver that sends \
                 its position",
    },
    Row {
        format: Format::Slcan,
        name: "an SLCAN adapter",
        kind: Some("slcan"),
        advice: "set kind = \"slcan\" with the bitrate of the bus",
    },
    Row {
        format: Format::Candump,
        name: "lines of candump",
        kind: None,
        advice: "read the CAN interface itself with kind = \"can\", or import the file with \
                 `atvrec import candump`",
    },
    Row {
        format: Format::Nmea2000,
        name: "NMEA 2000 frames as lines of candump",
        kind: None,
        advice: "this version does not decode NMEA 2000; record the CAN interface with kind = \"can\" and a \
                 DBC file of its messages",
    },
    Row {
        format: Format::Text,
        name: "lines of text",
        kind: Some("line"),
        advice: "set kind = \"line\" or \"csv\" and describe the fields (docs/configuration.md)",
    },
    Row {
        format: Format::OtherBaud,
        name: "text, such as NMEA, at another baud rate",
        kind: None,
        advice: "set the baud rate of the device; common ones are 4800, 9600, 38400, 57600, 115200, 230400 \
                 and 460800",
    },
];

impl Format {
    fn row(self) -> &'static Row {
        // The table has a row for each format, which a test checks.
        TABLE
            .iter()
            .find(|row| row.format == self)
            .unwrap_or(&TABLE[0])
    }

    /// Its name, for messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Kind of the source that decodes it, as in the configuration.
    #[must_use]
    pub fn kind(self) -> Option<&'static str> {
        self.row().kind
    }

    /// What to do to get data that are decoded.
    #[must_use]
    pub fn advice(self) -> &'static str {
        self.row().advice
    }

    /// All formats, in the order of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.format)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Length of the frame at the start of some bytes, if there is one.
type FrameAt = fn(&[u8]) -> Option<usize>;

/// The format that explains most of the first [`BYTES_MAX`] bytes; `None` if none does.
#[must_use]
pub fn recognise(bytes: &[u8]) -> Option<Format> {
    let bytes = &bytes[..bytes.len().min(BYTES_MAX)];
    let scans: [(Format, FrameAt, usize); 10] = [
        (Format::Ubx, |b| framed(b, 0xB5, ubx::scan), 1),
        (Format::Sbf, |b| framed(b, b'$', sbf::scan), 1),
        (Format::Novatel, novatel_frame, 1),
        (Format::Mip, mip, 1),
        (Format::Sbg, sbg, 1),
        (Format::Rtcm, |b| framed(b, 0xD3, rtcm::scan), 1),
        (
            Format::Crossbow440,
            |b| framed(b, 0x55, crossbow440::scan),
            1,
        ),
        (Format::Xsens, xsens, 2),
        (Format::Vectornav, vectornav_frame, 1),
        (Format::Nmea, nmea_frame, 1),
    ];
    let claims = scans.into_iter().map(|(format, frame, fewest)| {
        let (count, claimed) = claimed(bytes, frame);
        (format, if count >= fewest { claimed } else { 0 })
    });
    let best = claims.filter(|(_, claimed)| *claimed > 0);
    // Of equal claims, the first one.
    let best = best.reduce(|best, next| if next.1 > best.1 { next } else { best });
    let of_lines = by_lines(bytes);
    match (best, of_lines) {
        // A sentence between other lines does not explain them.
        (Some((format, claimed)), _) if 4 * claimed >= bytes.len() || of_lines.is_none() => {
            Some(format)
        }
        (_, Some(format)) => Some(format),
        _ => None,
    }
}

/// Number of frames, and bytes in them.
fn claimed(bytes: &[u8], frame: FrameAt) -> (usize, usize) {
    let (mut at, mut count, mut claimed) = (0, 0, 0);
    while at < bytes.len() {
        match frame(&bytes[at..]) {
            Some(len) => {
                at += len;
                count += 1;
                claimed += len;
            }
            None => at += 1,
        }
    }
    (count, claimed)
}

fn framed<K>(bytes: &[u8], first: u8, scan: impl Fn(&[u8]) -> Scan<K>) -> Option<usize> {
    match (bytes[0] == first).then(|| scan(bytes))? {
        Scan::Frame { len, .. } => Some(len),
        _ => None,
    }
}

fn novatel_frame(bytes: &[u8]) -> Option<usize> {
    [0xAA, b'#', b'%']
        .into_iter()
        .find_map(|first| framed(bytes, first, novatel::scan))
}

fn vectornav_frame(bytes: &[u8]) -> Option<usize> {
    let binary = framed(bytes, vectornav::SYNC, vectornav::scan);
    let ascii = || {
        bytes
            .starts_with(b"$VN")
            .then(|| framed(bytes, b'$', vectornav::scan))?
    };
    binary.or_else(ascii)
}

fn nmea_frame(bytes: &[u8]) -> Option<usize> {
    let other = bytes.starts_with(b"$VN") || bytes.starts_with(b"$@");
    (!other).then(|| framed(bytes, b'$', nmea::scan))?
}

/// `FA`, bus identifier, message, length (`FF`: two bytes more), data, and a byte with which the sum of
/// all but the first is zero.
fn xsens(bytes: &[u8]) -> Option<usize> {
    let [0xFA, 0xFF | 0x01, _, short, rest @ ..] = bytes else {
        return None;
    };
    let (head, length) = match (short, rest) {
        (0xFF, [high, low, ..]) => (6, usize::from(u16::from_be_bytes([*high, *low]))),
        (0xFF, _) => return None,
        (short, _) => (4, usize::from(*short)),
    };
    let frame = bytes.get(..head + length + 1)?;
    let sum = frame[1..]
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    (sum == 0).then_some(frame.len())
}

/// `75 65`, descriptor set, length, fields, and the checksum of RFC 1145.
fn mip(bytes: &[u8]) -> Option<usize> {
    let [0x75, 0x65, _, length, ..] = bytes else {
        return None;
    };
    let frame = bytes.get(..6 + usize::from(*length))?;
    let (content, saved) = frame.split_at(frame.len() - 2);
    (ubx::checksum(content) == saved).then_some(frame.len())
}

/// `FF 5A`, message, class, length, data, CRC-16 of polynomial 0x8408, `33`.
fn sbg(bytes: &[u8]) -> Option<usize> {
    static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&crc::Algorithm {
        init: 0,
        xorout: 0,
        ..CRC_16_IBM_SDLC
    });
    let [0xFF, 0x5A, _, _, low, high, ..] = bytes else {
        return None;
    };
    let length = usize::from(u16::from_le_bytes([*low, *high]));
    let frame = bytes.get(..9 + length)?;
    let saved = u16::from_le_bytes([frame[6 + length], frame[7 + length]]);
    let is_frame = frame[8 + length] == 0x33 && CRC.checksum(&frame[2..6 + length]) == saved;
    is_frame.then_some(frame.len())
}

/// Formats of lines, and text at another baud rate.
fn by_lines(bytes: &[u8]) -> Option<Format> {
    if bytes.is_empty() {
        return None;
    }
    let printable = |byte: &&u8| matches!(byte, b' '..=b'~' | b'\r' | b'\n' | b'\t' | 7);
    let share = bytes.iter().filter(printable).count() as f64 / bytes.len() as f64;
    if share >= PRINTABLE_MIN {
        return lines(bytes);
    }
    let mut counts = [0_usize; 256];
    for byte in bytes {
        counts[usize::from(*byte)] += 1;
    }
    let values = counts.iter().filter(|count| **count > 0).count();
    counts.sort_unstable_by(|a, b| b.cmp(a));
    let frequent = counts[..16].iter().sum::<usize>() as f64 / bytes.len() as f64;
    let is_text = bytes.len() >= BYTES_MIN && values <= VALUES_MAX && frequent >= FREQUENT_MIN;
    is_text.then_some(Format::OtherBaud)
}

fn lines(bytes: &[u8]) -> Option<Format> {
    let mut decoder = slcan::Decoder::new();
    decoder.push(bytes, &mut |_| {});
    let seen = decoder.statistics();
    if seen.frames > 0 && seen.frames > 3 * seen.malformed.saturating_sub(1) {
        return Some(Format::Slcan);
    }
    let text = String::from_utf8_lossy(bytes);
    let frames: Vec<_> = text
        .lines()
        .take(200)
        .filter_map(|line| candump::parse_line(line).ok())
        .map(|line| line.frame)
        .collect();
    if 2 * frames.len() > text.lines().count().min(200) {
        let boat = frames
            .iter()
            .filter(|frame| frame.flags.extended && is_nmea2000(frame.id))
            .count();
        let is_boat = 2 * boat > frames.len();
        return Some(if is_boat {
            Format::Nmea2000
        } else {
            Format::Candump
        });
    }
    let has_lines = bytes.iter().any(|byte| matches!(byte, b'\r' | b'\n'));
    (has_lines && bytes.len() >= 8).then_some(Format::Text)
}

/// Whether a 29-bit identifier has a parameter group of NMEA 2000, beyond those of SAE J1939.
#[must_use]
pub const fn is_nmea2000(id: u32) -> bool {
    matches!(crate::dbc::parameter_group(id), 126_208..=130_944)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_its_row() {
        for format in Format::all() {
            assert_eq!(format.row().format, format);
        }
        let names: std::collections::BTreeSet<_> = Format::all().map(Format::name).collect();
        assert_eq!(names.len(), TABLE.len());
    }

    #[test]
    fn commands_have_right_checksums() {
        let advice: Vec<&str> = Format::all().map(Format::advice).collect();
        let advice = advice.join(" ");
        let commands = advice
            .split('$')
            .skip(1)
            .filter_map(|rest| rest.split_once('*'));
        let mut checked = 0;
        for (content, rest) in commands {
            let sum = content.bytes().fold(0, |sum, byte| sum ^ byte);
            if let Ok(saved) = u8::from_str_radix(&rest[..2], 16) {
                assert_eq!(saved, sum, "{content}");
                checked += 1;
            }
        }
        assert_eq!(checked, 2);
    }

    #[test]
    fn lines_are_told_apart() {
        let slcan = b"3\rt1003010203\rT0000010021133\rz\rt1001FF\r";
        assert_eq!(recognise(slcan), Some(Format::Slcan));
        let text = b"+0123\r\n+0124\r\n+0125\r\n".repeat(4);
        assert_eq!(recognise(&text), Some(Format::Text));
        let boat = b"(1410714882.622188) can0 09F80102#36729A16021AB80D\n".repeat(3);
        assert_eq!(recognise(&boat), Some(Format::Nmea2000));
        let bus = b"(1410714882.622188) can0 123#36729A16021AB80D\n".repeat(3);
        assert_eq!(recognise(&bus), Some(Format::Candump));
        assert_eq!(recognise(b""), None);
        assert_eq!(recognise(&[0xA5, 0x17, 0x99]), None);
    }

    /// Bits of a text on the line, sampled at another rate as a serial port does.
    fn at_another_baud(text: &[u8], sent: u32, read: u32) -> Vec<u8> {
        let bits = text.iter().flat_map(|byte| {
            let data = (0..8).map(move |bit| byte >> bit & 1 != 0);
            std::iter::once(false).chain(data).chain([true])
        });
        let line: Vec<bool> = bits.collect();
        let step = f64::from(sent) / f64::from(read);
        let level = |at: f64| line.get(at as usize).copied().unwrap_or(true);
        let (mut at, mut bytes) = (0.0, Vec::new());
        while at < line.len() as f64 {
            if level(at) {
                at += step / 16.0;
                continue;
            }
            let bit = |n: u32| u8::from(level(at + step * (1.5 + f64::from(n)))) << n;
            bytes.push((0..8).map(bit).sum());
            at += step * 9.5;
            while !level(at) && at < line.len() as f64 {
                at += step / 16.0;
            }
        }
        bytes
    }

    #[test]
    fn nmea_at_another_baud_rate_is_named() {
        let mut text = Vec::new();
        for second in 0..20 {
            let gga = format!(
                "GPGGA,1200{second:02}.00,3235.1{second:02},N,08529.5,W,1,08,0.9,200.0,M,-30.0,M,,"
            );
            nmea::encode_sentence(&gga, &mut text);
            nmea::encode_sentence(
                "GPGSV,3,1,11,10,63,137,17,07,61,098,15,05,59,290,20",
                &mut text,
            );
        }
        assert_eq!(recognise(&text), Some(Format::Nmea));
        for (sent, read) in [
            (4800, 9600),
            (9600, 115_200),
            (9600, 38_400),
            (38_400, 115_200),
            (57_600, 115_200),
            (9600, 4800),
            (115_200, 57_600),
            (115_200, 38_400),
        ] {
            let bytes = at_another_baud(&text, sent, read);
            assert_eq!(
                recognise(&bytes),
                Some(Format::OtherBaud),
                "{sent} read at {read}"
            );
        }
    }
}
