//! The objects that hold a CAN frame.

use sample::{CanFlags, CanFrame, FrameData};

use crate::can_log::bytes::{u8_at, u16_at, u32_at, u64_at};
use crate::can_log::{Direction, Entry, len8_dlc};

/// Bit of a 29-bit identifier.
const EXTENDED: u32 = 0x8000_0000;
const IDENTIFIER: u32 = 0x1FFF_FFFF;
/// Object flag: the stamp has the unit 10 µs; otherwise it has the unit 1 ns.
const TEN_MICROSECONDS: u32 = 1;
/// End of the second header up to the stamp, bytes.
const STAMPED: usize = 32;

/// Kind of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `CAN_MESSAGE` (1) and `CAN_MESSAGE2` (86).
    Message,
    /// `CAN_ERROR` (2).
    Error,
    /// `CAN_ERROR_EXT` (73).
    ErrorExt,
    /// `CAN_FD_MESSAGE` (100).
    FdMessage,
    /// `CAN_FD_MESSAGE_64` (101).
    FdMessage64,
    /// `CAN_FD_ERROR_64` (104).
    FdError64,
    Other(u32),
}

impl Kind {
    pub const fn of(number: u32) -> Self {
        match number {
            1 | 86 => Self::Message,
            2 => Self::Error,
            73 => Self::ErrorExt,
            100 => Self::FdMessage,
            101 => Self::FdMessage64,
            104 => Self::FdError64,
            _ => Self::Other(number),
        }
    }

    /// Bytes of the fields before the data.
    const fn fields(self) -> usize {
        match self {
            Self::Message => 8,
            Self::Error => 4,
            Self::ErrorExt => 24,
            Self::FdMessage => 20,
            Self::FdMessage64 => 40,
            Self::FdError64 => 44,
            Self::Other(_) => 0,
        }
    }
}

/// The fields of an object.
#[derive(Default)]
struct Fields {
    channel: u16,
    direction: Option<Direction>,
    dlc: Option<u8>,
    /// With bit 31 for 29-bit identifiers.
    id: u32,
    flags: CanFlags,
    /// Bytes that are valid by the object's own field.
    len: u8,
    /// End of the data in the object; 0: the object's end.
    data_end: usize,
}

/// Reads an object. `None`: the object is too short or its stamp does not fit.
///
/// The result is the number of the channel, and the frame without it.
pub(super) fn decode(object: &[u8], kind: Kind, header_len: usize) -> Option<(u16, Entry)> {
    if header_len < STAMPED {
        return None;
    }
    let unit_ns = match u32_at(object, 16) & 3 {
        TEN_MICROSECONDS => 10_000,
        _ => 1,
    };
    let stamp_ns = i64::try_from(u64_at(object, 24)).ok()?;
    let stamp_ns = stamp_ns.checked_mul(unit_ns)?;
    let body = object.get(header_len..)?;
    if body.len() < kind.fields() {
        return None;
    }
    let fields = match kind {
        Kind::Message => message(body),
        Kind::Error => Fields {
            channel: u16_at(body, 0),
            flags: error(),
            ..Fields::default()
        },
        Kind::ErrorExt => error_ext(body),
        Kind::FdMessage => fd_message(body),
        Kind::FdMessage64 => fd_message_64(body),
        Kind::FdError64 => fd_error_64(body),
        Kind::Other(_) => return None,
    };
    let data_start = header_len + kind.fields();
    let data_end = match fields.data_end {
        0 => object.len(),
        end => end.min(object.len()),
    };
    let data = object.get(data_start..data_end).unwrap_or_default();
    let entry = Entry {
        stamp_ns,
        channel: None,
        direction: fields.direction,
        dlc: fields.dlc,
        frame: fields.frame(data),
    };
    Some((fields.channel, entry))
}

