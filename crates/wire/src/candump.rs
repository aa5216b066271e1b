//! The text that `candump -L` writes and `canplayer` reads, one frame a line:
//! `(1641469577.024400) can1 009#0011223344556677`.
//!
//! Identifiers of three digits are 11-bit ones, of eight digits 29-bit ones. `#R` and a length
//! stand for a remote frame; `##` and one hexadecimal digit of flags for a CAN FD frame (bit 0:
//! bit-rate switch, bit 1: error state, bit 2: FD, which kernels set since version 5.14). Error frames
//! have bit 29 set in an eight-digit identifier. `_` and a digit from 9 to F at the end are the data
//! length code of a classic frame with eight bytes.

use sample::{CanFlags, CanFrame};

/// Flag of error frames in an identifier (`CAN_ERR_FLAG` of `linux/can.h`).
const ERROR_FLAG: u32 = 0x2000_0000;
/// Most bytes of a frame.
const MAX_BYTES: usize = 64;

/// One line of a candump log.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Interface.
    pub interface: String,
    /// Frame, with its stamp as `kernel_ns`.
    pub frame: CanFrame,
}

/// Why a line cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{token}` is not {expected}")]
pub struct LineError {
    /// The word that does not fit.
    pub token: String,
    /// What belongs there.
    pub expected: &'static str,
}

impl LineError {
    fn new(token: &str, expected: &'static str) -> Self {
        Self {
            token: token.chars().take(160).collect(),
            expected,
        }
    }
}

/// Reads one line. Anything after the frame (newer versions write `R` or `T`, received or sent) is
/// passed over.
///
/// # Errors
/// The word that does not fit.
pub fn parse_line(line: &str) -> Result<Line, LineError> {
    let mut words = line.split_whitespace();
    let stamp = words.next().unwrap_or_default();
    let interface = words.next().unwrap_or_default();
    let text = words.next().unwrap_or_default();
    let kernel_ns = parse_stamp(stamp)
        .ok_or_else(|| LineError::new(stamp, "a time such as (1641469577.024400)"))?;
    if interface.is_empty() {
        return Err(LineError::new(line, "a line of `candump -L`"));
    }
    let frame = parse_frame(text)?;
    Ok(Line {
        interface: interface.to_owned(),
        frame: CanFrame {
            kernel_ns: Some(kernel_ns),
            ..frame
        },
    })
}

/// Reads a frame without time and interface, such as `123#DEADBEEF`.
///
/// # Errors
/// The text, if it is not a frame.
pub fn parse_frame(text: &str) -> Result<CanFrame, LineError> {
    let found = frame_of(text.as_bytes());
    found
        .map(|found| found.frame)
        .ok_or_else(|| LineError::new(text, "a frame such as 123#DEADBEEF"))
}

/// A frame as text, and the form of the text.
pub(crate) struct FrameText {
    pub frame: CanFrame,
    /// The digit of the flags of a CAN FD frame.
    pub fd_digit: u8,
}

/// Reads a frame without time and interface.
pub(crate) fn frame_of(text: &[u8]) -> Option<FrameText> {
    let split = text.iter().take(9).position(|byte| *byte == b'#')?;
    let (identifier, rest) = (&text[..split], &text[split + 1..]);
    let (id, mut flags) = identifier_of(identifier)?;
    if let [b'#', digit, data @ ..] = rest {
        let fd_digit = nibble(*digit)?;
        flags.fd = true;
        flags.bit_rate_switch = fd_digit & 1 != 0;
        flags.error_state = fd_digit & 2 != 0;
        let mut bytes = [0; 64];
        let len = hex_bytes(data, &mut bytes)?;
        let frame = CanFrame::new(id, flags, &bytes[..usize::from(len)])?;
        return Some(FrameText { frame, fd_digit });
    }
    let mut frame = CanFrame::new(id, flags, &[])?;
    let (data, code) = match rest {
        [data @ .., b'_', code] => (data, Some(nibble(*code)?)),
        data => (data, None),
    };
    if let [b'R' | b'r', length @ ..] = data {
        frame.flags.remote = true;
        frame.len = match length {
            [] => 0,
            [digit] => nibble(*digit).filter(|len| *len <= 8)?,
            _ => return None,
        };
    } else {
        frame.len = hex_bytes(data, &mut frame.data)?;
    }
    if let Some(code) = code {
        frame.len8_dlc = Some(code).filter(|code| frame.len == 8 && *code > 8)?;
    }
    Some(FrameText { frame, fd_digit: 0 })
}

