//! The text of `candump`: the lines of a log (`candump -l`, `-L`) and those of the screen.

mod style;
mod view;

use std::io::{Read, Seek, SeekFrom};
use std::ops::ControlFlow;

use sample::CanFrame;

pub use style::Style;

use super::lines::{Line, each};
use super::number::{code_of, decimal, unsigned, words};
use super::{Direction, Entry, Error, Record, Sink, Stamps, Summary};
use crate::candump::{frame_of, write_frame};

/// Earliest UNIX time that a stamp can be, ns: 1980. Stamps below it count from a start.
const UNIX_FROM_NS: i64 = 315_532_800_000_000_000;
/// Lines with frames that decide on the meaning of the stamps.
const LOOKED_AT: usize = 1000;

/// Reads a file that `candump` wrote.
///
/// # Errors
/// The file cannot be read, or its lines have no stamps.
pub fn read(input: &mut (impl Read + Seek), sink: &mut Sink<'_>) -> Result<Summary, Error> {
    read_with(input, sink, true)
}

/// As [`read`], but without the form of the lines in the summary.
///
/// # Errors
/// As [`read`].
pub fn read_frames(input: &mut (impl Read + Seek), sink: &mut Sink<'_>) -> Result<Summary, Error> {
    read_with(input, sink, false)
}

fn read_with(
    input: &mut (impl Read + Seek),
    sink: &mut Sink<'_>,
    compares_style: bool,
) -> Result<Summary, Error> {
    let begin = input.stream_position()?;
    let stamps = stamps(input)?;
    input.seek(SeekFrom::Start(begin))?;
    let mut reader = Reader {
        summary: Summary {
            stamps,
            ..Summary::default()
        },
        sum_ns: 0,
        compares_style,
        scratch: Vec::new(),
    };
    each(input, |line| reader.take(line, sink))?;
    Ok(reader.summary)
}

/// A frame of a line.
struct Found<'l> {
    stamp_ns: i64,
    /// The stamp is a date and a time of day.
    is_date: bool,
    interface: &'l [u8],
    frame: CanFrame,
    direction: Option<Direction>,
    /// Form of the line, of a log.
    style: Option<Style>,
}

