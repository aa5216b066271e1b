//! Lines of an ASC file with a frame.

use sample::{CanFlags, CanFrame};

use super::super::Direction;
use super::super::number::{code_of, hexadecimal, length_of, number, unsigned};

/// Bits of the flags of a CANFD line.
const FLAG_REMOTE: u32 = 1 << 4;
const FLAG_FD: u32 = 1 << 12;
/// Words after the data of a CANFD line: duration, number of bits, flags, checksum, and four settings
/// of the bit times.
const TAIL_WORDS: usize = 8;
/// Position of the flags among the words after the data.
const TAIL_FLAGS: usize = 2;

/// Kind of the events that this reader does not know.
pub(super) const OTHER_EVENT: &str = "lines of other events";

/// A frame of a line.
pub(super) struct Found<'l> {
    pub channel: &'l [u8],
    pub direction: Option<Direction>,
    pub dlc: Option<u8>,
    pub frame: CanFrame,
}

/// What a line with a time contains.
pub(super) enum Parsed<'l> {
    Frame(Found<'l>),
    /// Another event, by kind.
    Event(&'static str),
    Unreadable,
}

/// Reads the words after the time of the line.
pub(super) fn parse<'l>(
    line: &[u8],
    mut words: impl Iterator<Item = &'l [u8]> + Clone,
    base: u32,
) -> Parsed<'l> {
    if let Some(kind) = event_of(words.clone()) {
        return Parsed::Event(kind);
    }
    let found = match words.next() {
        Some(b"CANFD") => fd(words, base),
        Some(channel) if unsigned(channel).is_some() => classic(channel, words, base),
        _ => None,
    };
    if found.is_none() && !has_frame_word(line) {
        // A line without the form of a frame is one of the many other events.
        return Parsed::Event(OTHER_EVENT);
    }
    found.map_or(Parsed::Unreadable, Parsed::Frame)
}

/// Whether the line has a word that only frames have.
fn has_frame_word(line: &[u8]) -> bool {
    let mut words = super::words(line);
    words.any(|word| matches!(word, b"CANFD" | b"ErrorFrame" | b"Rx" | b"Tx" | b"TxRq"))
}

/// The kind of an event that is no frame; `None` for frames and for what is not known.
fn event_of<'l>(mut words: impl Iterator<Item = &'l [u8]>) -> Option<&'static str> {
    let first = words.next()?;
    let second = words.next().unwrap_or_default();
    Some(match (first, second) {
        (b"Start", _) => "lines with the start of the measurement",
        (b"CAN", _) => "CAN status lines",
        (b"CANXL", _) => "CAN XL lines",
        (_, b"J1939TP") => "J1939TP lines",
        (_, b"OverloadFrame") => "overload frames",
        (_, second) if second.starts_with(b"Statistic") => "statistics lines",
        (first, _) if first.starts_with(b"SV:") => "lines of system variables",
        (b"L1" | b"L2" | b"L3" | b"L4" | b"Li" | b"Li1" | b"Li2", _) => "LIN lines",
        (b"Fr", _) => "FlexRay lines",
        (b"ETH", _) => "Ethernet lines",
        (b"log", _) => "lines of the logging",
        _ => return None,
    })
}

fn direction_of(word: &[u8]) -> Option<Direction> {
    match word {
        b"Rx" => Some(Direction::Received),
        b"Tx" => Some(Direction::Sent),
        b"TxRq" => Some(Direction::SendRequest),
        _ => None,
    }
}

/// Identifier, with `x` at the end if it has 29 bits.
fn identifier(word: &[u8], base: u32) -> Option<(u32, bool)> {
    let digits = word.strip_suffix(b"x").or(word.strip_suffix(b"X"));
    let id = number(digits.unwrap_or(word), base)?;
    let extended = digits.is_some();
    let most = if extended { 0x1FFF_FFFF } else { 0x7FF };
    (id <= most).then_some((id, extended))
}

fn byte(word: &[u8], base: u32) -> Option<u8> {
    u8::try_from(number(word, base)?).ok()
}

/// A data length code: decimal, or one hexadecimal letter, whatever the base of the file is.
fn code(word: &[u8]) -> Option<u8> {
    let value = match word {
        [b'a'..=b'f' | b'A'..=b'F'] => hexadecimal(word)?,
        _ => unsigned(word)?,
    };
    u8::try_from(value).ok().filter(|code| *code <= 15)
}

/// An error frame without known content.
fn error_frame(channel: &[u8], direction: Option<Direction>, fd: bool) -> Option<Found<'_>> {
    let flags = CanFlags {
        error: true,
        fd,
        ..CanFlags::default()
    };
    Some(Found {
        channel,
        direction,
        dlc: None,
        frame: CanFrame::new(0, flags, &[])?,
    })
}

