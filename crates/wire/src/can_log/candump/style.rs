//! The form of the lines of a candump log.

use std::fmt;
use std::str::FromStr;

use super::super::lines::Line;
use super::{CanFrame, Direction, write_frame};
use crate::candump::{FrameText, LOWER, UPPER};

/// Bit of the digit of a CAN FD frame that kernels set since version 5.14 (`CANFD_FDF`).
const FD_BIT: u8 = 4;
/// Most digits of the seconds.
const SECONDS_MAX: u8 = 20;
/// Most digits after the point of the seconds.
const DECIMALS_MAX: u8 = 9;

/// Form of the lines of a candump log: what the same frame can be written in several ways for.
///
/// As text, it is the number of digits of the seconds and of their fraction, then a letter for each
/// property: `10.6RF`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// Fewest digits of the seconds.
    pub seconds_digits: u8,
    /// Digits of the fraction of the seconds.
    pub decimals: u8,
    /// Lines end with the direction, `R` or `T`.
    pub direction: bool,
    /// The digit of a CAN FD frame has the bit FDF, if there is such a frame.
    pub fd_bit: Option<bool>,
    /// Hexadecimal digits are small letters.
    pub lower: bool,
    /// Lines end with a carriage return and a line feed.
    pub carriage_return: bool,
}

impl Default for Style {
    /// That of `candump -L`.
    fn default() -> Self {
        Self {
            seconds_digits: 10,
            decimals: 6,
            direction: false,
            fd_bit: None,
            lower: false,
            carriage_return: false,
        }
    }
}

impl Style {
    /// The form of a line.
    pub(super) fn of(
        stamp: &[u8],
        text: &[u8],
        found: &FrameText,
        direction: bool,
        line: Line<'_>,
    ) -> Self {
        let seconds = stamp.iter().position(|byte| *byte == b'.');
        let decimals = seconds.map_or(0, |point| stamp.len() - point - 1);
        let digits = |count: usize, most: u8| u8::try_from(count).map_or(most, |c| c.min(most));
        Self {
            seconds_digits: digits(seconds.unwrap_or(stamp.len()), SECONDS_MAX),
            decimals: digits(decimals, DECIMALS_MAX),
            direction,
            fd_bit: (found.frame.flags.fd).then_some(found.fd_digit & FD_BIT != 0),
            lower: text.iter().any(u8::is_ascii_lowercase),
            carriage_return: line.carriage_return,
        }
    }

    /// Appends the line of a frame.
    pub fn write(
        &self,
        text: &mut Vec<u8>,
        stamp_ns: i64,
        interface: &str,
        frame: &CanFrame,
        direction: Option<Direction>,
    ) {
        let stamp_ns = stamp_ns.max(0).cast_unsigned();
        let decimals = self.decimals.min(DECIMALS_MAX);
        let (seconds, nanos) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        let fraction = nanos / 10_u64.pow(u32::from(DECIMALS_MAX - decimals));
        text.push(b'(');
        push_padded(text, seconds, self.seconds_digits);
        if decimals > 0 {
            text.push(b'.');
            push_padded(text, fraction, decimals);
        }
        text.extend_from_slice(b") ");
        text.extend_from_slice(interface.as_bytes());
        text.push(b' ');
        let fd_bits = if self.fd_bit == Some(true) { FD_BIT } else { 0 };
        write_frame(text, frame, fd_bits, if self.lower { LOWER } else { UPPER });
        if self.direction {
            let sent = matches!(direction, Some(Direction::Sent | Direction::SendRequest));
            text.extend_from_slice(if sent { b" T" } else { b" R" });
        }
        text.extend_from_slice(self.line_end());
    }

    /// The end of a line.
    #[must_use]
    pub const fn line_end(&self) -> &'static [u8] {
        match self.carriage_return {
            true => b"\r\n",
            false => b"\n",
        }
    }
}

/// Appends a number with at least `digits` digits.
fn push_padded(text: &mut Vec<u8>, mut number: u64, digits: u8) {
    let mut written = [b'0'; SECONDS_MAX as usize];
    let mut first = written.len();
    while number > 0 {
        first -= 1;
        written[first] = b'0' + (number % 10) as u8;
        number /= 10;
    }
    let first = first.min(written.len() - usize::from(digits.clamp(1, SECONDS_MAX)));
    text.extend_from_slice(&written[first..]);
}

impl fmt::Display for Style {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.seconds_digits, self.decimals)?;
        let letters = [
            (self.direction, "R"),
            (self.fd_bit == Some(true), "F"),
            (self.lower, "l"),
            (self.carriage_return, "c"),
        ];
        letters
            .iter()
            .filter(|(has, _)| *has)
            .try_for_each(|(_, letter)| f.write_str(letter))
    }
}

impl FromStr for Style {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let numbers = text.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
        let letters = &text[numbers.len()..];
        let (seconds, decimals) = numbers.split_once('.').ok_or(())?;
        let digits = |text: &str, most: u8| text.parse().ok().filter(|count| *count <= most);
        Ok(Self {
            seconds_digits: digits(seconds, SECONDS_MAX).ok_or(())?,
            decimals: digits(decimals, DECIMALS_MAX).ok_or(())?,
            direction: letters.contains('R'),
            fd_bit: letters.contains('F').then_some(true),
            lower: letters.contains('l'),
            carriage_return: letters.contains('c'),
        })
    }
}