/// The identifier and the flags that its digits tell.
pub(crate) fn identifier_of(digits: &[u8]) -> Option<(u32, CanFlags)> {
    let mut number = 0;
    for digit in digits {
        number = number << 4 | u32::from(nibble(*digit)?);
    }
    let mut flags = CanFlags::default();
    match digits.len() {
        3 if number <= 0x7FF => {}
        8 if number & ERROR_FLAG != 0 && number >> 30 == 0 => {
            flags.error = true;
            number &= !ERROR_FLAG;
        }
        8 if number <= 0x1FFF_FFFF => flags.extended = true,
        _ => return None,
    }
    Some((number, flags))
}

/// Writes one line, without its end. A frame without a kernel stamp gets time zero.
#[must_use]
pub fn format_line(interface: &str, frame: &CanFrame) -> String {
    let micros = frame.kernel_ns.unwrap_or(0).max(0) / 1000;
    let (seconds, fraction) = (micros / 1_000_000, micros % 1_000_000);
    format!(
        "({seconds:010}.{fraction:06}) {interface} {}",
        format_frame(frame)
    )
}

/// Writes a frame without time and interface.
#[must_use]
pub fn format_frame(frame: &CanFrame) -> String {
    let mut text = Vec::with_capacity(32);
    write_frame(&mut text, frame, 0, UPPER);
    text.iter().map(|byte| char::from(*byte)).collect()
}

/// Digits of hexadecimal numbers.
pub(crate) const UPPER: &[u8; 16] = b"0123456789ABCDEF";
/// Digits of hexadecimal numbers.
pub(crate) const LOWER: &[u8; 16] = b"0123456789abcdef";

/// Appends a frame without time and interface; `fd_bits` are set in the digit of the flags of a CAN FD
/// frame.
pub(crate) fn write_frame(text: &mut Vec<u8>, frame: &CanFrame, fd_bits: u8, digits: &[u8; 16]) {
    let flags = frame.flags;
    let digit = |value: u8| digits[usize::from(value & 15)];
    let (id, places) = match (flags.error, flags.extended) {
        (true, _) => (frame.id | ERROR_FLAG, 8),
        (false, true) => (frame.id, 8),
        (false, false) => (frame.id, 3),
    };
    let id: [u8; 8] = std::array::from_fn(|place| digit((id >> (28 - 4 * place)) as u8));
    text.extend_from_slice(&id[8 - places..]);
    text.push(b'#');
    if flags.fd {
        let bits = u8::from(flags.bit_rate_switch) | u8::from(flags.error_state) << 1;
        text.extend_from_slice(&[b'#', digit(bits | fd_bits)]);
    }
    if flags.remote {
        text.push(b'R');
        if frame.len > 0 {
            text.push(digit(frame.len));
        }
    }
    let mut pairs = [[0; 2]; MAX_BYTES];
    let bytes = frame.bytes();
    for (pair, byte) in pairs.iter_mut().zip(bytes) {
        *pair = [digit(byte >> 4), digit(*byte)];
    }
    text.extend_from_slice(pairs[..bytes.len()].as_flattened());
    if frame.len8_dlc > 8 {
        text.extend_from_slice(&[b'_', digit(frame.len8_dlc)]);
    }
}

/// `(seconds.fraction)` in ns; the fraction has up to nine digits.
fn parse_stamp(word: &str) -> Option<i64> {
    let inner = word.strip_prefix('(')?.strip_suffix(')')?;
    let (seconds, fraction) = inner.split_once('.')?;
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if fraction.is_empty() || fraction.len() > 9 || !digits(seconds) || !digits(fraction) {
        return None;
    }
    let scale = 10_i64.pow(9 - fraction.len() as u32);
    let nanos = fraction.parse::<i64>().ok()? * scale;
    let seconds = seconds.parse::<i64>().ok()?;
    seconds.checked_mul(1_000_000_000)?.checked_add(nanos)
}

