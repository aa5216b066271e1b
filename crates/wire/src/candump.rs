//! The text that `candump -L` writes and `canplayer` reads, one frame a line:
//! `(1641469577.024400) can1 009#0011223344556677`.
//!
//! Identifiers of three digits are 11-bit ones, of eight digits 29-bit ones. `#R` and a length
//! stand for a remote frame; `##` and one hexadecimal digit of flags for a CAN FD frame (bit 0:
//! bit-rate switch, bit 1: error state). Error frames have bit 29 set in an eight-digit identifier.

use std::fmt::Write;

use sample::{CanFlags, CanFrame};

/// Flag of error frames in an identifier (`CAN_ERR_FLAG` of `linux/can.h`).
const ERROR_FLAG: u32 = 0x2000_0000;

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
    let wrong = || LineError::new(text, "a frame such as 123#DEADBEEF");
    let (identifier, rest) = text.split_once('#').ok_or_else(wrong)?;
    let number = hex_number(identifier).ok_or_else(wrong)?;
    let mut flags = CanFlags {
        error: identifier.len() == 8 && number & ERROR_FLAG != 0,
        ..CanFlags::default()
    };
    flags.extended = identifier.len() == 8 && !flags.error;
    let id = match identifier.len() {
        3 if number <= 0x7FF => number,
        8 if flags.error => number & !ERROR_FLAG,
        8 if number <= 0x1FFF_FFFF => number,
        _ => return Err(wrong()),
    };
    if let Some(fd) = rest.strip_prefix('#') {
        let (digit, data) = fd.split_at_checked(1).ok_or_else(wrong)?;
        let bits = hex_number(digit).ok_or_else(wrong)?;
        flags.fd = true;
        flags.bit_rate_switch = bits & 1 != 0;
        flags.error_state = bits & 2 != 0;
        return CanFrame::new(id, flags, &hex_bytes(data).ok_or_else(wrong)?).ok_or_else(wrong);
    }
    if let Some(length) = rest.strip_prefix(['R', 'r']) {
        flags.remote = true;
        let length = length.split('_').next().unwrap_or_default();
        let len = match length {
            "" => 0,
            digit => hex_number(digit)
                .filter(|len| *len <= 8)
                .ok_or_else(wrong)?,
        };
        let frame = CanFrame::new(id, flags, &[]).ok_or_else(wrong)?;
        return Ok(CanFrame {
            len: len as u8,
            ..frame
        });
    }
    let data = rest.split('_').next().unwrap_or_default();
    CanFrame::new(id, flags, &hex_bytes(data).ok_or_else(wrong)?).ok_or_else(wrong)
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
    let flags = frame.flags;
    let mut text = if flags.error {
        format!("{:08X}#", frame.id | ERROR_FLAG)
    } else if flags.extended {
        format!("{:08X}#", frame.id)
    } else {
        format!("{:03X}#", frame.id)
    };
    if flags.fd {
        let bits = u8::from(flags.bit_rate_switch) | u8::from(flags.error_state) << 1;
        // Writing into a String cannot fail.
        let _ = write!(text, "#{bits:X}");
    }
    if flags.remote {
        text.push('R');
        if frame.len > 0 {
            let _ = write!(text, "{:X}", frame.len);
        }
    }
    for byte in frame.bytes() {
        let _ = write!(text, "{byte:02X}");
    }
    text
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

fn hex_number(text: &str) -> Option<u32> {
    let digits = text.bytes().all(|byte| byte.is_ascii_hexdigit());
    digits.then(|| u32::from_str_radix(text, 16).ok())?
}

/// Bytes of two digits each; dots between them are passed over.
fn hex_bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u32> = text
        .chars()
        .filter(|digit| *digit != '.')
        .map(|digit| digit.to_digit(16))
        .collect::<Option<_>>()?;
    let pairs = digits.chunks_exact(2);
    pairs.remainder().is_empty().then_some(())?;
    Some(pairs.map(|pair| (pair[0] << 4 | pair[1]) as u8).collect())
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