/// The meaning of the stamps of a file.
fn stamps(input: &mut impl Read) -> Result<Stamps, Error> {
    let (mut first, mut last_ns, mut count) = (None, 0, 0);
    let (mut rises, mut falls, mut equal) = (0, 0, 0);
    let (mut is_date, mut without) = (false, 0);
    each(input, |line| {
        let Some(found) = parse(line) else {
            without += usize::from(view::is_without_stamp(line.bytes));
            return ControlFlow::Continue(());
        };
        is_date = found.is_date;
        match first {
            None => first = Some(found.stamp_ns),
            Some(_) if found.stamp_ns > last_ns => rises += 1,
            Some(_) if found.stamp_ns < last_ns => falls += 1,
            Some(_) if found.stamp_ns > 0 => equal += 1,
            Some(_) => {}
        }
        last_ns = found.stamp_ns;
        count += 1;
        match count < LOOKED_AT && !is_date && found.stamp_ns < UNIX_FROM_NS {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    })?;
    if first.is_none() && without > 0 {
        return Err(Error::NoStamps);
    }
    Ok(match first {
        _ if is_date => Stamps::LocalDate,
        Some(first) if first >= UNIX_FROM_NS => Stamps::Unix,
        // Times since a start rise. Differences fall as often as they rise, or stay equal.
        Some(0) if 2 * falls >= rises && (falls > 0 || equal > rises) => Stamps::Differences,
        _ => Stamps::SinceStart,
    })
}

/// Whether the line has a frame, with or without a stamp.
pub(super) fn is_line(line: Line<'_>) -> bool {
    parse(line).is_some() || view::is_without_stamp(line.bytes)
}

/// Reads a line of either form.
fn parse(line: Line<'_>) -> Option<Found<'_>> {
    log_line(line).or_else(|| view::parse(line.bytes))
}

/// Reads a line such as `(1641469577.024400) can1 009#0011223344556677 R`.
fn log_line(line: Line<'_>) -> Option<Found<'_>> {
    let rest = line.bytes.trim_ascii_start().strip_prefix(b"(")?;
    let close = rest.iter().take(32).position(|byte| *byte == b')')?;
    let stamp = &rest[..close];
    let stamp_ns = decimal(stamp, 9).filter(|ns| *ns >= 0)?;
    let mut words = words(&rest[close + 1..]);
    let interface = words.next()?;
    let text = words.next()?;
    let found = frame_of(text)?;
    let direction = direction_of(words.next());
    Some(Found {
        stamp_ns,
        is_date: false,
        interface,
        direction,
        style: Some(Style::of(stamp, text, &found, direction.is_some(), line)),
        frame: found.frame,
    })
}

fn direction_of(word: Option<&[u8]>) -> Option<Direction> {
    match word? {
        b"R" | b"RX" => Some(Direction::Received),
        b"T" | b"TX" => Some(Direction::Sent),
        _ => None,
    }
}

/// `DROPCOUNT: dropped 3 CAN frames on 'vcan0' socket (total drops 3)`: interface and number.
fn drop_count(line: &[u8]) -> Option<(&[u8], u64)> {
    let mut words = words(line);
    (words.next()? == b"DROPCOUNT:").then_some(())?;
    let count = words.find_map(unsigned)?;
    let interface = words.find_map(|word| word.strip_prefix(b"'")?.strip_suffix(b"'"))?;
    Some((interface, count.into()))
}

struct Reader {
    summary: Summary,
    /// Sum of the differences, ns.
    sum_ns: i64,
    compares_style: bool,
    scratch: Vec<u8>,
}

impl Reader {
    fn take(&mut self, line: Line<'_>, sink: &mut Sink<'_>) -> ControlFlow<()> {
        let Some(found) = parse(line) else {
            return self.take_other(line, sink);
        };
        let channel = self.channel(found.interface);
        let stamp_ns = match self.summary.stamps {
            Stamps::Differences => {
                self.sum_ns = self.sum_ns.saturating_add(found.stamp_ns);
                self.sum_ns
            }
            _ => found.stamp_ns,
        };
        if self.compares_style {
            self.compare_style(&found, channel, line);
        }
        let frame = found.frame;
        self.summary.frames += 1;
        sink(Record::Frame(Entry {
            stamp_ns,
            channel,
            direction: found.direction,
            dlc: Some(match frame.len8_dlc {
                0 => code_of(frame.len),
                code => code,
            }),
            frame,
        }))
    }

    /// Compares the line with the text that [`Style::write`] makes of its frame.
    fn compare_style(&mut self, found: &Found<'_>, channel: Option<u16>, line: Line<'_>) {
        let Some(mut style) = found.style else {
            return;
        };
        let known = self.summary.style.get_or_insert(style);
        if found.frame.flags.fd && known.fd_bit.is_none() {
            known.fd_bit = style.fd_bit;
        }
        style = *known;
        let name = channel.and_then(|channel| self.summary.channels.get(usize::from(channel)));
        let name = name.map_or("", String::as_str);
        self.scratch.clear();
        style.write(
            &mut self.scratch,
            found.stamp_ns,
            name,
            &found.frame,
            found.direction,
        );
        let end = self.scratch.len() - style.line_end().len();
        let same = self.scratch[..end] == *line.bytes
            && (line.carriage_return == style.carriage_return || !line.ended);
        self.summary.restyled += u64::from(!same || !line.ended);
    }

    fn channel(&mut self, interface: &[u8]) -> Option<u16> {
        let mut names = self.summary.channels.iter();
        match names.position(|name| name.as_bytes() == interface) {
            Some(at) => u16::try_from(at).ok(),
            None => self.summary.channel(&String::from_utf8_lossy(interface)),
        }
    }

    /// Takes a line without a frame.
    fn take_other(&mut self, line: Line<'_>, sink: &mut Sink<'_>) -> ControlFlow<()> {
        if let Some((interface, count)) = drop_count(line.bytes) {
            let channel = self.channel(interface);
            return sink(Record::Lost { channel, count });
        }
        if line.bytes.trim_ascii().is_empty() {
            self.summary.restyled += 1;
            return ControlFlow::Continue(());
        }
        self.summary.restyled += 1;
        // `candump -e` explains an error frame in the lines after it.
        if line.bytes.starts_with(b"\t") {
            self.summary.leave_out("lines that explain error frames");
            return ControlFlow::Continue(());
        }
        self.summary.unreadable(line, "a frame of candump");
        ControlFlow::Continue(())
    }
}

/// Appends the text of a loss; `total` is the number of all frames that the interface lost.
pub fn write_loss(text: &mut Vec<u8>, style: &Style, interface: &str, count: u64, total: u64) {
    let plural = if count > 1 { "s" } else { "" };
    text.extend_from_slice(
        format!("DROPCOUNT: dropped {count} CAN frame{plural} on '{interface}' socket (total drops {total})")
            .as_bytes(),
    );
    text.extend_from_slice(style.line_end());
}