/// `1  18EBFF00x  Rx  d 8 01 A0 0F A6 60 3B D1 40  Length = ...`.
fn classic<'l>(
    channel: &'l [u8],
    mut words: impl Iterator<Item = &'l [u8]>,
    base: u32,
) -> Option<Found<'l>> {
    let word = words.next()?;
    if word == b"ErrorFrame" {
        return error_frame(channel, None, false);
    }
    let (id, extended) = identifier(word, base)?;
    let direction = Some(direction_of(words.next()?)?);
    let mut flags = CanFlags {
        extended,
        ..CanFlags::default()
    };
    let kind = words.next()?;
    if kind == b"r" {
        flags.remote = true;
        let dlc = words.next().and_then(code).unwrap_or(0);
        let mut frame = CanFrame::new(id, flags, &[])?;
        set_length(&mut frame, dlc);
        return Some(Found {
            channel,
            direction,
            dlc: Some(dlc),
            frame,
        });
    }
    if kind != b"d" {
        return None;
    }
    let dlc = code(words.next()?)?;
    let mut data = [0; 64];
    let mut count = 0;
    for word in words.take(data.len()) {
        let Some(value) = byte(word, base) else { break };
        data[count] = value;
        count += 1;
    }
    // Old files have CAN FD frames in this form: the code then stands for more than eight bytes.
    let fd_length = usize::from(length_of(dlc, true));
    flags.fd = dlc > 8 && count >= fd_length;
    let length = usize::from(length_of(dlc, flags.fd));
    let mut frame = CanFrame::new(id, flags, data[..count].get(..length)?)?;
    set_length(&mut frame, dlc);
    Some(Found {
        channel,
        direction,
        dlc: Some(dlc),
        frame,
    })
}

/// Sets the length that the code stands for.
fn set_length(frame: &mut CanFrame, dlc: u8) {
    frame.len = length_of(dlc, frame.flags.fd);
    frame.len8_dlc = if dlc > 8 && !frame.flags.fd { dlc } else { 0 };
}

/// `2 Rx  300  Name  1 0 8  8 01 02 03 04 05 06 07 08  102203 133 303000 ...`: the words after `CANFD`.
fn fd<'l>(mut words: impl Iterator<Item = &'l [u8]> + Clone, base: u32) -> Option<Found<'l>> {
    let channel = words.next().filter(|word| unsigned(word).is_some())?;
    let direction = Some(direction_of(words.next()?)?);
    let word = words.next()?;
    if word == b"ErrorFrame" {
        return error_frame(channel, direction, true);
    }
    let (id, extended) = identifier(word, base)?;
    // The name of the message is absent, or it is one word, which can be a number.
    let without = fd_body(words.clone(), base);
    let with = fd_body(words.skip(1), base);
    let body = match (without, with) {
        (Some(a), Some(b)) if a.tail_words != TAIL_WORDS && b.tail_words == TAIL_WORDS => b,
        (Some(a), _) => a,
        (None, b) => b?,
    };
    let remote = body.flags & FLAG_REMOTE != 0;
    // Some tools write no flags.
    let fd = !remote && (body.flags & FLAG_FD != 0 || body.flags == 0 || body.length > 8);
    let flags = CanFlags {
        extended,
        remote,
        fd,
        bit_rate_switch: body.bit_rate_switch,
        error_state: body.error_state,
        ..CanFlags::default()
    };
    let data: &[u8] = if remote {
        &[]
    } else {
        &body.data[..body.length]
    };
    let mut frame = CanFrame::new(id, flags, data)?;
    if remote {
        set_length(&mut frame, body.dlc);
    } else if !fd && body.dlc > 8 {
        frame.len8_dlc = body.dlc;
    }
    Some(Found {
        channel,
        direction,
        dlc: Some(body.dlc),
        frame,
    })
}

/// Words of a CANFD line from the bit-rate switch on.
struct FdBody {
    bit_rate_switch: bool,
    error_state: bool,
    dlc: u8,
    length: usize,
    data: [u8; 64],
    flags: u32,
    /// Number of words after the data.
    tail_words: usize,
}

/// Reads `BRS ESI DLC length data ... duration bits flags ...`; `None` if the words contradict each
/// other.
fn fd_body<'l>(mut words: impl Iterator<Item = &'l [u8]>, base: u32) -> Option<FdBody> {
    let bit = |word: &[u8]| match word {
        b"0" => Some(false),
        b"1" => Some(true),
        _ => None,
    };
    let bit_rate_switch = bit(words.next()?)?;
    let error_state = bit(words.next()?)?;
    let dlc = u8::try_from(hexadecimal(words.next()?)?).ok()?;
    let length = usize::try_from(unsigned(words.next()?)?).ok()?;
    let mut data = [0; 64];
    for place in data.get_mut(..length)? {
        *place = byte(words.next()?, base)?;
    }
    let mut flags = 0;
    let mut tail_words = 0;
    for word in words {
        let value = hexadecimal(word)?;
        if tail_words == TAIL_FLAGS {
            flags = value;
        }
        tail_words += 1;
    }
    let agrees = dlc <= 15
        && match flags & FLAG_REMOTE != 0 {
            true => length == 0,
            false => usize::from(length_of(dlc, true)) == length || (dlc > 8 && length == 8),
        };
    (agrees && usize::from(code_of(length as u8)) <= 15).then_some(FdBody {
        bit_rate_switch,
        error_state,
        dlc,
        length,
        data,
        flags,
        tail_words,
    })
}
