//! SLCAN, the ASCII protocol of LAWICEL's CAN232 and of most USB adapters without a driver.
//!
//! Both directions are read by one [`Decoder`]: a host reads an adapter's frames and answers, a
//! virtual adapter reads a host's commands. Lines end with a carriage return, of some adapters with a
//! line feed:
//! - `tiiildd...`, `Tiiiiiiiildd...`: data frame with 11- or 29-bit identifier, length, data;
//! - `riiil`, `Riiiiiiiil`: remote frame;
//! - `d`, `D`, `b`, `B`: CAN FD frame without and with bit-rate switch, the length as DLC 0 to F;
//! - the length of a classic frame may be 9 to F, which means eight bytes (ISO 11898-1, 8.4.2.4);
//! - four more digits behind a frame: the adapter's clock in ms, from 0 to 59999 (`Z1`), or from 0 to
//!   65535 where it runs freely;
//! - eight more digits: the adapter's clock in µs (`Z2`), from 0 to 3,599,999,999 or to 2^32 - 1;
//! - `Fxx`: status flags; an empty line: accepted; BELL: refused.

use std::fmt::Write;

use sample::{CanFlags, CanFrame};

/// Longest line: a FD frame of 64 bytes with 29-bit identifier and stamp.
const LINE_BYTES_MAX: usize = 1 + 8 + 1 + 128 + 8;
/// Where the adapter's millisecond clock starts again.
const CLOCK_PERIOD_MS: i64 = 60_000;
const BELL: u8 = 7;

/// Bit rates of `S0` to `S8`, bit/s.
pub const BIT_RATES: [u32; 9] = [
    10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
];

/// Data lengths of the DLCs 0 to F, bytes (ISO 11898-1, table 5).
const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// What a line says.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A frame: received by the adapter, or to be sent by it. With stamps on, `hardware_ns` counts
    /// the adapter's clock on through its wraps; a silence of a period or more is not seen in it.
    Frame(CanFrame),
    /// The adapter accepted the last command.
    Accepted,
    /// The adapter refused the last command.
    Refused,
    /// The adapter sent the last frame.
    Sent,
    /// The adapter's status.
    Status(Status),
    /// The adapter's version (`V`) or serial number (`N`), as it writes it.
    Identity(String),
    /// A host's command.
    Command(Command),
}

/// Status flags of an adapter, bit by bit as in the CAN232 manual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub u8);

impl Status {
    /// Whether the adapter lost frames: receive queue full (bit 0) or data overrun (bit 3).
    #[must_use]
    pub const fn lost_frames(self) -> bool {
        self.0 & 0b1001 != 0
    }

    /// The flags that are set, in words; empty if all is well.
    #[must_use]
    pub fn describe(self) -> String {
        const NAMES: [&str; 8] = [
            "receive queue full",
            "send queue full",
            "error warning",
            "data overrun",
            "",
            "error passive",
            "arbitration lost",
            "bus error",
        ];
        let set = (0..8).filter(|bit| self.0 >> bit & 1 != 0);
        let names: Vec<_> = set
            .map(|bit| NAMES[bit])
            .filter(|name| !name.is_empty())
            .collect();
        names.join(", ")
    }
}

/// A host's command to an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// `O`: go on the bus.
    Open,
    /// `L`: go on the bus and do not acknowledge.
    ListenOnly,
    /// `C`: leave the bus.
    Close,
    /// `S0` to `S8`: bit rate in bit/s, one of [`BIT_RATES`].
    BitRate(u32),
    /// `Z0`, `Z1`: stamps off or on.
    Timestamps(bool),
    /// `F`: say the status.
    ReadStatus,
    /// `V`: say the version.
    ReadVersion,
    /// `N`: say the serial number.
    ReadSerial,
}