impl Fields {
    /// The frame, with zeros where the object has fewer bytes than are valid, as CANoe shows it.
    fn frame(&self, stored: &[u8]) -> CanFrame {
        let flags = CanFlags {
            extended: self.id & EXTENDED != 0,
            ..self.flags
        };
        let [len, present] = if flags.remote {
            [self.dlc.unwrap_or_default().min(8), 0]
        } else {
            [self.len.min(if flags.fd { 64 } else { 8 }); 2]
        };
        let present = stored.len().min(usize::from(present));
        let mut data = FrameData::zeros(len);
        data[..present].copy_from_slice(&stored[..present]);
        CanFrame {
            id: self.id & IDENTIFIER,
            flags,
            len,
            data,
            len8_dlc: len8_dlc(flags, self.dlc),
            kernel_ns: None,
            hardware_ns: None,
        }
    }
}

fn error() -> CanFlags {
    CanFlags {
        error: true,
        ..CanFlags::default()
    }
}

fn sent_if(sent: bool) -> Option<Direction> {
    Some(if sent {
        Direction::Sent
    } else {
        Direction::Received
    })
}

fn message(body: &[u8]) -> Fields {
    let (bits, dlc) = (u8_at(body, 2), u8_at(body, 3));
    Fields {
        channel: u16_at(body, 0),
        direction: sent_if(bits & 1 != 0),
        dlc: Some(dlc),
        id: u32_at(body, 4),
        flags: CanFlags {
            remote: bits & 0x80 != 0,
            ..CanFlags::default()
        },
        len: dlc,
        data_end: 0,
    }
}

fn error_ext(body: &[u8]) -> Fields {
    let dlc = u8_at(body, 10) & 0x0F;
    Fields {
        channel: u16_at(body, 0),
        direction: None,
        dlc: Some(dlc),
        id: u32_at(body, 16),
        flags: error(),
        len: dlc,
        data_end: 0,
    }
}

fn fd_message(body: &[u8]) -> Fields {
    let (bits, fd_bits) = (u8_at(body, 2), u8_at(body, 13));
    Fields {
        channel: u16_at(body, 0),
        direction: sent_if(bits & 1 != 0),
        dlc: Some(u8_at(body, 3)),
        id: u32_at(body, 4),
        flags: CanFlags {
            remote: bits & 0x80 != 0,
            fd: fd_bits & 1 != 0,
            bit_rate_switch: fd_bits & 2 != 0,
            error_state: fd_bits & 4 != 0,
            ..CanFlags::default()
        },
        len: u8_at(body, 14),
        data_end: 0,
    }
}

fn fd_message_64(body: &[u8]) -> Fields {
    let bits = u32_at(body, 12);
    Fields {
        channel: u16::from(u8_at(body, 0)),
        direction: match u8_at(body, 34) {
            2 => Some(Direction::SendRequest),
            direction => sent_if(direction == 1),
        },
        dlc: Some(u8_at(body, 1)),
        id: u32_at(body, 4),
        flags: CanFlags {
            remote: bits & 0x0010 != 0,
            fd: bits & 0x1000 != 0,
            bit_rate_switch: bits & 0x2000 != 0,
            error_state: bits & 0x4000 != 0,
            ..CanFlags::default()
        },
        len: u8_at(body, 2),
        data_end: usize::from(u8_at(body, 35)),
    }
}

/// The library `vector_blf` documents bits 5 to 7 for the CAN FD flags; other writers set the bits of
/// object 101. More than eight bytes are possible in a CAN FD frame only.
fn fd_error_64(body: &[u8]) -> Fields {
    let bits = u16_at(body, 8);
    let len = u8_at(body, 2);
    Fields {
        channel: u16::from(u8_at(body, 0)),
        direction: None,
        dlc: Some(u8_at(body, 1)),
        id: u32_at(body, 12),
        flags: CanFlags {
            fd: bits & 0x1080 != 0 || len > 8,
            bit_rate_switch: bits & 0x2040 != 0,
            error_state: bits & 0x4020 != 0,
            ..error()
        },
        len,
        data_end: usize::from(u8_at(body, 10)),
    }
}
