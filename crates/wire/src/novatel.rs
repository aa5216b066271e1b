//! NovAtel OEM4, OEMV and OEM6 logs, binary and ASCII (OEMV family firmware reference OM-20000094).

mod body;
mod convert;
mod encode;
mod frame;

pub use body::{
    Body, Cartesian, Heading, Inertial, Position, SOLUTION_COMPUTED, Solution, Tail, Time, Utm,
    Velocity,
};
pub use frame::Header;
pub(crate) use frame::{Form, scan};

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
    Inertial,
}

/// Message id, name and layout of what is decoded.
const LOGS: [(u16, &str, Layout); 12] = [
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
];

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
    Unknown(Header),
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
        return Decoded::Unknown(header);
    };
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
