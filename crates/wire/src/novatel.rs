//! NovAtel OEM4, OEMV, OEM6 and OEM7 logs, binary and ASCII (OEMV family firmware reference
//! OM-20000094; OEM7 commands and logs reference manual).

mod body;
mod convert;
mod encode;
mod frame;
mod names;

pub use body::{
    Body, Cartesian, CorrectedImu, Heading, Heading2, Inertial, InertialX, Position, Solution,
    Tail, Time, Utm, Velocity,
};
pub use frame::Header;
pub(crate) use frame::{Form, scan};
pub use names::SOLUTION_COMPUTED;

use crate::codec::{AsciiReader, BinaryReader};

/// The kinds of body that logs share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    Position,
    Velocity,
    Cartesian,
    Utm,
    Time,
    Heading,
    Heading2,
    Inertial,
    InertialX,
    CorrectedImu,
}

/// Message id, name and layout of what is decoded.
const LOGS: [(u16, &str, Layout); 19] = [
    (42, "BESTPOS", Layout::Position),
    (47, "PSRPOS", Layout::Position),
    (141, "RTKPOS", Layout::Position),
    (99, "BESTVEL", Layout::Velocity),
    (100, "PSRVEL", Layout::Velocity),
    (241, "BESTXYZ", Layout::Cartesian),
    (243, "PSRXYZ", Layout::Cartesian),
    (726, "BESTUTM", Layout::Utm),
    (101, "TIME", Layout::Time),
    (971, "HEADING", Layout::Heading),
    (507, "INSPVA", Layout::Inertial),
    (508, "INSPVAS", Layout::Inertial),
    (1429, "BESTGNSSPOS", Layout::Position),
    (1430, "BESTGNSSVEL", Layout::Velocity),
    (1335, "HEADING2", Layout::Heading2),
    (2042, "DUALANTENNAHEADING", Layout::Heading),
    (1465, "INSPVAX", Layout::InertialX),
    (812, "CORRIMUDATA", Layout::CorrectedImu),
    (813, "CORRIMUDATAS", Layout::CorrectedImu),
];

/// Message id and name of what is known by name alone.
const KNOWN: [(u16, &str); 30] = [
    (5, "LOGLIST"),
    (8, "IONUTC"),
    (16, "CLOCKMODEL"),
    (37, "VERSION"),
    (41, "RAWEPHEM"),
    (43, "RANGE"),
    (48, "SATVIS"),
    (72, "PORTSTATS"),
    (83, "TRACKSTAT"),
    (93, "RXSTATUS"),
    (128, "RXCONFIG"),
    (140, "RANGECMP"),
    (174, "PSRDOP"),
    (263, "INSATT"),
    (264, "INSCOV"),
    (265, "INSPOS"),
    (266, "INSSPD"),
    (267, "INSVEL"),
    (268, "RAWIMU"),
    (325, "RAWIMUS"),
    (492, "TIMESYNC"),
    (963, "HWMONITOR"),
    (1163, "PSRDOP2"),
    (1194, "BESTSATS"),
    (1461, "RAWIMUX"),
    (1462, "RAWIMUSX"),
    (1945, "INSCONFIG"),
    (2051, "INSSTDEV"),
    (2264, "CORRIMUS"),
    (1177, "CLOCKSTEERING"),
];

/// Name of the logs of a receiver's further antennas, which are not decoded.
const OTHER_ANTENNA: &str = "log of another antenna";

/// One log.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Its header.
    pub header: Header,
    /// Its content.
    pub body: Body,
}

/// What a frame with a good checksum turned out to be.
pub(crate) enum Decoded {
    Log(&'static str, Log),
    Response(Header),
    /// With its name if that is known.
    Unknown(Header, Option<&'static str>),
    Malformed(Option<u16>),
}

/// Decodes a frame that [`scan`] has checked.
pub(crate) fn decode(form: Form, bytes: &[u8]) -> Decoded {
    let parsed = match form {
        Form::Long | Form::Short => frame::binary_header(form, bytes),
        Form::Ascii | Form::ShortAscii => frame::ascii_header(form, bytes),
    };
    let Some((header, content)) = parsed else {
        return Decoded::Malformed(None);
    };
    if header.response {
        return Decoded::Response(header);
    }
    let Some((_, name, layout)) = LOGS.iter().find(|(id, ..)| *id == header.id) else {
        let known = KNOWN.iter().find(|(id, _)| *id == header.id);
        return Decoded::Unknown(header, known.map(|(_, name)| *name));
    };
    let of_antenna = matches!(
        layout,
        Layout::Position | Layout::Velocity | Layout::Cartesian | Layout::Utm
    );
    // Sources beyond the second antenna are not defined; OEMV receivers send 2 with their one antenna.
    if of_antenna && header.antenna == 1 {
        return Decoded::Unknown(header, Some(OTHER_ANTENNA));
    }
    let mut body = Body::empty(*layout);
    let walked = match form {
        Form::Long | Form::Short => body.walk(&mut BinaryReader(content)),
        Form::Ascii | Form::ShortAscii => std::str::from_utf8(content)
            .ok()
            .and_then(|text| body.walk(&mut AsciiReader::new(text))),
    };
    match walked {
        Some(()) => Decoded::Log(name, Log { header, body }),
        None => Decoded::Malformed(Some(header.id)),
    }
}

/// A command that makes a receiver send `log` on `port` every `period_s` seconds, for example
/// `log com1 bestvelb ontime 0.05`. A `b` at the log's end asks for binary, an `a` for ASCII.
#[must_use]
pub fn log_command(port: &str, log: &str, period_s: f64) -> String {
    format!("log {port} {log} ontime {period_s}\r\n")
}

/// A command that stops all logs on `port`.
#[must_use]
pub fn unlog_all_command(port: &str) -> String {
    format!("unlogall {port}\r\n")
}

/// A command that sets the line speed of `port`: 8N1, no handshake.
#[must_use]
pub fn baud_command(port: &str, baud: u32) -> String {
    format!("com {port} {baud} n 8 1 n off on\r\n")
}