impl Command {
    /// The command's line; `None` for a bit rate that SLCAN does not have.
    #[must_use]
    pub fn encode(self) -> Option<Vec<u8>> {
        let line: &[u8] = match self {
            Self::Open => b"O\r",
            Self::ListenOnly => b"L\r",
            Self::Close => b"C\r",
            Self::Timestamps(false) => b"Z0\r",
            Self::Timestamps(true) => b"Z1\r",
            Self::ReadStatus => b"F\r",
            Self::ReadVersion => b"V\r",
            Self::ReadSerial => b"N\r",
            Self::BitRate(rate) => {
                let code = BIT_RATES.iter().position(|known| *known == rate)?;
                return Some(vec![b'S', b'0' + code as u8, b'\r']);
            }
        };
        Some(line.to_vec())
    }
}

/// What a [`Decoder`] has seen since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlcanStatistics {
    /// Frames.
    pub frames: u64,
    /// Lines that say nothing known: noise, or cut by lost bytes.
    pub malformed: u64,
    /// Whether the first line was malformed: it may be the rest of a line that began before.
    pub first_malformed: bool,
    /// Refusals.
    pub refused: u64,
}

/// Reads SLCAN, byte by byte.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    line: Vec<u8>,
    /// The line is too long to be one; wait for its end.
    overlong: bool,
    /// Lines so far.
    lines: u64,
    /// Last byte was a carriage return: a line feed after it ends no line.
    after_return: bool,
    clock: Option<Clock>,
    statistics: SlcanStatistics,
}

/// An adapter's clock.
#[derive(Clone, Copy, Debug)]
struct Clock {
    unit: Unit,
    /// Whether a stamp was beyond the end of the shorter period: the clock runs freely.
    runs_freely: bool,
    /// The last stamp, and the same with all wraps before it.
    last: i64,
    total: i64,
}

/// Unit of a stamp, by the number of its digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unit {
    Millisecond,
    Microsecond,
}

impl Unit {
    const fn nanos(self) -> i64 {
        match self {
            Self::Millisecond => 1_000_000,
            Self::Microsecond => 1_000,
        }
    }

    /// Where the clock starts again: after a minute or an hour, or at the end of its digits.
    const fn periods(self) -> [i64; 2] {
        match self {
            Self::Millisecond => [CLOCK_PERIOD_MS, 1 << 16],
            Self::Microsecond => [3_600_000_000, 1 << 32],
        }
    }
}

impl Clock {
    /// Clock after a stamp. The shorter period holds until a stamp is beyond it.
    fn after(before: Option<Self>, unit: Unit, stamp: u32) -> Self {
        let stamp = i64::from(stamp);
        let [short, long] = unit.periods();
        let before = before.filter(|clock| clock.unit == unit);
        let runs_freely = stamp >= short || before.is_some_and(|clock| clock.runs_freely);
        let period = if runs_freely { long } else { short };
        let total = before.map_or(stamp, |clock| {
            clock.total + (stamp - clock.last).rem_euclid(period)
        });
        Self {
            unit,
            runs_freely,
            last: stamp,
            total,
        }
    }
}

impl Decoder {
    /// A decoder at the start of a line.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// What it has seen.
    #[must_use]
    pub const fn statistics(&self) -> SlcanStatistics {
        self.statistics
    }

    /// Takes bytes and hands on what they say, in order.
    pub fn push(&mut self, bytes: &[u8], deliver: &mut impl FnMut(Event)) {
        for byte in bytes {
            let after_return = std::mem::replace(&mut self.after_return, *byte == b'\r');
            match *byte {
                b'\r' => self.end_line(deliver),
                b'\n' if after_return || self.line.is_empty() && !self.overlong => {}
                b'\n' => self.end_line(deliver),
                // Refusals stand alone; what waited before one was cut.
                BELL => {
                    if !self.line.is_empty() || self.overlong {
                        self.statistics.malformed += 1;
                        self.clear();
                    }
                    self.statistics.refused += 1;
                    deliver(Event::Refused);
                }
                _ if self.line.len() == LINE_BYTES_MAX => self.overlong = true,
                other => self.line.push(other),
            }
        }
    }

