//! VectorNav VN-100, VN-200 and VN-300 (interface control documents of VN-100, VN-200, VN-300 and
//! VN-310): binary outputs of any fields, and the ASCII messages VNYPR, VNYMR, VNIMU, VNQMR, VNISL, VNINS
//! and VNGPS.

mod ascii;
mod binary;
mod convert;

pub use ascii::{Ascii, encode_inertial, encode_text};
pub use binary::{Binary, Group, encode_binary};

use crc::{CRC_16_XMODEM, Crc, Table};

use crate::frame::Scan;

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_XMODEM);

/// First byte of a binary output.
pub(crate) const SYNC: u8 = 0xFA;

/// How a message is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Binary,
    Ascii,
}

/// Scans bytes that begin with `FA` or `$VN`.
pub(crate) fn scan(bytes: &[u8]) -> Scan<Form> {
    if bytes[0] == SYNC {
        binary::scan(bytes)
    } else {
        ascii::scan(bytes)
    }
}

/// What a message with a good checksum turned out to be.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Output {
    /// A binary output.
    Binary(Binary),
    /// An ASCII message.
    Ascii(Ascii),
}

/// What a message turned out to be.
#[expect(
    clippy::large_enum_variant,
    reason = "it lives for one message, on the stack"
)]
pub(crate) enum Decoded {
    Output(&'static str, Output),
    /// With its name if that is known.
    Unknown(Option<&'static str>),
    Malformed,
}

/// Decodes a message that [`scan`] has checked.
pub(crate) fn decode(form: Form, bytes: &[u8]) -> Decoded {
    match form {
        Form::Binary => match binary::decode(bytes) {
            Some(output) => Decoded::Output("VN-BIN", Output::Binary(output)),
            None => Decoded::Malformed,
        },
        Form::Ascii => ascii::decode(bytes),
    }
}

fn checksum(bytes: &[u8]) -> u16 {
    CRC.checksum(bytes)
}
