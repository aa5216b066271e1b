//! Writes an ASC file.

use std::fmt::Write as _;

use sample::CanFrame;

use super::super::Direction;
use super::super::number::code_of;
use crate::gps_time::Utc;

/// Last line of a file.
pub const END: &str = "End TriggerBlock\n";

const DAYS: [&str; 7] = ["Thu", "Fri", "Sat", "Sun", "Mon", "Tue", "Wed"];
const MONTHS: [&str; 12] = [
    "Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec",
];
/// Bits of the flags of a CANFD line: FD, bit-rate switch, error state.
const FLAG_FD: u32 = 1 << 12;
const FLAG_BRS: u32 = 1 << 13;
const FLAG_ESI: u32 = 1 << 14;

/// Appends the head of a file whose time zero is this UNIX time, ns.
pub fn write_head(text: &mut Vec<u8>, zero_ns: i64) {
    let seconds = zero_ns.div_euclid(1_000_000_000).max(0).cast_unsigned();
    let utc = Utc::of_unix_s(seconds);
    let month = MONTHS[usize::from(utc.month.clamp(1, 12)) - 1];
    let date = format!(
        "{} {month} {} {:02}:{:02}:{:02}.{:03} {}",
        DAYS[(seconds / 86_400 % 7) as usize],
        utc.day,
        utc.hour,
        utc.minute,
        utc.second,
        zero_ns.rem_euclid(1_000_000_000) / 1_000_000,
        utc.year
    );
    let head = format!(
        "date {date}\nbase hex  timestamps absolute\nno internal events logged\n\
         Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
    );
    text.extend_from_slice(head.as_bytes());
}

/// Appends the line of a frame. The stamp has six digits after the point, or nine if it is not a
/// multiple of 1 us.
pub fn write_frame(
    text: &mut Vec<u8>,
    stamp_ns: i64,
    channel: u32,
    frame: &CanFrame,
    direction: Option<Direction>,
) {
    let mut line = String::with_capacity(96);
    let (sign, size) = (if stamp_ns < 0 { "-" } else { "" }, stamp_ns.unsigned_abs());
    let (seconds, nanos) = (size / 1_000_000_000, size % 1_000_000_000);
    // Writing into a String cannot fail.
    let _ = match nanos % 1000 {
        0 => write!(line, "{sign}{seconds:>4}.{:06}", nanos / 1000),
        _ => write!(line, "{sign}{seconds:>4}.{nanos:09}"),
    };
    let flags = frame.flags;
    let direction = match direction {
        Some(Direction::Sent) => "Tx",
        Some(Direction::SendRequest) => "TxRq",
        Some(Direction::Received) | None => "Rx",
    };
    let id = match flags.extended {
        true => format!("{:X}x", frame.id),
        false => format!("{:X}", frame.id),
    };
    let dlc = match frame.len8_dlc {
        0 => code_of(frame.len),
        code => code,
    };
    let _ = match (flags.error, flags.fd, flags.remote) {
        (true, false, _) => write!(line, " {channel}  ErrorFrame"),
        (true, true, _) => write!(line, " CANFD {channel:>3} {direction:<4} ErrorFrame"),
        (false, true, _) => write_fd(&mut line, channel, direction, &id, dlc, frame),
        (false, false, true) => write!(line, " {channel}  {id:<15} {direction:<4} r {dlc:x}"),
        (false, false, false) => {
            let _ = write!(line, " {channel}  {id:<15} {direction:<4} d {dlc:x}");
            write_bytes(&mut line, frame.bytes())
        }
    };
    line.push('\n');
    text.extend_from_slice(line.as_bytes());
}

fn write_bytes(line: &mut String, bytes: &[u8]) -> std::fmt::Result {
    bytes
        .iter()
        .try_for_each(|byte| write!(line, " {byte:02X}"))
}

fn write_fd(
    line: &mut String,
    channel: u32,
    direction: &str,
    id: &str,
    dlc: u8,
    frame: &CanFrame,
) -> std::fmt::Result {
    let flags = frame.flags;
    let (brs, esi) = (
        u32::from(flags.bit_rate_switch),
        u32::from(flags.error_state),
    );
    let word = FLAG_FD | (brs * FLAG_BRS) | (esi * FLAG_ESI);
    let length = frame.bytes().len();
    write!(
        line,
        " CANFD {channel:>3} {direction:<4} {id:>10}  {:32} {brs} {esi} {dlc:x} {length:>2}",
        ""
    )?;
    write_bytes(line, frame.bytes())?;
    write!(line, " 0 0 {word:x} 0 0 0 0 0")
}