/// Value of a hexadecimal digit.
pub(crate) const fn nibble(digit: u8) -> Option<u8> {
    match NIBBLES[digit as usize] {
        NO_DIGIT => None,
        value => Some(value),
    }
}

/// Entry of [`NIBBLES`] of a byte that is no digit.
const NO_DIGIT: u8 = u8::MAX;
/// Values of hexadecimal digits.
const NIBBLES: [u8; 256] = {
    let mut values = [NO_DIGIT; 256];
    let mut value = 0;
    while value < 16 {
        values[UPPER[value] as usize] = value as u8;
        values[LOWER[value] as usize] = value as u8;
        value += 1;
    }
    values
};

/// Bytes of two digits each, with or without a dot before each byte but the first; their number.
fn hex_bytes(mut text: &[u8], bytes: &mut [u8]) -> Option<u8> {
    let mut count = 0;
    while let [high, low, rest @ ..] = text {
        *bytes.get_mut(usize::from(count))? = nibble(*high)? << 4 | nibble(*low)?;
        count += 1;
        text = match rest {
            [b'.', more @ ..] if !more.is_empty() => more,
            _ => rest,
        };
    }
    text.is_empty().then_some(count)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn lines_of_candump_are_read() {
        let line = parse_line("(1641469577.024400) can1 009#0011223344556677 R").expect("a line");
        assert_eq!(line.interface, "can1");
        assert_eq!(line.frame.kernel_ns, Some(1_641_469_577_024_400_000));
        assert_eq!(line.frame.id, 9);
        assert_eq!(
            line.frame.bytes(),
            [0, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77]
        );
        let extended = parse_frame("09F11223#").expect("a frame");
        assert!(extended.flags.extended && extended.len == 0);
        let error = parse_frame("20000004#0004000000000000").expect("an error frame");
        assert!(error.flags.error && error.id == 4 && !error.flags.extended);
        let remote = parse_frame("123#R8").expect("a remote frame");
        assert!(remote.flags.remote && remote.len == 8 && remote.bytes().is_empty());
    }

    #[test]
    fn wrong_words_are_named() {
        for (line, token) in [
            ("", ""),
            ("(12.5 can0 123#", "(12.5"),
            ("(1.5) can0 1234#00", "1234#00"),
            ("(1.5) can0 123#0", "123#0"),
            ("(1.5) can0 800#00", "800#00"),
            (
                "(1.5) can0 123#001122334455667788",
                "123#001122334455667788",
            ),
            ("(9999999999999.0) can0 123#", "(9999999999999.0)"),
        ] {
            assert_eq!(parse_line(line).expect_err(line).token, token);
        }
    }

    fn frames() -> impl Strategy<Value = CanFrame> {
        let data = proptest::collection::vec(any::<u8>(), 0..=64);
        (any::<u32>(), 0_u8..64, data, 0_i64..4_000_000_000_000_000).prop_map(
            |(id, bits, mut data, micros)| {
                let mut flags = CanFlags::from_bits(bits);
                flags.extended &= !flags.error;
                flags.remote &= !flags.error && !flags.fd;
                flags.fd &= !flags.error;
                flags.bit_rate_switch &= flags.fd;
                flags.error_state &= flags.fd;
                data.truncate(if flags.fd { 64 } else { 8 });
                let wide = flags.extended || flags.error;
                let id = id & if wide { 0x1FFF_FFFF } else { 0x7FF };
                let frame = CanFrame::new(id, flags, if flags.remote { &[] } else { &data });
                let frame = frame.expect("data fits");
                CanFrame {
                    len: if flags.remote {
                        data.len() as u8
                    } else {
                        frame.len
                    },
                    kernel_ns: Some(micros * 1000),
                    ..frame
                }
            },
        )
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(frame in frames()) {
            let line = parse_line(&format_line("vcan0", &frame)).expect("its own line");
            prop_assert_eq!(line.frame, frame);
        }

        #[test]
        fn no_line_panics(line in any::<String>()) {
            let _ = parse_line(&line);
            let _ = parse_frame(&line);
        }
    }
}
