//! ASC, the text log of Vector's CANalyzer and CANoe, which many tools write.
//!
//! A line with an event begins with its time. Lines of other events than frames advance the time of a
//! file with relative stamps.

mod frame;
mod write;

use std::io::{Read, Seek};
use std::ops::ControlFlow;

pub use write::{END, write_frame, write_head};

use super::date::{midnight_ns, vector_date};
use super::lines::{Line, each};
use super::number::{decimal, words};
use super::{Entry, Error, Record, Sink, Stamps, Summary};

/// Reads an ASC file.
///
/// # Errors
/// The file cannot be read.
pub fn read(input: &mut (impl Read + Seek), sink: &mut Sink<'_>) -> Result<Summary, Error> {
    let mut reader = Reader {
        summary: Summary::default(),
        base: 16,
        heads: 0,
        date_ns: None,
        sum_ns: 0,
    };
    each(input, |line| reader.take(line, sink))?;
    let Reader {
        mut summary,
        date_ns,
        heads,
        ..
    } = reader;
    summary.start_ns = match summary.stamps {
        Stamps::OfDay => date_ns.map(midnight_ns),
        _ => date_ns,
    };
    if heads > 1 {
        let text =
            "the file has several recordings, each with a head; the date of the first one is used";
        summary.defect(|| format!("{text} ({heads} recordings)"));
    }
    Ok(summary)
}

/// The time of a date line, `date Sat Sep 30 15:06:13.191 2017`, as UNIX time as if the clock of the
/// writer's computer showed UTC. `None` if it is no date.
#[must_use]
pub fn date_of(line: &str) -> Option<i64> {
    vector_date(line.strip_prefix("date ")?.as_bytes())
}

/// Whether the line is of the head, or has a frame.
pub(super) fn is_line(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    let text = line.to_ascii_lowercase();
    let mut rest = words(line);
    let mut small = words(&text);
    match (small.next(), small.next()) {
        (Some(b"base"), Some(b"hex" | b"dec")) | (Some(b"begin"), Some(b"triggerblock")) => true,
        (Some(b"date"), Some(_)) => vector_date(&line[b"date".len()..]).is_some(),
        _ => {
            let time = rest.next().filter(|word| word.contains(&b'.'));
            time.and_then(|word| decimal(word, 9)).is_some()
                && matches!(frame::parse(line, rest, 16), frame::Parsed::Frame(_))
        }
    }
}

struct Reader {
    summary: Summary,
    /// Base of identifiers and data.
    base: u32,
    /// Number of heads.
    heads: usize,
    /// Date of the first head.
    date_ns: Option<i64>,
    /// Sum of the differences, ns.
    sum_ns: i64,
}

impl Reader {
    fn take(&mut self, line: Line<'_>, sink: &mut Sink<'_>) -> ControlFlow<()> {
        let bytes = line.bytes.trim_ascii();
        let mut rest = words(bytes);
        let Some(first) = rest.next() else {
            return ControlFlow::Continue(());
        };
        let Some(stored_ns) = decimal(first, 9) else {
            self.take_head(first, bytes, line);
            return ControlFlow::Continue(());
        };
        let stamp_ns = match self.summary.stamps {
            Stamps::Differences => {
                self.sum_ns = self.sum_ns.saturating_add(stored_ns);
                self.sum_ns
            }
            _ => stored_ns,
        };
        match frame::parse(bytes, rest, self.base) {
            frame::Parsed::Frame(found) => {
                let channel = self
                    .summary
                    .channel(&String::from_utf8_lossy(found.channel));
                self.summary.frames += 1;
                sink(Record::Frame(Entry {
                    stamp_ns,
                    channel,
                    direction: found.direction,
                    dlc: found.dlc,
                    frame: found.frame,
                }))
            }
            // A line that was cut can lack the words of a frame.
            frame::Parsed::Event(kind) if line.ended || kind != frame::OTHER_EVENT => {
                self.summary.leave_out(kind);
                ControlFlow::Continue(())
            }
            frame::Parsed::Event(_) | frame::Parsed::Unreadable => {
                self.summary.unreadable(line, "an event of an ASC file");
                ControlFlow::Continue(())
            }
        }
    }

    /// Takes a line that does not begin with a time.
    fn take_head(&mut self, first: &[u8], line: &[u8], place: Line<'_>) {
        match first.to_ascii_lowercase().as_slice() {
            b"date" => {
                self.heads += 1;
                let date_ns = vector_date(&line[first.len()..]);
                if date_ns.is_none() {
                    self.summary.defect(|| {
                        let (number, text) = (place.number, String::from_utf8_lossy(line));
                        format!("line {number}: \"{text}\" is no date that this program knows")
                    });
                }
                self.date_ns = self.date_ns.or(date_ns);
            }
            b"base" => self.take_base(line),
            b"begin" => {
                // Files without a head begin so.
                let date = line.get(b"Begin TriggerBlock".len()..);
                let date_ns = date.and_then(vector_date);
                self.date_ns = self.date_ns.or(date_ns);
            }
            b"end" | b"internal" | b"no" => {}
            word if word.starts_with(b"//") || word.starts_with(b";") => {}
            _ => self.summary.unreadable(place, "a line of an ASC file"),
        }
    }

    /// `base hex  timestamps absolute`.
    fn take_base(&mut self, line: &[u8]) {
        let text = line.to_ascii_lowercase();
        let mut words = words(&text).skip(1);
        self.base = if words.next() == Some(b"dec") { 10 } else { 16 };
        self.summary.stamps = match words.next() {
            Some(b"timestamps") if words.next() == Some(b"relative") => Stamps::Differences,
            Some(b"timestamps") => Stamps::SinceStart,
            // BUSMASTER writes the time of day and does not say what its stamps are.
            _ => Stamps::OfDay,
        };
    }
}