    fn end_line(&mut self, deliver: &mut impl FnMut(Event)) {
        let event = if self.overlong {
            None
        } else {
            parse_line(&self.line)
        };
        match event {
            Some(Parsed::Frame(mut frame, stamp)) => {
                self.statistics.frames += 1;
                frame.hardware_ns = stamp.map(|(unit, stamp)| {
                    let clock = Clock::after(self.clock, unit, stamp);
                    self.clock = Some(clock);
                    clock.total * unit.nanos()
                });
                deliver(Event::Frame(frame));
            }
            Some(Parsed::Event(event)) => deliver(event),
            None => {
                self.statistics.malformed += 1;
                self.statistics.first_malformed |= self.lines == 0;
            }
        }
        self.lines += 1;
        self.clear();
    }

    fn clear(&mut self) {
        self.line.clear();
        self.overlong = false;
    }
}

/// Writes a frame as a line; `stamp_ms` is the adapter's clock, taken modulo 60000. `None` for
/// error frames and for lengths that CAN does not have.
#[must_use]
pub fn encode_frame(frame: &CanFrame, stamp_ms: Option<u64>) -> Option<Vec<u8>> {
    let flags = frame.flags;
    let code = LENGTHS.iter().position(|length| *length == frame.len)?;
    if flags.error || (!flags.fd && frame.len > 8) || (flags.fd && flags.remote) {
        return None;
    }
    let letter = match (flags.remote, flags.fd, flags.bit_rate_switch) {
        (true, ..) => 'r',
        (false, false, _) => 't',
        (false, true, false) => 'd',
        (false, true, true) => 'b',
    };
    let mut text = String::with_capacity(LINE_BYTES_MAX + 1);
    // Writing into a String cannot fail.
    let _ = if flags.extended {
        let letter = letter.to_ascii_uppercase();
        write!(text, "{letter}{:08X}{code:X}", frame.id & 0x1FFF_FFFF)
    } else {
        write!(text, "{letter}{:03X}{code:X}", frame.id & 0x7FF)
    };
    for byte in frame.bytes() {
        let _ = write!(text, "{byte:02X}");
    }
    if let Some(ms) = stamp_ms {
        let _ = write!(text, "{:04X}", ms % CLOCK_PERIOD_MS as u64);
    }
    text.push('\r');
    Some(text.into_bytes())
}

enum Parsed {
    /// A frame, and its stamp.
    Frame(CanFrame, Option<(Unit, u32)>),
    Event(Event),
}

fn parse_line(line: &[u8]) -> Option<Parsed> {
    let Some((letter, rest)) = line.split_first() else {
        return Some(Parsed::Event(Event::Accepted));
    };
    let event = match (letter, rest) {
        (b't' | b'T' | b'r' | b'R' | b'd' | b'D' | b'b' | b'B', _) => {
            return parse_frame(*letter, rest);
        }
        (b'z' | b'Z', []) => Event::Sent,
        (b'F', [_, _]) => Event::Status(Status(u8::try_from(hex(rest)?).ok()?)),
        (b'F', []) => Event::Command(Command::ReadStatus),
        (b'V', []) => Event::Command(Command::ReadVersion),
        (b'N', []) => Event::Command(Command::ReadSerial),
        (b'V' | b'v' | b'N', text) if text.iter().all(u8::is_ascii_graphic) => {
            Event::Identity(String::from_utf8_lossy(line).into_owned())
        }
        (b'O', []) => Event::Command(Command::Open),
        (b'L', []) => Event::Command(Command::ListenOnly),
        (b'C', []) => Event::Command(Command::Close),
        (b'Z', b"0") => Event::Command(Command::Timestamps(false)),
        (b'Z', b"1") => Event::Command(Command::Timestamps(true)),
        (b'S', [digit @ b'0'..=b'8']) => {
            Event::Command(Command::BitRate(BIT_RATES[usize::from(digit - b'0')]))
        }
        _ => return None,
    };
    Some(Parsed::Event(event))
}

