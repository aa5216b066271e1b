//! The lines that `candump` writes to a screen:
//! ` (1641469577.024400) can1  RX - -  009   [8]  00 11 22 33 44 55 66 77`.

use super::super::date::unix_ns;
use super::super::number::{decimal, hexadecimal, unsigned, words};
use sample::FrameData;

use super::{CanFrame, Found, direction_of};
use crate::candump::{identifier_of, nibble};

/// Reads a line with a stamp.
pub(super) fn parse(line: &[u8]) -> Option<Found<'_>> {
    let rest = line.trim_ascii_start().strip_prefix(b"(")?;
    let close = rest.iter().take(32).position(|byte| *byte == b')')?;
    let stamp = &rest[..close];
    let (stamp_ns, is_date) = match decimal(stamp, 9) {
        Some(ns) => (ns, false),
        None => (date_of(stamp)?, true),
    };
    let found = body(&rest[close + 1..])?;
    (stamp_ns >= 0).then_some(Found {
        stamp_ns,
        is_date,
        ..found
    })
}

/// Whether the line is one with a frame, but without a stamp.
pub(super) fn is_without_stamp(line: &[u8]) -> bool {
    body(line).is_some()
}

/// `2023-01-03 20:08:44.573555` as UNIX time.
fn date_of(text: &[u8]) -> Option<i64> {
    let mut words = words(text);
    let (date, time) = (words.next()?, words.next()?);
    let mut date = date.split(|byte| *byte == b'-').map(unsigned);
    let (year, month, day) = (date.next()??, date.next()??, date.next()??);
    let mut time = time.split(|byte| *byte == b':');
    let (hour, minute) = (unsigned(time.next()?)?, unsigned(time.next()?)?);
    let second_ns = decimal(time.next()?, 9)?;
    unix_ns([year, month, day], [hour, minute], second_ns)
}

/// The part of a line after the stamp.
fn body(rest: &[u8]) -> Option<Found<'_>> {
    let mut words = words(rest);
    let interface = words.next()?;
    let mut word = words.next()?;
    let direction = direction_of(Some(word).filter(|word| word.len() == 2));
    let (mut bit_rate_switch, mut error_state) = (false, false);
    if direction.is_some() {
        bit_rate_switch = words.next()? == b"B";
        error_state = words.next()? == b"E";
        word = words.next()?;
    }
    let (id, mut flags) = identifier_of(word)?;
    let length = words.next()?;
    let (len, code) = match length {
        [b'{', digit, b'}'] => {
            let code = nibble(*digit)?;
            (code.min(8), code)
        }
        [b'[', digit @ b'0'..=b'8', b']'] => (digit - b'0', 0),
        [b'[', digits @ .., b']'] if digits.len() == 2 => {
            flags.fd = true;
            (u8::try_from(unsigned(digits)?).ok()?, 0)
        }
        _ => return None,
    };
    flags.bit_rate_switch = bit_rate_switch && flags.fd;
    flags.error_state = error_state && flags.fd;
    let mut frame = CanFrame::new(id, flags, &[])?;
    frame.data = FrameData::zeros(len);
    let mut data = words.peekable();
    if data.peek() == Some(&&b"remote"[..]) {
        frame.flags.remote = true;
    } else {
        for byte in frame.data.get_mut(..usize::from(len))? {
            let word = data.next().filter(|word| word.len() == 2)?;
            *byte = u8::try_from(hexadecimal(word)?).ok()?;
        }
    }
    frame.len = len;
    frame.len8_dlc = if code > 8 { code } else { 0 };
    Some(Found {
        stamp_ns: 0,
        is_date: false,
        interface,
        frame,
        direction,
        style: None,
    })
}