fn parse_frame(letter: u8, rest: &[u8]) -> Option<Parsed> {
    let flags = CanFlags {
        extended: letter.is_ascii_uppercase(),
        remote: letter.eq_ignore_ascii_case(&b'r'),
        fd: matches!(letter.to_ascii_lowercase(), b'd' | b'b'),
        bit_rate_switch: letter.eq_ignore_ascii_case(&b'b'),
        ..CanFlags::default()
    };
    let (identifier, rest) = rest.split_at_checked(if flags.extended { 8 } else { 3 })?;
    let (code, rest) = rest.split_at_checked(1)?;
    let id = hex(identifier)?;
    if id > if flags.extended { 0x1FFF_FFFF } else { 0x7FF } {
        return None;
    }
    let len = LENGTHS[hex(code)? as usize];
    let len = if flags.fd { len } else { len.min(8) };
    let data_len = if flags.remote { 0 } else { usize::from(len) };
    let (data, stamp) = rest.split_at_checked(2 * data_len)?;
    let stamp = match stamp.len() {
        0 => None,
        4 => Some((Unit::Millisecond, hex(stamp)?)),
        8 => Some((Unit::Microsecond, hex(stamp)?)),
        _ => return None,
    };
    let mut bytes = [0; 64];
    for (byte, digits) in bytes.iter_mut().zip(data.chunks_exact(2)) {
        *byte = hex(digits)? as u8;
    }
    let frame = CanFrame::new(id, flags, &bytes[..data_len])?;
    Some(Parsed::Frame(CanFrame { len, ..frame }, stamp))
}

fn hex(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0, |value, digit| {
        let digit = char::from(*digit).to_digit(16)?;
        Some(value << 4 | digit)
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn events(bytes: &[u8]) -> (Vec<Event>, SlcanStatistics) {
        let mut decoder = Decoder::new();
        let mut events = Vec::new();
        decoder.push(bytes, &mut |event| events.push(event));
        (events, decoder.statistics())
    }

    #[test]
    fn examples_of_the_manual_are_read() {
        let (events, statistics) = events(b"\r\x07t10021133\rT0000010021133\rF08\rV1013\rZ\r");
        let [
            Event::Accepted,
            Event::Refused,
            Event::Frame(short),
            Event::Frame(long),
            rest @ ..,
        ] = &events[..]
        else {
            panic!("{events:?}");
        };
        assert_eq!((short.id, short.bytes()), (0x100, &[0x11, 0x33][..]));
        assert_eq!((long.id, long.bytes()), (0x100, &[0x11, 0x33][..]));
        assert!(long.flags.extended && !short.flags.extended);
        assert_eq!(rest[0], Event::Status(Status(8)));
        assert!(Status(8).lost_frames());
        assert_eq!(Status(8).describe(), "data overrun");
        assert_eq!(rest[1], Event::Identity("V1013".to_owned()));
        assert_eq!(rest[2], Event::Sent);
        assert_eq!((statistics.frames, statistics.refused), (2, 1));
    }

    fn stamps_ms(bytes: &[u8]) -> Vec<f64> {
        let (events, _) = events(bytes);
        let stamp = |event: &Event| match event {
            Event::Frame(frame) => frame.hardware_ns.expect("a stamp") as f64 * 1e-6,
            other => panic!("{other:?}"),
        };
        events.iter().map(stamp).collect()
    }

    #[test]
    fn the_clock_counts_on_through_its_wrap() {
        let minute = b"t1000EA5F\rt1000000A\rt1000000A\r";
        assert_eq!(stamps_ms(minute), [59_999.0, 60_010.0, 60_010.0]);
        // EA60 is 60,000: the clock runs to 65,535, also in the next periods.
        let free = b"t1000EA5F\rt1000EA60\rt1000FFFF\rt1000000A\rt1000EA00\rt1000000A\r";
        let expected = [59_999.0, 60_000.0, 65_535.0, 65_546.0, 125_440.0, 131_082.0];
        assert_eq!(stamps_ms(free), expected);
        // Microseconds: an hour, 3,600,000,000 is D693A400; and 2^32.
        let hour = b"t1000D693A3FF\rt10000000000A\r";
        assert_eq!(stamps_ms(hour), [3_599_999.999, 3_600_000.01]);
        let free = b"t1000FFFFFFFF\rt10000000000A\r";
        assert_eq!(stamps_ms(free), [4_294_967.295, 4_294_967.306]);
    }

    #[test]
    fn classic_frames_with_a_longer_code_have_eight_bytes() {
        let lines = b"t123CAABBCCDDEEFF0011\rT0000012FFAABBCCDDEEFF0011EA5F\rr123F\r";
        let (events, statistics) = events(lines);
        assert_eq!((statistics.frames, statistics.malformed), (3, 0));
        for event in &events[..2] {
            let Event::Frame(frame) = event else {
                panic!("{event:?}");
            };
            let bytes = [0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF, 0, 0x11];
            assert_eq!((frame.len, frame.bytes()), (8, &bytes[..]));
        }
    }

    #[test]
    fn lines_end_at_line_feeds_too() {
        let (found, statistics) = events(b"\nt1230\nt1230\r\nt1230\n\nt12\nt1230\r");
        assert_eq!((statistics.frames, statistics.malformed), (4, 1));
        assert_eq!(found.len(), 4, "a line feed accepts no command: {found:?}");
        assert!(!statistics.first_malformed);
        assert!(events(b"12\nt1230\r").1.first_malformed);
    }

    #[test]
    fn noise_costs_its_own_line_only() {
        let mut bytes = vec![b'A'; 5000];
        bytes.extend(b"\rt1001FF\rt1002F\rt8000\rt1001GG\rt1009\rt12301\r\xFF\rt7FF0\r");
        let (events, statistics) = events(&bytes);
        assert_eq!(events.len(), 2);
        assert_eq!(statistics.malformed, 7);
    }

    #[test]
    fn commands_round_trip() {
        let rates = BIT_RATES.map(Command::BitRate);
        let others = [
            Command::Open,
            Command::ListenOnly,
            Command::Close,
            Command::Timestamps(false),
            Command::Timestamps(true),
            Command::ReadStatus,
            Command::ReadVersion,
            Command::ReadSerial,
        ];
        for command in rates.into_iter().chain(others) {
            let line = command.encode().expect("a known rate");
            assert_eq!(events(&line).0, [Event::Command(command)]);
        }
        assert_eq!(Command::BitRate(333_333).encode(), None);
    }

    proptest! {
        #[test]
        fn frames_round_trip_however_they_are_cut(
            id in any::<u32>(),
            bits in 0_u8..32,
            code in 0_usize..16,
            data in any::<[u8; 32]>(),
            stamp in proptest::option::of(0_u64..60_000),
            cut in 0_usize..20,
        ) {
            let mut flags = CanFlags::from_bits(bits);
            flags.error = false;
            flags.fd &= !flags.remote;
            flags.bit_rate_switch &= flags.fd;
            let data = [data, data].concat();
            let len = LENGTHS[if flags.fd { code } else { code.min(8) }];
            let id = id & if flags.extended { 0x1FFF_FFFF } else { 0x7FF };
            let held = if flags.remote { 0 } else { usize::from(len) };
            let frame = CanFrame::new(id, flags, &data[..held]).expect("data fits");
            let frame = CanFrame { len, ..frame };
            let line = encode_frame(&frame, stamp).expect("a frame of CAN");
            let cut = cut.min(line.len());
            let mut decoder = Decoder::new();
            let mut events = Vec::new();
            decoder.push(&line[..cut], &mut |event| events.push(event));
            decoder.push(&line[cut..], &mut |event| events.push(event));
            let hardware_ns = stamp.map(|ms| ms as i64 * 1_000_000);
            prop_assert_eq!(events, [Event::Frame(CanFrame { hardware_ns, ..frame })]);
        }

        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let (_, statistics) = events(&bytes);
            prop_assert!(statistics.malformed <= bytes.len() as u64);
        }
    }
}
